"""Parabolas through all samples of the flights between impacts.

    q(τ) = q_0 + v τ + a τ²/2,    τ = t − mean of t in the flight,    Σ_k B_k B_kᵀ (q_0, v, a)ᵀ = Σ_k B_k q(t_k)

with B = (1, τ, τ²/2).  The variance of a is σ² times the last diagonal element of (Σ_k B_k B_kᵀ)⁻¹, with σ² (3,) the
noise of a sample in m² or rad², correlation included.

A flight that is not a parabola contains an undetected hit, or is bent by something other than gravity.  Its
acceleration is meaningless; many such flights are evidence against a body that only falls (`bent_sentence`).
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.samples import Samples, position

LATER = 1e-9  # s; an instant this much after a hit counts as after it
GUARD = 1e-3  # s; samples this near to an impact may lie in the contact
MIN_FLIGHT = 12  # samples: noise dominates the acceleration of a shorter flight
MAX_CHI2 = 2.5  # reduced; a flight above it is not a parabola
MOST = 0.5  # share of the flights that are parabolas unless something bends them all
FEW, SOME = 0.05, 3  # share and number of non-parabolic flights that are not reported: undetected hits


def later(t: np.ndarray) -> np.ndarray:
    """Instants (n,) in s that count as after t: by a nanosecond, or by the last digit of a coarser clock."""
    return t + np.maximum(LATER, np.spacing(np.abs(t)))


@dataclass(frozen=True)
class Hits:
    """All detected hits, sorted by trial and time: trial, t in s, used (h,)."""

    trial: np.ndarray
    t: np.ndarray
    used: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    def before(self, trial: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Number of hits before each instant, over all trials in order."""
        return position(self.trial, self.t, trial, t)

    def instants(self, number: np.ndarray, trial: np.ndarray, otherwise: float) -> np.ndarray:
        """Times in s of the hits of these numbers; `otherwise` if the trial has no such hit."""
        times = np.full(len(number), otherwise)
        rows = np.flatnonzero((number >= 0) & (number < len(self)))
        rows = rows[self.trial[number[rows]] == trial[rows]]
        times[rows] = self.t[number[rows]]
        return times

    def edges(self, trial: np.ndarray, t: np.ndarray, guard: float = GUARD) -> np.ndarray:
        """Edges (n, 4) in s of the flights before and after single hits at (trial, t): neighbouring hits end a flight.

        Samples within `guard` (s) of a hit belong to no flight.
        """
        after = self.before(trial, later(t))  # number of the first hit after the impact
        earliest, latest = self.instants(after - 2, trial, -np.inf), self.instants(after, trial, np.inf)
        return np.stack([earliest + guard, t - guard, t + guard, latest - guard], axis=1)


@dataclass(frozen=True)
class Parabolas:
    """m flights that are parabolas, and the trials of flights that are not.

    Attributes:
        trial, t, span: (m,) trial, mid-flight, and s from the first sample to the last.
        fitted: (m, 3, 3) q_0, v, a by channel at mid-flight, in m, m/s, m/s² and rad, rad/s, rad/s².
        variance: (m, 3) of the acceleration.
        bent: (b,) trials of the flights that are not parabolas.
    """

    trial: np.ndarray
    t: np.ndarray
    span: np.ndarray
    fitted: np.ndarray
    variance: np.ndarray
    bent: np.ndarray


NO_PARABOLAS = Parabolas(*(np.zeros((0,) + shape) for shape in ((), (), (), (3, 3), (3,), ())))


def hits_of(arcs: pd.DataFrame) -> Hits:
    """The hits in a table with columns trial, t and used."""
    table = arcs.sort_values(["trial", "t"])
    return Hits(table["trial"].to_numpy(), table["t"].to_numpy(), table["used"].to_numpy(bool))


def parabolas(
    samples: Samples, hits: Hits, variance: np.ndarray, guard: float = GUARD, air: Air | None = None
) -> Parabolas:
    """Parabolas of the flights with at least `MIN_FLIGHT` samples, whose noise has `variance` (3,) in m², rad².

    Where the `air` bends most of them, its effect is removed before a flight is tested for a parabola.

    A flight must end at a hit that is used: after the last hit of a trial the body may rest, and a poorly known instant
    mixes samples of two flights.  Samples within `guard` (s) of a hit belong to no flight.
    """
    next_hit = hits.before(samples.trial, samples.t)
    near = np.zeros(len(samples), bool)
    for hit in (next_hit - 1, next_hit):
        near |= np.abs(hits.instants(hit, samples.trial, np.inf) - samples.t) < guard
    samples, next_hit = samples.select(~near), next_hit[~near]
    trial, t, q = samples.trial, samples.t, samples.q

    # samples are sorted: a flight begins at a new trial or after a hit
    begins = np.r_[True, (trial[1:] != trial[:-1]) | (next_hit[1:] != next_hit[:-1])][: len(t)]
    first, flight = np.flatnonzero(begins), np.cumsum(begins) - 1
    count, end = np.bincount(flight), next_hit[first]
    ended = end < len(hits)
    ended[ended] = (hits.trial[end[ended]] == trial[first[ended]]) & hits.used[end[ended]]
    rows = np.flatnonzero((count >= MIN_FLIGHT) & ended)

    def totals(values: np.ndarray) -> np.ndarray:
        return np.bincount(flight, values, minlength=len(count))

    middle = totals(t) / count
    tau = t - middle[flight]
    B = np.stack([np.ones(len(t)), tau, 0.5 * tau**2], axis=1)
    powers = [totals(tau**k)[rows] for k in range(5)]
    half = np.array([1.0, 1.0, 0.5])
    normal = np.array([[half[i] * half[j] * powers[i + j] for j in range(3)] for i in range(3)])
    inverse = np.linalg.inv(np.moveaxis(normal, -1, 0))

    def through(path: np.ndarray) -> np.ndarray:  # (flights, [q_0, v, a], channel)
        right = np.array([[totals(B[:, k] * path[:, c])[rows] for c in range(3)] for k in range(3)])
        return inverse @ np.moveaxis(right, -1, 0)

    number = np.full(len(count), -1)
    number[rows] = np.arange(len(rows))
    inside = number[flight] >= 0
    i = number[flight[inside]]

    def are_straight(path: np.ndarray, fitted: np.ndarray) -> np.ndarray:
        residual = path[inside] - np.einsum("nk,nkc->nc", B[inside], fitted[i])
        squares = np.stack([np.bincount(i, residual[:, c] ** 2, len(rows)) for c in range(3)], axis=1) / variance
        return squares.sum(axis=1) / (3.0 * (count[rows] - 3.0)) < MAX_CHI2

    fitted = through(q)
    straight = are_straight(q, fitted)
    if air is not None and len(rows) and straight.mean() < MOST:
        free = replace(samples, air=air).without_air()
        straight = are_straight(free, through(free))
    bent, rows, fitted, inverse = rows[~straight], rows[straight], fitted[straight], inverse[straight]
    span = t[first[rows] + count[rows] - 1] - t[first[rows]]
    unit = inverse[:, 2, 2][:, None]
    return Parabolas(trial[first[rows]], middle[rows], span, fitted, unit * variance, trial[first[bent]])


def bent_sentence(bent: int, all_of_them: int) -> str:
    """Sentence on the flights that are not parabolas, if there are more than a few; else ""."""
    if bent < SOME or bent <= FEW * all_of_them:
        return ""
    return (
        f"{bent} of {all_of_them} flights are not parabolas and are left out: either they contain undetected "
        "hits, or something other than gravity bends them. All results on flights refer to the others."
    )
