"""Do units and signs fit together?  Heuristics that must not misfire on real drops.

| on paper | in code  | unit  |                                                     |
|----------|----------|-------|-----------------------------------------------------|
| e        | `extent` | m     | largest distance of the outline from the origin     |
| k        | `k_g`    | m     | radius of gyration                                  |
| φ_n      | `gap`    | m     | gap between body and surface                        |
| E        | `energy` | m²/s² | ½(v_x² + v_y² + k²ω²), kinetic energy per unit mass |

Angles are judged by physics, not by their size: θ is continuous, so 20 rad is as good a value as 0.2.
Degrees look like radians that are 57 times too large, so one of these gives them away:
- trajectories: steps of more than 1.5 turns between samples (a camera cannot see them, and a wrapped radian angle
  jumps by one turn at most), a median k|ω| above 10 times the median speed (a rotational energy 100 times the
  translational one), or k|ω| above the speed and a body that sinks into the surface at the angles as given but not
  at the angles read as degrees;
- impacts: most impacts gain energy as given and would not if ω were in degrees per second; contact points (or, if
  there are none, gaps at the surface) that fit the shape at θ read as degrees and not at θ as given.
Lengths are judged by ratios to the body (positions that never come within 300 body extents of the surface) and by
speeds (above 100 m/s).
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.header import Header
from thesis_lib.datasets.impacts import POSE, V_POST, V_PRE
from thesis_lib.datasets.validate import MIN_SAMPLES, Report, Table

LARGEST_BODY = 10.0  # m; what is dropped on a rig fits on a table
LARGEST_HEIGHT = 300.0  # in extents, lowest tenth: bodies come down to 1 extent, in millimetres to 1000
LARGEST_SPEED = 100.0  # m/s, 90th percentile; a fall from 500 m
LARGEST_GRAVITY = 100.0  # m/s²; 9810 mm/s² and 981 cm/s² lie beyond, planets do not
DENSEST = 22_600.0  # kg/m³, osmium
BLIND_STEP = 3.0 * np.pi  # rad between samples: a true step below π plus a wrap of one turn
MIN_BLIND_STEPS = 3  # one or two glitches of a tracker are no unit
SPIN_SURE = 10.0  # k|ω| over speed; dice throws have 0.25 (2.7 at most), a spun coin about 5
SPIN_FAST = 1.0  # m/s of k|ω|; below it both medians may be tracker noise of a body at rest
SPIN_LIKELY = 1.0  # k|ω| over speed; in degrees, dice throws have 14
DEEP = 0.1  # penetration in extents that no tracker error explains ...
DEEP_SHARE = 0.05  # ... if it happens this often
FITS_BETTER = 5.0  # degrees explain contact points this many times better than radians
MISFIT = 0.05  # extents; misfits of contact points below it are tracker errors
TO_RAD = np.pi / 180.0

RADIANS = "give theta in radians (and omega in rad/s): multiply by pi/180"
METRES = "give lengths in m: divide by 1000 if they are in millimetres, by 100 if in centimetres"
UPWARDS = (
    "y must point up, away from the surface: flip its sign (and that of theta if that turns clockwise then)"
)


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


def check_header(header: Header, file: str, report: Report) -> None:
    """Size, inertia, mass, gravity and noise against each other."""
    extent, body, noise = header.body.shape.extent, header.body, header.noise
    if extent > LARGEST_BODY:
        report.error(
            file,
            "body.shape",
            f"the body reaches {extent:g} m from its centre, more than {LARGEST_BODY:g} m: millimetres?",
            METRES,
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
    fall = _first_acceleration(trial, y, float(np.median(dt[usable]))) / -body.gravity
    doubtful = _check_direction(table, y, body, fall, report)
    doubtful |= _check_lengths(table, x, y, speeds, body, fall, report)
    if not doubtful:  # angles are judged by positions
        _check_degrees(table, y, theta, np.diff(theta)[usable], speeds, body, report)


def _first_acceleration(trial: np.ndarray, y: np.ndarray, dt: float) -> float:
    """Median over trials of ÿ (m/s²) from a parabola through the first `MIN_SAMPLES` samples; NaN if none is long."""
    starts = np.flatnonzero(np.diff(trial, prepend=trial[0] - 1) != 0)
    starts = starts[np.diff(np.append(starts, len(trial))) >= MIN_SAMPLES]
    if len(starts) == 0:
        return float("nan")
    i = np.arange(MIN_SAMPLES)
    curvature = np.linalg.pinv(np.vander(i * 1.0, 3))[0]  # weights that give the coefficient of i²
    return float(np.median(2.0 * (y[starts[:, None] + i] @ curvature)) / dt**2)


def _check_direction(table: Table, y: np.ndarray, body: Body, fall: float, report: Report) -> bool:
    below = y < body.height
    if np.mean(below) <= 0.5:
        return False
    falling_up = -2.0 < fall < -0.5  # accelerated by g in the direction of +y
    why = "; they also fall towards larger y" if falling_up else ""
    report.error(
        table.file,
        f"column y, {table.rows(below)}",
        f"the body's centre is below the surface ({body.height:g} m) in most rows{why}",
        UPWARDS + ("" if falling_up else ", or correct surface.height in dataset.yaml"),
    )
    return True


def _check_lengths(
    table: Table, x: np.ndarray, y: np.ndarray, speeds: dict, body: Body, fall: float, report: Report
) -> bool:
    suspicious = []
    high = 0.0 if body.extent is None else float(np.quantile(np.abs(y - body.height), 0.1)) / body.extent
    for name in ("x", "y"):
        fast = float(np.quantile(speeds[name], 0.9))
        if fast > LARGEST_SPEED:
            suspicious.append((name, f"speeds reach {fast:.0f} m/s"))
        elif name == "y" and high > LARGEST_HEIGHT:
            suspicious.append((name, f"the body is {high:.0f} times its own size above the surface"))
        elif name == "y" and high > 3.0 and (50.0 < fall < 200.0 or 500.0 < fall < 2000.0):
            suspicious.append((name, f"bodies fall at {fall:.0f} times gravity"))
    for name, why in suspicious:
        values = x if name == "x" else y
        report.error(
            table.file,
            f"column {name}",
            f"looks like millimetres or centimetres ({values.min():.4g} to {values.max():.4g}; {why})",
            METRES,
        )
    return bool(suspicious)


def _check_degrees(
    table: Table,
    y: np.ndarray,
    theta: np.ndarray,
    steps: np.ndarray,
    speeds: dict,
    body: Body,
    report: Report,
) -> None:
    blind = int(np.sum(np.abs(steps) > BLIND_STEP))
    why = None
    if blind >= MIN_BLIND_STEPS:
        why = f"{blind} steps between samples are larger than 1.5 turns"
    elif body.k_g is not None:
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
    sunk = 0.0 if body.shape is None else _sunk_share(body, y, theta, 2.5 * DEEP)
    if sunk > DEEP_SHARE:
        report.warn(
            table.file,
            "columns y and theta",
            f"the body is deep inside the surface in {sunk:.0%} of the rows",
            "check surface.height, the shape, and that theta is counter-clockwise and 0 where the shape is as drawn",
        )


def _sunk_share(body: Body, y: np.ndarray, theta: np.ndarray, depth: float = DEEP) -> float:
    return float(np.mean(body.shape.gap(y, theta, body.height) < -depth * body.extent))


def check_impacts(table: Table, body: Body, report: Report) -> None:
    """Directions and units of impacts."""
    data = table.data
    q, v_pre, v_post = (data[list(names)].to_numpy(float) for names in (POSE, V_PRE, V_POST))
    below = q[:, 1] < body.height
    if np.mean(below) > 0.5:
        report.error(
            table.file,
            f"column y, {table.rows(below)}",
            f"the body's centre is below the surface ({body.height:g} m) in most rows",
            UPWARDS + ", or correct surface.height in dataset.yaml",
        )
    fast = {name: float(np.median(np.abs(data[name].to_numpy(float)))) for name in (*V_PRE[:2], *V_POST[:2])}
    if fast := {name: value for name, value in fast.items() if value > LARGEST_SPEED}:
        name, value = next(iter(fast.items()))
        report.error(
            table.file,
            f"column{'s' if len(fast) > 1 else ''} {', '.join(fast)}",
            f"looks like mm/s or cm/s (median of {name}: {value:.4g})",
            "give velocities in m/s: divide by 1000 if they are in mm/s",
        )
    if body.extent is None:
        return
    high = float(np.quantile(np.abs(q[:, 1] - body.height), 0.1)) / body.extent
    if high > LARGEST_HEIGHT:
        report.error(
            table.file,
            "columns x, y",
            f"looks like millimetres (y {q[:, 1].min():.4g} to {q[:, 1].max():.4g}: {high:.0f} times the body's size)",
            METRES,
        )
    if not fast and high <= LARGEST_HEIGHT:
        _check_impact_angles(table, q, v_pre, v_post, body, report)


def _check_impact_angles(
    table: Table, q: np.ndarray, v_pre: np.ndarray, v_post: np.ndarray, body: Body, report: Report
) -> None:
    data = table.data
    stated = data[["r_x", "r_y"]].to_numpy(float) if {"r_x", "r_y"} <= set(data.columns) else None
    if stated is not None and np.median(np.linalg.norm(stated, axis=1)) > LARGEST_HEIGHT * body.extent:
        report.error(table.file, "columns r_x, r_y", "look like millimetres (far outside the body)", METRES)
        return

    def misfit(theta: np.ndarray) -> float:
        r = body.shape.contact_point(theta)
        error = q[:, 1] + r[:, 1] - body.height if stated is None else np.linalg.norm(stated - r, axis=1)
        return float(np.median(np.abs(error))) / body.extent

    as_given, as_degrees = misfit(q[:, 2]), misfit(q[:, 2] * TO_RAD)
    spread = float(np.ptp(q[:, 2]))
    if as_given > max(MISFIT, FITS_BETTER * as_degrees) and spread > 2.0 * np.pi:
        report.error(
            table.file,
            "column theta",
            f"looks like degrees ({q[:, 2].min():.4g} to {q[:, 2].max():.4g}; read as degrees, the contact points "
            f"fit the shape {as_given / max(as_degrees, 1e-9):.0f} times better)",
            RADIANS,
        )

    # E = ½(v_x² + v_y² + k²ω²) drops in an impact
    def gains(factor: float) -> float:
        scale = np.array([1.0, 1.0, factor * body.k_g])
        return float(np.mean(np.sum((v_post * scale) ** 2, axis=1) > np.sum((v_pre * scale) ** 2, axis=1)))

    if gains(1.0) > 0.5 > 2.0 * gains(TO_RAD):
        report.error(
            table.file,
            "columns omega_pre, omega_post",
            f"look like degrees per second ({gains(1.0):.0%} of the impacts would gain energy, "
            f"read as degrees {gains(TO_RAD):.0%})",
            "give omega in rad/s: multiply by pi/180",
        )
    elif gains(1.0) > 0.5:
        report.warn(
            table.file,
            "columns v*_pre, v*_post, omega_*",
            f"{gains(1.0):.0%} of the impacts gain energy",
            "check units, and that _pre and _post are not exchanged",
        )

    # v_n = v_y + r_x ω < 0: the contact point approaches the surface
    r = body.shape.contact_point(q[:, 2]) if stated is None else stated
    leaving = v_pre[:, 1] + r[:, 0] * v_pre[:, 2] >= 0.0
    if np.mean(leaving) > 0.5:
        report.warn(
            table.file,
            f"columns vy_pre and omega_pre, {table.rows(leaving)}",
            "the contact point does not approach the surface before the impact in most rows (v_n >= 0)",
            "check the signs: y up, theta and omega counter-clockwise, _pre before _post",
        )
