"""A long recording on a table is cut into pieces that replace the trials.

Splits and bootstraps are by trial, but a camera that runs for minutes gives one trial with hundreds of hits.  It is cut
in the longest flight, or rest, after every few usable hits: no impact is lost, and the two arcs of one flight seldom
belong to different pieces.

Without gravity a body that is left alone stays where it is, often for most of a recording.  Samples rest where `ROWS`
of them in a row stay within the noise of their mean.  They form separate runs, so that no arc, and no estimate of the
noise along a flight, extends into a rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.format.validate import first_of

HITS = 4  # fewest usable hits of a piece
ENOUGH = 20  # trials; with so many, none is cut
NAMED = 5  # recordings whose pieces are named
ROWS = 9
GLITCHES = 2  # wrong samples in a row that do not end a rest
_WITHIN = 3.0  # sigmas from the mean; at rest most windows stay within, and each sample is in nine of them


@dataclass(frozen=True)
class Pieces:
    """Pieces of the trials `trial` (p,) that begin at times `start` (p,) in s, both ascending.

    They are numbered from 0; without `cut`, they are the trials and keep their numbers.
    """

    trial: np.ndarray
    start: np.ndarray
    cut: bool

    def of(self, trial: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Number of the piece for each trial (n,) and time (n,) in s."""
        if not self.cut:
            return trial
        number = np.searchsorted(self.trial, trial)
        for i, (one, start) in enumerate(zip(self.trial, self.start)):
            number[(trial == one) & (t >= start)] = i
        return number

    def text(self) -> str:
        """Message on the recordings that were cut; "" if there are none."""
        if not self.cut:
            return ""
        whole, first, count = np.unique(self.trial, return_index=True, return_counts=True)
        long = np.flatnonzero(count > 1)
        named = [f"trial {whole[i]} into the pieces {first[i]} to {first[i] + count[i] - 1}" for i in long]
        return (
            f"Long recordings were cut between hits into pieces of {HITS} usable hits or more. The pieces replace the "
            f"trials from here on, and all are numbered anew: {first_of(named, NAMED)}."
        )


def cut_into_pieces(samples: Samples, at: np.ndarray, used: np.ndarray) -> Pieces:
    """Pieces of recordings with hits after the samples `at` (n,), of which those in the mask `used` (n,) are usable."""
    trials, first = np.unique(samples.trial, return_index=True)
    parts = [(one, [float(samples.t[i])]) for one, i in zip(trials, first)]
    if len(trials) < ENOUGH:
        for one, starts in parts:
            hits = np.flatnonzero(samples.trial[at] == one)
            starts += [float(samples.t[i]) for i in _cuts(at[hits], used[hits])]
    trial = np.concatenate([np.full(len(starts), one) for one, starts in parts])
    start = np.concatenate([starts for _, starts in parts])
    return Pieces(trial, start, len(start) > len(trials))


def _cuts(at: np.ndarray, used: np.ndarray) -> Sequence[int]:
    """Samples at which the pieces of one recording begin, without the first piece."""
    passed, cuts, begun = np.cumsum(used), [], 0
    total = int(passed[-1]) if len(passed) else 0
    while total - begun >= 2 * HITS:
        # after the fourth usable hit, or up to as many later, and at least four from the end
        after = np.flatnonzero((passed >= begun + HITS) & (passed <= min(begun + 2 * HITS, total - HITS)))
        gap = at[after + 1] - at[after]
        cut = int(after[gap.argmax()])
        cuts.append(int(at[cut] + 1 + gap.max() // 2))
        begun = int(passed[cut])
    return cuts


def without_rests(samples: Samples, sigma: np.ndarray) -> Samples:
    """The samples with new runs where a rest begins or ends; `sigma` (3,) is the noise of x, y, θ in m, m, rad."""
    rests = resting(samples, sigma)
    begins = (samples.run[1:] != samples.run[:-1]) | (rests[1:] != rests[:-1])
    return replace(samples, run=np.r_[0, np.cumsum(begins)][: len(samples)])


def resting(
    samples: Samples, sigma: np.ndarray, channels: Sequence[int] = (0, 1), *, drifts: bool = False
) -> np.ndarray:
    """Mask (N,) of samples that rest in all of the `channels` of their q (N, c), whose noise is `sigma` (c,).

    `drifts`: whether they may change at a constant rate.
    """
    rests = np.zeros(len(samples), bool)
    if len(samples) < ROWS:
        return rests
    rows, used = np.arange(len(samples) - ROWS + 1)[:, None] + np.arange(ROWS), list(channels)
    q = samples.q[rows][:, :, used]
    off = q - q.mean(axis=1, keepdims=True)
    if drifts:
        t = samples.t[rows]
        tau = (t - t.mean(axis=1, keepdims=True))[:, :, None]
        off = off - tau * (tau * off).sum(axis=1, keepdims=True) / (tau * tau).sum(axis=1, keepdims=True)
    off = np.abs(off).max(axis=1)
    still = (off < _WITHIN * sigma[used]).all(axis=1) & (samples.run[rows[:, 0]] == samples.run[rows[:, -1]])
    for lag in range(ROWS):
        rests[lag : lag + len(still)] |= still
    # one or two wrong samples do not end a rest
    for lost in range(GLITCHES, 0, -1):
        rests[1:-lost] |= rests[: -lost - 1] & rests[lost + 1 :]
    return rests
