"""The pose of the tracked frame in the body is found from tosses, wherever it is and whatever direction is up."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from tests.tosses import recorded, simulate_tosses
from thesis_lib.bodies.solid_body import Tracked
from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Sphere
from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.commands.datasets import main
from thesis_lib.datasets import dataset_of, read_dataset
from thesis_lib.datasets.checks.in_space import one_clock
from thesis_lib.datasets.checks.tracked_pose import settled, tracked_frame_told
from thesis_lib.datasets.format.frames import surface_frames
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import QUATERNION
from thesis_lib.datasets.space.tracked_frame import TrackedFrame, find_tracked_frame
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import of_rotation_matrix

SHAPES = {
    "box 3:2:1": {"kind": "box", "half_extents": [0.03, 0.02, 0.01]},
    "box 5:4:3": {"kind": "box", "half_extents": [0.05, 0.04, 0.03]},
    "cube": {"kind": "box", "half_extents": [0.03, 0.03, 0.03]},
    "cylinder": {"kind": "cylinder", "radius": 0.03, "half_length": 0.05},
    "ellipsoid": {"kind": "ellipsoid", "semi_axes": [0.05, 0.04, 0.03]},
}
NOISE = (2e-4, 3e-3)  # m and rad


def rig(shape: str, seed: int) -> SpaceHeader:
    """A tracked frame up to 40 mm off and turned by any angle, in axes in which any direction is up."""
    rng = np.random.default_rng(seed)
    mount, world = Rotation.random(2, rng=rng)
    off = rng.standard_normal(3)
    body = {"shape": SHAPES[shape], "mass": 0.25, "homogeneous": True}
    tracked = {"position": 0.04 * off / np.linalg.norm(off), "quaternion": mount.as_quat(scalar_first=True)}
    axes = {"gravity": world.apply([0.0, 0.0, -9.81]), "surface": {"point": world.apply([0.3, 0.1, 0.2])}}
    return SpaceHeader.model_validate({"schema": 2, "body": body, "tracked": tracked, "rate": 240.0} | axes)


def tossed(header: SpaceHeader, trials: int, seed: int, before_hits: bool = False, noise=NOISE) -> pd.DataFrame:
    """Tosses that the camera saw; with `before_hits` until each body hits."""
    made = simulate_tosses(header, trials, np.random.default_rng(seed), noise=noise)
    table = made.trajectories
    if before_hits:
        table = table[table["t"] < table["trial"].map(made.hits.groupby("trial")["t"].min())]
    return table


def at_rest(header: SpaceHeader, table: pd.DataFrame, ups: np.ndarray, seed: int, frames: int = 60) -> pd.DataFrame:
    """The tosses with 0.25 s of rest after each, in which the direction `ups[trial]` (n, 3) of the shape is up."""
    (frame,), rng, parts = surface_frames(header), np.random.default_rng(seed), [table]
    for (trial, toss), up in zip(table.groupby("trial"), ups):
        turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)]) * Rotation.align_vectors([[0, 0, 1.0]], [up])[0]
        q = turn.as_quat(scalar_first=True)[:, None]
        place = np.array([*rng.uniform(-0.1, 0.1, 2), -header.body.solid.lowest(q)[2, 0]])
        pose = np.repeat(np.r_[place, q[:, 0]][:, None], frames, axis=1)
        t = toss["t"].max() + 0.2 + np.arange(frames) / 240.0
        parts.append(recorded([(trial, t, pose)], header, frame, rng, NOISE))
    return pd.concat(parts).sort_values(["trial", "t"], kind="stable", ignore_index=True)


def found_in(header: SpaceHeader, table: pd.DataFrame) -> TrackedFrame:
    trial, t, position = one_clock(table)
    return find_tracked_frame(trial, t, position, table[list(QUATERNION)].to_numpy(), header.body, 9.81)


def errors(header: SpaceHeader, found: TrackedFrame) -> tuple[np.ndarray, np.ndarray]:
    """Off in position (3,) in m and rotation (3,) in rad, of the true pose that is equal by symmetry and nearest."""
    assert header.tracked is not None
    true, R = (
        Rotation.from_quat(one.attitude, scalar_first=True).as_matrix() for one in (header.tracked, found.tracked)
    )
    near = Symmetry(header.body.solid, header.body.inertia_per_mass).nearest(true, R)
    place = near @ true.T @ np.array(header.tracked.position)
    return np.array(found.tracked.position) - place, Rotation.from_matrix(R @ near.T).as_rotvec()


def assert_right(header: SpaceHeader, found: TrackedFrame) -> None:
    place, turn = errors(header, found)
    within = found.tracked.uncertainty
    assert within is not None and within.position < 1e-3 and within.rotation < 0.03
    assert np.abs(place).max() < 3.0 * within.position and np.abs(turn).max() < 3.0 * within.rotation
    down = np.array(header.gravity) / 9.81
    assert np.linalg.norm(found.gravity / 9.81 - down) < 4.0 * found.gravity_angle
    ((point, normal),) = header.planes
    assert abs((found.point - point) @ normal) < 1e-3 and np.linalg.norm(found.normal - normal) < 5e-3
    assert found.open == () and found.doubt == ""


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("shape", SHAPES)
def test_hits_and_flights_give_the_pose_within_its_uncertainty(shape, seed):
    header = rig(shape, seed)
    assert_right(header, found_in(header, tossed(header, 40, seed)))


@pytest.mark.parametrize("known", [3e-4, None])
def test_a_centre_of_mass_off_the_middle_tells_apart_what_the_shape_does_not(known):
    header = rig("box 5:4:3", 2)
    content = header.model_dump(mode="json", by_alias=True, exclude_none=True)
    content["body"] |= {"center_of_mass": [2.5e-3, -2e-3, 1.5e-3], "radii_of_gyration": [0.03, 0.035, 0.038]}
    content["body"] |= {"homogeneous": False} | ({"uncertainty": {"center_of_mass": known}} if known else {})
    header = SpaceHeader.model_validate(content)
    found = found_in(header, tossed(header, 30, 2, noise=(1e-3, 0.015)))
    assert np.linalg.norm(errors(header, found)[1]) < 0.1  # not turned by half a turn
    if known:
        assert found.open == ()
    else:
        (left,) = found.open
        assert "which moves only its centre of mass (taken as known within 1.5 mm: body.unc" in left


@pytest.mark.parametrize("factor", [0.5, pytest.param(2.0, marks=pytest.mark.slow)])
def test_a_shape_of_the_wrong_size_is_doubted(factor):
    header = rig("box 5:4:3", 5)
    table = at_rest(header, tossed(header, 9, 5), np.tile(np.eye(3), (3, 1)), 5)
    content = header.model_dump(mode="json", by_alias=True, exclude_none=True) | {"tracked": "unknown"}
    content["body"]["shape"]["half_extents"] = [factor * half for half in (0.05, 0.04, 0.03)]
    found = found_in(SpaceHeader.model_validate(content), table)
    assert "the lowest point of the shape is off the surface, by" in found.doubt


def slowly_filmed(shape: str, seed: int, rate: float) -> TrackedFrame:
    header = rig(shape, seed)
    made = simulate_tosses(header, 16, np.random.default_rng(seed), noise=NOISE, rate=rate)
    return found_in(header, made.trajectories)


def test_hits_whose_instant_is_uncertain_at_a_low_rate_do_not_put_the_shape_in_doubt():
    assert slowly_filmed("cube", 1, 60.0).doubt == ""


def test_too_few_touches_that_agree_are_counted():
    with pytest.raises(
        UserError, match=r"^5 of 6 hits and rests after free flights agree on one .* but 6 must: record"
    ):
        slowly_filmed("box 5:4:3", 0, 45.0)


@pytest.mark.slow
@pytest.mark.parametrize("shape", ["box 3:2:1", "cube"])
def test_rests_on_several_faces_give_it_without_a_hit(shape):
    header = rig(shape, 5)
    ups = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (4, 1))
    found = found_in(header, at_rest(header, tossed(header, 24, 5, before_hits=True), ups, 5))
    assert found.hits == 0 and found.rests > 20
    assert_right(header, found)


@pytest.mark.slow
def test_flights_are_found_where_most_of_a_recording_is_rest():
    header = rig("box 5:4:3", 7)
    ups = np.tile(np.concatenate([np.eye(3), -np.eye(3)]), (4, 1))
    table = at_rest(header, tossed(header, 24, 7), ups, 7, frames=4000)
    assert_right(header, found_in(header, table))


@pytest.mark.slow
def test_rests_on_one_face_leave_open_which_face_it_is_and_the_turn_about_it():
    header = rig("box 3:2:1", 6)
    table = at_rest(header, tossed(header, 12, 6, before_hits=True), np.tile([0.0, 0.0, 1.0], (12, 1)), 6)
    found = found_in(header, table)
    (about,) = [re.findall(r"-?\d\.\d\d", said) for said in found.open if said.startswith("the rotation about")]
    assert sorted(np.abs([float(part) for part in about[:3]])) == pytest.approx([0.0, 0.0, 1.0], abs=0.05)
    assert any("fit as well with the shape turned by" in said for said in found.open)
    assert found.tracked.uncertainty is not None and found.tracked.uncertainty.rotation > 0.5
    unknown = header.model_copy(update={"tracked": None})
    content = unknown.model_dump(mode="json", by_alias=True, exclude_none=True) | {"tracked": "unknown"}
    with pytest.raises(UserError, match=r"tracked: unknown: the rotation about .* on different faces"):
        settled(dataset_of(content, trajectories=table))


@pytest.mark.slow
def test_an_unknown_pose_of_a_dataset_is_settled():
    header = rig("box 5:4:3", 2)
    content = header.model_dump(mode="json", by_alias=True, exclude_none=True) | {"tracked": "unknown"}
    dataset = dataset_of(content, trajectories=tossed(header, 40, 2))
    made = settled(dataset)
    assert dataset.in_space.tracked is None and made.in_space.tracked is not None
    assert settled(made) is made
    few = dataset_of(content, trajectories=tossed(header, 2, 2))
    with pytest.raises(UserError, match=r"tracked: unknown: .*follow"):
        settled(few)


def test_a_slope_that_is_stated_does_not_turn_the_tracked_frame():
    content = rig("box 5:4:3", 8).model_dump(mode="json", by_alias=True, exclude_none=True)
    up = -np.array(content["gravity"]) / 9.81
    content["surface"]["normal"] = tuple(up + 0.4 * np.cross(up, [0.0, 1.0, 0.0]))
    header = SpaceHeader.model_validate(content)
    table = tossed(header, 16, 8)
    told = tracked_frame_told(dataset_of(content, trajectories=table), compare=True)
    assert told is not None and re.fullmatch(r"tracked frame as stated, according to \d+ hits and 0 rests", told)
    found = settled(dataset_of(content | {"tracked": "unknown"}, trajectories=table)).in_space.tracked
    assert found is not None and found.uncertainty is not None and header.tracked is not None
    assert found.uncertainty.position is not None and found.uncertainty.position < 1e-3
    np.testing.assert_allclose(_lever(found), _lever(header.tracked), atol=1e-3)


def test_a_stated_pose_is_compared_with_the_symmetry_of_shape_and_mass_together():
    content = rig("box 5:4:3", 4).model_dump(mode="json", by_alias=True, exclude_none=True)
    content["body"] |= {"center_of_mass": (0.012, 0.009, 0.0), "homogeneous": None, "radii_of_gyration": (0.03,) * 3}
    header = SpaceHeader.model_validate(content)
    table, tracked = tossed(header, 24, 4), header.tracked
    assert tracked is not None
    half = Rotation.from_euler("z", 180.0, degrees=True)
    turned = half * Rotation.from_quat(tracked.attitude, scalar_first=True)
    content["tracked"] = {"position": half.apply(tracked.position), "quaternion": turned.as_quat(scalar_first=True)}
    told = [
        tracked_frame_told(dataset_of(one, trajectories=table), compare=True)
        for one in (header.model_dump(mode="json", by_alias=True, exclude_none=True), content)
    ]
    assert told[0] is not None and told[0].startswith("tracked frame as stated")
    assert told[1] is not None and "180° from the pose in dataset.yaml: correct tracked" in told[1]


def _lever(tracked: Tracked) -> np.ndarray:
    """From the origin of the tracked frame to that of the shape, (3,) in m, in axes of the tracked frame."""
    return Rotation.from_quat(tracked.attitude, scalar_first=True).inv().apply(tracked.position)


@pytest.mark.slow
def test_a_turned_world_turns_gravity_and_table_and_not_the_pose():
    header, turn = rig("box 5:4:3", 3), Rotation.from_rotvec([0.5, 1.5, -1.0])
    table = tossed(header, 30, 3)
    other = table.copy()
    other[["x", "y", "z"]] = turn.apply(table[["x", "y", "z"]].to_numpy(copy=True)) + [1.0, -2.0, 0.5]
    q = turn * Rotation.from_quat(table[list(QUATERNION)].to_numpy(copy=True), scalar_first=True)
    other[list(QUATERNION)] = q.as_quat(scalar_first=True)
    first, second = found_in(header, table), found_in(header, other)
    np.testing.assert_allclose(second.tracked.position, first.tracked.position, atol=5e-5)
    np.testing.assert_allclose(second.tracked.attitude, first.tracked.attitude, atol=5e-4)
    np.testing.assert_allclose(second.gravity, turn.apply(first.gravity), atol=1e-6)
    np.testing.assert_allclose(second.normal, turn.apply(first.normal), atol=5e-4)


@pytest.mark.slow
def test_init_writes_the_pose_and_the_fall_of_a_camera(tmp_path, capsys):
    header = rig("box 5:4:3", 4)
    tossed(header, 20, 4).to_csv(tmp_path / "log.csv", index=False)
    options = ["--quaternion", "wxyz", "--columns", "q1=qw,q2=qx,q3=qy,q4=qz", "--shape", "box:0.1,0.08,0.06"]
    assert main(["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "made"), *options]) == 0
    printed = capsys.readouterr().out
    assert "note: tracked frame found from" in printed and "note: up is (" in printed
    made = read_dataset(tmp_path / "made").in_space
    assert made.tracked is not None and made.tracked.uncertainty is not None
    np.testing.assert_allclose(made.gravity, header.gravity, atol=0.02)
    true = np.linalg.norm(np.array(header.tracked.position)) if header.tracked else 0.0
    assert np.linalg.norm(made.tracked.position) == pytest.approx(true, abs=1e-3)
    given = ["-o", str(tmp_path / "given"), *options, "--surface-height", "0.5"]
    assert main(["init", str(tmp_path / "log.csv"), *given]) == 0
    assert "the surface is at 0.5 m along up, as given; by hits and rests the table is" in capsys.readouterr().out
    of_given = read_dataset(tmp_path / "given").in_space
    up = -np.array(of_given.gravity) / 9.81
    ((point, normal),) = of_given.planes
    assert point @ up == pytest.approx(0.5) and of_given.tracked == made.tracked
    np.testing.assert_allclose(normal, up, atol=1e-9)
    code = main(["init", str(tmp_path / "log.csv"), "-o", str(tmp_path / "as_shape"), *options, "--tracked", "shape"])
    assert code == 2 or read_dataset(tmp_path / "as_shape").in_space.tracked.position == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("solid", "turns", "axes", "stands"),
    [
        (Box(half_extents=(0.03, 0.02, 0.01)), 4, [], 6),
        (Box(half_extents=(0.03, 0.03, 0.01)), 8, [], 6),
        (Box(half_extents=(0.03, 0.03, 0.03)), 24, [], 6),
        (Cylinder(radius=0.03, half_length=0.05), 8, [2], 6),
        (Capsule(radius=0.03, half_length=0.05), 8, [2], 4),
        (Ellipsoid(semi_axes=(0.05, 0.04, 0.03)), 4, [], 2),
        (Sphere(radius=0.03), 24, [0, 1, 2], 6),
    ],
)
def test_symmetries_and_the_ways_to_stand(solid, turns, axes, stands):
    same = Symmetry(solid, solid.moments.inertia_per_mass)
    assert (len(same.turns), same.axes, len(same.stands)) == (turns, axes, stands)
    off = Symmetry(solid, solid.moments.inertia_per_mass + np.diag([0.0, 2e-4, 1e-4]) + 1e-5)
    assert len(off.turns) == 1 and off.axes == []
    R = Rotation.from_rotvec([0.1, 0.2, -0.1]).as_matrix()
    np.testing.assert_allclose(same.nearest(same.turns[-1] @ R, R), R, atol=1e-12)
    assert of_rotation_matrix(same.nearest(R, np.eye(3)))[0] > 0.99
