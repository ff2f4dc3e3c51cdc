"""Whole tosses of a recording, for effects that depend on the motion so far: first touches, integrated rotations.

Shared by effects; not an effect itself.  A tracker that integrates rates times 1 + s from the first frame on reports

    R_k = exp(φ_k) R_{k−1};   true is R'_k = exp(φ_k / (1 + s)) R'_{k−1},   so R_k = E_k R'_k,   E_0 = 1

| on paper | in code | unit | shape   |                                                            |
|----------|---------|------|---------|------------------------------------------------------------|
| φ_k      | `turn`  | rad  | (3, N)  | reported rotation since the last frame, axes of the surface |
| E_k      |         | 1    | (4, N)  | quaternion from the true to the reported attitude          |
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from thesis_lib.mechanics.space import SPACE, multiplied, of_rotation_vector
from thesis_lib.mechanics.state import State

KEPT = 32  # scales whose integrated rotations are kept
LATER = 0.03  # s: later touches within this time belong to the first hit


@dataclass(frozen=True, eq=False)
class WholeTosses:
    """The frames of all tosses, by trial and time.

    Attributes:
        trial, t: (N,) trial and time of each frame; t in s from the first frame of its trial.
        turn: (3, N) as in the module's table, 0 at first frames.
        touched: (m,) time in s of the first touch of each trial, infinite if there is none.
    """

    trial: np.ndarray
    t: np.ndarray
    turn: np.ndarray
    touched: np.ndarray

    @classmethod
    def of(cls, frames: State, trial: np.ndarray, t: np.ndarray) -> "WholeTosses":
        """Whole tosses from frames by trial and time and from the trials and times (k,) in s of the observed hits."""
        first = np.r_[True, frames.trial[1:] != frames.trial[:-1]]
        turn = np.zeros((3, len(frames)))
        turn[:, 1:] = SPACE.turn_between(frames.attitude[:, :-1], frames.attitude[:, 1:])
        turn[:, first] = 0.0
        since = frames.t - frames.t[first][np.cumsum(first) - 1]
        touched = [np.min(t[trial == one], initial=np.inf) for one in frames.trial[first]]
        return cls(frames.trial, since, turn, np.array(touched))

    def is_later(self, state: State) -> np.ndarray:
        """Whether each hit (n,) is a later one of its toss, not the first; false in trials that were not recorded."""
        known = np.unique(self.trial)
        at = np.clip(np.searchsorted(known, state.trial), 0, len(known) - 1)
        return state.t > np.where(known[at] == state.trial, self.touched[at], np.inf) + LATER

    @cached_property
    def _in_one_row(self) -> tuple[np.ndarray, float, np.ndarray]:
        """Trial numbers, time in s allotted to each trial, and times (N,) of all frames, one trial after another."""
        known, length = np.unique(self.trial), float(np.max(self.t, initial=0.0)) + 1.0
        return known, length, np.clip(np.searchsorted(known, self.trial), 0, len(known) - 1) * length + self.t

    def over(self, state: State, scale: float) -> np.ndarray:
        """E (4, n) at the times of the states, if rates are reported times 1 + `scale`; 1 if not recorded."""
        E, (known, length, row) = _summed(self, float(scale)), self._in_one_row
        of = np.searchsorted(known, state.trial)
        at = of * length + np.clip(state.t, 0.0, length - 1.0)
        last = np.clip(np.searchsorted(row, at, side="right") - 1, 0, len(row) - 1)
        after = np.minimum(last + 1, len(row) - 1)
        same = self.trial[after] == self.trial[last]
        share = np.where(same & (after > last), (at - row[last]) / np.maximum(row[after] - row[last], 1e-12), 0.0)
        mixed = E[:, last] * (1.0 - share) + np.where(same, E[:, after], 0.0) * share
        found = (of < len(known)) & np.isfinite(state.t)
        found &= known[np.minimum(of, len(known) - 1)] == state.trial
        mixed = np.where(found, mixed, np.array([[1.0], [0.0], [0.0], [0.0]]))
        return mixed / np.sqrt((mixed**2).sum(axis=0))


@lru_cache(maxsize=KEPT)
def _summed(recorded: WholeTosses, scale: float) -> np.ndarray:
    """E (4, N) at all frames."""
    first = np.flatnonzero(np.r_[True, recorded.trial[1:] != recorded.trial[:-1]])
    lengths = np.diff(np.r_[first, len(recorded.trial)])
    there, back = (of_rotation_vector(factor * recorded.turn) for factor in (1.0, -1.0 / (1.0 + scale)))
    E = np.zeros((4, len(recorded.trial)))
    E[0, first] = 1.0
    for k in range(1, int(lengths.max(initial=0))):  # all trials at once
        rows = first[lengths > k] + k
        E[:, rows] = multiplied(there[:, rows], multiplied(E[:, rows - 1], back[:, rows]))
    return E
