"""Jumps of a tracker in space: a tag flips, or another tag or marker takes over.

    turn:   |Δφ_i| > `TURN` + 3 times the median of its neighbours
    place:  |d_i| > `ODD` times the median,  p = a + v s + b s² (+ d_i from sample i on)  in the neighbouring samples,
            if this fits as well as elsewhere, far better than a step one sample earlier or later, and the spin does
            not change, as it would at a hit

Δφ_i is the turn from one sample to the next, p (3,) the tracked point, s time; steps across lost frames and from trial
to trial are ignored.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from thesis_lib.datasets.space.motion import turning
from thesis_lib.mechanics.space import SPACE

TURN = 0.3  # rad
BACK = 0.1  # s within which an orientation jumps back; a tag that is read in its other pose for longer is kept
NEIGHBOURS = 3  # samples on either side that give the usual turn
BESIDE = 4  # samples on either side of a jump of position
ODD, PLACE = 5.0, 1e-3  # median steps, and m: a jump of position exceeds both
SMOOTH = 2.0  # median misfits of a parabola with a step, beyond which a step is not a jump
ALONE = 0.6  # of the misfits of a step one sample earlier or later, which are alike for two hits in a row
STEADY = 4.0  # median changes of the spin; a hit changes it by more
CHUNK = 50_000  # windows fitted at once
LOST = 1.5  # median time steps; longer steps lack samples


@dataclass(frozen=True, eq=False)
class Jumps:
    """Jumps in a table.

    Attributes:
        rows: (k,) indices of the first samples after the jumps.
        size: median size in rad or m; 0 without jumps.
        share: share of the samples that lie between a jump and the jump back.
    """

    rows: np.ndarray
    size: float
    share: float


NO_JUMPS = Jumps(np.zeros(0, int), 0.0, 0.0)


def turn_jumps(trial: np.ndarray, t: np.ndarray, quaternion: np.ndarray) -> Jumps:
    """Jumps of the orientation (n, 4), scalar first and NaN if lost, at times (n,) in s."""
    rows = np.flatnonzero(np.isfinite(quaternion[:, 0]))
    if len(rows) < 2 * NEIGHBOURS + 2:
        return NO_JUMPS
    q = quaternion[rows][:, [1, 2, 3, 0]]
    step = np.linalg.norm(turning(q), axis=1)
    step[~_unbroken(trial, t)[rows[:-1]] | (np.diff(rows) > 1)] = 0.0
    around = np.lib.stride_tricks.sliding_window_view(np.pad(step, NEIGHBOURS, mode="edge"), 2 * NEIGHBOURS + 1)
    far = step > TURN + 3.0 * np.median(around, axis=1)
    return _jumps(trial, rows[1:][far], step[far])


def out_and_back(trial: np.ndarray, t: np.ndarray, quaternion: np.ndarray) -> np.ndarray:
    """Mask (n,) of samples in which the ambiguous pose of a tag is read wrongly: the orientation (n, 4), scalar first,
    jumps there, and soon back to that of the body, which has turned on.  Times t (n,) in s rise within a trial."""
    mask = np.zeros(len(t), bool)
    if len(t) < 2 * NEIGHBOURS + 2:
        return mask
    dt, same = np.diff(t), trial[1:] == trial[:-1]
    rate = np.where(same, SPACE.turn_between(quaternion[:-1].T, quaternion[1:].T) / np.where(same, dt, 1.0), 0.0)
    speed = np.linalg.norm(rate, axis=0)
    around = np.lib.stride_tricks.sliding_window_view(np.pad(speed, NEIGHBOURS, mode="edge"), 2 * NEIGHBOURS + 1)
    far = speed * dt > TURN + 3.0 * np.quantile(around, 0.25, axis=1) * dt  # a median of these may be a jump, too
    steady, done, jumps = same & ~far, -1, np.flatnonzero(far & same)
    for out, back in pairwise(jumps):  # step i leads from sample i to sample i + 1
        if out < done or trial[out] != trial[back + 1] or t[back + 1] - t[out] > BACK:
            continue
        beside = [step for step in (out - 1, back + 1) if 0 <= step < len(dt) and steady[step]]
        spin = rate[:, beside].mean(axis=1) if beside else np.zeros(3)
        turn = SPACE.turn_between(quaternion[out][:, None], quaternion[back + 1][:, None])[:, 0]
        if np.linalg.norm(turn - spin * (t[back + 1] - t[out])) < TURN:
            mask[out + 1 : back + 1], done = True, back + 1
    return mask


def place_jumps(trial: np.ndarray, t: np.ndarray, position: np.ndarray, quaternion: np.ndarray | None) -> Jumps:
    """Jumps of the tracked point (n, 3) in m at unchanged spin, at times (n,) in s that rise within a trial.

    `quaternion` (n, 4), scalar first; None for a ball whose orientation is not measured.
    """
    whole = np.lib.stride_tricks.sliding_window_view(_unbroken(trial, t), 2 * BESIDE - 1) if len(t) > 2 * BESIDE else []
    at = np.flatnonzero(np.all(whole, axis=1)) + BESIDE if len(whole) else np.zeros(0, int)
    if not len(at):
        return NO_JUMPS
    size, rest, hit = np.concatenate([_steps(t, position, part) for part in np.array_split(at, len(at) // CHUNK + 1)]).T
    far = (size > max(ODD * np.median(size), PLACE)) & (rest < SMOOTH * np.median(rest)) & (hit < 1.0)
    beside = np.zeros(len(t) + 2 * BESIDE)
    beside[at + BESIDE] = size
    misfit = np.full(len(t) + 2, np.inf)
    misfit[at + 1] = rest
    far &= rest < ALONE * np.minimum(misfit[at], misfit[at + 2])
    if quaternion is not None:
        kick = _spin_changes(t, quaternion, at)
        far &= kick < STEADY * np.median(kick)
    far &= size == np.lib.stride_tricks.sliding_window_view(beside, 2 * BESIDE + 1).max(axis=1)[at]
    return _jumps(trial, at[far], size[far])


def _steps(t: np.ndarray, position: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Array (k, 3): step in m before each sample `at`, rms misfit in m, and ratio of the step that a hit would make.

    A hit between two samples displaces the point by at most the change of velocity times the interval; the ratio is
    this displacement over the step, with both fitted.
    """
    rows = at[:, None] + np.arange(-BESIDE, BESIDE)
    s = t[rows] - t[at, None]
    s = s / np.ptp(s, axis=1)[:, None]
    later = np.broadcast_to(rows[:1] >= at[0], s.shape).astype(float)
    X, y = np.stack([np.ones_like(s), s, s**2, later, later * s], axis=-1), position[rows] - position[at, None]
    both, step = _solved(X, y), _solved(X[..., :4], y)
    rest = np.sqrt(np.mean((y - X[..., :4] @ step) ** 2, axis=(1, 2)))
    way, size = (np.linalg.norm(both[:, i], axis=1) for i in (4, 3))
    return np.stack(
        [np.linalg.norm(step[:, 3], axis=1), rest, way / (2 * BESIDE - 1) / np.maximum(size, 1e-12)], axis=1
    )


def _spin_changes(t: np.ndarray, quaternion: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Changes (k,) in rad/s of the mean spin between the samples before each sample `at` and those from it on."""
    turns = np.concatenate([np.zeros((1, 3)), np.cumsum(turning(quaternion[:, [1, 2, 3, 0]]), axis=0)])
    ends = np.array([[0, BESIDE - 1], [-BESIDE, -1]])
    before, after = ((turns[at + b] - turns[at + a]) / (t[at + b] - t[at + a])[:, None] for a, b in ends)
    return np.linalg.norm(after - before, axis=1)


def _solved(X: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.linalg.solve(X.swapaxes(1, 2) @ X, X.swapaxes(1, 2) @ y)


def _unbroken(trial: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Mask (n - 1,) of the steps within a trial without lost samples."""
    dt, same = np.diff(t), trial[1:] == trial[:-1]
    return same & (dt < LOST * (np.median(dt[same]) if same.any() else 0.0))


def _jumps(trial: np.ndarray, rows: np.ndarray, size: np.ndarray) -> Jumps:
    here = np.bincount(rows, minlength=len(trial))
    between = 0
    for number in np.unique(trial[rows]):
        other = np.cumsum(here[trial == number]) % 2 == 1
        between += min(int(other.sum()), int((~other).sum()))
    return Jumps(rows, float(np.median(size)) if len(size) else 0.0, between / max(len(trial), 1))
