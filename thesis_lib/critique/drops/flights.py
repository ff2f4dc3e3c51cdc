"""Accelerations of the flights between impacts, from parabolas through all samples of each.

    q(τ) = q_0 + v τ + a τ²/2,    τ = t − mean of t in the flight,    Σ_k B_k B_kᵀ (q_0, v, a)ᵀ = Σ_k B_k q(t_k)

with B = (1, τ, τ²/2).  The variance of a is σ² times the last diagonal element of (Σ_k B_k B_kᵀ)⁻¹, with σ² (3,) the
noise of a sample in m² or rad², correlation included.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.drops.lines import GUARD, Hits
from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.effects.effect import State

MIN_FLIGHT = 12  # samples: noise dominates the acceleration of a shorter flight
MAX_CHI2 = 2.5  # reduced; a flight above it is no parabola: it holds an undetected hit
MOST = 0.5  # share of the flights that are parabolas unless something bends them all


@dataclass(frozen=True)
class Flights:
    """m flights: state at mid-flight, acceleration (m, 3) in m/s², rad/s² with variance (m, 3), span (m,) in s."""

    state: State
    acceleration: np.ndarray
    variance: np.ndarray
    span: np.ndarray

    def __len__(self) -> int:
        return len(self.acceleration)

    def select(self, rows: np.ndarray) -> "Flights":
        """The flights at `rows`."""
        return Flights(self.state.select(rows), self.acceleration[rows], self.variance[rows], self.span[rows])


NO_FLIGHTS = Flights(State(*(np.zeros(0),) * 8), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


def measured_flights(
    samples: Samples, hits: Hits, variance: np.ndarray, guard: float = GUARD, air: Air | None = None
) -> Flights:
    """Accelerations of the flights with at least `MIN_FLIGHT` samples, whose noise has `variance` (3,) in m², rad².

    Where the `air` bends most of them, what it has made of a flight is taken off before it is tested for a parabola.

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
    right = np.array([[totals(B[:, k] * q[:, c])[rows] for c in range(3)] for k in range(3)])
    inverse = np.linalg.inv(np.moveaxis(normal, -1, 0))
    fitted = inverse @ np.moveaxis(right, -1, 0)  # (flights, [q_0, v, a], channel)

    # a path that is no parabola holds an undetected hit
    number = np.full(len(count), -1)
    number[rows] = np.arange(len(rows))
    inside = number[flight] >= 0
    i = number[flight[inside]]

    def are_straight(path: np.ndarray, parabolas: np.ndarray) -> np.ndarray:
        residual = path[inside] - np.einsum("nk,nkc->nc", B[inside], parabolas[i])
        squares = np.stack([np.bincount(i, residual[:, c] ** 2, len(rows)) for c in range(3)], axis=1) / variance
        return squares.sum(axis=1) / (3.0 * (count[rows] - 3.0)) < MAX_CHI2

    straight = are_straight(q, fitted)
    if air is not None and len(rows) and straight.mean() < MOST:
        free = replace(samples, air=air).without_air()
        right = np.array([[totals(B[:, k] * free[:, c])[rows] for c in range(3)] for k in range(3)])
        straight = are_straight(free, inverse @ np.moveaxis(right, -1, 0))
    rows, fitted, inverse = rows[straight], fitted[straight], inverse[straight]
    state = State.of(fitted[:, 0], fitted[:, 1], trial[first[rows]], middle[rows])
    span = t[first[rows] + count[rows] - 1] - t[first[rows]]
    return Flights(state, fitted[:, 2], inverse[:, 2, 2][:, None] * variance, span)
