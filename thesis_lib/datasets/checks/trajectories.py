"""Are the units and signs of header and trajectories consistent?  Heuristics that must not misfire on real drops.

- y points down if bodies clearly fall towards larger y, whatever the stated surface.
- Lengths are judged by their ratio to the body (positions always more than 300 extents from the surface) and by speeds
  (above 100 m/s).
- Different units of x and y are recognised by their different noise: one camera measures both.
- Gravity is measured in free flight (windows of samples that are parabolas).  A factor beyond any effect of a rig is an
  error, reported with its likely cause.
- Angles are judged by lengths (`angles`), and not at all if lengths or the shape are in doubt.  Shape and surface are
  judged only if impacts were found (`known_body.contradictions`).

The direction of the fall is found from short windows, without knowledge of the impacts.  A window inside one flight is
a parabola with ÿ = −g.  A window that spans an impact is not a parabola, and is left out; a body that rests or is held
has ÿ = 0.  If windows have ÿ near +g, and hardly any near −g, y points down.  The window is as short as the noise
allows, so that it fits into the flight of a low bounce.

    ÿ = 2 c₂/Δt²,   var ÿ = 4 σ²/Δt⁴ · 180/(n (n² − 1)(n² − 4))        (parabola c₀ + c₁ i + c₂ i² through n samples)

Δt is the sampling interval, σ the noise of a sample of y.
"""

import numpy as np

from thesis_lib.datasets.checks.angles import check_degrees
from thesis_lib.datasets.checks.known_body import (
    FILE,
    LARGEST_BODY,
    LARGEST_HEIGHT,
    LARGEST_SPEED,
    METRES,
    ONE_UNIT,
    SHAPE_METRES,
    UPWARDS,
    KnownBody,
    contradictory_body,
    unlike_column,
)
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import Samples, noise_from_differences
from thesis_lib.datasets.format.validate import MIN_SAMPLES, UsableRows, ValidationReport

LARGEST_GRAVITY = 100.0  # m/s²; 9810 mm/s² and 981 cm/s² lie beyond, planets do not
DENSEST = 22_600.0  # kg/m³, osmium
PRECISION = 0.1  # one sigma of ÿ/g: rest (0) and flight (1) are then ten sigmas apart
ABOUT_G = (0.5, 2.0)  # |ÿ|/g accepted as a flight: y may be scaled slightly wrong, which other checks report
SMALLEST_WINDOW = 5  # samples; recognising a parabola takes two degrees of freedom
LARGEST_WINDOW = 1000
PARABOLA = 3.0  # reduced chi² of a window that may pass for a parabola
NOISE_FLOOR = 1e-6  # m; simulated poses have no noise, but finitely many digits
CLEARLY = 5.0  # upward falls per downward fall; a true flight has none, small hits give a few
FALL_PRECISION = 0.2  # m/s², one sigma of the acceleration in a window
FALL_CLEAR = 5.0  # sigmas by which a window must fall to be a flight, and not a body at rest
GROSS_FALL = 1.5  # measured over stated gravity; drag and guides stay below 1.2, unlike a wrong unit of time
FEW_FALLS = 0.05  # share of the flights that may fall as stated although all others contradict it
NEAR = 0.15  # relative distance to gravity on Earth within which the stated gravity is wrong


def check_header(header: Header, report: ValidationReport) -> None:
    """Report contradictions between size, inertia, mass, gravity and noise."""
    extent, body, noise = header.body.shape.extent, header.body, header.noise
    if extent > LARGEST_BODY:
        what = f"the body reaches {extent:g} m from its centre, more than {LARGEST_BODY:g} m: millimetres?"
        report.error(FILE, "body.shape", what, SHAPE_METRES)
    elif body.radius_of_gyration > extent:
        what = f"{body.radius_of_gyration:g} m is larger than the body, which reaches {extent:g} m from its centre"
        lamina = f"a uniform lamina of this shape has {body.shape.radius_of_gyration:.6g}"
        remedy = f"give sqrt(I/m) in m (not the moment of inertia, not millimetres); {lamina}"
        report.error(FILE, "body.radius_of_gyration", what, remedy)
    elif body.mass is not None and body.mass > DENSEST * (2.0 * extent) ** 3:
        what = f"{body.mass:g} kg would be denser than any metal for a body of {2 * extent:g} m: grams?"
        report.warn(FILE, "body.mass", what, "give the mass in kg")
    report.errors += contradictory_body(body)
    if header.gravity > LARGEST_GRAVITY:
        what = f"{header.gravity:g} m/s² is more than on any planet"
        report.error(FILE, "gravity", what, "give it in m/s² (9.81 on Earth)")
    if noise is not None and noise.position is not None and noise.position > extent:
        what = f"{noise.position:g} m is larger than the body: millimetres?"
        report.error(FILE, "noise.position", what, "give it in m")
    if noise is not None and noise.angle is not None and noise.angle > 1.0:
        report.warn(FILE, "noise.angle", f"{noise.angle:g} rad is most of a turn: degrees?", "give it in rad")


def check_trajectories(table: UsableRows, body: KnownBody) -> None:
    """Report wrong directions and units of poses; angles between walls are not judged."""
    data, names = table.data, ["x", "y", "theta"]
    trial, t, q = data["trial"].to_numpy(), data["t"].to_numpy(float), data[names].to_numpy(float)
    dt = np.diff(t)
    usable = (trial[1:] == trial[:-1]) & (dt > 0.0)
    if not usable.any():
        return
    speeds = {name: np.abs(np.diff(values))[usable] / dt[usable] for name, values in zip(names, q.T)}
    samples = Samples(trial, t, q, runs_of(trial, t))
    noise = noise_from_differences(samples)
    if body.gravity == 0.0:
        return _check_on_a_table(table, samples, speeds, noise, body)
    fall = _first_acceleration(trial, q[:, 1], float(np.median(dt[usable]))) / -body.gravity
    doubtful = _check_direction(table, samples, noise, body)
    doubtful |= _check_lengths(table, q, speeds, body, fall)
    doubtful = doubtful or _check_columns(table, samples, noise, body)
    if not doubtful and body.gravity <= LARGEST_GRAVITY:
        doubtful = _check_gravity(table, samples, noise, body)
    if not doubtful and not body.oversized:  # angles are judged by positions and by the shape
        check_degrees(table, samples, speeds, noise, body)


def _check_on_a_table(table: UsableRows, samples: Samples, speeds: dict, noise: np.ndarray, body: KnownBody) -> None:
    """Report wrong units of a motion without gravity, and a body behind its surface or a wall."""
    q = samples.q
    doubtful = False
    for name in ("x", "y"):
        if (fast := float(np.quantile(speeds[name], 0.9))) > LARGEST_SPEED:
            table.error(
                f"column {name}", f"looks like millimetres or centimetres (speeds reach {fast:.0f} m/s)", METRES
            )
            doubtful = True
    doubtful = doubtful or _check_columns(table, samples, noise, body)
    for wall in body.walls:
        behind = (q[:, :2] - wall.point) @ wall.n < 0.0
        if not doubtful and behind.mean() > 0.5:
            what = f"the body's centre is behind the wall {wall.name} in most rows"
            remedy = "the normal must point from the wall to the body; correct it, or the point"
            table.report.error(FILE, f"surfaces, {wall.name}", what, remedy)
            doubtful = True
    if not body.walls and not doubtful and (sunk := body.sunk(q[:, 1])):
        table.error("column y", sunk, UPWARDS + ", or correct surface.height in dataset.yaml", q[:, 1] < body.height)
        doubtful = True
    if not doubtful and not body.oversized and not body.walls and q[:, 2].any():
        check_degrees(table, samples, speeds, noise, body)


def _first_acceleration(trial: np.ndarray, y: np.ndarray, dt: float) -> float:
    """Median over trials of ÿ (m/s²) from a parabola through the first `MIN_SAMPLES` samples; NaN if all are short."""
    starts = np.flatnonzero(np.diff(trial, prepend=trial[0] - 1) != 0)
    starts = starts[np.diff(np.append(starts, len(trial))) >= MIN_SAMPLES]
    if len(starts) == 0:
        return float("nan")
    i = np.arange(MIN_SAMPLES)
    curvature = np.linalg.pinv(np.vander(i * 1.0, 3))[0]  # weights that give the coefficient of i²
    return float(np.median(2.0 * (y[starts[:, None] + i] @ curvature)) / dt**2)


def _check_direction(table: UsableRows, samples: Samples, noise: np.ndarray, body: KnownBody) -> bool:
    """Report y that points down, or a body below the surface; return whether there is such a problem."""
    y = samples.q[:, 1]
    sunk = body.sunk(y)
    up, down, n = _flight_windows(samples, noise[1], body.gravity)
    remedy = UPWARDS + ", or correct surface.height in dataset.yaml"
    what = sunk
    if up >= n and up > CLEARLY * down:  # at least n windows for a fall upwards, hardly any against it
        remedy = UPWARDS + ", and set surface.height in dataset.yaml accordingly"
        falls = f"bodies fall towards larger y, by about gravity ({up} windows of {n} samples do so, "
        falls += f"{down} fall towards smaller y)"
        what = f"{sunk}, and {falls}" if sunk else falls
    if what:
        table.error("column y", what, remedy, y < body.height if sunk else None)
    return bool(what)


def _check_lengths(table: UsableRows, q: np.ndarray, speeds: dict, body: KnownBody, fall: float) -> bool:
    """Report x or y in millimetres or centimetres; return whether one is.  `fall` is ÿ at release over −gravity."""
    doubts = {}
    high = 0.0
    if body.shape is not None and not body.oversized:
        high = float(np.quantile(np.abs(q[:, 1] - body.height), 0.1)) / body.shape.extent
    for name in ("x", "y"):
        fast = float(np.quantile(speeds[name], 0.9))
        if fast > LARGEST_SPEED:
            doubts[name] = f"speeds reach {fast:.0f} m/s"
        elif name == "y" and high > LARGEST_HEIGHT:
            doubts[name] = f"the body is {high:.0f} times its own size above the surface"
        elif name == "y" and high > 3.0 and (50.0 < abs(fall) < 200.0 or 500.0 < abs(fall) < 2000.0):
            doubts[name] = f"bodies fall at {abs(fall):.0f} times gravity"
    for name, why in doubts.items():
        values = q[:, "xy".index(name)]
        what = f"looks like millimetres or centimetres ({values.min():.4g} to {values.max():.4g}; {why})"
        table.error(f"column {name}", what, METRES)
    return bool(doubts)


def _check_columns(table: UsableRows, samples: Samples, noise: np.ndarray, body: KnownBody) -> bool:
    """Report x and y in different units; return whether they are."""
    if body.shape is None or body.oversized:
        return False
    found = unlike_column(noise[:2], samples.q[:, :2], body.shape.extent)
    if found is not None:
        table.error(f"column {'xy'[found[0]]}", found[1], ONE_UNIT)
    return found is not None


def _check_gravity(table: UsableRows, samples: Samples, noise: np.ndarray, body: KnownBody) -> bool:
    """Report falls that differ from the stated gravity by more than any effect of a rig; return whether they do."""
    accelerations, n = _free_accelerations(samples, noise[1], FALL_PRECISION)
    falls = -accelerations[accelerations < -FALL_CLEAR * FALL_PRECISION] / body.gravity
    if len(falls) < 5 * n:
        return False
    ratio = float(np.median(falls))
    as_stated = np.mean((falls > 1.0 / GROSS_FALL) & (falls < GROSS_FALL))
    if 1.0 / GROSS_FALL < ratio < GROSS_FALL or as_stated > FEW_FALLS:
        return False
    measured = ratio * body.gravity
    what = f"bodies fall with {measured:.3g} m/s², {ratio:.3g} times the {body.gravity:g} m/s² "
    if abs(measured / 9.81 - 1.0) < NEAR:
        table.report.error(FILE, "gravity", f"{what}stated", "give 9.81 (or leave gravity out)")
        return True
    clock, size = np.sqrt(ratio), ratio
    table.error(
        "columns t and y",
        f"{what}of {FILE}: times are {max(clock, 1 / clock):.3g} times too {'long' if clock < 1 else 'short'} (another "
        f"frame rate than that of the camera?), or lengths are {max(size, 1 / size):.3g} times too "
        f"{'small' if size < 1 else 'large'}",
        "correct t (and rate), or the scale of x and y, or gravity if the rig is tilted or not on Earth",
    )
    return True


def runs_of(trial: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Run numbers (N,), constant over the rows of a trial without a gap in the times `t` (N,), in s."""
    step = np.diff(t)
    usable = (trial[1:] == trial[:-1]) & (step > 0.0)
    usual = np.median(step[usable]) if usable.any() else np.inf
    return np.r_[0, np.cumsum(~usable | (np.abs(step / usual - 1.0) > 0.5))]


def _free_accelerations(samples: Samples, sigma_y: float, precision: float) -> tuple[np.ndarray, int]:
    """Accelerations ÿ (m,) in m/s² of the windows of n samples that are parabolas, and n, as small as possible.

    `precision` is the one-sigma error of ÿ in m/s² that n samples must reach, `sigma_y` that of y in m.
    """
    inside = samples.run[1:] == samples.run[:-1]
    none = np.zeros(0), 1
    if not inside.any():
        return none
    step = float(np.median(np.diff(samples.t)[inside]))
    sigma = max(float(np.nan_to_num(sigma_y)), NOISE_FLOOR)
    sizes = np.arange(SMALLEST_WINDOW, LARGEST_WINDOW + 1, dtype=float)
    error = 2.0 * sigma / step**2 * np.sqrt(180.0 / (sizes * (sizes**2 - 1.0) * (sizes**2 - 4.0)))
    precise = error < precision
    if not precise.any() or len(samples) < sizes[precise][0]:
        return none
    n = int(sizes[precise][0])
    basis, scale = np.linalg.qr(np.vander(np.arange(n) - (n - 1) / 2.0, 3, increasing=True))
    y = samples.q[:, 1] - np.median(samples.q[:, 1])
    c = [np.correlate(y, basis[:, k], "valid") for k in range(3)]
    rest = np.correlate(y * y, np.ones(n), "valid") - c[0] ** 2 - c[1] ** 2 - c[2] ** 2
    flight = (samples.run[n - 1 :] == samples.run[: len(y) - n + 1]) & (rest < PARABOLA * sigma**2 * (n - 3))
    return (2.0 * c[2] / scale[2, 2] / step**2)[flight], n


def _flight_windows(samples: Samples, sigma_y: float, gravity: float) -> tuple[int, int, int]:
    """Numbers of windows that accelerate by about `gravity` (m/s²) towards larger and smaller y, and their length n.

    `sigma_y` is the noise of y in m.
    """
    accelerations, n = _free_accelerations(samples, sigma_y, PRECISION * gravity)
    ratio = accelerations / gravity
    low, high = ABOUT_G
    up, down = (int(np.sum((low < sign * ratio) & (sign * ratio < high))) for sign in (1.0, -1.0))
    return up, down, n
