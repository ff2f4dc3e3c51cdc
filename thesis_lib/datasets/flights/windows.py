"""Which samples belong to the flights before and after an impact.

The window of an impact is W samples about its detected instant.  Gaps in time, the ends of the trial and neighbouring
hits end a flight; samples within `guard` of an instant may lie in the contact and belong to neither flight.  As a fit
moves the instant t_c, samples change sides.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.flights.lines import rank
from thesis_lib.datasets.format.samples import ArcSettings, Samples

_WALK = 3  # samples by which t_c may leave the detected instant: the detector is that coarse for weak hits


@dataclass(frozen=True)
class Windows:
    """The W samples around each of n impacts, as many before the detected instant as after it."""

    t_0: np.ndarray  # t_0, q_0: (n,) s and (n, 3), middle of the two samples beside the detected instant
    q_0: np.ndarray
    t: np.ndarray  # t, q: (n, W) s and (n, W, 3) relative to these, so that long records lose no digits
    q: np.ndarray
    usable: np.ndarray  # (n, W) whether a sample may belong to a flight
    low: np.ndarray  # low, high: (n,) s, bounds of t_c, relative to t_0
    high: np.ndarray
    same_trial: np.ndarray  # (n − 1,) whether an impact and the next one belong to the same trial

    def moved(self, t: np.ndarray) -> np.ndarray:
        """Samples (n,) by which the instants t (n,), relative to t_0, are later than the detected ones."""
        passed = self.usable & (t[:, None] >= self.t)
        before = np.arange(self.t.shape[1]) < self.t.shape[1] // 2
        return (passed & ~before).sum(1) - (self.usable & before & ~passed).sum(1)


def windows_around(samples: Samples, at: np.ndarray, size: int, beyond: int = 1) -> Windows:
    """The `size` + 1 samples on either side of the instants after the samples `at` (n,).

    They hold as many samples `beyond` neighbouring hits, which may be detected a sample early or late.
    """
    last = len(samples) - 1
    index = at[:, None] + np.arange(-size, size + 2)
    usable = (index >= 0) & (index <= last)
    index = np.clip(index, 0, last)
    # gaps bound each side; if a gap holds the impact itself, the two sides are different runs
    before = index <= at[:, None]
    usable &= samples.run[index] == np.where(before, samples.run[at][:, None], samples.run[at + 1][:, None])
    # a neighbouring hit ends the window; the times of its two samples exclude them later
    hit_before = np.r_[-1, at[:-1] + 1 - beyond] if len(at) else at
    hit_after = np.r_[at[1:] + beyond, last] if len(at) else at
    usable &= (index >= hit_before[:, None]) & (index <= hit_after[:, None])
    t_0 = 0.5 * (samples.t[at] + samples.t[at + 1])
    q_0 = 0.5 * (samples.q[at] + samples.q[at + 1])
    t, q = samples.t[index] - t_0[:, None], samples.q[index] - q_0[:, None, :]
    low, high = (bound - t_0 for bound in _bounds(samples, at))
    return Windows(t_0, q_0, t, q, usable, low, high, samples.trial[at[1:]] == samples.trial[at[:-1]])


def _bounds(samples: Samples, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (n,) of t_c in s: some samples either way, within the trial and half-way to the next hit."""
    first = np.searchsorted(samples.trial, samples.trial[at], side="left")
    last = np.searchsorted(samples.trial, samples.trial[at], side="right") - 1
    half_way = at[:-1] + (np.diff(at) + 1) // 2
    low = np.maximum(np.maximum(at - _WALK, first), np.r_[0, half_way][: len(at)])
    high = np.minimum(np.minimum(at + 1 + _WALK, last), np.r_[half_way, len(samples)][: len(at)])
    # never less than the detected interval itself
    return samples.t[np.minimum(low, at)], samples.t[np.maximum(high, at + 1)]


def sides_of(windows: Windows, t: np.ndarray, settings: ArcSettings, size: np.ndarray | None) -> np.ndarray:
    """Samples in the flights before and after impacts at t (n,), in s relative to t_0: (n, 2, W), 0 or 1."""
    tau = windows.t - t[:, None]
    # neighbouring hits bound the flights, too: the body does not fly freely during their contact
    start, end = np.full(len(t), -np.inf), np.full(len(t), np.inf)
    instant, same = t + windows.t_0, windows.same_trial
    start[1:][same] = (instant[:-1] + settings.guard - windows.t_0[1:])[same]
    end[:-1][same] = (instant[1:] - settings.guard - windows.t_0[:-1])[same]
    flying = windows.usable & (windows.t > start[:, None]) & (windows.t < end[:, None])
    side = np.stack([flying & (tau < -settings.guard), flying & (tau > settings.guard)], 1) * 1.0
    return side * (rank(side) <= (settings.max_window if size is None else size[..., None]))
