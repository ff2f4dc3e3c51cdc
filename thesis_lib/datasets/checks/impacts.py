"""Are the units and signs of impacts.csv consistent?  (`trajectories` checks the same for poses.)

Most impacts lose energy; with ω in degrees per second they seem to gain some.  θ in degrees is recognised by contact
points that fit the shape only if θ is converted from degrees or, without contact points, by gaps to the surface.
Source: energy balance of the planar body (thesis section 3.3.1); the limits are our choice.
"""

import numpy as np

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.checks.known_body import (
    ALREADY_RADIANS,
    LARGEST_HEIGHT,
    LARGEST_SPEED,
    METRES,
    RADIANS,
    TO_RAD,
    UPWARDS,
    KnownBody,
    contradictions,
    radians_as_degrees,
)
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.datasets.format.validate import UsableRows

FITS_BETTER = 5.0  # degrees must explain contact points this many times better than radians
EXCHANGED = 0.9  # share of impacts that seem reversed in time; the rest is noise of weak impacts
MISFIT = 0.05  # extents; smaller misfits of contact points are tracker errors


def check_impacts(table: UsableRows, body: KnownBody) -> None:
    """Report wrong directions and units of impacts."""
    data = table.data
    q, v_pre, v_post = (data[list(names)].to_numpy(float) for names in (POSE, V_PRE, V_POST))
    if what := body.sunk(q[:, 1]):
        remedy = UPWARDS + ", or correct surface.height in dataset.yaml"
        table.error("column y", what, remedy, q[:, 1] < body.height)
    speeds = {name: float(np.median(np.abs(data[name].to_numpy(float)))) for name in (*V_PRE[:2], *V_POST[:2])}
    if fast := {name: value for name, value in speeds.items() if value > LARGEST_SPEED}:
        name, value = next(iter(fast.items()))
        where, what = f"column{'s' if len(fast) > 1 else ''} {', '.join(fast)}", "looks like mm/s or cm/s"
        remedy = "give velocities in m/s: divide by 1000 if they are in mm/s"
        table.error(where, f"{what} (median of {name}: {value:.4g})", remedy)
    shape = body.shape
    if shape is None or body.oversized:  # contact points and inertia mean nothing if the shape is oversized
        return
    high = float(np.quantile(np.abs(q[:, 1] - body.height), 0.1)) / shape.extent
    if high > LARGEST_HEIGHT:
        what = f"y {q[:, 1].min():.4g} to {q[:, 1].max():.4g}: {high:.0f} times the body's size"
        table.error("columns x, y", f"looks like millimetres ({what})", METRES)
    if _contradicts_shape(table, q, shape, body.height):
        return  # angles and inertia are judged by the shape
    if not fast and high <= LARGEST_HEIGHT:
        _check_angles_and_energy(table, q, v_pre, v_post, body)


def _contradicts_shape(table: UsableRows, q: np.ndarray, shape: Shape, height: float) -> bool:
    """Whether contact points, or poses without them, contradict the shape or the height of the surface."""
    if "r_x" in table.data and "r_y" in table.data:
        r_y = table.data["r_y"].to_numpy(float)
        if np.median(np.abs(r_y)) > LARGEST_HEIGHT * shape.extent:
            return False  # millimetres, which is reported below
        q = np.column_stack([q[:, 0], height - r_y, q[:, 2]])
    elif np.quantile(np.abs(q[:, 1] - height), 0.1) > LARGEST_HEIGHT * shape.extent:
        return False
    if what := radians_as_degrees(shape, q):
        table.error("column theta", what, ALREADY_RADIANS)
        return True
    wrong = contradictions(shape, height, q)
    # if the poses fit when read as degrees, the unit of the angle is wrong and not the shape
    if wrong and contradictions(shape, height, q * [1.0, 1.0, TO_RAD]):
        table.report.errors.extend(wrong)
        return True
    return False


def _check_angles_and_energy(
    table: UsableRows, q: np.ndarray, v_pre: np.ndarray, v_post: np.ndarray, body: KnownBody
) -> None:
    """Check angles by the contact points, and spin and direction of time by the energy; states are (n, 3)."""
    data, shape, k_g = table.data, body.shape, body.k_g
    assert shape is not None and k_g is not None
    stated = data[["r_x", "r_y"]].to_numpy(float) if {"r_x", "r_y"} <= set(data.columns) else None
    if stated is not None and np.median(np.linalg.norm(stated, axis=1)) > LARGEST_HEIGHT * shape.extent:
        table.error("columns r_x, r_y", "look like millimetres (far outside the body)", METRES)
        return

    def misfit(theta: np.ndarray) -> float:
        r = shape.contact_point(theta)
        error = q[:, 1] + r[:, 1] - body.height if stated is None else np.linalg.norm(stated - r, axis=1)
        return float(np.median(np.abs(error))) / shape.extent

    as_given, as_degrees = misfit(q[:, 2]), misfit(q[:, 2] * TO_RAD)
    if as_given > max(MISFIT, FITS_BETTER * as_degrees) and float(np.ptp(q[:, 2])) > 2.0 * np.pi:
        better = f"the contact points fit the shape {as_given / max(as_degrees, 1e-9):.0f} times better"
        what = f"looks like degrees ({q[:, 2].min():.4g} to {q[:, 2].max():.4g}; read as degrees, {better})"
        table.error("column theta", what, RADIANS)

    r = shape.contact_point(q[:, 2]) if stated is None else stated

    def v_n(v: np.ndarray) -> np.ndarray:  # < 0: the contact point approaches the surface
        return v[:, 1] + r[:, 0] * v[:, 2]

    # E = ½(v_x² + v_y² + k²ω²) drops in an impact
    def gains(factor: float) -> float:
        scale = np.array([1.0, 1.0, factor * k_g])
        return float(np.mean(np.sum((v_post * scale) ** 2, axis=1) > np.sum((v_pre * scale) ** 2, axis=1)))

    gain, leaving = gains(1.0), v_n(v_pre) > 0.0
    if gain > 0.5 > 2.0 * gains(TO_RAD):
        what = f"{gain:.0%} of the impacts would gain energy, read as degrees {gains(TO_RAD):.0%}"
        remedy = "give omega in rad/s: multiply by pi/180"
        table.error("columns omega_pre, omega_post", f"look like degrees per second ({what})", remedy)
    elif gain > EXCHANGED and leaving.mean() > EXCHANGED and (v_n(v_post) < 0.0).mean() > EXCHANGED:
        what = f"_pre and _post are exchanged: {gain:.0%} of the impacts gain energy, and the contact point moves "
        what += "away from the surface before them and towards it after"
        table.error("columns *_pre and *_post", what, "exchange the columns vx, vy, omega of _pre and _post", leaving)
        return
    elif gain > 0.5:
        remedy = "check units, and that _pre and _post are not exchanged"
        table.warn("columns v*_pre, v*_post, omega_*", f"{gain:.0%} of the impacts gain energy", remedy)

    away = v_n(v_pre) >= 0.0
    if np.mean(away) > 0.5:
        what = "the contact point does not approach the surface before the impact in most rows (v_n >= 0)"
        remedy = "check the signs: y up, theta and omega counter-clockwise, _pre before _post"
        table.warn("columns vy_pre and omega_pre", what, remedy, away)
