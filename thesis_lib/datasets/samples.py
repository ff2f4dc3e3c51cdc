"""Poses of all trials as flat arrays, and the settings with which impacts are found in them."""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.header import Header


@dataclass(frozen=True)
class ArcSettings:
    """Settings of detection, arc fits and quality tests.

    Attributes:
        max_window: samples used at most on either side of an impact.
        min_window: samples needed on either side; two hits nearer than this are `second_hit`.
        guard: s; samples this near to an impact may fall into the contact (about 1 ms) and are not used.
        touch_sigma: m; how well "gap = 0 at impact" is believed.  1 mm covers the millimetre by which
            measured dice hover or dip at rest, and is still ten times the error of 20 samples.
        contact_spread: s; one sigma by which arcs may miss each other, over |Δv|; None: estimated.
        stray_acceleration: allow for accelerations beyond gravity of the size found in the arcs.
        threshold: sigmas (root of a chi² with 3 dof) that a velocity jump must exceed to be a candidate.
        min_jump: m/s in the kinetic metric; slower events are rocking and rolling, not impacts.
        scales: samples on either side of the detector's line fits, fine to coarse.
        outlier_sigma: sigmas by which a single sample must stand out to be masked as a tracking glitch.
        lost_frame: a step in t above this many sampling intervals is a gap.
        not_ballistic: reduced chi² of an arc above which it is no free flight and the impact is left out.
        arc_deviation: reduced chi² of an arc above which (if also significant) the impact is flagged.
        meet_sigma, meet_time: arcs that miss each other by more than this many sigmas and by more than
            meet_time (s) times |Δv| belong to more than one hit.
        mu_max: cone test |P_t| ≤ mu_max P_n (0.35 as in the thesis authors' code).
        touch_limit: m; gap at impact above this (and above 5 sigma) is flagged `no_touch`.
        noise_ratio: factor between stated and found noise that calls for a warning.
    """

    max_window: int = 25
    min_window: int = 5
    guard: float = 1e-3
    touch_sigma: float = 1e-3
    contact_spread: float | None = None
    stray_acceleration: bool = True
    threshold: float = 6.0
    min_jump: float = 0.1
    scales: tuple[int, ...] = (2, 3, 5, 8)
    outlier_sigma: float = 7.0
    lost_frame: float = 1.5
    not_ballistic: float = 9.0
    arc_deviation: float = 2.0
    meet_sigma: float = 6.0
    meet_time: float = 1e-3
    mu_max: float = 0.35
    touch_limit: float = 2e-3
    noise_ratio: float = 1.5

    def __post_init__(self) -> None:
        if not 3 <= self.min_window <= self.max_window:
            raise ValueError(
                f"arc settings: need 3 ≤ min_window ≤ max_window, got {self.min_window} and {self.max_window}"
            )
        if not self.scales or min(self.scales) < 2:
            raise ValueError(f"arc settings: scales must be at least 2 samples, got {self.scales}")


@dataclass(frozen=True)
class Samples:
    """Poses of all trials, sorted by trial and time.

    Attributes:
        trial: (N,) integers.
        t: (N,) s.
        q: (N, 3) m, m, rad.
        run: (N,) integers; constant over samples of one trial without a gap in t.
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
        """q (N, 3) with the fall g t²/2 added to y, t from the start of the trial: free flight is straight."""
        first = np.flatnonzero(np.r_[True, self.trial[1:] != self.trial[:-1]][: len(self)])
        t = self.t - np.repeat(self.t[first], np.diff(np.r_[first, len(self)]))
        return np.column_stack([self.q[:, 0], self.q[:, 1] + 0.5 * gravity * t**2, self.q[:, 2]])


def make_samples(
    trial: np.ndarray, t: np.ndarray, q: np.ndarray, header: Header, settings: ArcSettings
) -> Samples:
    """Sort poses by trial and time, and mark the runs without a gap in time."""
    trial, t, q = np.asarray(trial), np.asarray(t, float), np.asarray(q, float)
    order = np.lexsort((t, trial))
    trial, t, q = trial[order], t[order], q[order]
    within = trial[1:] == trial[:-1]
    step = np.diff(t)
    interval = 1.0 / header.rate if header.rate else (np.median(step[within]) if within.any() else np.inf)
    new_run = ~within | (step > settings.lost_frame * interval)
    return Samples(trial, t, q, np.r_[0, np.cumsum(new_run)][: len(t)])
