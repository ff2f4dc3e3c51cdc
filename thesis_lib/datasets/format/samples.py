"""Poses of all trials as flat arrays, and the settings for the detection of impacts in them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.datasets.format.air import Air
from thesis_lib.datasets.format.header import Header
from thesis_lib.foundation.settings import Section
from thesis_lib.statistics.spread import MAD_TO_STD

PART = 100  # samples within which arrival times drift by less than they jitter
_UNEVEN = 1e-3  # relative spread of steps beyond which differences for equal steps contain the motion of the body
# of the mean step, with half of the frames lost; shorter periods are those within a burst of rows
_BURST, _NO_GAP = 0.5, 0.95  # the longest steps, of a body out of view, are left out of the mean
_BETTER = 0.9  # ratio of the distances of steps from whole periods, from which single steps show the period


class ArcSettings(Section):
    """Settings for impact detection, arc fits and quality tests.  The numbers are our choice; the thesis gives none."""

    max_window: int = Field(25, description="largest number of samples used on either side of an impact")
    min_window: int = Field(5, ge=3, description="fewest samples on either side; closer hits are `second_hit`")
    min_window_in_space: int = Field(
        3, ge=3, description="the same for bodies in space, whose hits follow more closely"
    )
    guard: float = Field(1e-3, ge=0, description="s; closer samples, perhaps in the contact (1 ms), are not used")
    double_hit: float = Field(
        5e-3, ge=0, description="s within which corners hit as one: one sample and a contact of 1 ms"
    )
    touch_sigma: float = Field(1e-3, gt=0, description="m; one sigma of the gap at impact: dice hover or dip by 1 mm")
    contact_spread: float | None = Field(
        None, ge=0, description="s; one sigma of the jump of the pose at impact over |Δv|; null: estimated"
    )
    stray_acceleration: bool = Field(True, description="allow for unmodelled accelerations of the size seen in flight")
    threshold: float = Field(6.0, gt=0, description="velocity jump of a hit, in sigmas (root of chi² with 3 dof)")
    min_jump: float = Field(0.1, ge=0, description="m/s in the kinetic metric; smaller jumps are rocking or rolling")
    scales: tuple[Annotated[int, Field(ge=2)], ...] = Field(
        (2, 3, 5, 8), min_length=1, description="samples on either side in the detector's line fits, fine to coarse"
    )
    outlier_sigma: float = Field(7.0, gt=0, description="sigmas from which a single sample counts as a glitch")
    lost_frame: float = Field(8.0, gt=1, description="a step in t above this many sampling intervals ends a flight")
    not_ballistic: float = Field(9.0, gt=1, description="reduced chi² of an arc above which the impact is left out")
    arc_deviation: float = Field(2.0, gt=1, description="reduced chi² from which an arc is flagged, if significant")
    meet_sigma: float = Field(6.0, gt=0, description="sigmas of the pose jump that means several hits, see meet_time")
    meet_time: float = Field(1e-3, gt=0, description="s; a pose jump below this times |Δv| is one hit, at any sigma")
    mu_max: float = Field(0.35, gt=0, description="cone test |c_t| ≤ mu_max c_n, as in the authors' code")
    touch_limit: float = Field(2e-3, gt=0, description="m; a gap above this and 5 sigma is flagged `no_touch`")
    noise_ratio: float = Field(1.5, gt=1, description="factor between stated and found noise that causes a warning")

    @model_validator(mode="after")
    def _windows_fit(self) -> "ArcSettings":
        for name in ("min_window", "min_window_in_space"):
            if (least := getattr(self, name)) > self.max_window:
                raise ValueError(f"{name} ({least}) exceeds max_window ({self.max_window})")
        return self


@dataclass(frozen=True)
class Samples:
    """Poses q (N, 3) in m, m, rad at times t (N,) in s, sorted by trial and time.

    The integers `run` (N,) are constant over samples of one trial without a long gap in t, or a rest on a table.
    `air`: aerodynamic forces that bend the flights visibly; None if gravity alone describes them.
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
        """Index (n,) of the first sample at or after each instant (trial, t)."""
        return position(self.trial, self.t, trial, t)

    def around(self, at: np.ndarray, trial: np.ndarray, low: int, high: int) -> tuple[np.ndarray, np.ndarray]:
        """Indices (n, W) of the samples from `at` (n,) + `low` to below `at` + `high`, and the mask of those that
        belong to `trial` (n,); the other indices are arbitrary."""
        wanted = at[:, None] + np.arange(low, high)
        index = np.clip(wanted, 0, len(self) - 1)
        return index, (wanted == index) & (self.trial[index] == trial[:, None])

    def without_air(self) -> np.ndarray:
        """q (N, 3) less the displacement by the air since the start of the trial: free flight becomes a parabola."""
        if self.air is None:
            return self.q
        return self.q - self.air.made(self.t, self.q, self._first)

    def without_gravity(self, gravity: float) -> np.ndarray:
        """`without_air()` plus g t²/2 in y, with t from the start of the trial: free flight becomes a straight line."""
        first, q = self._first, self.without_air()
        t = self.t - np.repeat(self.t[first], np.diff(np.r_[first, len(self)]))
        return np.column_stack([q[:, 0], q[:, 1] + 0.5 * gravity * t**2, q[:, 2]])

    @property
    def _first(self) -> np.ndarray:
        """Index of the first sample of each trial."""
        return np.flatnonzero(np.r_[True, self.trial[1:] != self.trial[:-1]][: len(self)])


def position(trial: np.ndarray, t: np.ndarray, of_trial: np.ndarray, of_t: np.ndarray) -> np.ndarray:
    """Insertion index of each instant (of_trial, of_t) into (trial, t), sorted by trial and time."""
    # one sort key of small numbers, whatever the trial numbers and clocks, to resolve differences of a nanosecond
    trials, number = np.unique(np.concatenate([trial, of_trial]), return_inverse=True)
    times = np.concatenate([t, of_t])
    start = np.full(len(trials), np.inf)
    np.minimum.at(start, number, times)
    since = times - start[number]
    key = number * (since.max(initial=0.0) + 1.0) + since
    return np.searchsorted(key[: len(t)], key[len(t) :])


def sampling_period(t: np.ndarray, trial: np.ndarray, first: int | None = None) -> float:
    """Sampling period in s of times `t` (n,) in s within trials (n,); NaN without steps.

    A median step over `first` rows, then means over longer and longer spans of rows, each counted in the last estimate:
    single steps do not show the period if stamps have few digits (240 Hz in whole milliseconds).  Without `first`, that
    of 1 and 4 is used of whose period single steps are multiples: lost frames lengthen spans of 4 rows, while rows that
    arrive in bursts, or by chance, mislead single steps.
    """
    if first is None:
        one, four = (sampling_period(t, trial, rows) for rows in (1, 4))
        step = np.diff(t)[trial[1:] == trial[:-1]]
        single = len(step) and one > _BURST * step[step <= np.quantile(step, _NO_GAP)].mean()
        return one if single and _off(step, one) < _BETTER * _off(step, four) else four
    period = 0.0
    for span in first * 2 ** np.arange(14):
        step = (t[span:] - t[:-span])[trial[span:] == trial[:-span]]
        if period and len(step) < PART:
            break
        if period:
            period = float(step.sum() / np.maximum(np.round(step / period), 1.0).sum())
        else:
            if not len(step):
                span, step = 1, np.diff(t)[trial[1:] == trial[:-1]]
            period = float(np.median(step)) / span if len(step) else np.nan
    return period


def _off(step: np.ndarray, period: float) -> float:
    """Mean distance of steps (m,) from whole numbers of periods, in periods."""
    frames = step / max(period, 1e-300)
    return float(np.abs(frames - np.maximum(np.round(frames), 1.0)).mean())


def long_gaps(trial: np.ndarray, t: np.ndarray, header: Header, settings: ArcSettings) -> np.ndarray:
    """Mask (N − 1,) of the steps between samples, sorted by trial and time, that are too long for one flight."""
    within, step = trial[1:] == trial[:-1], np.diff(t)
    interval = 1.0 / header.rate if header.rate else (np.median(step[within]) if within.any() else np.inf)
    return within & (step > settings.lost_frame * interval)


def make_samples(trial: np.ndarray, t: np.ndarray, q: np.ndarray, header: Header, settings: ArcSettings) -> Samples:
    """Samples from `trial` (N,), `t` (N,) in s and `q` (N, 3) in m, m, rad, in any order: sorted, runs numbered."""
    trial, t, q = np.asarray(trial), np.asarray(t, float), np.asarray(q, float)
    order = np.lexsort((t, trial))
    trial, t, q = trial[order], t[order], q[order]
    new_run = (trial[1:] != trial[:-1]) | long_gaps(trial, t, header, settings)
    return Samples(trial, t, q, np.r_[0, np.cumsum(new_run)][: len(t)])


def is_uneven(t: np.ndarray) -> np.ndarray:
    """Mask (m,) of rows of times (m, N) whose steps differ by more than the digits of a clock explain."""
    step = np.diff(t, axis=1)
    return np.ptp(step, axis=1) > _UNEVEN * step.mean(axis=1) if len(step) else np.zeros(0, bool)


def noise_from_differences(samples: Samples) -> np.ndarray:
    """Robust noise (3,) of x, y, θ (m, m, rad) from third differences of neighbouring samples; NaN without any.

    Third differences remove a parabola; the few across impacts do not move the median.  Exact zeros (a body at rest,
    logged with few digits) carry no information on the noise in flight and are dropped.
    """
    same = (samples.run[3:] == samples.run[:-3]) if len(samples) > 3 else np.zeros(0, bool)
    third = np.abs(np.diff(samples.q, n=3, axis=0))[same]
    first = np.flatnonzero(same)
    t = samples.t[first[:, None] + np.arange(4)]
    uneven = is_uneven(t)
    if uneven.any():
        # divided differences, with weights 1/Π_k (t_j − t_k) scaled to the norm of (1, −3, 3, −1)
        apart = t[uneven, :, None] - t[uneven, None, :] + np.eye(4)
        weight = 1.0 / apart.prod(axis=2)
        weight *= np.sqrt(20.0 / (weight**2).sum(axis=1, keepdims=True))
        q = samples.q[first[uneven, None] + np.arange(4)]
        # relative to the first sample: small numbers keep their digits
        third[uneven] = np.abs(np.einsum("nj,njc->nc", weight, q - q[:, :1]))
    scale = MAD_TO_STD / np.sqrt(20.0)  # the variance of (1, −3, 3, −1) is 20 σ²
    columns = [column[column > 0] for column in third.T]
    return np.array([scale * np.median(c) if len(c) else np.nan for c in columns])
