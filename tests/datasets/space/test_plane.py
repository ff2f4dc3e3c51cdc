"""The plane of a motion: found, given, and the energy out of it."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.datasets.in_space import UP, plane_axes, take
from thesis_lib.datasets.sources.tables.options import parse_direction
from thesis_lib.datasets.space.flights import find_flights, follow, smoothed_turning
from thesis_lib.datasets.space.motion import Motion, from_angles, turning, unit
from thesis_lib.datasets.space.plane import Plane, find_plane, in_plane, share_out
from thesis_lib.foundation.errors import UserError

K_G = 0.019235  # m, of the ellipse
NEAR = np.radians(0.3)  # between a plane found and the true one; 0.2 mm and 2 mrad of noise give 0.1°


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("tilt", [0.0, 4.0, 20.0])
def test_a_plane_is_found_from_the_flights(up, tilt):
    recorded = take(10, up=up, tilt=tilt, axes=plane_axes(up, -63.0, tilt))
    track = follow(recorded.t, recorded.position, 9.81)
    motion = Motion("", "", recorded.t, recorded.position, recorded.quaternion)
    omega = smoothed_turning(turning(motion.quaternion), motion.t, track.half)
    inner = np.concatenate([np.arange(f.start, f.stop) for f in find_flights(track, -9.81 * UP[up])])
    inner = inner[np.isfinite(omega[inner]).all(axis=1) & np.isfinite(track.v[inner]).all(axis=1)]
    plane = find_plane(track.v[inner], omega[inner], K_G, UP[up])
    assert np.arccos(min(1.0, abs(plane.normal @ recorded.axes[2]))) < NEAR
    assert abs(plane.tilt) == pytest.approx(np.radians(tilt), abs=NEAR)
    axes = np.stack([plane.x, plane.y, plane.normal])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(plane.x, plane.y), plane.normal, atol=1e-12)


def test_poses_in_the_plane_are_those_that_were_embedded():
    for mount in (Rotation.identity(), *(Rotation.from_euler(axis, 90, degrees=True) for axis in "xy")):
        recorded = take(3, noise=0.0, mount=mount)
        plane = Plane(recorded.axes[0], recorded.axes[1], recorded.axes[2], np.radians(4.0))
        motion = Motion("", "", recorded.t, recorded.position, recorded.quaternion)
        q, _ = in_plane(motion, plane)
        during = recorded.drop >= 0
        q, truth = q[during], recorded.planar[during]
        offset = np.median(recorded.position @ plane.normal) * np.tan(plane.tilt)  # the hand's way is off the plane
        np.testing.assert_allclose(q[:, :2], truth[:, :2] + [0.0, offset], atol=1e-9)
        turned = np.exp(1j * (q[:, 2] - truth[:, 2]))
        np.testing.assert_allclose(turned, turned[0], atol=1e-9)  # to a constant, that of the body's axis


def test_the_share_out_of_the_plane_is_that_of_the_energy():
    plane = Plane.of(UP["y"], UP["z"])
    v, omega = np.array([[3.0, 1.0, 0.0], [0.0, 0.0, 2.0]]), np.array([[0.0, 0.0, 0.0], [30.0, 40.0, 0.0]])
    out, total = share_out(v, omega, plane, 0.1)
    np.testing.assert_allclose(out, [1.0, 9.0])
    np.testing.assert_allclose(total, [10.0, 4.0 + 25.0])


def test_a_plane_that_nothing_tells_is_asked_for():
    falling = np.outer(np.linspace(0.0, 3.0, 50), -UP["z"])
    with pytest.raises(UserError, match="Give it with --plane"):
        find_plane(falling, np.zeros((50, 3)), K_G, UP["z"])
    sliding = np.outer(np.linspace(0.0, 3.0, 50), UP["x"]) + np.outer(np.sin(np.arange(50)), UP["y"])
    with pytest.raises(UserError, match="90° off the vertical"):
        find_plane(sliding, np.outer(np.ones(50), [0.0, 0.1, 30.0]), K_G, UP["z"] + 0.05 * UP["x"])
    with pytest.raises(UserError, match="level"):
        Plane.of(UP["z"], UP["z"])


def test_directions():
    np.testing.assert_allclose(parse_direction("-y", "--up"), [0.0, -1.0, 0.0])
    np.testing.assert_allclose(parse_direction("0,3,4", "--plane"), [0.0, 0.6, 0.8])
    for text in ("w", "1,2", "0,0,0", "nan,1,0", "1e99,0,0", "", "--x"):
        with pytest.raises(UserError, match="--up"):
            parse_direction(text, "--up")


def test_rotations_from_angles():
    """A quarter turn about x, then about the body's own new y, against fixed axes, and as axis times angle."""
    own, fixed = (Rotation.from_quat(from_angles(kind, np.array([[90.0, 90.0, 0.0]]), True)) for kind in ("XYZ", "xyz"))
    np.testing.assert_allclose(own.apply([0.0, 0.0, 1.0])[0], [1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(fixed.apply([0.0, 0.0, 1.0])[0], [0.0, -1.0, 0.0], atol=1e-12)
    vector = np.array([[0.1, -0.4, 2.0], [np.nan, 0.0, 0.0]])
    turned = from_angles("helical", vector, False)
    np.testing.assert_allclose(Rotation.from_quat(turned[:1]).as_rotvec(), vector[:1])
    assert np.isnan(turned[1]).all()
    with pytest.raises(UserError, match=r"a\.csv: a rotation has the length 1\.414"):
        unit(np.array([[1.0, 1.0, 0.0, 0.0]]), "a.csv")
