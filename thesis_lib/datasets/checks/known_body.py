"""Known properties of the body for the checks of units and signs; limits and remedies that these checks share."""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Shape
from thesis_lib.bodies.walls import Wall
from thesis_lib.datasets.checks.gap_line import STEEP, gap_line
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.validate import Problem

FILE = "dataset.yaml"
LARGEST_BODY = 10.0  # m; a body that is dropped on a rig fits on a table
LARGEST_HEIGHT = 300.0  # extents, 10 % quantile of the heights; bodies come down to 1 extent, read in mm to 1000
LARGEST_SPEED = 100.0  # m/s, 90th percentile; a fall from 500 m
TO_RAD = np.pi / 180.0
GROSS_SIZE = 1.4  # ratio of heights at impact to those of the shape; beyond any error of ruler or frame
FEW_HITS = 10  # impacts below which shape and surface are not judged
BLIND_SHAPE = 0.1  # extents by which the lowest point moves over a turn; below, the gap does not depend on theta
FACTORS = {  # likely causes of a shape that is too large by a factor
    2.0: "diameters given as semi-axes or radius?",
    10.0: "centimetres for millimetres?",
    0.1: "millimetres for centimetres?",
    25.4: "inches?",
    100.0: "centimetres?",
    1000.0: "millimetres?",
}
UNLIKE = (300.0, 3000.0)  # ratio of the noise of two columns, one in mm and one in m; otherwise at most tens
NOISY = 1e-5  # m; below, the noise may be that of digits, or a simulation has none
STILL, SHAKY = 0.1, 0.03  # noise in extents, below which columns can be in m, and above which a column cannot
FITS_BETTER = 3.0  # times by which the heights at impact scatter less if angles are in the right unit
ROUNDED = 1e-3  # relative; numbers in dataset.yaml may have three digits
NEAR = 0.15  # relative distance to one of `FACTORS`

BELIEVED = 3.0  # standard uncertainties by which statements of a header on one body may differ

RADIANS = "give theta in radians (and omega in rad/s): multiply by pi/180, or --units deg of the init command"
ONE_UNIT = "give every column in m; the unit of one of them in the log's header or in --units is wrong"
ALREADY_RADIANS = "multiply theta (and omega) by 180/pi; its unit in the log's header or in --units is wrong"
METRES = "give lengths in m: divide by 1000 if they are in millimetres, by 100 if in centimetres"
SHAPE_METRES = METRES + " (--shape of the init command is in m, whatever the --units of the log)"
UPWARDS = "y must point up, away from the surface: flip its sign (and that of theta if it then turns clockwise)"


@dataclass(frozen=True)
class KnownBody:
    """Properties of the body that hold even if dataset.yaml has faults elsewhere.

    `shape` and `k_g` (m) are None without a valid shape; `height` (m) is the height of the surface, unused if there
    are `walls`; `gravity` in m/s².
    """

    shape: Shape | None = None
    k_g: float | None = None
    height: float = 0.0
    gravity: float = 9.81
    walls: tuple[Wall, ...] = ()

    @classmethod
    def of(cls, header: Header | None, shape: Shape | None) -> "KnownBody":
        """Properties from a valid header, else from the shape alone."""
        if header is None:
            return cls(shape, None if shape is None else shape.extent / 2)
        shape = header.body.shape
        k_g = min(header.body.radius_of_gyration, shape.extent)  # a larger one is reported by `check_header`
        return cls(shape, k_g, header.surface.height, header.gravity, header.surfaces or ())

    @property
    def oversized(self) -> bool:
        """Whether the shape is too large to be in m, so that ratios to it mean nothing."""
        return self.shape is not None and self.shape.extent > LARGEST_BODY

    def sunk(self, y: np.ndarray) -> str:
        """Message if most of the heights `y` (n,) in m lie below the surface; '' otherwise."""
        if np.mean(y < self.height) <= 0.5:
            return ""
        return f"the body's centre is below the surface ({self.height:g} m) in most rows"


def unlike_column(noise: np.ndarray, position: np.ndarray, extent: float) -> tuple[int, str] | None:
    """Index of the column of positions (n, d) in m with another unit than all others, and a message; None if none has.

    One camera measures all columns with similar noise (d,), in m; ranges are less reliable, as drops may fall straight
    down.  `extent` of the body, in m: in a column that is a thousand times too small, no body moves as far.
    """
    for i, own in enumerate(noise):
        others = np.delete(noise, i)
        moves = float(np.diff(np.quantile(position[:, i], (0.01, 0.99)))[0])
        smaller, larger = (bool(np.all((r > UNLIKE[0]) & (r < UNLIKE[1]))) for r in (others / own, own / others))
        if not others.min() > NOISY:
            continue
        if smaller and moves < extent and others.max() < STILL * extent:
            seen, read = f"{others.min() / own:.0f} times less than", "metres read as millimetres?"
        elif larger and own > SHAKY * extent:
            seen, read = f"{own / others.max():.0f} times as much as", "millimetres read as metres?"
        else:
            continue
        return i, f"is not in the unit of the others: it scatters {seen} they do, and moves by {moves:.2g} m; {read}"
    return None


def _scatter(values: np.ndarray) -> float:
    return float(np.median(np.abs(values - np.median(values))))


def radians_as_degrees(shape: Shape, q: np.ndarray) -> str:
    """Message if poses q (n, 3) at impact, in m and rad, show that radians were read as degrees; "" otherwise.

    The heights of the centre then fit the shape at angles 180/π times as large.
    """
    if len(q) < FEW_HITS:
        return ""
    as_given, as_radians = (_scatter(q[:, 1] + shape.contact_point(q[:, 2] / by)[:, 1]) for by in (1.0, TO_RAD))
    if as_given <= FITS_BETTER * as_radians:
        return ""
    return (
        f"looks like radians that were read as degrees: at {len(q)} impacts the height of the centre fits the shape to "
        f"{1e3 * as_radians:.2g} mm and not {1e3 * as_given:.2g} mm if angles are 180/pi times as large"
    )


def contradictions(shape: Shape, height: float, q: np.ndarray) -> list[Problem]:
    """Problems if poses q (n, 3) at impact, in m and rad, contradict the shape or the surface height (m).

    At impact the lowest point touches: y − height = reach(θ).  If the ratio of the two is far from 1 in most impacts,
    the shape is wrong by that factor or the surface lies elsewhere; the explanation with less scatter is reported.
    """
    if len(q) < FEW_HITS:
        return []
    reach, centre = -shape.contact_point(q[:, 2])[:, 1], q[:, 1] - height
    ratio = float(np.median(centre / reach))
    if 1.0 / GROSS_SIZE < ratio < GROSS_SIZE:
        return []
    line = gap_line(shape, q)
    if line is not None and line.angle:
        # a critique finds a small angle by itself
        steep = abs(line.angle) > STEEP
        return [Problem(FILE, "surface", line.said().rstrip("."), line.remedy())] if steep else []
    offset = float(np.median(centre - reach))
    what = f"at {len(q)} impacts the centre is {ratio:.3g} times as high above the surface as the shape requires"
    closes = f"surface.height {height + offset:.4g} m instead of {height:g} m would close the gap of {offset:+.3g} m"
    round_body = np.ptp(reach) < BLIND_SHAPE * shape.extent
    if ratio > 0.0 and (round_body or _scatter(centre - ratio * reach) < _scatter(centre - reach)):
        times = 1.0 / ratio
        why = next((f" ({text})" for factor, text in FACTORS.items() if abs(times / factor - 1.0) < NEAR), "")
        what += f": the shape is {max(times, ratio):.3g} times too {'large' if times > 1 else 'small'}{why}"
        what += f"; or {closes}" if round_body else ""
        return [Problem(FILE, "body.shape", what, SHAPE_METRES + ", semi-axes and not diameters")]
    remedy = "correct surface.height, or the shape, or y, which must be that of the body's centre of mass"
    return [Problem(FILE, "surface.height", f"{what}: {closes}", remedy)]


def contradictory_body(body: Body) -> list[Problem]:
    """Problems if the statements of dataset.yaml on a homogeneous body contradict each other."""
    if not body.homogeneous:
        return []
    if body.inertia_uncertainty is None:
        what = "true, but its uncertainty is not stated"
        remedy = "add uncertainty: {size: 0.002} (relative, one sigma, as a caliper gives it), or leave homogeneous out"
        return [Problem(FILE, "body.homogeneous", what, remedy)]
    shape, found = body.shape, []
    off = (body.radius_of_gyration / shape.radius_of_gyration) ** 2 - 1.0
    if abs(off) > BELIEVED * body.inertia_uncertainty + ROUNDED:
        what = (
            f"{body.radius_of_gyration:g} m gives a moment of inertia {100 * off:+.2g} % off that of this shape with "
            f"uniform density ({shape.radius_of_gyration:.6g} m), which is stated to be known to "
            f"{100 * body.inertia_uncertainty:.2g} %"
        )
        remedy = "give the value of the shape, or leave homogeneous out and state uncertainty.inertia as measured"
        found.append(Problem(FILE, "body.radius_of_gyration", what, remedy))
    centre = float(np.hypot(*shape.centroid))
    if centre > BELIEVED * (body.centre_uncertainty or 0.0) + ROUNDED * shape.extent:
        what = f"its centroid is {1e3 * centre:.3g} mm from the origin, where a homogeneous body has its centre of mass"
        remedy = "give the vertices from the centroid, or leave homogeneous out"
        found.append(Problem(FILE, "body.shape", what, remedy))
    return found
