"""Colour of the noise: its factor on the variance of an arc's velocity, compared with white noise of the same size.

The velocity of an arc of n samples is the slope c·q of the line through them.  For stationary noise with covariance R
it has the variance cᵀ R c, and with white noise of variance σ² it would have σ² c·c:

    colour = cᵀ R c / (σ² c·c)

R is estimated from all long flights.  With M, which removes a parabola, and u_k, the k-th vector of the discrete cosine
transform of N samples, the power of the noise near k half-waves per flight is

    P_k = mean of the lower 80 % of (u_k · M q)² over flights / 0.44,        E P_k = u_kᵀ M R M u_k,       k ≥ 3

R = Σ_j w_j R_j with w_j ≥ 0 is noise whose spectrum falls with frequency, a sum of boxes from 0 to the cutoff f_j:

    R_j(l) = 2 f_j sinc(2 f_j l)        at l samples apart, f_j in cycles per sample; f = 1/2 is white noise

and w minimises Σ_k (P_k − E P_k)² / P_k².  The common part of all flights is removed before: air drag bends them alike.
The lower 80 % contain no flight with an undetected hit.  Slow noise makes a flight look bent or displaced, not noisy:
only flights longer than an arc show it.  Below the lowest k the spectrum is assumed to be flat.
"""

import numpy as np
from scipy.fft import idct
from scipy.linalg import toeplitz
from scipy.optimize import nnls

from thesis_lib.datasets.format.samples import Samples, is_uneven

SHORTEST = 12
ENOUGH = 30  # flights
FIRST = 3  # half-waves; a parabola absorbs longer ones
CUTOFFS = 0.5 * 2.0 ** (-0.5 * np.arange(13))  # cycles per sample; waves of 2 to 128 samples
KEPT = 0.8  # share of the flights
_MEAN_OF_KEPT = 0.4377  # chi² with one degree of freedom below its 80th percentile: its mean
_ROUNDS = 4  # of weights 1/E P_k
_LEAST = 0.1  # of the largest power: smaller powers do not affect the slope


def long_flights(samples: Samples, at: np.ndarray, t: np.ndarray, guard: float, longest: int) -> list[np.ndarray]:
    """Poses (m, N, 3) at the ends of flights that end with a hit, for up to two N: few long ones, many shorter ones.

    If time stamps are irregular, a parabola in time is removed from the poses.

    Hits happen at times `t` (n,) in s, ascending by trial, after samples `at` (n,); samples within `guard` (s) of one
    belong to no flight.  N is at most `longest`; at least `ENOUGH` flights have it.
    """
    size = len(samples)
    after = np.zeros(size + 1, int)
    np.add.at(after, at + 1, 1)
    passed = np.cumsum(after[:size])  # hits before each sample, over all trials
    near = np.zeros(size, bool)
    for hit in (passed - 1, passed):
        known = (hit >= 0) & (hit < len(at))
        hit = np.clip(hit, 0, len(at) - 1)
        near |= known & (samples.trial == samples.trial[at[hit]]) & (np.abs(samples.t - t[hit]) < guard)
    begins = np.r_[True, (passed[1:] != passed[:-1]) | (samples.run[1:] != samples.run[:-1]) | (near[1:] != near[:-1])]
    first = np.flatnonzero(begins)
    length = np.diff(np.r_[first, size])
    last = first + length - 1
    ends = passed[last] < len(at)
    ends[ends] = samples.run[at[passed[last[ends]]]] == samples.run[last[ends]]
    usable = ~near[first] & ends & (length >= SHORTEST)
    if usable.sum() < ENOUGH:
        return []
    last, length = last[usable], length[usable]
    ranked = np.minimum(np.sort(length), longest)
    sizes = {int(ranked[-ENOUGH]), int(ranked[len(ranked) // 2])}
    return [_as_if_evenly_spaced(samples, last[length >= N][:, None] + np.arange(1 - N, 1)) for N in sorted(sizes)]


def _as_if_evenly_spaced(samples: Samples, rows: np.ndarray) -> np.ndarray:
    """Poses (m, N, 3) at `rows` (m, N); where the steps differ, their residuals from a parabola in time."""
    q, t = samples.without_air()[rows], samples.t[rows]
    uneven = is_uneven(t)
    if uneven.any():
        tau = t[uneven] - t[uneven].mean(axis=1, keepdims=True)
        basis = np.linalg.qr((tau / np.ptp(tau, axis=1)[:, None])[..., None] ** np.arange(3))[0]
        moved = q[uneven] - q[uneven, :1]
        q[uneven] = moved - basis @ (basis.swapaxes(1, 2) @ moved)
    return q


def slope_variance(flights: list[np.ndarray], n: int) -> np.ndarray:
    """Variance cᵀ R c (3,) of the slope of a line through n samples, in units of a pose² per sampling interval².

    `flights` holds poses (m, N, 3), equally spaced, of m flights of N samples each.
    """
    rows = [_powers(poses) for poses in flights]
    expected = np.concatenate([row[0] for row in rows])
    power = np.concatenate([row[1] for row in rows])
    weight = np.concatenate([np.full(len(row[1]), np.sqrt(len(poses))) for row, poses in zip(rows, flights)])
    # the lowest frequency that is seen
    seen = FIRST / (2.0 * max(poses.shape[1] for poses in flights)) <= CUTOFFS
    c = np.arange(n) - (n - 1) / 2.0
    c /= c @ c
    slope = np.einsum("i,jil,l->j", c, _correlations(n), c)
    return np.array(
        [slope[seen] @ _weights(expected[:, seen], power[:, channel], weight) for channel in range(power.shape[1])]
    )


def _powers(poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Expected powers u_kᵀ M R_j M u_k (k, components) and measured P_k (k, 3) of flights `poses` (m, N, 3)."""
    N = poses.shape[1]
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, N), 3))[0]
    waves = np.asarray(idct(np.eye(N), norm="ortho", axis=0))[:, FIRST:]
    waves = waves - basis @ (basis.T @ waves)  # M u_k
    moved = poses - poses[:, :1]  # keeps digits
    waved = np.einsum("mic,ik->mkc", moved, waves)
    squares = np.sort((waved - np.median(waved, axis=0)) ** 2, axis=0)
    power = squares[: max(1, round(KEPT * len(squares)))].mean(0) / _MEAN_OF_KEPT
    return np.einsum("ik,jil,lk->kj", waves, _correlations(N), waves), power


def _correlations(size: int) -> np.ndarray:
    """Correlation matrices R_j (cutoffs, size, size)."""
    lag = np.arange(size)
    return np.array([toeplitz(2.0 * f * np.sinc(2.0 * f * lag)) for f in CUTOFFS])


def _weights(expected: np.ndarray, power: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """w ≥ 0 (cutoffs,) with `expected` (k, cutoffs) @ w near `power` (k,); `weight` (k,) weights relative errors."""
    scale = np.maximum(power, _LEAST * power.max() + 1e-300)
    w = np.zeros(expected.shape[1])
    for _ in range(_ROUNDS):
        w = nnls(expected * (weight / scale)[:, None], power * weight / scale)[0]
        scale = np.maximum(expected @ w, _LEAST * power.max() + 1e-300)
    return w
