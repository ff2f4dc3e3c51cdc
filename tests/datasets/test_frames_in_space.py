"""Frames of schema 2: a tracked frame elsewhere in the body and a turned world change nothing of the body's motion."""

import numpy as np
import pandas as pd
import pytest
from folders_in_space import BOX, body, header, trajectories
from scipy.spatial.transform import Rotation

from thesis_lib.critique.likelihood.observations import rig_of
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_of_body, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, V_PRE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

EXACT = 1e-12
CENTRE = [0.004, -0.002, 0.001]
INERTIA = {"xx": 2.1e-4, "yy": 2.8e-4, "zz": 3.4e-4, "xy": 1e-5}
BODY = body(homogeneous=None, inertia=INERTIA, center_of_mass=CENTRE)


def head(**changes) -> SpaceHeader:
    return SpaceHeader.model_validate(header(body=BODY, **changes))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def some_states(rng) -> State:
    """Bodies anywhere: place of the centre of mass, attitude of S."""
    n = 20
    q = Rotation.random(n, rng=rng).as_quat(scalar_first=True)
    pose = np.concatenate([rng.standard_normal((n, 3)), q], axis=1)
    return State.of(pose, rng.standard_normal((n, 6)), np.arange(n), np.zeros(n), space=SPACE)


def table_of(state: State) -> pd.DataFrame:
    """impacts.csv with these tracked motions before the hits."""
    columns = dict(zip(POSE_IN_SPACE, state.pose)) | dict(zip(V_PRE_IN_SPACE, state.motion))
    return pd.DataFrame({"trial": state.trial, "t": state.t, **columns})


def same(one: State, other: State) -> None:
    np.testing.assert_allclose(SPACE.difference(one.pose, other.pose), 0.0, atol=EXACT)
    np.testing.assert_allclose(one.motion, other.motion, atol=EXACT)


def pose(place, turn: Rotation) -> dict:
    return {"position": list(place), "quaternion": turn.as_quat(scalar_first=True).tolist()}


def turned(state: State, R: Rotation) -> State:
    """The same motions in a world that is turned."""
    q = (R * Rotation.from_quat(state.attitude.T, scalar_first=True)).as_quat(scalar_first=True).T
    return state.changed(R.apply(state.position.T).T, q, R.apply(state.velocity.T).T, R.apply(state.spin.T).T)


def test_poses_and_velocities_follow_the_rules_of_the_format(rng):
    """R_WS = R(q) R(tracked)ᵀ, p_S = p − R_WS · position, and the centre of mass lies at p_S + R_WS c."""
    turn, place = Rotation.from_rotvec([0.3, 1.2, -2.0]), np.array([0.04, -0.01, 0.02])
    states = some_states(rng)
    found = body_states(states, head(tracked=pose(place, turn)))
    R_WS = Rotation.from_quat(states.attitude.T, scalar_first=True) * turn.inv()
    np.testing.assert_allclose(
        SPACE.turned(found.attitude, np.eye(3)[:, :1]).T, R_WS.apply([1.0, 0.0, 0.0]), atol=EXACT
    )
    p_S = states.position.T - R_WS.apply(place)
    np.testing.assert_allclose(found.position.T, p_S + R_WS.apply(CENTRE), atol=EXACT)
    arm = found.position - states.position
    np.testing.assert_allclose(found.velocity, states.velocity + np.cross(states.spin.T, arm.T).T, atol=EXACT)
    assert (found.spin == states.spin).all()


def test_a_moved_tracked_frame_changes_nothing_of_the_body(rng):
    states, plain = some_states(rng), head()
    for _ in range(5):
        moved = head(tracked=pose(rng.uniform(-0.05, 0.05, 3), Rotation.random(rng=rng)))
        tracked = tracked_of_body(states, moved)
        same(body_states(tracked_states(table_of(tracked), V_PRE_IN_SPACE), moved), states)
    same(body_states(tracked_of_body(states, plain), plain), states)


def test_a_turned_world_changes_nothing_that_the_surface_sees(rng):
    states, plain = some_states(rng), head()
    (floor,) = surface_frames(plain)
    solid = dataset_of(header(), trajectories=trajectories()).shape
    here = floor.seen(states)
    for _ in range(5):
        R = Rotation.random(rng=rng)
        surface = {"point": R.apply([0.3, 0.2, 0.0]).tolist(), "normal": R.apply([0.0, 0.0, 2.0]).tolist()}
        other = head(gravity=R.apply([0.0, 0.0, -9.81]).tolist(), surface=surface)
        there = surface_frames(other)[0].seen(turned(states, R))
        np.testing.assert_allclose(there.height, here.height, atol=EXACT)
        np.testing.assert_allclose(there.velocity[2], here.velocity[2], atol=EXACT)
        np.testing.assert_allclose(solid.lowest(there.attitude)[2], solid.lowest(here.attitude)[2], atol=EXACT)
        of_body = [SPACE.turned_back(state.attitude, state.spin) for state in (here, there)]
        np.testing.assert_allclose(*of_body, atol=EXACT)


@pytest.mark.parametrize("normal", [[0, 0, 1], [0, 1, 0], [1, 0, 0], [-0.95, 0.2, 0.1], [0.3, -0.4, -0.8]])
def test_frames_of_surfaces_follow_the_rule(normal, rng):
    n = np.array(normal) / np.linalg.norm(normal)
    frame = Frame.of_surface(np.array([0.1, 0.2, 0.3]), n)
    t_1, t_2, up = (frame.vectors_out(axis[:, None])[:, 0] for axis in np.eye(3))
    np.testing.assert_allclose(up, n, atol=EXACT)
    np.testing.assert_allclose(np.cross(n, t_1), t_2, atol=EXACT)
    first = np.eye(3)[1 if abs(n[0]) > 0.9 else 0]
    assert t_1 @ first > 0.0 and abs(np.cross(first, n) @ t_1) < EXACT  # level, above x or y of the world
    states = some_states(rng)
    same(frame.shown(frame.seen(states)), states)
    there = frame.seen(states).position
    np.testing.assert_allclose(there[2], n @ (states.position - [[0.1], [0.2], [0.3]]), atol=EXACT)


def test_nobody_can_say_where_a_body_with_an_unknown_tracked_frame_is(rng):
    for call in (body_states, tracked_of_body):
        with pytest.raises(UserError, match="tracked: unknown: to locate the body, give the pose"):
            call(some_states(rng), head(tracked="unknown"))


def test_the_rig_of_a_dataset_is_seen_from_the_surface(rng):
    slope = np.radians(10.0)
    normal = [np.sin(slope), 0.0, np.cos(slope)]
    made = dataset_of(header(body=BODY, surface={"normal": normal}), trajectories=trajectories())
    rig, states = rig_of(made), some_states(rng)
    assert rig.space is SPACE and rig.gravity == 9.81 and rig.height == 0.0
    np.testing.assert_allclose(rig.G[:, :, 0], made.header.body.inertia_per_mass)
    np.testing.assert_allclose(rig.down, [np.sin(slope), 0.0, -np.cos(slope)], atol=EXACT)
    np.testing.assert_allclose(rig.fall(states)[:3], 9.81 * np.tile(rig.down[:, None], len(states)), atol=EXACT)
    level = rig_of(dataset_of(header(body=BODY), trajectories=trajectories()))
    assert level.down is None and (level.fall(states)[2] == -9.81).all()
    # the shape's origin is the believed centre of mass
    r = rig.lowest(states)
    wanted = made.shape.lowest(states.attitude) - SPACE.turned(states.attitude, np.array(CENTRE)[:, None])
    np.testing.assert_allclose(r, wanted, atol=EXACT)
    ceiling = dataset_of(header(surface={"normal": [0, 0, -1]}), trajectories=trajectories())
    np.testing.assert_allclose(rig_of(ceiling).down, [0.0, 0.0, 1.0], atol=EXACT)


def test_a_recentred_solid_is_the_same_body_about_another_point(rng):
    solid = dataset_of(header(body=body(shape=BOX)), trajectories=trajectories()).shape
    moved, d = solid.about(np.array(CENTRE)), rng.standard_normal((3, 30))
    np.testing.assert_allclose(moved.support(d), solid.support(d) - np.array(CENTRE)[:, None], atol=EXACT)
    np.testing.assert_allclose(moved.corners.max(axis=1), np.array([0.05, 0.04, 0.03]) - CENTRE, atol=EXACT)
    np.testing.assert_allclose(moved.moments.centre, -np.array(CENTRE), atol=EXACT)
    assert np.linalg.norm(moved.support(d), axis=0).max() <= moved.extent + EXACT
    np.testing.assert_allclose(moved.scaled(2.0).support(d), 2.0 * moved.support(d), atol=EXACT)
    assert solid.about(np.zeros(3)) is solid
