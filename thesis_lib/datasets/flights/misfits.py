"""How well free arcs describe the samples on either side of an impact, for the quality tests.

A free arc is a least-squares line through x, y + g τ²/2 and θ; the two arcs need not meet.  Stray (unmodelled)
acceleration a of prior variance s_a² lowers the residual sum of squares by the part that the prior allows,

    ss = ss_line − (ss_line − ss_free) s_a² / (s_a² + var a),    var a = σ² / Σ b²,

where b is the residual of τ²/2 from a line.
"""

import numpy as np

from thesis_lib.datasets.flights.lines import bow, lines_through, rank


def with_stray(
    line_ss: np.ndarray, curvature: np.ndarray, norm2: np.ndarray, white: np.ndarray, stray: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Residual sums of squares (n, 2, 3) of arcs with stray acceleration of known size, and of any size."""
    gain = np.minimum(curvature**2 * norm2, line_ss)
    return line_ss - _share(norm2, white, stray) * gain, line_ss - gain


def _share(norm2: np.ndarray, white: np.ndarray, stray: np.ndarray) -> np.ndarray:
    """s_a²/(s_a² + var a) with var a = 1/(white Σ b²): the share of a fitted acceleration that the prior keeps."""
    return stray**2 * white * norm2 / (stray**2 * white * norm2 + 1.0)


def misfits(
    side: np.ndarray,
    tau: np.ndarray,
    z: np.ndarray,
    white: np.ndarray,
    weight: np.ndarray,
    metric: np.ndarray,
    gravity: float,
    stray: np.ndarray,
    in_air: bool = False,
) -> dict[str, np.ndarray]:
    """The statistics of `ArcFits` that are computed from free arcs, by name.

    `side` (n, 2, W) is 1 for the samples used before and after, else 0; `tau` (n, W) is the time after the impact in s,
    `z` (n, W, 3) are poses; `white` and `weight` (3,) are 1/σ² of a sample, and of fitted values (noise may be
    correlated); `metric` is (1, 1, k), `gravity` in m/s², `stray` (3,) one sigma of accelerations beyond gravity.
    `in_air`: these are large, and move the two samples next to an impact as well.
    """
    flight = z.copy()
    flight[..., 1] += 0.5 * gravity * tau**2
    free = lines_through(side, tau, flight)
    residual, line_ss, b, curvature, norm2 = bow(side, tau, free)
    ss, ss_free = with_stray(line_ss, curvature, norm2, white, stray)
    straight = residual - curvature[:, :, None] * b
    pairs = (straight[:, :, 1:] * straight[:, :, :-1]).sum((1, 2))
    total = ss_free.sum(1)

    # effect of an acceleration on a line at τ = 0
    parabola = 0.5 * tau[..., None] ** 2
    turn = lines_through(side, tau, parabola)
    # friction with a table bends all arcs: it is removed as far as they show it
    known = _share(norm2, white, stray) * (gravity == 0.0)
    value, slope = free.value - known * curvature * turn.value, free.slope - known * curvature * turn.slope

    # the arcs miss each other by d + Δv t; the best t leaves the part across Δv (2 of 3 dimensions)
    d, dv = value[:, 1] - value[:, 0], slope[:, 1] - slope[:, 0]
    safe = np.maximum(free.count, 1.0)
    leverage = (1.0 / safe + free.mean**2 / np.where(free.spread > 0, free.spread, 1.0)).sum(1)
    variance_d = np.where(leverage > 0, leverage, 1.0)[:, None] / weight + (
        (stray * turn.value) ** 2 * (1.0 - known)
    ).sum(1)
    inverse = 1.0 / variance_d
    shift = -(d * dv * inverse).sum(1) / np.maximum((dv * dv * inverse).sum(1), 1e-300)
    across = d + dv * shift[:, None]
    share = (dv * metric) ** 2 / np.maximum(((dv * metric) ** 2).sum(1), 1e-300)[:, None]
    miss_noise = np.sqrt(((1.0 - share) * metric**2 * variance_d).sum(1))

    # the two samples next to the impact against a line through the others
    close = (side > 0) & (rank(side) <= 2)
    rest = side * ~close
    others = lines_through(rest, tau, flight)
    spread = np.where(others.spread > 0, others.spread, np.inf)
    reach = 1.0 + 1.0 / np.maximum(others.count, 1.0)[..., None]
    reach = reach + (tau[:, None] - others.mean[..., None]) ** 2 / spread[..., None]
    usable = close & (others.count >= 3)[..., None]
    dof = 3.0 * (others.count - 2.0)
    _, rest_ss, _, rest_curvature, rest_norm2 = bow(rest, tau, others)
    chi2_rest = with_stray(rest_ss, rest_curvature, rest_norm2, white, stray)[0] @ white
    off, variance = others.residual, reach[..., None]
    if gravity == 0.0 or in_air:
        known = _share(rest_norm2, white, stray) * (gravity == 0.0)
        bend = lines_through(rest, tau, parabola).residual
        off = off - (known * rest_curvature)[:, :, None] * bend
        variance = variance + (stray**2 * white * (1.0 - known))[:, :, None] * bend**2
    near2 = ((off * metric) ** 2).sum(-1) * usable
    chi2_near = (off**2 * white / variance).sum(-1) * usable
    supported = lines_through(side, tau, z[..., 1:2])
    chi2_supported = ((supported.residual[..., 0] * side) ** 2).sum(2) * white[1]
    return {
        "chi2_rest": np.where(dof > 0, chi2_rest / np.maximum(dof, 1.0), np.nan),
        "fall": chi2_supported - line_ss[..., 1] * white[1],
        "n_side": side.sum(2).astype(int),
        "ss": ss,
        "ss_free": ss_free,
        "curvature": curvature,
        "bow2": norm2[..., 0],
        "chi2": (ss * white).sum(2),
        "chi2_meet": (across**2 * inverse).sum(1),
        "miss": np.linalg.norm(across * metric, axis=-1),
        "miss_noise": miss_noise,
        "chi2_near": chi2_near.max((1, 2), initial=0.0),
        "near": np.sqrt(near2.max((1, 2), initial=0.0)),
        "lag1": pairs / np.where(total > 0, total, 1.0),
    }
