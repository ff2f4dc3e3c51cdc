"""Samples of pushes, the data of all learners: the robot's readings before and after each advance of 1 mm.

A sample is the tuple (z_t, z_{t+1}, a_t) = (`state`, `next_state`, `action`) of the thesis (section 5.4.3); a push is a
sequence of samples of one block.  State and next state are sensor readings, noise included.  Learners work in mm and N.
Angles become lengths through the block's radius of gyration, as in the thesis: yaw · r_g, r_g = 23 mm.

`truth` is the hidden label of the push; it is used for evaluation only, never for learning.
Source: N. Fazeli et al., Science Robotics 4, eaav3123 (2019), doi 10.1126/scirobotics.aav3123.
"""

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_table, write_table

MM = 1e3  # in a metre
RADIUS_OF_GYRATION = 23.0  # mm; thesis, figure 5-9
STATE = ("x", "y", "yaw", "f_n", "f_t", "advance", "tower")
X, Y, YAW, F_N, F_T, ADVANCE, TOWER = range(len(STATE))
ACTION = ("offset", "heading")
CONTEXT = ("layer", "side")
GROUPS = {"state": STATE, "action": ACTION, "next_state": STATE, "context": CONTEXT}  # of numbers in a sample
FREE, STUCK, UNKNOWN = 0, 1, -1
KINDS = {STUCK: "stuck", FREE: "easy"}  # names of pushes of such blocks

# Values outside these ranges cannot come from a push: the block has left the tower, or the tower has fallen.
RANGE = {
    "x": (-6.0, 75.0),  # mm: the block's length, of which at most three quarters are pushed
    "y": (-25.0, 25.0),  # mm: one width sideways
    "yaw": (-25.0, 25.0),  # mm: 62 degrees
    "f_n": (-1.0, 12.0),  # N: the whole tower weighs 8 N; the pusher's limit is lower
    "f_t": (-6.0, 6.0),  # N
    "advance": (-0.5, 75.0),  # mm: as x
    "tower": (-5.0, 25.0),  # mm: a block that moved by its own width means a tower that fell
    "offset": (-12.5, 12.5),  # mm: the end face is 25 mm wide
    "heading": (-1.0, 1.0),  # rad
    "layer": (0.0, 60.0),  # number of layers above
    "side": (0.0, 1.0),
}
# N; some blocks of a standing tower resist more (the weight of one layer alone gives 0.35 N of friction)
RESISTANCE = 0.5
ENOUGH = 100  # samples, of which at least one must reach that resistance


@dataclass(frozen=True)
class PushSamples:
    """Samples in order of collection.

    push: (n,) int, id of the push.  step: (n,) int, from 0 within the push.  state, next_state: (n, 7), mm and N, see
    `STATE`; x, y, yaw, tower and the arm's advance are displacements since the push began.  `state` is
    read before the advance, after any re-contact.  action: (n, 2), mm and rad, see `ACTION`.  context: (n, 2), layers
    above the block; 0 middle or 1 side block.  truth: (n,) int, `FREE`, `STUCK` or `UNKNOWN`.  tower, block: (n,) int,
    seed of the tower and number of the block.  UserError for arrays of unequal length or rows outside `RANGE`.
    """

    push: np.ndarray
    step: np.ndarray
    state: np.ndarray
    action: np.ndarray
    next_state: np.ndarray
    context: np.ndarray
    truth: np.ndarray
    tower: np.ndarray
    block: np.ndarray

    def __post_init__(self) -> None:
        n = len(self.push)
        for item in fields(self):
            value = np.asarray(getattr(self, item.name))
            value = value.astype(float if item.name in GROUPS else int)
            shape = (n, len(GROUPS[item.name])) if item.name in GROUPS else (n,)
            if value.shape != shape:
                raise UserError(f"samples: {item.name} has shape {value.shape}, expected {shape}.")
            object.__setattr__(self, item.name, value)
        if n:
            self._check_rows()

    def __len__(self) -> int:
        return len(self.push)

    def _check_rows(self) -> None:
        for part, names in GROUPS.items():
            values = getattr(self, part)
            low, high = np.array([RANGE[name] for name in names]).T
            bad = ~((values >= low) & (values <= high))  # also true for NaN
            if bad.any():
                row, column = np.argwhere(bad)[0]
                raise UserError(
                    f"samples: {part} {names[column]} = {values[row, column]:.4g} in row {row} (push {self.push[row]}, "
                    f"step {self.step[row]}) is outside {low[column]:g} to {high[column]:g}: the tower has fallen or "
                    "the block has left it. Leave that push out, or collect it again."
                )
        if not np.isin(self.truth, (FREE, STUCK, UNKNOWN)).all():
            raise UserError("samples: truth must be 0 (free), 1 (stuck) or -1 (unknown).")

    def check_resistance(self) -> None:
        """UserError if none of at least `ENOUGH` samples reaches `RESISTANCE`: an exploded tower gives forces of 0."""
        if len(self) >= ENOUGH and self.next_state[:, F_N].max() < RESISTANCE:
            raise UserError(
                f"samples: none of {len(self)} pushes of 1 mm met a resistance of {RESISTANCE} N; "
                "the tower has exploded or is missing. Check the tower's health and collect again."
            )

    def select(self, rows: np.ndarray) -> "PushSamples":
        """Return the samples of `rows` (indices or mask), in that order."""
        return replace(self, **{item.name: getattr(self, item.name)[rows] for item in fields(self)})

    def first(self, n: int) -> "PushSamples":
        """Return the first `n` samples collected; UserError if there are fewer."""
        if n > len(self):
            raise UserError(f"{n} samples are needed but only {len(self)} were collected; collect more.")
        return self.select(np.arange(n))


def join(parts: list[PushSamples]) -> PushSamples:
    """Concatenate samples, with pushes renumbered from 0; UserError if `parts` is empty."""
    if not parts:
        raise UserError("samples: nothing to join; collect from at least one tower.")
    numbered, start = [], 0
    for part in parts:
        _, push = np.unique(part.push, return_inverse=True)
        numbered.append(replace(part, push=push + start))
        start += push.max(initial=-1) + 1
    return PushSamples(
        **{item.name: np.concatenate([getattr(part, item.name) for part in numbered]) for item in fields(PushSamples)}
    )


_INTEGERS = ("push", "step", "tower", "block", "truth")
_COLUMNS = {group: [f"{group[0]}_{name}" for name in names] for group, names in GROUPS.items()}


def as_table(samples: PushSamples) -> pd.DataFrame:
    """Table with a row per sample: push, step, tower, block, s_*, a_*, n_*, c_*, truth."""
    table = {name: getattr(samples, name) for name in _INTEGERS[:-1]}
    for group, names in _COLUMNS.items():
        table |= dict(zip(names, getattr(samples, group).T))
    return pd.DataFrame(table | {"truth": samples.truth})


def write_samples(samples: PushSamples, path: str | Path) -> None:
    """Write samples to a CSV file.  Errors as in `PushSamples.check_resistance`."""
    samples.check_resistance()
    write_table(as_table(samples), path)


def read_samples(path: str | Path) -> PushSamples:
    """Read a file of `write_samples`.  Errors as in `read_table`, `PushSamples` and `PushSamples.check_resistance`."""
    columns = [*_INTEGERS, *(name for names in _COLUMNS.values() for name in names)]
    table = read_table(path, columns)
    groups = {group: table[names].to_numpy() for group, names in _COLUMNS.items()}
    samples = PushSamples(**{name: table[name].to_numpy() for name in _INTEGERS}, **groups)
    samples.check_resistance()
    return samples
