"""Poses of all trials as flat arrays, and the settings of the search for impacts in them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.header import Header
from thesis_lib.foundation.settings import Section
from thesis_lib.statistics.spread import MAD_TO_STD

_UNEVEN = 1e-3  # relative spread of steps beyond which a body in motion shows in differences of equal steps


class ArcSettings(Section):
    """Detection of impacts, arc fits and quality tests.  The numbers are own choices; the thesis gives none."""

    max_window: int = Field(25, description="samples used at most on either side of an impact")
    min_window: int = Field(5, ge=3, description="samples needed on either side; two nearer hits are `second_hit`")
    guard: float = Field(1e-3, ge=0, description="s; nearer samples may lie in the contact (about 1 ms): not used")
    double_hit: float = Field(
        5e-3, ge=0, description="s between corners that hit as one: a sample and a contact of 1 ms"
    )
    touch_sigma: float = Field(1e-3, gt=0, description="m; one sigma of 'gap = 0 at impact': dice hover or dip by 1 mm")
    contact_spread: float | None = Field(
        None, ge=0, description="s; one sigma of the arcs' miss over |Δv|; null: estimated"
    )
    stray_acceleration: bool = Field(True, description="allow for accelerations beyond gravity as found in the arcs")
    threshold: float = Field(6.0, gt=0, description="sigmas (root of chi² with 3 dof) of a velocity jump that is a hit")
    min_jump: float = Field(0.1, ge=0, description="m/s in the kinetic metric; slower events are rocking and rolling")
    scales: tuple[Annotated[int, Field(ge=2)], ...] = Field(
        (2, 3, 5, 8), min_length=1, description="samples on either side of the detector's line fits, fine to coarse"
    )
    outlier_sigma: float = Field(7.0, gt=0, description="sigmas by which a single sample stands out as a glitch")
    lost_frame: float = Field(8.0, gt=1, description="a step in t above this many sampling intervals ends a flight")
    not_ballistic: float = Field(9.0, gt=1, description="reduced chi² of an arc above which the impact is left out")
    arc_deviation: float = Field(2.0, gt=1, description="reduced chi² of an arc that is flagged if significant")
    meet_sigma: float = Field(6.0, gt=0, description="sigmas of a miss of the arcs, beyond meet_time: several hits")
    meet_time: float = Field(1e-3, gt=0, description="s; times |Δv|: a smaller miss is one hit, see meet_sigma")
    mu_max: float = Field(0.35, gt=0, description="cone test |c_t| ≤ mu_max c_n, as in the authors' code")
    touch_limit: float = Field(2e-3, gt=0, description="m; a gap above this and 5 sigma is flagged `no_touch`")
    noise_ratio: float = Field(1.5, gt=1, description="factor between stated and found noise that calls for a warning")

    @model_validator(mode="after")
    def _windows_fit(self) -> "ArcSettings":
        if self.min_window > self.max_window:
            raise ValueError(f"min_window ({self.min_window}) exceeds max_window ({self.max_window})")
        return self


@dataclass(frozen=True)
class Samples:
    """Poses q (N, 3) in m, m, rad at times t (N,) in s, sorted by trial and time.

    The integers `run` (N,) are constant over samples of one trial without a long gap in t, or a rest on a table.
    `air`: forces on the body in flight that bend it visibly, None if gravity is enough.
    """

    trial: np.ndarray
    t: np.ndarray
    q: np.ndarray
    run: np.ndarray
    air: Air | None = None

    def __len__(self) -> int:
        return len(self.t)

    def select(self, rows: np.ndarray) -> "Samples":
        """The samples at `rows` (mask or indices)."""
        return Samples(self.trial[rows], self.t[rows], self.q[rows], self.run[rows], self.air)

    def position(self, trial: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Number (n,) of the first sample that is not before each instant (trial, t)."""
        return position(self.trial, self.t, trial, t)

    def around(self, at: np.ndarray, trial: np.ndarray, low: int, high: int) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (n, W) of the samples from `at` (n,) + `low` to below `at` + `high`, and which of them are of
        `trial` (n,); the others are any."""
        wanted = at[:, None] + np.arange(low, high)
        index = np.clip(wanted, 0, len(self) - 1)
        return index, (wanted == index) & (self.trial[index] == trial[:, None])

    def without_air(self) -> np.ndarray:
        """q (N, 3) less what the air has made of it since the start of the trial: free flight becomes a parabola."""
        if self.air is None:
            return self.q
        return self.q - self.air.made(self.t, self.q, self._first)

    def without_gravity(self, gravity: float) -> np.ndarray:
        """The same with g t²/2 added to y, t from the start of the trial: free flight becomes a straight line."""
        first, q = self._first, self.without_air()
        t = self.t - np.repeat(self.t[first], np.diff(np.r_[first, len(self)]))
        return np.column_stack([q[:, 0], q[:, 1] + 0.5 * gravity * t**2, q[:, 2]])

    @property
    def _first(self) -> np.ndarray:
        """Index of the first sample of each trial."""
        return np.flatnonzero(np.r_[True, self.trial[1:] != self.trial[:-1]][: len(self)])


def position(trial: np.ndarray, t: np.ndarray, of_trial: np.ndarray, of_t: np.ndarray) -> np.ndarray:
    """Insertion index of each instant (of_trial, of_t) into (trial, t), sorted by trial and time."""
    # one sort key, made of small numbers whatever those of trials and clocks: differences of a nanosecond count
    trials, number = np.unique(np.concatenate([trial, of_trial]), return_inverse=True)
    times = np.concatenate([t, of_t])
    start = np.full(len(trials), np.inf)
    np.minimum.at(start, number, times)
    since = times - start[number]
    key = number * (since.max(initial=0.0) + 1.0) + since
    return np.searchsorted(key[: len(t)], key[len(t) :])


def long_gaps(trial: np.ndarray, t: np.ndarray, header: Header, settings: ArcSettings) -> np.ndarray:
    """Mask (N − 1,) of the steps between samples, sorted by trial and time, in which too much may have happened."""
    within, step = trial[1:] == trial[:-1], np.diff(t)
    interval = 1.0 / header.rate if header.rate else (np.median(step[within]) if within.any() else np.inf)
    return within & (step > settings.lost_frame * interval)


def make_samples(trial: np.ndarray, t: np.ndarray, q: np.ndarray, header: Header, settings: ArcSettings) -> Samples:
    """Samples from `trial` (N,), `t` (N,) in s and `q` (N, 3) in m, m, rad, in any order: sorted, runs marked."""
    trial, t, q = np.asarray(trial), np.asarray(t, float), np.asarray(q, float)
    order = np.lexsort((t, trial))
    trial, t, q = trial[order], t[order], q[order]
    new_run = (trial[1:] != trial[:-1]) | long_gaps(trial, t, header, settings)
    return Samples(trial, t, q, np.r_[0, np.cumsum(new_run)][: len(t)])


def is_uneven(t: np.ndarray) -> np.ndarray:
    """Mask (m,) of rows of times (m, N) whose steps differ by more than a clock's digits do."""
    step = np.diff(t, axis=1)
    return np.ptp(step, axis=1) > _UNEVEN * step.mean(axis=1) if len(step) else np.zeros(0, bool)


def noise_from_differences(samples: Samples) -> np.ndarray:
    """Robust noise (3,) of x, y, θ (m, m, rad) from third differences of neighbouring samples; NaN without any.

    Third differences remove a parabola; the few across impacts do not move the median.  Exact zeros (a body at rest,
    logged with few digits) say nothing about the noise in flight and are dropped.
    """
    same = (samples.run[3:] == samples.run[:-3]) if len(samples) > 3 else np.zeros(0, bool)
    third = np.abs(np.diff(samples.q, n=3, axis=0))[same]
    first = np.flatnonzero(same)
    t = samples.t[first[:, None] + np.arange(4)]
    uneven = is_uneven(t)
    if uneven.any():
        # divided differences, with weights 1/Π_k (t_j − t_k) made as long as (1, −3, 3, −1)
        apart = t[uneven, :, None] - t[uneven, None, :] + np.eye(4)
        weight = 1.0 / apart.prod(axis=2)
        weight *= np.sqrt(20.0 / (weight**2).sum(axis=1, keepdims=True))
        q = samples.q[first[uneven, None] + np.arange(4)]
        # small numbers keep their digits
        third[uneven] = np.abs(np.einsum("nj,njc->nc", weight, q - q[:, :1]))
    scale = MAD_TO_STD / np.sqrt(20.0)  # the variance of (1, −3, 3, −1) is 20 σ²
    columns = [column[column > 0] for column in third.T]
    return np.array([scale * np.median(c) if len(c) else np.nan for c in columns])
