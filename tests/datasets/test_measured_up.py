"""A planar body seen by a tilted camera: the fall says where up is, and whether the plane itself is inclined."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.datasets.in_space import UP, plane_axes, take
from thesis_lib.datasets.sources.conversion import Conversion, View
from thesis_lib.datasets.sources.logs import convert_motions
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, parse_shape
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

TURNED = 20.0  # degrees
CLOSE = np.radians(0.5)  # of the upward axis found
EXACT = 1e-3  # relative, of gravity; an inclination of half a degree changes less


def converted(
    axes: np.ndarray, tilt: float = 0.0, up_is_given: bool = False, height: float | None = None
) -> Conversion:
    """The dataset of drops in a plane with these axes, under the gravity of a plane inclined by `tilt` degrees."""
    seen = take(8, shape="square", axes=axes, tilt=tilt)
    motion = Motion("", "log.csv", seen.t, seen.position, seen.quaternion)
    rig = RigOptions(parse_shape("square:0.06"), surface_height=height)
    return convert_motions([motion], "made", ["log.csv"], rig, View(UP["z"], up_is_given=up_is_given), [])


def turned(degrees: float, about: int) -> np.ndarray:
    """Axes of a vertical plane as a camera has them that is turned about its axis x (0, pitch) or normal (2, roll)."""
    upright = plane_axes(tilt=0.0)
    return Rotation.from_rotvec(np.radians(degrees) * upright[about]).apply(upright)


@pytest.mark.parametrize("degrees", [8.0, TURNED])
@pytest.mark.parametrize("about", [0, 2])
def test_up_is_opposite_the_fall_unless_it_is_given(about, degrees):
    axes = turned(degrees, about)
    made = converted(axes)
    (note,) = [note for note in made.notes if note.startswith("up is (")]
    up = np.array(note[len("up is (") :].split(")")[0].split(","), float)
    assert np.linalg.norm(up - axes[1]) < CLOSE
    assert float(note.split(" and ")[1].split("°")[0]) == pytest.approx(degrees, abs=np.degrees(CLOSE))
    assert made.dataset.header.gravity == pytest.approx(9.81, rel=EXACT) and not made.warnings
    again = converted(axes, up_is_given=True)
    (warning,) = again.warnings
    given = np.array(warning.split("With --up ")[1].split(" ")[0].split(","), float)
    np.testing.assert_allclose(given, up, atol=1e-3)
    assert not any(note.startswith("up is (") for note in again.notes)
    with pytest.raises(UserError, match=r"reaches the surface.* With --up "):
        converted(axes, up_is_given=True, height=-0.5)


def test_an_axis_that_fits_and_a_plane_that_is_inclined_stay():
    for tilt in (0.0, TURNED):
        made = converted(plane_axes(tilt=tilt), tilt)
        assert not made.warnings and not any(note.startswith("up is (") for note in made.notes)
        assert made.dataset.header.gravity == pytest.approx(9.81 * np.cos(np.radians(tilt)), rel=EXACT)


def test_in_an_inclined_plane_only_the_roll_is_undone():
    axes = plane_axes(tilt=TURNED)
    axes = Rotation.from_rotvec(np.radians(TURNED) * axes[2]).apply(axes)
    made = converted(axes, TURNED)
    assert any(note.startswith("up is (") for note in made.notes)
    assert made.dataset.header.gravity == pytest.approx(9.81 * np.cos(np.radians(TURNED)), rel=EXACT)
