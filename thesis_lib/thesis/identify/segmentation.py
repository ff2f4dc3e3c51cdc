"""Segmentation of a drop's noisy states into flights: noise from differences, impact steps by dynamic programming.

A time stepper with step h moves a free body by v_{k+1} = v_k + h g + Δv_k, q_{k+1} = q_k + h v_{k+1}, Δv_k ≠ 0 only
at an impact.  Without gravity, ỹ_k = y_k + g h² k (k+1) / 2 and ṽ_y,k = v_y,k + g h k, a flight has two numbers for
each of x, y, θ:

    q̃_k = q_a + (k - a) h v_a,    ṽ_k = v_a.

Noise (robust against the few impacts): median |difference| / 0.6745, of first differences of ṽ over √2 and of second
differences of q̃ over √6.  Segmentation: with C(a, b) the χ² of the best flight through samples a..b-1 (running sums,
O(1) each), F(b) = min_a F(a) + C(a, b) + penalty is the exact minimum over all numbers and instants of impacts.  Step k
is an impact if a flight ends with sample k: the velocity changes from v_k to v_{k+1}.

Sources: thesis section 2.4 (drops, eq. 2.23); R. Bellman, Communications of the ACM 4 (1961) 284,
doi 10.1145/366573.366611 (curve fitting by segments); F. R. Hampel, Journal of the American Statistical
Association 69 (1974) 383, doi 10.1080/01621459.1974.10482962 (median deviation).
"""

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.spread import robust_std

MIN_SAMPLES = 8  # of a drop; fewer do not give enough second differences to estimate the noise
SIGMA_FLOOR = 1e-6  # share of a channel's spread, assumed as noise of exact data to keep χ² finite
PENALTY = 60.0  # χ² that a further flight must save: 6 numbers and an instant, log(1500) each, with a margin


def without_gravity(h: float, q: np.ndarray, v: np.ndarray, gravity: float) -> tuple[np.ndarray, np.ndarray]:
    """States (m+1, 3) with gravity removed, which are straight lines in every flight."""
    k = np.arange(len(q))
    q, v = q.astype(float).copy(), v.astype(float).copy()
    q[:, 1] += gravity * h**2 * k * (k + 1) / 2.0
    v[:, 1] += gravity * h * k
    return q, v


def check_states(h: float, q: np.ndarray, v: np.ndarray) -> None:
    """Check that states can be those of a drop.

    Raises:
        UserError: shapes are wrong, samples are too few, values are NaN or infinite, or the step is not positive.
    """
    q, v = np.asarray(q), np.asarray(v)
    if q.ndim != 2 or q.shape[1:] != (3,) or q.shape != v.shape:
        raise UserError(f"States of a drop are q and v of shape (samples, 3); got {q.shape} and {v.shape}.")
    if len(q) < MIN_SAMPLES:
        raise UserError(f"A drop needs at least {MIN_SAMPLES} samples; got {len(q)}.")
    bad = ~(np.isfinite(q) & np.isfinite(v)).all(axis=1)
    if bad.any():
        raise UserError(
            f"The drop's states contain NaN or infinity, first at sample {int(np.argmax(bad))}; end the drop there."
        )
    if not 0 < h < np.inf:
        raise UserError(f"The time step must be positive, in s; got {h}.")


def noise_from_differences(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Noise σ (2, 3) of q (row 0, m and rad) and v (row 1, per s) from states without gravity, (m+1, 3) each."""
    second = q[2:] - 2.0 * q[1:-1] + q[:-2]
    sigma = np.stack([robust_std(second) / np.sqrt(6.0), robust_std(np.diff(v, axis=0)) / np.sqrt(2.0)])
    return floored(sigma, q, v)


def floored(sigma: np.ndarray, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Raise `sigma` (2, 3) to at least `SIGMA_FLOOR` of the spread of its channel (1 if the channel is constant)."""
    spread = np.stack([np.std(q, axis=0), np.std(v, axis=0)])
    return np.maximum(sigma, SIGMA_FLOOR * np.where(spread > 0, spread, 1.0))


def flight_costs(h: float, q: np.ndarray, v: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Costs χ² (m+1, m+2) of the best flight through samples a..b-1; infinite where b <= a.

    `q`, `v` (m+1, 3) are states without gravity, `sigma` (2, 3) their noise, `h` the time step in s.
    """
    n = len(q)
    # a straight line per channel is removed, so that running sums lose few digits
    k = np.arange(n)[:, None] * h
    v_mean = v.mean(axis=0)
    q, v = (q - q.mean(axis=0) - k * v_mean) / sigma[0], (v - v_mean) / sigma[1]
    slope = k / sigma[0]  # column of a flight's velocity in the rows of q
    drift = np.broadcast_to(1.0 / sigma[1], (n, 3))  # the same column in the rows of v
    ones = np.broadcast_to(1.0 / sigma[0], (n, 3))
    products = np.stack(
        [ones * ones, ones * slope, slope * slope + drift * drift, ones * q, slope * q + drift * v, q * q + v * v]
    )
    sums = np.concatenate([np.zeros((6, 1, 3)), np.cumsum(products, axis=1)], axis=1)
    a11, a12, a22, b1, b2, c = sums[:, None, :, :] - sums[:, :-1, None, :]  # each (n, n+1, 3): [a, b]
    with np.errstate(divide="ignore", invalid="ignore"):
        det = a11 * a22 - a12**2
        explained = (b1**2 * a22 - 2.0 * b1 * b2 * a12 + b2**2 * a11) / det
    cost = np.maximum(c - explained, 0.0).sum(axis=2)
    cost[np.arange(n)[:, None] >= np.arange(n + 1)[None, :]] = np.inf
    return cost


def impact_steps(h: float, q: np.ndarray, v: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Impact steps k (n_impacts,), ascending: the velocity changes from v_k to v_{k+1}; arguments as `flight_costs`.

    Positions of successive flights need not agree there; `mass_ratio.estimate` enforces this and shifts the steps.
    """
    cost = flight_costs(h, q, v, sigma)
    n = len(q)
    best, previous = np.zeros(n + 1), np.zeros(n + 1, dtype=int)
    for b in range(1, n + 1):
        total = best[:b] + cost[:b, b]
        previous[b] = np.argmin(total)
        best[b] = total[previous[b]] + PENALTY
    steps, b = [], n
    while (b := previous[b]) > 0:
        steps.append(b - 1)
    return np.array(steps[::-1], dtype=int)
