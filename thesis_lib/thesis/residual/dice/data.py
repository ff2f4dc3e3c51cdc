"""States from recorded throws of a die: before the first contact, around contacts between flights, and at rest.

Between contacts a pose is a parabola in time.  Its acceleration is nearly known and enters as a measurement:

    q_j = q + v t_j + a t_j²/2 + noise,    a = −(0, g, 0) − c v ± stray          weighted least squares, each coordinate

    noise: white of one sigma σ √((1 + ρ)/(1 − ρ)), σ and the lag-one correlation ρ pooled over all first flights

A contact extends from the last sample of one flight to an early sample of the next.  Hits with fewer than `fewest`
samples between them are one contact: the camera cannot resolve them, and no assumption about them is needed.

A throw is at rest if it moves by less than `still` over its last samples.  Throws without a pose at rest, or without a
usable first flight, are left out and counted.
"""

from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Self

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.residual.dice.settings import DiceDataSettings

ROBUST = 4.0  # standard deviations beyond which a sample counts as an outlier
MAD_TO_STD = 1.4826  # four digits, unlike statistics.spread: dice are chaotic, more would change the stored throws
FINEST = 1e-9  # m, rad; simulated poses may have no noise


@dataclass(frozen=True)
class ByTrial:
    """Arrays with a row for each of n measurements; `trial` (n,) is the number of its throw."""

    trial: np.ndarray

    def __len__(self) -> int:
        return len(self.trial)

    def select(self, rows: np.ndarray) -> Self:
        """Return the measurements at `rows` (mask or indices)."""
        names = [item.name for item in fields(self) if item.name not in ("left_out", "sigma")]
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


@dataclass(frozen=True)
class ThrowReleases(ByTrial):
    """Throws with a usable first flight and a pose at rest."""

    q: np.ndarray  # q, v: (n, 3) at the last sample of the flight, m, rad and m/s, rad/s
    v: np.ndarray
    cov: np.ndarray  # (n, 6, 6) of (q, v)
    end: np.ndarray  # (n, 3) pose at rest
    left_out: dict[str, int]  # number of throws left out, by reason
    sigma: np.ndarray  # (3,) noise of x, y (m) and θ (rad), correlation included


@dataclass(frozen=True)
class MeasuredContacts(ByTrial):
    """Measured contacts: states before and after (n, 3), `span` apart; `first` marks the first contact of a throw."""

    first: np.ndarray
    q: np.ndarray
    v: np.ndarray
    q_after: np.ndarray
    v_after: np.ndarray
    span: np.ndarray  # s
    last_hit: np.ndarray  # s from the state before to the last hit that was detected before the next flight


@dataclass(frozen=True)
class LongFlights(ByTrial):
    """Long flights: changes of pose and velocity (n, 3) between an early and the last sample."""

    dq: np.ndarray
    dv: np.ndarray


def flight_drag(flights: LongFlights) -> tuple[float, float]:
    """Fit linear drag (c_v, c_w) in 1/s of translation along x and of spin, at least 0.

    Linear drag gives Δv_x = −c_v Δx and Δω = −c_w Δθ exactly, for any length of flight.  The fit is the line through
    the origin of least absolute deviation: the median of −Δv/Δq weighted by |Δq|.
    """
    drags = []
    for i in (0, 2):
        dq, dv = flights.dq[:, i], flights.dv[:, i]
        used = np.flatnonzero(dq)
        weighted = {"weights": np.abs(dq[used]), "method": "inverted_cdf"}
        drags.append(max(0.0, float(np.quantile(-dv[used] / dq[used], 0.5, **weighted))) if len(used) else 0.0)
    return drags[0], drags[1]


def read_throws(
    dataset: Dataset, hits: pd.DataFrame, settings: DiceDataSettings
) -> tuple[ThrowReleases, MeasuredContacts, LongFlights]:
    """Read states, contacts and long flights of all throws of a dataset with trajectories.

    `hits` has columns trial, t (s) for all detected hits, measurable or not, as in arcs.csv.  Raises UserError if there
    are no trajectories or no throw is usable.
    """
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has no trajectories, so throws cannot be followed to rest.")
    when = {trial: np.sort(rows["t"].to_numpy(float)) for trial, rows in hits.groupby("trial")}
    throws = []
    for trial, rows in dataset.trajectories.groupby("trial"):
        t, pose = rows["t"].to_numpy(float), rows[["x", "y", "theta"]].to_numpy(float)
        throws.append((trial, t, pose, _flights(t, when.get(trial, np.array([])), settings)))
    sigma = _noise(throws, settings)
    releases, contacts, long = [], [], []
    left_out = {"no_first_flight": 0, "not_at_rest": 0}
    for trial, t, pose, flights in throws:
        fits = []
        for begin, end, inside in flights:
            start, stop = inside[: settings.most], inside[-settings.most :]
            early = t[start[min(3, len(start) - 1)]]
            last, cov = _fit(t[stop], pose[stop], t[inside[-1]], sigma, dataset.gravity, settings)
            head, _ = _fit(t[start], pose[start], early, sigma, dataset.gravity, settings)
            fits.append((begin, end, early, head, t[inside[-1]], last, cov))
            if len(inside) >= settings.long_flight:
                long.append((trial, *(last - head).T))
        for (begin, end, _, _, t_0, before, _), (begin_next, _, t_1, after, *_) in pairwise(fits):
            if begin_next - end <= settings.longest_contact:
                contacts.append((trial, begin == -np.inf, *before.T, *after.T, t_1 - t_0, begin_next - t_0))
        tail = pose[-settings.last :]
        moved = np.ptp(tail * [1.0, 1.0, dataset.k_g], axis=0).max()
        if not fits or fits[0][0] != -np.inf:
            left_out["no_first_flight"] += 1
        elif moved > settings.still:
            left_out["not_at_rest"] += 1
        else:
            state, cov = fits[0][5:]
            releases.append((trial, *state.T, cov, tail.mean(axis=0)))
    if not releases or not contacts:
        raise UserError(f"{dataset.name} has no throw with a first flight that comes to rest: nothing to study.")
    starts, met, flown = (map(np.array, zip(*rows)) for rows in (releases, contacts, long))
    flights = LongFlights(*flown) if long else LongFlights(np.zeros(0, int), np.zeros((0, 3)), np.zeros((0, 3)))
    return ThrowReleases(*starts, left_out=left_out, sigma=sigma), MeasuredContacts(*met), flights


def _flights(t: np.ndarray, hits: np.ndarray, settings: DiceDataSettings) -> list[tuple[float, float, np.ndarray]]:
    """Begin, end (s; ±∞ without a hit) and samples of each sufficiently long stretch between hits."""
    stretches = []
    for begin, end in zip(np.r_[-np.inf, hits], np.r_[hits, np.inf]):
        inside = np.flatnonzero((t > begin + settings.guard) & (t < end - settings.guard))
        if len(inside) >= settings.fewest:
            stretches.append((begin, end, inside))
    return stretches


def _noise(throws: list, settings: DiceDataSettings) -> np.ndarray:
    """Estimate the noise σ √((1 + ρ)/(1 − ρ)) (3,) of x, y, θ from parabolas through the first flights."""
    residuals, freedom = [], 0
    for _, t, pose, flights in throws:
        if flights and flights[0][0] == -np.inf:
            rows = flights[0][2][-settings.most :]
            powers = np.vander(t[rows] - t[rows].mean(), 3)
            residuals.append(pose[rows] - powers @ np.linalg.lstsq(powers, pose[rows], rcond=None)[0])
            freedom += len(rows) - 3
    if not residuals or freedom < 1:
        raise UserError("No throw begins with a flight before its first hit.")
    # clipped, so that a lost frame does not raise the noise of all throws
    limit = ROBUST * MAD_TO_STD * np.median(np.abs(np.concatenate(residuals)), axis=0)
    residuals = [np.clip(residual, -limit, limit) for residual in residuals]
    square = sum((residual**2).sum(0) for residual in residuals)
    rho = sum((residual[1:] * residual[:-1]).sum(0) for residual in residuals) / np.maximum(square, 1e-300)
    rho = np.clip(rho, 0.0, 0.9)
    return np.maximum(np.sqrt(square / freedom * (1.0 + rho) / (1.0 - rho)), FINEST)


def _fit(
    t: np.ndarray, pose: np.ndarray, at: float, sigma: np.ndarray, gravity: float, settings: DiceDataSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Fit the state [q_i, v_i] (3, 2) at time `at` in s, with covariance (6, 6) of (q, v)."""
    tau = t - at
    powers = np.column_stack([np.ones_like(tau), tau, 0.5 * tau**2])
    state, cov = np.empty((3, 2)), np.zeros((6, 6))
    for i, (noise, stray, pull) in enumerate(zip(sigma, settings.stray, (0.0, gravity, 0.0))):
        # acceleration as a measurement: a + c v = −pull ± stray
        rows = np.vstack([powers / noise, [0.0, settings.drag / stray, 1.0 / stray]])
        right = np.append(pose[:, i] / noise, -pull / stray)
        inverse = np.linalg.inv(rows.T @ rows)
        state[i] = (inverse @ (rows.T @ right))[:2]
        cov[np.ix_([i, 3 + i], [i, 3 + i])] = inverse[:2, :2]
    return state, cov
