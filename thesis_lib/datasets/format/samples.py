"""Poses of all trials as flat arrays, and the settings of the search for impacts in them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.datasets.format.header import Header
from thesis_lib.foundation.settings import Section


class ArcSettings(Section):
    """Detection of impacts, arc fits and quality tests.  The numbers are own choices; the thesis gives none."""

    max_window: int = Field(25, description="samples used at most on either side of an impact")
    min_window: int = Field(
        5, ge=3, description="samples needed on either side; two hits nearer than this are `second_hit`"
    )
    guard: float = Field(
        1e-3, ge=0, description="s; samples this near to an impact may fall into the contact (about 1 ms): not used"
    )
    double_hit: float = Field(
        5e-3,
        ge=0,
        description="s; two corners of a polygon that touch within this time make one hit in the samples, which is no "
        "single impact: a sample and a contact of about 1 ms",
    )
    touch_sigma: float = Field(
        1e-3,
        gt=0,
        description="m; how well 'gap = 0 at impact' is believed. 1 mm covers the millimetre by which measured dice "
        "hover or dip at rest, and is still ten times the error of 20 samples",
    )
    contact_spread: float | None = Field(
        None, ge=0, description="s; one sigma by which arcs may miss each other, over |Δv|; null: estimated"
    )
    stray_acceleration: bool = Field(
        True, description="allow for accelerations beyond gravity of the size found in the arcs"
    )
    threshold: float = Field(
        6.0, gt=0, description="sigmas (root of a chi² with 3 dof) that a velocity jump must exceed"
    )
    min_jump: float = Field(
        0.1, ge=0, description="m/s in the kinetic metric; slower events are rocking and rolling, not impacts"
    )
    scales: tuple[Annotated[int, Field(ge=2)], ...] = Field(
        (2, 3, 5, 8), min_length=1, description="samples on either side of the detector's line fits, fine to coarse"
    )
    outlier_sigma: float = Field(
        7.0, gt=0, description="sigmas by which one sample must stand out to be masked as a tracking glitch"
    )
    lost_frame: float = Field(1.5, gt=1, description="a step in t above this many sampling intervals is a gap")
    not_ballistic: float = Field(
        9.0, gt=1, description="reduced chi² of an arc above which it is no free flight: the impact is left out"
    )
    arc_deviation: float = Field(
        2.0, gt=1, description="reduced chi² of an arc above which (if also significant) the impact is flagged"
    )
    meet_sigma: float = Field(
        6.0,
        gt=0,
        description="arcs that miss each other by more sigmas than this, and by more than meet_time, "
        "belong to more than one hit",
    )
    meet_time: float = Field(1e-3, gt=0, description="s; times |Δv|: see meet_sigma")
    mu_max: float = Field(0.35, gt=0, description="cone test |c_t| ≤ mu_max c_n, as in the authors' code")
    touch_limit: float = Field(
        2e-3, gt=0, description="m; gap at impact above this (and above 5 sigma) is flagged `no_touch`"
    )
    noise_ratio: float = Field(1.5, gt=1, description="factor between stated and found noise that calls for a warning")

    @model_validator(mode="after")
    def _windows_fit(self) -> "ArcSettings":
        if self.min_window > self.max_window:
            raise ValueError(f"min_window ({self.min_window}) exceeds max_window ({self.max_window})")
        return self


@dataclass(frozen=True)
class Samples:
    """Poses q (N, 3) in m, m, rad at times t (N,) in s, sorted by trial and time.

    The integers `run` (N,) are constant over samples of one trial without a gap in t.
    """

    trial: np.ndarray
    t: np.ndarray
    q: np.ndarray
    run: np.ndarray

    def __len__(self) -> int:
        return len(self.t)

    def select(self, rows: np.ndarray) -> "Samples":
        """The samples at `rows` (mask or indices)."""
        return Samples(self.trial[rows], self.t[rows], self.q[rows], self.run[rows])

    def without_gravity(self, gravity: float) -> np.ndarray:
        """q (N, 3) with g t²/2 added to y, t from the start of the trial: free flight becomes a straight line."""
        first = np.flatnonzero(np.r_[True, self.trial[1:] != self.trial[:-1]][: len(self)])
        t = self.t - np.repeat(self.t[first], np.diff(np.r_[first, len(self)]))
        return np.column_stack([self.q[:, 0], self.q[:, 1] + 0.5 * gravity * t**2, self.q[:, 2]])


def make_samples(trial: np.ndarray, t: np.ndarray, q: np.ndarray, header: Header, settings: ArcSettings) -> Samples:
    """Samples from `trial` (N,), `t` (N,) in s and `q` (N, 3) in m, m, rad, in any order: sorted, runs marked."""
    trial, t, q = np.asarray(trial), np.asarray(t, float), np.asarray(q, float)
    order = np.lexsort((t, trial))
    trial, t, q = trial[order], t[order], q[order]
    within = trial[1:] == trial[:-1]
    step = np.diff(t)
    interval = 1.0 / header.rate if header.rate else (np.median(step[within]) if within.any() else np.inf)
    new_run = ~within | (step > settings.lost_frame * interval)
    return Samples(trial, t, q, np.r_[0, np.cumsum(new_run)][: len(t)])
