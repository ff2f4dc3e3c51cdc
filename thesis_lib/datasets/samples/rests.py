"""Where a body stands still on a table: no flight, and no noise of a flight.

Without gravity a body that is left alone stays where it is, often for most of a recording.  Samples rest where `ROWS`
of them in a row stay within the noise of their mean.  They make runs of their own, so that no arc, and no estimate of
the noise along a flight, reaches into a rest.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from thesis_lib.datasets.format.samples import Samples

ROWS = 9
GLITCHES = 2  # samples in a row
_WITHIN = 3.0  # sigmas from the mean; at rest most windows stay within, and each sample is in nine of them


def without_rests(samples: Samples, sigma: np.ndarray) -> Samples:
    """The samples with new runs where a rest begins or ends; `sigma` (3,) is the noise of x, y, θ in m, m, rad."""
    rests = resting(samples, sigma)
    begins = (samples.run[1:] != samples.run[:-1]) | (rests[1:] != rests[:-1])
    return replace(samples, run=np.r_[0, np.cumsum(begins)][: len(samples)])


def resting(samples: Samples, sigma: np.ndarray, channels: Sequence[int] = (0, 1)) -> np.ndarray:
    """Mask (N,) of samples that rest in all of the `channels` of their q (N, c), whose noise is `sigma` (c,)."""
    rests = np.zeros(len(samples), bool)
    if len(samples) < ROWS:
        return rests
    rows, used = np.arange(len(samples) - ROWS + 1)[:, None] + np.arange(ROWS), list(channels)
    q = samples.q[rows][:, :, used]
    off = np.abs(q - q.mean(axis=1, keepdims=True)).max(axis=1)
    still = (off < _WITHIN * sigma[used]).all(axis=1) & (samples.run[rows[:, 0]] == samples.run[rows[:, -1]])
    for lag in range(ROWS):
        rests[lag : lag + len(still)] |= still
    # a tracking glitch or two end no rest
    for lost in range(GLITCHES, 0, -1):
        rests[1:-lost] |= rests[: -lost - 1] & rests[lost + 1 :]
    return rests
