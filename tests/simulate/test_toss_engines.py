"""Engines of tosses: flights, restitution and friction in closed form, and hidden causes by what they do."""

import numpy as np
import pytest

from thesis_lib.bodies.solids import Box, Sphere
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.free_motion import flown
from thesis_lib.mechanics.inertia import in_world
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.drake.hunt_crossley import dissipation, restitution
from thesis_lib.simulate.drake.tosses import DrakeTosses
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.rig.causes_in_space import CAUSES_IN_SPACE
from thesis_lib.simulate.tosses.camera import CameraInSpace, film
from thesis_lib.simulate.tosses.causes import NOT_IN_DRAKE, NOT_IN_MUJOCO, OUTSIDE, RANGES
from thesis_lib.simulate.tosses.drawn import header_of
from thesis_lib.simulate.tosses.own import OwnTosses
from thesis_lib.simulate.tosses.world import TossedWorld, released

BOX, BALL = Box(half_extents=(0.05, 0.04, 0.03)), Sphere(radius=0.04)
ENGINES = [
    pytest.param(OwnTosses(), id="own"),
    pytest.param(MujocoTosses(), id="mujoco"),
    pytest.param(DrakeTosses(), id="drake"),
]
MISSING = {OwnTosses: (), MujocoTosses: NOT_IN_MUJOCO, DrakeTosses: NOT_IN_DRAKE}
SHAPES = ("box", "ellipsoid", "cylinder", "bracket")
G = 9.81
HIDDEN = {name: cause.sizes for name, cause in CAUSES_IN_SPACE.items()} | {
    name: of.drawn(np.random.default_rng(1)) for name, of in RANGES.items()
}


def header(shape=BOX, **more):
    body = {"shape": shape, "mass": 0.25, "homogeneous": True}
    noise = {"position": 2e-4, "rotation": 3e-3}
    return SpaceHeader.model_validate({"schema": 2, "body": body, "rate": 240.0, "noise": noise} | more)


def state(place, attitude, velocity, spin):
    return State.of(np.array([[*place, *attitude]]), np.array([[*velocity, *spin]]), *np.zeros((2, 1)), space=SPACE)


def path(engine, world, place, times, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0)):
    return engine.moves(world, state(place, (1.0, 0.0, 0.0, 0.0), velocity, spin), times[None])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_flight_is_torque_free(engine):
    world = TossedWorld(header(), hidden={"com_offset.c_x": 3e-3})
    start = state([0.0, 0.0, 5.0], [0.8, 0.6, 0.0, 0.0], [0.4, -0.3, 0.5], [9.0, -5.0, 4.0])
    times = np.linspace(0.02, 0.5, 9)
    got = engine.moves(world, start, times[None])
    body, off = world.rig.body, np.array([3e-3, 0.0, 0.0])
    arm = SPACE.turned(start.attitude, off[:, None])
    centre = np.concatenate([start.position + arm, start.attitude])
    moved = np.concatenate([SPACE.velocity_at(start.velocity, start.spin, arm), start.spin])
    true = flown(centre, moved, body.inertia_per_mass, np.array([[0.0], [0.0], [-G]]), times[:, None]).pose[..., 0]
    np.testing.assert_allclose(SPACE.turn_between(true[3:], got.attitude), 0.0, atol=2e-3)
    origin = true[:3] - SPACE.turned(true[3:], off[:, None])
    np.testing.assert_allclose(got.position, origin, atol=2e-4)


@pytest.mark.parametrize("epsilon", [0.3, 0.7])
@pytest.mark.parametrize("time", [3e-4, 3e-3])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_central_hit_gives_back_its_share(engine, time, epsilon):
    world = TossedWorld(header(BALL), epsilon=epsilon, contact_time=time)
    times = np.linspace(0.05, 0.45, 2001)
    height = path(engine, world, [0.0, 0.0, 0.14], times, [0.3, 0.0, -1.0]).height
    hit = int(height.argmin())
    up = height[hit : hit + 1200]
    rise = up[: 1 + int(np.flatnonzero(np.diff(up) < 0.0)[0])].max() - 0.04
    speed = np.sqrt(1.0 + 2.0 * G * 0.1)
    if isinstance(engine, DrakeTosses):  # there restitution falls with the speed
        epsilon = restitution(dissipation(epsilon), speed)
    # gravity takes g T of the speed in a contact
    assert np.sqrt(2.0 * G * rise) / speed == pytest.approx(epsilon, abs=0.02)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_box_slides_with_its_friction(engine):
    times = np.linspace(0.02, 0.2, 10)
    slower = [] if isinstance(engine, DrakeTosses) else [({"sliding_friction.d_mu": -0.1}, 0.2)]
    for hidden, mu in (({}, 0.3), *slower):
        world = TossedWorld(header(), mu=0.3, hidden=hidden)
        x = path(engine, world, [0.0, 0.0, 0.03], times, [1.0, 0.0, 0.0]).position[0]
        assert np.polyfit(times, x, 2)[0] == pytest.approx(-0.5 * mu * G, rel=0.02)


@pytest.mark.parametrize("engine", ENGINES[:2])
def test_a_ball_that_spins_on_its_point_is_stopped_by_torsional_friction(engine):
    world = TossedWorld(header(BALL), hidden={"torsional_friction.m_t": 5e-3})
    times = np.linspace(0.02, 0.1, 9)
    spun = path(engine, world, [0.0, 0.0, 0.04], times, spin=[0.0, 0.0, 10.0]).attitude
    rate = SPACE.turn_between(spun[:, :-1], spun[:, 1:])[2] / 0.01
    np.testing.assert_allclose(np.diff(rate) / 0.01, -5e-3 * G / (0.4 * BALL.radius**2), rtol=1e-2)


def test_a_ball_that_rolls_is_stopped_by_the_contact_torque():
    world, times = TossedWorld(header(BALL), hidden={"contact_torque.m_r": 1e-3}), np.linspace(0.02, 0.2, 10)
    x = path(OwnTosses(), world, [0.0, 0.0, 0.04], times, [0.4, 0.0, 0.0], [0.0, 10.0, 0.0]).position[0]
    assert np.polyfit(times, x, 2)[0] == pytest.approx(-0.5 * 1e-3 * G / BALL.radius / 1.4, rel=1e-3)


def test_a_box_is_slowed_by_the_ellipse_of_friction_and_carried_by_a_moving_surface():
    times = np.linspace(0.02, 0.15, 10)
    for hidden, v, factor in (
        ({"anisotropic_friction.a_c": 0.3}, [1.0, 0.0], -1.3),
        ({"anisotropic_friction.a_s": 0.3}, [0.6, -0.6], -0.7 / np.sqrt(2.0)),
        ({"moving_surface.V_x": 1.0}, [0.0, 0.0], 1.0),
    ):
        world = TossedWorld(header(), mu=0.3, hidden=hidden)
        x = path(OwnTosses(), world, [0.0, 0.0, 0.03], times, [*v, 0.0]).position[0]
        assert np.polyfit(times, x, 2)[0] == pytest.approx(0.5 * factor * 0.3 * G, rel=0.02)


def test_a_ball_swings_in_a_bowl_as_a_pendulum():
    bowl = {"curved_surface.kappa": 1.0, "curved_surface.y_0": 0.1}
    world = TossedWorld(header(BALL), mu=0.0, epsilon=0.1, hidden=bowl)
    length, times, off = 1.0 - BALL.radius, np.linspace(0.02, 0.8, 20), 0.05
    height = 1.0 - np.sqrt(length**2 - off**2)
    place = path(OwnTosses(), world, [0.0, 0.1 + off, height], times).position
    np.testing.assert_allclose(place[1] - 0.1, off * np.cos(np.sqrt(G / length) * times), atol=1e-3)
    np.testing.assert_allclose(place[0], 0.0, atol=1e-9)


def test_a_softer_place_or_face_lets_a_ball_in_by_its_contact_time():
    deep, times = [], np.linspace(0.0195, 0.0225, 301)
    for hidden in (
        {},
        {"position_dependent_contact_time.g_tau_x": 2.0},
        {"orientation_dependent_contact_time.a_z": 0.5},
    ):
        world = TossedWorld(header(BALL), contact_time=2e-3, hidden=hidden)
        z = path(OwnTosses(), world, [0.1, 0.0, 0.06], times, [0.0, 0.0, -0.9]).height
        deep.append(BALL.radius - z.min())
    np.testing.assert_allclose(np.array(deep[1:]) / deep[0], [1.0 / np.sqrt(0.6), np.exp(-0.5)], rtol=0.03)


@pytest.mark.parametrize("cause", HIDDEN)
@pytest.mark.parametrize("engine", ENGINES)
def test_what_is_hidden_changes_what_is_filmed_and_not_what_is_believed(engine, cause):
    drawn = {f"{cause}.{name}": value for name, value in HIDDEN[cause].items()}
    world = TossedWorld(header(), hidden=drawn)
    if cause in MISSING[type(engine)]:
        with pytest.raises(UserError, match="has no element"):
            engine.moves(world, released(world, 1, np.random.default_rng(0)), np.ones((1, 1)))
        return
    made = [
        film("a", TossedWorld(header(), hidden=hidden), engine, CameraInSpace(seconds=0.8), 2, np.random.default_rng(3))
        for hidden in ({}, drawn)
    ]
    assert made[0].header == made[1].header
    assert not np.allclose(made[0].trajectories, made[1].trajectories, atol=1e-6)


@pytest.mark.parametrize(
    "world", ["own-box", "own-bracket", *(f"{engine}-{shape}" for engine in ("mujoco", "drake") for shape in SHAPES)]
)
def test_hits_take_energy_and_the_body_comes_to_rest_on_the_surface(world):
    name, shape = world.split("-")
    engine = {"own": OwnTosses, "mujoco": MujocoTosses, "drake": DrakeTosses}[name]()
    drawn = {"shape": shape, "size": 1.0, "rate": 240.0, "position": 2e-4, "rotation": 3e-3}
    upright = header_of(drawn, np.array([0.0, 0.0, 1.0]), np.random.default_rng(0))
    world = TossedWorld(upright, contact_time=1e-3)
    times = np.tile(0.02 + np.arange(400) / 500.0, (8, 1))
    states = engine.moves(world, released(world, 8, np.random.default_rng(0)), times)
    arm = SPACE.turned(states.attitude, world.rig.body.centre[:, None])
    place, q = (states.position + arm).reshape(3, 8, -1), states.attitude.reshape(4, 8, -1)
    velocity = np.diff(place) * 500.0
    spin = SPACE.turn_between(q[..., :-1], q[..., 1:]).reshape(3, -1) * 500.0
    tensor = in_world(world.rig.body.inertia_per_mass, q[..., 1:].reshape(4, -1))
    turning = np.einsum("in,ijn,jn->n", spin, tensor, spin).reshape(8, -1)
    energy = 0.5 * ((velocity**2).sum(axis=0) + turning) + G * 0.5 * (place[2, :, 1:] + place[2, :, :-1])
    assert np.all(energy < 1.01 * energy[:, :1]) and np.all(energy[:, -1] < 0.8 * energy[:, 0])
    gap = states.height + world.rig.body.solid.lowest(states.attitude)[2]
    assert gap.min() > -2e-3 and np.abs(gap.reshape(8, -1)[:, -50:]).min(axis=1).max() < 3e-3


def test_a_bracket_of_another_size_grows_about_its_centre_of_mass():
    drawn = {"shape": "bracket", "size": 1.0, "rate": 240.0, "position": 2e-4, "rotation": 3e-3}
    believed = header_of(drawn, np.array([0.0, 0.0, 1.0]), np.random.default_rng(0))
    true = TossedWorld(believed, hidden={"wrong_size.s": 0.1}).rig
    arms = [np.array(one.tracked.position) - one.body.centre for one in (believed, true)]
    corners = [one.body.solid.corners - one.body.centre[:, None] for one in (believed, true)]
    np.testing.assert_allclose(arms[1], arms[0], atol=1e-12)
    np.testing.assert_allclose(np.sort(corners[1]), 1.1 * np.sort(corners[0]), atol=1e-9)


@pytest.mark.parametrize("cause", OUTSIDE)
def test_what_no_effect_describes_changes_the_tosses(cause):
    sizes = {
        "loose_mass": {"share": 0.3, "frequency": 8.0, "damping": 0.1},
        "two_materials": {"edge": 0.0, "friction": 2.0, "restitution": 0.5},
        "hand": {"push": 10.0, "share": 1.0},
        "second_object": {"x": 0.0, "y": 0.0, "radius": 0.12},
        "light_table": {"mass": 1.0, "frequency": 20.0, "damping": 0.1},
    }[cause]
    worlds = [TossedWorld(header(), hidden=hidden) for hidden in ({}, {f"{cause}.{k}": v for k, v in sizes.items()})]
    times = np.tile(np.linspace(0.02, 0.5, 40), (6, 1))
    release = released(worlds[0], 6, np.random.default_rng(0))
    apart = np.abs(np.diff([MujocoTosses().moves(one, release, times).height for one in worlds], axis=0)).reshape(6, -1)
    assert (apart[:, -1] > 1e-3).sum() >= 2
    # only a hand acts in flight
    assert apart[:, 0].max() < 1e-9 and (apart[:, 4].max() > 1e-5) == (cause == "hand")


def test_a_camera_in_its_own_axes_sees_the_same_motion():
    up = np.array([0.36, -0.8, 0.48])
    turned = header(
        gravity=tuple(-G * up),
        surface={"point": (1.0, 2.0, 0.5)},
        tracked={"position": (0.04, -0.05, 0.02), "quaternion": (0.5, 0.5, -0.5, 0.5)},
    )
    camera = CameraInSpace(seconds=0.5, dropped=0.05, irregular=0.2, bursts=0.5)
    world, rng = TossedWorld(turned, contact_time=3e-4), np.random.default_rng(3)
    made = film("a", world, OwnTosses(), camera, 4, rng)
    release = released(world, 4, np.random.default_rng(3).spawn(1)[0])
    (frame,) = surface_frames(turned)
    seen = frame.seen(body_states(tracked_states(made.trajectories), turned))
    assert 0.8 < len(seen) / (4 * 115) < 0.97 and np.ptp(np.diff(seen.t[seen.trial == 0])) > 1e-3
    for i in range(4):
        rows = seen.select(seen.trial == i)
        true = OwnTosses().moves(world, release.select(np.array([i])), rows.t[None])
        turn = SPACE.turn_between(true.attitude, rows.attitude)
        assert np.std(turn) == pytest.approx(3e-3, rel=0.2)
        # noise of 3 mrad turns the centre about a point that is 7 cm away
        assert np.std(rows.position - true.position) == pytest.approx(2e-4, abs=2e-4)


@pytest.mark.parametrize("smoothing", ["butterworth", "kalman_smoother"])
def test_a_filter_lowers_the_noise(smoothing):
    camera = [CameraInSpace(seconds=0.3, filter=name, cutoff=30.0) for name in ("none", smoothing)]
    world, rough = TossedWorld(header()), []
    for one in camera:
        table = film("a", world, OwnTosses(), one, 3, np.random.default_rng(3)).trajectories
        rough += [table[list(POSE_IN_SPACE)].to_numpy()[:, [2, 4]]]
    steps = [np.std(np.diff(one[5:60], n=4, axis=0), axis=0) for one in rough]
    assert np.all(steps[1] < 0.5 * steps[0])
