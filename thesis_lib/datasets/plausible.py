"""Do units and signs fit together?  Heuristics that must not misfire on real drops.

| on paper | in code  | unit  |                                                     |
|----------|----------|-------|-----------------------------------------------------|
| e        | `extent` | m     | largest distance of the outline from the origin     |
| k        | `k_g`    | m     | radius of gyration                                  |
| φ_n      | `gap`    | m     | gap between body and surface                        |
| σ        | `noise`  | m, rad| noise of a sample, from third differences           |

Angles are judged by physics, not by their size: θ is continuous, so 20 rad is as good a value as 0.2.
Degrees look like radians that are 57 times too large, so one of these gives them away: steps of more than 1.5 turns
between samples (a camera cannot see them, and a wrapped radian angle jumps by one turn at most); a median k|ω| above
10 times the median speed (a rotational energy 100 times the translational one); or k|ω| above the speed and a body
that sinks into the surface at the angles as given but not at the angles read as degrees.
Where the angle moves no contact point (a disk), that last test is blind; k|ω| above the speed, or angle noise that
at the rim is far above position noise, is then a warning.  Angles are judged by lengths, so they are not judged at
all where lengths, or the shape, are in doubt.

y points down if bodies clearly fall towards larger y (free_fall.py), wherever the surface is said to be.
Gravity is measured where bodies fall freely (windows of samples that are a parabola), and shape and surface where
impacts were found (`contradictions`): a factor that no effect of a rig has is an error, with the likely cause.
A single sample that jumps out and back is a glitch of the tracker, and says nothing of units.
Lengths are judged by ratios to the body (positions that never come within 300 body extents of the surface) and by
speeds (above 100 m/s).
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.free_fall import flight_windows, free_accelerations, runs_of
from thesis_lib.datasets.header import Header
from thesis_lib.datasets.noise import noise_from_differences
from thesis_lib.datasets.samples import Samples
from thesis_lib.datasets.validate import MIN_SAMPLES, Problem, Report, Table

FILE = "dataset.yaml"

LARGEST_BODY = 10.0  # m; what is dropped on a rig fits on a table
LARGEST_HEIGHT = 300.0  # in extents, lowest tenth: bodies come down to 1 extent, in millimetres to 1000
LARGEST_SPEED = 100.0  # m/s, 90th percentile; a fall from 500 m
LARGEST_GRAVITY = 100.0  # m/s²; 9810 mm/s² and 981 cm/s² lie beyond, planets do not
DENSEST = 22_600.0  # kg/m³, osmium
BLIND_STEP = 3.0 * np.pi  # rad between samples: a true step below π plus a wrap of one turn
BLIND_MEDIAN = 5  # samples on either side of a step, of which two may be glitches
MIN_BLIND_STEPS = 3  # one or two glitches of a tracker are no unit
SPIN_SURE = 10.0  # k|ω| over speed; dice throws have 0.25 (2.7 at most), a spun coin about 5
SPIN_FAST = 1.0  # m/s of k|ω|; below it both medians may be tracker noise of a body at rest
SPIN_LIKELY = 1.0  # k|ω| over speed; in degrees, dice throws have 14
BLIND_SHAPE = 0.1  # extents by which the lowest point moves over a turn; below, the gap says nothing of theta
RIM_NOISE = 5.0  # k σ_θ over σ of positions; markers at the rim give 1, so that a factor of 57 shows
BURIED = 0.5  # smallest half-widths; a centre that never rises above that is inside the surface at any angle
DEEP = 0.1  # penetration in extents that no tracker error explains ...
DEEP_SHARE = 0.05  # ... if it happens this often
FALL_PRECISION = 0.2  # m/s², one sigma of the acceleration in a window
FALL_CLEAR = 5.0  # sigmas by which a window must fall to be a flight, and not a body at rest
GROSS_FALL = 1.5  # ratio of gravity found to that stated; drag and guides stay below 1.2, time in a wrong unit does not
GROSS_SIZE = (
    1.4  # ratio of heights at impact to those of the shape; beyond any error of a ruler or of a frame
)
FEW_FALLS = 0.05  # share of the flights that may fall as stated where all others contradict it
FEW_HITS = 10  # impacts below which shape and surface are not judged
TO_RAD = np.pi / 180.0
FACTORS = {
    2.0: "diameters given as semi-axes or radius?",
    10.0: "centimetres for millimetres?",
    0.1: "millimetres for centimetres?",
    25.4: "inches?",
    100.0: "centimetres?",
    1000.0: "millimetres?",
}  # a shape that is so many times too large, and why
NEAR = 0.15  # relative distance to such a factor

RADIANS = "give theta in radians (and omega in rad/s): multiply by pi/180"
METRES = "give lengths in m: divide by 1000 if they are in millimetres, by 100 if in centimetres"
SHAPE_METRES = METRES + " (--shape of the init command takes m, whatever --units says of the log)"
UPWARDS = (
    "y must point up, away from the surface: flip its sign (and that of theta if that turns clockwise then)"
)
AND_HEIGHT = ", and set surface.height in dataset.yaml accordingly"
OR_HEIGHT = ", or correct surface.height in dataset.yaml"


@dataclass(frozen=True)
class Body:
    """What is known of the body even where dataset.yaml is wrong elsewhere; None = unknown."""

    shape: Shape | None = None
    extent: float | None = None
    k_g: float | None = None
    height: float = 0.0
    gravity: float = 9.81

    @classmethod
    def of(cls, header: Header | None, shape: Shape | None) -> "Body":
        """From a valid header, else from the shape alone."""
        if header is None:
            return cls(
                shape, None if shape is None else shape.extent, None if shape is None else shape.extent / 2
            )
        shape = header.body.shape
        k_g = min(header.body.radius_of_gyration, shape.extent)  # a larger one is told by `check_header`
        return cls(shape, shape.extent, k_g, header.surface.height, header.gravity)

    @property
    def oversized(self) -> bool:
        """Whether the shape is far too large to be meant in m: no ratio to it says anything then."""
        return self.extent is not None and self.extent > LARGEST_BODY

    def reach(self) -> tuple[float, float]:
        """Smallest and largest distance in m, over a turn, from the body origin down to the lowest point."""
        depth = -self.shape.contact_point(np.linspace(0.0, 2.0 * np.pi, 181))[:, 1]  # pyright: ignore[reportOptionalMemberAccess]
        return float(depth.min()), float(depth.max())


def check_header(header: Header, file: str, report: Report) -> None:
    """Size, inertia, mass, gravity and noise against each other."""
    extent, body, noise = header.body.shape.extent, header.body, header.noise
    if extent > LARGEST_BODY:
        report.error(
            file,
            "body.shape",
            f"the body reaches {extent:g} m from its centre, more than {LARGEST_BODY:g} m: millimetres?",
            SHAPE_METRES,
        )
    elif body.radius_of_gyration > extent:
        report.error(
            file,
            "body.radius_of_gyration",
            f"{body.radius_of_gyration:g} m is larger than the body, which reaches {extent:g} m from its centre",
            "give sqrt(I/m) in m (not the moment of inertia, not millimetres); "
            f"a uniform lamina of this shape has {body.shape.radius_of_gyration:.6g}",
        )
    elif body.mass is not None and body.mass > DENSEST * (2.0 * extent) ** 3:
        report.warn(
            file,
            "body.mass",
            f"{body.mass:g} kg would be denser than any metal for a body of {2 * extent:g} m: grams?",
            "give the mass in kg",
        )
    if header.gravity > LARGEST_GRAVITY:
        report.error(
            file, "gravity", f"{header.gravity:g} m/s² is no planet's", "give it in m/s² (9.81 on Earth)"
        )
    if noise is not None and noise.position is not None and noise.position > extent:
        report.error(
            file,
            "noise.position",
            f"{noise.position:g} m is larger than the body: millimetres?",
            "give it in m",
        )
    if noise is not None and noise.angle is not None and noise.angle > 1.0:
        report.warn(file, "noise.angle", f"{noise.angle:g} rad is most of a turn: degrees?", "give it in rad")


def check_trajectories(table: Table, body: Body, report: Report) -> None:
    """Directions and units of poses."""
    data = table.data
    trial = data["trial"].to_numpy()
    t, x, y, theta = (data[name].to_numpy(float) for name in ("t", "x", "y", "theta"))
    dt = np.diff(t)
    usable = (trial[1:] == trial[:-1]) & (dt > 0.0)
    if not usable.any():
        return
    speeds = {
        name: np.abs(np.diff(v))[usable] / dt[usable] for name, v in (("x", x), ("y", y), ("theta", theta))
    }
    samples = Samples(trial, t, np.column_stack([x, y, theta]), runs_of(trial, t))
    noise = noise_from_differences(samples)
    fall = _first_acceleration(trial, y, float(np.median(dt[usable]))) / -body.gravity
    doubtful = _check_direction(table, samples, noise, body, report)
    doubtful |= _check_lengths(table, x, y, speeds, body, fall, report)
    if not doubtful and body.gravity <= LARGEST_GRAVITY:
        doubtful = _check_gravity(table, samples, noise, body, report)
    if not doubtful and not body.oversized:  # angles are judged by positions and by the shape
        _check_degrees(table, y, theta, _blind_steps(samples.run, theta), speeds, noise, body, report)


def _first_acceleration(trial: np.ndarray, y: np.ndarray, dt: float) -> float:
    """Median over trials of ÿ (m/s²) from a parabola through the first `MIN_SAMPLES` samples; NaN if none is long."""
    starts = np.flatnonzero(np.diff(trial, prepend=trial[0] - 1) != 0)
    starts = starts[np.diff(np.append(starts, len(trial))) >= MIN_SAMPLES]
    if len(starts) == 0:
        return float("nan")
    i = np.arange(MIN_SAMPLES)
    curvature = np.linalg.pinv(np.vander(i * 1.0, 3))[0]  # weights that give the coefficient of i²
    return float(np.median(2.0 * (y[starts[:, None] + i] @ curvature)) / dt**2)


def _check_direction(table: Table, samples: Samples, noise: np.ndarray, body: Body, report: Report) -> bool:
    below = samples.q[:, 1] < body.height
    sunk = bool(np.mean(below) > 0.5)
    flights = flight_windows(samples, noise[1], body.gravity)
    if flights.fall_up:
        where = f", {table.rows(below)}" if sunk else ""
        what = f"bodies fall towards larger y, by about gravity ({flights.up} windows of {flights.n} samples do so, "
        what += f"{flights.down} fall towards smaller y)"
        if sunk:
            what = f"the body's centre is below the surface ({body.height:g} m) in most rows, and {what}"
        report.error(table.file, f"column y{where}", what, UPWARDS + AND_HEIGHT)
    elif sunk:
        report.error(
            table.file,
            f"column y, {table.rows(below)}",
            f"the body's centre is below the surface ({body.height:g} m) in most rows",
            UPWARDS + OR_HEIGHT,
        )
    return sunk or flights.fall_up


def _check_lengths(
    table: Table, x: np.ndarray, y: np.ndarray, speeds: dict, body: Body, fall: float, report: Report
) -> bool:
    suspicious = []
    known = body.extent is not None and not body.oversized
    high = float(np.quantile(np.abs(y - body.height), 0.1)) / body.extent if known else 0.0  # pyright: ignore[reportOperatorIssue]
    for name in ("x", "y"):
        fast = float(np.quantile(speeds[name], 0.9))
        if fast > LARGEST_SPEED:
            suspicious.append((name, f"speeds reach {fast:.0f} m/s"))
        elif name == "y" and high > LARGEST_HEIGHT:
            suspicious.append((name, f"the body is {high:.0f} times its own size above the surface"))
        elif name == "y" and high > 3.0 and (50.0 < abs(fall) < 200.0 or 500.0 < abs(fall) < 2000.0):
            suspicious.append((name, f"bodies fall at {abs(fall):.0f} times gravity"))
    for name, why in suspicious:
        values = x if name == "x" else y
        report.error(
            table.file,
            f"column {name}",
            f"looks like millimetres or centimetres ({values.min():.4g} to {values.max():.4g}; {why})",
            METRES,
        )
    return bool(suspicious)


def _check_gravity(table: Table, samples: Samples, noise: np.ndarray, body: Body, report: Report) -> bool:
    found = free_accelerations(samples, noise[1], FALL_PRECISION)
    falls = -found.values[found.values < -FALL_CLEAR * FALL_PRECISION] / body.gravity
    if len(falls) < 5 * found.n:
        return False
    ratio = float(np.median(falls))
    as_stated = np.mean((falls > 1.0 / GROSS_FALL) & (falls < GROSS_FALL))
    if 1.0 / GROSS_FALL < ratio < GROSS_FALL or as_stated > FEW_FALLS:
        return False
    found_g = ratio * body.gravity
    if abs(found_g / 9.81 - 1.0) < NEAR:
        report.error(
            FILE,
            "gravity",
            f"bodies fall with {found_g:.3g} m/s², {ratio:.3g} times the {body.gravity:g} m/s² stated",
            "give 9.81 (or leave gravity out)",
        )
        return True
    clock, size = np.sqrt(ratio), ratio
    report.error(
        table.file,
        "columns t and y",
        f"bodies fall with {found_g:.3g} m/s², {ratio:.3g} times the {body.gravity:g} m/s² of {FILE}: times are "
        f"{max(clock, 1 / clock):.3g} times too {'long' if clock < 1 else 'short'} (another frame rate than that "
        f"of the camera?), or lengths are {max(size, 1 / size):.3g} times too {'small' if size < 1 else 'large'}",
        "correct t (and rate), or the scale of x and y, or gravity if the rig is tilted or not on Earth",
    )
    return True


def _blind_steps(run: np.ndarray, theta: np.ndarray) -> int:
    """How many steps of θ a camera could not see, without those to and from samples that jump out and back."""
    n = BLIND_MEDIAN
    if len(theta) < 2 * n:
        return 0
    level = np.median(np.lib.stride_tricks.sliding_window_view(theta, n), axis=1)
    same = run[2 * n - 1 :] == run[: len(run) - 2 * n + 1]
    lasting = (
        np.abs(level[n:] - level[:-n]) > BLIND_STEP
    )  # between the n samples before and the n after a step
    steps = np.abs(np.diff(theta))[n - 1 : len(theta) - n] > BLIND_STEP
    return int(np.sum(steps & lasting & same))


def contradictions(shape: Shape, height: float, q: np.ndarray) -> list[Problem]:
    """What poses q (n, 3) at impact say against the shape and the height (m) of the surface in dataset.yaml.

    At impact the lowest point touches, y − height = reach(θ): a ratio of the two that is far from 1 in most impacts
    is the factor by which the shape is wrong, if that makes them agree, and an offset of the surface otherwise.
    """
    if len(q) < FEW_HITS:
        return []
    reach, centre = -shape.contact_point(q[:, 2])[:, 1], q[:, 1] - height
    ratio = float(np.median(centre / reach))
    if 1.0 / GROSS_SIZE < ratio < GROSS_SIZE:
        return []
    offset = float(np.median(centre - reach))

    def scatter(rest: np.ndarray) -> float:
        return float(np.median(np.abs(rest - np.median(rest))))

    what = f"at {len(q)} impacts the centre is {ratio:.3g} times as high above the surface as the shape says"
    closes = f"surface.height {height + offset:.4g} m instead of {height:g} m would close the gap of {offset:+.3g} m"
    as_size, as_offset = scatter(centre - ratio * reach), scatter(centre - reach)
    round_body = np.ptp(reach) < BLIND_SHAPE * shape.extent
    if ratio > 0.0 and (round_body or as_size < as_offset):
        times = 1.0 / ratio
        why = next((f" ({text})" for factor, text in FACTORS.items() if abs(times / factor - 1.0) < NEAR), "")
        size = f"the shape is {max(times, ratio):.3g} times too {'large' if times > 1 else 'small'}{why}"
        other = f"; or {closes}" if round_body else ""
        return [
            Problem(
                FILE, "body.shape", f"{what}: {size}{other}", SHAPE_METRES + ", semi-axes and not diameters"
            )
        ]
    return [
        Problem(
            FILE,
            "surface.height",
            f"{what}: {closes}",
            "correct surface.height, or the shape, or y, which must be that of the body's centre of mass",
        )
    ]


def _check_degrees(
    table: Table,
    y: np.ndarray,
    theta: np.ndarray,
    blind: int,
    speeds: dict,
    noise: np.ndarray,
    body: Body,
    report: Report,
) -> None:
    why = None
    # sunk at any angle: the shape or the height of the surface is wrong, which is told below
    buried = body.shape is not None and np.quantile(y - body.height, 0.9) < BURIED * body.reach()[0]
    if blind >= MIN_BLIND_STEPS:
        why = f"{blind} steps between samples are larger than 1.5 turns"
    elif body.k_g is not None and not buried:
        speed = float(np.median(np.hypot(speeds["x"], speeds["y"])))
        spin = body.k_g * float(np.median(speeds["theta"]))
        sunk = _sunk_share(body, y, theta)
        if spin > max(SPIN_FAST, SPIN_SURE * speed) and speed > 0.0:
            why = f"as radians, the rim would move {spin / speed:.0f} times faster than the centre"
        elif spin > SPIN_LIKELY * speed > 0.0 and sunk > DEEP_SHARE > _sunk_share(body, y, theta * TO_RAD):
            why = f"as radians, the body would be sunk into the surface in {sunk:.0%} of the rows, as degrees in none"
    if why:
        report.error(
            table.file,
            "column theta",
            f"looks like degrees ({theta.min():.4g} to {theta.max():.4g}; {why})",
            RADIANS,
        )
        return
    if body.shape is None:
        return
    if not buried:
        _doubt_degrees_of_a_disk(table, theta, speeds, noise, body, report)
    sunk = _sunk_share(body, y, theta, 2.5 * DEEP)
    if sunk > DEEP_SHARE:
        report.warn(
            table.file,
            "columns y and theta",
            f"the body is deep inside the surface in {sunk:.0%} of the rows",
            "check surface.height, the shape (in m), and that theta is counter-clockwise and 0 where the shape is "
            "as drawn",
        )


def _doubt_degrees_of_a_disk(
    table: Table, theta: np.ndarray, speeds: dict, noise: np.ndarray, body: Body, report: Report
) -> None:
    low, high = body.reach()
    if high - low > BLIND_SHAPE * body.extent:  # pyright: ignore[reportOperatorIssue]
        return
    speed = float(np.median(np.hypot(speeds["x"], speeds["y"])))
    spin = body.k_g * float(np.median(speeds["theta"]))  # pyright: ignore[reportOptionalOperand]
    position, rim = float(np.max(noise[:2])), body.k_g * noise[2]
    why = []
    if spin > max(SPIN_FAST, SPIN_LIKELY * speed) and speed > 0.0:
        why.append(f"as radians, the rim moves {spin / speed:.1f} times faster than the centre")
    if rim > RIM_NOISE * position:
        why.append(
            f"theta scatters by {noise[2]:.2g} rad, at the rim {rim / position:.0f} times as much as the position"
        )
    if why:
        report.warn(
            table.file,
            "column theta",
            f"may be in degrees ({theta.min():.4g} to {theta.max():.4g}; {'; '.join(why)}); the contact of a round "
            "body cannot tell",
            RADIANS
            + "; nothing, if it is in radians and the body spins fast or its angle is hard to measure",
        )


def _sunk_share(body: Body, y: np.ndarray, theta: np.ndarray, depth: float = DEEP) -> float:
    return float(np.mean(body.shape.gap(y, theta, body.height) < -depth * body.extent))  # pyright: ignore[reportOperatorIssue, reportOptionalMemberAccess]
