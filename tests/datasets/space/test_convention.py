"""A rotation that is read in another way than it was written is told from the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.datasets.in_space import BODIES, UP, Take, plane_axes, take
from thesis_lib.datasets.space.convention import OUT, Scene, check_reading, fit
from thesis_lib.datasets.space.flights import find_flights, follow
from thesis_lib.datasets.space.motion import Motion, conjugate, handed, mirrored
from thesis_lib.foundation.errors import UserError

PLANES = [(35.0, 4.0), (0.0, 0.0), (90.0, 0.0), (125.0, 12.0)]  # degrees about the vertical, off it
MOUNTS = {"as drawn": Rotation.identity(), "askew": Rotation.from_rotvec([0.4, -0.9, 0.3])}


def scene_of(recorded: Take, shape: str) -> tuple[Motion, Scene]:
    motion = Motion("body", "log.csv", recorded.t, recorded.position, recorded.quaternion)
    track = follow(motion.t, motion.position, 9.81)
    flights = find_flights(track, -9.81 * UP["z"])
    body = BODIES[shape]
    return motion, Scene(track, flights, body.shape, body.radius_of_gyration, UP["z"], None)


@pytest.mark.slow
@pytest.mark.parametrize(("yaw", "tilt", "mount"), [(*plane, mount) for plane, mount in zip(PLANES, [*MOUNTS] * 2)])
@pytest.mark.parametrize("shape", ["ellipse", "square"])
def test_only_true_readings_fit(shape, yaw, tilt, mount):
    """Every wrong order and hand is out of the plane or turns the wrong way, or is the same motion read from a body
    frame that is another one; the true one fits."""
    axes = plane_axes("z", yaw, tilt)
    recorded = take(16, shape=shape, axes=axes, tilt=0.0, mount=MOUNTS[mount])
    motion, scene = scene_of(recorded, shape)
    q = motion.quaternion
    readings = {"other order": q[:, [1, 2, 3, 0]], "other order back": q[:, [3, 0, 1, 2]], "left": conjugate(q)}
    readings |= {f"axis {axis} reversed": mirrored(q, axis) for axis in range(3)}
    assert fit(motion, scene).out < OUT / 4
    assert fit(motion, scene).good
    for name, quaternion in readings.items():
        read = replace(motion, quaternion=quaternion)
        if fit(read, scene).good:
            assert same_turning(motion, read, axes), name


def same_turning(motion: Motion, read: Motion, axes: np.ndarray) -> bool:
    """Whether both turn about the normal of the plane by the same angles."""
    turns = [Rotation.from_quat(one.quaternion) for one in (motion, read)]
    moved = [(turn * turn[0].inv()).as_rotvec() @ axes[2] for turn in turns]
    return bool(np.median(np.abs(moved[0] - moved[1])) < 0.05)


def test_the_option_that_mends_it_is_named():
    motion, scene = scene_of(take(16), "ellipse")
    q = motion.quaternion
    wrong = replace(motion, quaternion=q[:, [1, 2, 3, 0]], readings={"--quaternion xyzw": lambda: q})
    with pytest.raises(UserError, match=r"log\.csv: read as stated.*They fit with --quaternion xyzw\."):
        check_reading(wrong, scene)
    with pytest.raises(UserError, match="They fit with no --left-handed"):
        check_reading(handed(motion, True), scene)
    left = replace(motion, quaternion=conjugate(q))
    assert check_reading(handed(left, True), scene).good
    assert check_reading(handed(motion, False), scene).good


def test_an_axis_that_is_reversed_shows_in_the_impacts_alone():
    """The turning is about the same axis all the same, but the wrong way about."""
    axes = plane_axes("z", 0.0, 0.0)
    motion, scene = scene_of(take(16, axes=axes, tilt=0.0), "ellipse")
    read = replace(motion, quaternion=mirrored(motion.quaternion, 0))
    found = fit(read, scene)
    assert found.out < OUT and found.mirrored < 0.2 and not found.good
    with pytest.raises(UserError, match="its impacts turn the body in the wrong direction"):
        check_reading(replace(read, readings={"another way": lambda: motion.quaternion}), scene)


def test_trials_that_leave_the_plane_do_not_spoil_the_reading():
    motion, scene = scene_of(take(16, tumbling=(2, 5, 9)), "ellipse")
    assert fit(motion, scene).good


def test_a_body_that_does_not_turn_tells_nothing():
    motion, scene = scene_of(take(10), "ellipse")
    still = replace(motion, quaternion=np.tile([0.0, 0.0, 0.0, 1.0], (len(motion), 1)))
    found = check_reading(handed(still, False), scene)
    assert found.good and np.isnan(found.mirrored)


@pytest.mark.parametrize("shape", ["ellipse", "square"])
def test_the_angle_of_a_shape_in_its_frame_is_told(shape):
    """The shape was drawn at another angle than the tracked frame: the couples of the impacts say by how much."""
    motion, scene = scene_of(take(16, shape=shape), shape)
    assert fit(motion, scene).turned == 0.0
    for turn in (0.4, -0.6):
        found = fit(motion, replace(scene, turn=turn))
        assert found.good
        period = np.pi if shape == "ellipse" else np.pi / 2
        off = (found.turned + turn + period / 2) % period - period / 2
        assert abs(off) < np.radians(4.0)
