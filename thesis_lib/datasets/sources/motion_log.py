"""A dataset from motions in space: one clock for all of them, then the plane of the motion, or space."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.samples.stamps import times_of_pictures
from thesis_lib.datasets.sources.conversion import Conversion
from thesis_lib.datasets.sources.kept_in_space import keep_in_space
from thesis_lib.datasets.sources.projected import project
from thesis_lib.datasets.sources.recorded import PART, Recorded, View, long_period
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, needs_no_angle
from thesis_lib.datasets.space.motion import Motion, handed, join
from thesis_lib.foundation.errors import UserError


def convert_motions(
    motions: Sequence[Motion], name: str, files: Sequence[str | Path], rig: RigOptions, view: View, notes: list[str]
) -> Conversion:
    """A dataset of trajectories from the motions of one body, one of each recording; adds to `notes`.

    The motion stays in space if the shape is one of space; else it is projected.  UserError if no free flight or no
    plane is found, rotations fit far better if they are read otherwise, or no drop is left.
    """
    samples = sum(map(len, motions))
    if not motions[0].oriented:
        needs_no_angle(rig.shape, motions[0].source)
    motion, piece = join([handed(motion, view.left_handed) for motion in motions], placed=rig.in_space)
    if len(motion) < samples:
        notes.append(f"{samples - len(motion)} of {samples} samples left out: the body was not seen")
    if unturned := int(np.sum(~motion.seen)):
        notes.append(
            f"{unturned} of {samples} samples have a position and no orientation: they stay as rows without one"
        )
    motion, piece = _at_exposure(motion, piece, rig.rate, notes)
    try:
        recorded = Recorded(motion, piece, name, files, rig, view, notes)
        return keep_in_space(recorded) if rig.in_space else project(recorded)
    except UserError as error:
        text = str(error)
        raise error if str(files[0]) in text or text.startswith("--") else UserError(f"{files[0]}: {text}") from None


def _at_exposure(motion: Motion, piece: np.ndarray, rate: float | None, notes: list[str]) -> tuple[Motion, np.ndarray]:
    """The motion at the times of its pictures where stamps are those of arrival, as for the trials of a dataset.

    A long recording is looked at in parts, for the lateness that is the same in all rows wanders.
    """
    first = np.flatnonzero(np.r_[True, np.diff(piece) != 0])
    row = np.arange(len(piece)) - np.repeat(first, np.diff(np.r_[first, len(piece)]))
    part = np.cumsum(row % PART == 0)
    samples = Samples(part, motion.t, motion.position, part)
    found = times_of_pictures(samples, rate or 1.0 / long_period(motion.t, piece), lengths=3)
    if found is None:
        return motion, piece
    sure, t, said = found
    notes.append(said)
    rises = t > np.maximum.accumulate(np.r_[-np.inf, t[:-1]])  # a part that has counted one too many runs into the next
    rows = np.flatnonzero(sure)[rises]
    return replace(motion.part(rows), t=t[rises]), piece[rows]
