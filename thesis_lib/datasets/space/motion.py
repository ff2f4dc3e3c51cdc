"""The recorded motion of one body in space: times, positions, unit quaternions.

| on paper | in code      | unit  | shape  |                                                                       |
|----------|--------------|-------|--------|-----------------------------------------------------------------------|
| p        | `position`   | m     | (n, 3) | origin of the tracked frame, in the axes of the recording             |
| q        | `quaternion` | 1     | (n, 4) | (x, y, z, w), turns the body's axes into those of the recording       |
| ω        |              | rad/s | (n, 3) | angular velocity, in the axes of the recording                        |

A sample that the recording lacks is NaN.  A point (one marker, or a ball) has no orientation: its quaternions are the
identity.  Conventions that a recording does not state for certain (order of the quaternion, sequence of Euler angles)
are kept as `readings`: the same cells, read in another way, by the option that would do so.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solid_body import UNIT
from thesis_lib.foundation.errors import UserError

Readings = Mapping[str, Callable[[], np.ndarray]]
# of the longer steps in time: no camera takes two frames so close, and frames that arrive together are further apart
NEARLY = 1e-3


@dataclass(frozen=True, eq=False)
class Motion:
    """One body of one recording; arrays as above, `t` (n,) in s does not fall."""

    body: str
    source: str  # file, for messages
    t: np.ndarray
    position: np.ndarray
    quaternion: np.ndarray
    trial: np.ndarray | None = None  # text (n,), if the recording states to which release a sample belongs
    readings: Readings = field(default_factory=dict)  # option -> the quaternions (n, 4) that it would give
    oriented: bool = True  # False: a point
    row: np.ndarray | None = None  # (n,) in the file, for messages

    @classmethod
    def of_point(
        cls, body: str, source: str, t: np.ndarray, position: np.ndarray, trial: np.ndarray | None = None
    ) -> "Motion":
        """The motion of a point, whose orientation is not measured."""
        return cls(body, source, t, position, np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)), trial, oriented=False)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def seen(self) -> np.ndarray:
        """Mask (n,) of the samples with a time and a complete pose."""
        whole = np.isfinite(self.position).all(axis=1) & np.isfinite(self.quaternion).all(axis=1)
        return whole & np.isfinite(self.t)

    @property
    def placed(self) -> np.ndarray:
        """Mask (n,) of the samples with a time and a position; zeros without an orientation mark a lost body."""
        lost = ~self.position.any(axis=1) & ~np.isfinite(self.quaternion).all(axis=1)
        return np.isfinite(self.position).all(axis=1) & np.isfinite(self.t) & ~lost

    def part(self, chosen: np.ndarray) -> "Motion":
        """The motion of the samples `chosen` (mask or indices)."""
        trial, row = (None if one is None else one[chosen] for one in (self.trial, self.row))
        readings = {name: lambda read=read: read()[chosen] for name, read in self.readings.items()}
        arrays = self.t[chosen], self.position[chosen], self.quaternion[chosen]
        arrays = dict(zip(("t", "position", "quaternion"), arrays))
        return replace(self, **arrays, trial=trial, row=row, readings=readings)

    def distinct(self) -> "Motion":
        """The motion without samples that equal the one before in everything."""
        cells = np.column_stack([self.t, self.position, np.nan_to_num(self.quaternion)])
        equal = (cells[1:] == cells[:-1]).all(axis=1)
        if self.trial is not None:
            equal &= self.trial[1:] == self.trial[:-1]
        return self.part(np.r_[True, ~equal][: len(self)])


def unit(quaternion: np.ndarray, where: str) -> np.ndarray:
    """Quaternions (n, 4) of length 1; NaN for zeros, with which systems mark a lost orientation.

    UserError if they are not rotations (`where` names the file and the columns).
    """
    quaternion = np.where(quaternion.any(axis=1, keepdims=True), quaternion, np.nan)
    length = np.linalg.norm(quaternion, axis=1)
    with np.errstate(invalid="ignore"):
        wrong = np.abs(length - 1.0) > UNIT
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        raise UserError(
            f"{where}: a rotation has the length {length[first]:.4g}, but unit quaternions have 1 "
            f"({int(wrong.sum())} of {len(length)}). Check that these are the four columns of a quaternion."
        )
    return quaternion / length[:, None]


def conjugate(quaternion: np.ndarray) -> np.ndarray:
    """The inverse rotations (n, 4), as in a left-handed frame, or as of the world seen from the body."""
    return quaternion * [-1.0, -1.0, -1.0, 1.0]


def handed(motion: Motion, left: bool) -> Motion:
    """The motion with its rotations reversed if they are `left`-handed; the other handedness becomes a reading."""
    stated = {"": lambda: motion.quaternion} | dict(motion.readings)
    readings = {}
    for option, read in stated.items():
        for other in (False, True):
            words = f"{option} --left-handed".strip() if other else option or "no --left-handed"
            if option or other != left:
                readings[words] = (lambda read=read: conjugate(read())) if other else read
    return replace(motion, quaternion=conjugate(motion.quaternion) if left else motion.quaternion, readings=readings)


def mirrored(quaternion: np.ndarray, axis: int) -> np.ndarray:
    """The same rotations (n, 4) in a frame whose `axis` points the other way."""
    sign = np.array([-1.0, -1.0, -1.0, 1.0])
    sign[axis] = 1.0
    return quaternion * sign


def turning(quaternion: np.ndarray) -> np.ndarray:
    """Rotation vectors (n - 1, 3) in rad from each orientation (n, 4) to the next, in the axes of the recording."""
    whole = Rotation.from_quat(quaternion)
    return (whole[1:] * whole[:-1].inv()).as_rotvec()


def from_angles(sequence: str, angles: np.ndarray, degrees: bool) -> np.ndarray:
    """Quaternions (n, 4) of rotations (n, 3): about the body's own axes in a sequence such as XYZ, about fixed ones if
    the letters are small, or `helical`, the axis times the angle.  Rows with NaN stay NaN.
    """
    if sequence == "helical":
        return quaternions(angles, lambda rows: Rotation.from_rotvec(rows, degrees=degrees))
    return quaternions(angles, lambda rows: Rotation.from_euler(sequence, rows, degrees=degrees))


def quaternions(rotations: np.ndarray, read: Callable[[np.ndarray], Rotation]) -> np.ndarray:
    """Quaternions (n, 4) of `rotations` (n, ...), converted by `read`; NaN for those with NaN."""
    whole = np.isfinite(rotations).all(axis=tuple(range(1, rotations.ndim)))
    result = np.full((len(rotations), 4), np.nan)
    if whole.any():
        result[whole] = read(rotations[whole]).as_quat()
    return result


PAUSE = 10.0  # s between recordings that are joined: no motion continues across it


def join(motions: Sequence[Motion], placed: bool = False) -> tuple[Motion, np.ndarray]:
    """The seen samples of several recordings in sequence, as one motion, and the number (n,) of each sample's piece.

    `placed`: include samples with a position but no orientation, which is then NaN.
    A piece is a trial of a recording that names trials, else a whole recording; the motion keeps these names.
    UserError if time falls within a piece, or if no sample is complete.
    """
    pieces = _pieces(motions, placed)
    if len({piece.oriented for piece in pieces}) > 1:
        raise UserError("Some of the files have the orientation of the body, others do not; convert them separately.")
    if not any(piece.seen.any() for piece in pieces):
        raise UserError(f"{motions[0].source} contains no complete pose of {motions[0].body or 'the body'}.")
    if found := _first_step(pieces, lambda step: step < 0.0):
        where, at, count, named = found
        trials = "" if named else "; if several trials are in one file, name their column with --columns trial=…"
        raise UserError(f"{where}: time falls after {at:.6g} s (such rows: {count}). Sort the rows by time{trials}.")
    clock, times = 0.0, []
    for piece in pieces:
        times.append(piece.t - piece.t[0] + clock)
        clock = times[-1][-1] + PAUSE
    first = pieces[0]
    options = [option for option in first.readings if all(option in piece.readings for piece in pieces)]
    readings = {
        option: lambda option=option: np.concatenate([piece.readings[option]() for piece in pieces])
        for option in options
    }
    number = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    position = np.concatenate([piece.position for piece in pieces])
    quaternion = np.concatenate([piece.quaternion for piece in pieces])
    arrays = {"t": np.concatenate(times), "position": position, "quaternion": quaternion}
    names = [piece.trial for piece in pieces if piece.trial is not None]
    trial = np.concatenate(names) if len(names) == len(pieces) else None
    return replace(first, **arrays, trial=trial, row=None, readings=readings), number


def refuse_equal_times(motions: Sequence[Motion], placed: bool) -> None:
    """UserError if samples of a piece (as in `join`) have equal times, or nearly, but distinct poses."""
    if found := _first_step(_pieces(motions, placed), together):
        where, at, count, _ = found
        raise UserError(
            f"{where}: the time {at:.6g} s is that of the row before, or nearly, but the pose is another one (such "
            f"rows: {count}). Times of arrival are replaced by those of the frames, but the flights do not show that "
            "these are. Use the number of the frame (--columns t=NAME --rate HZ), or log the time with more digits. If "
            "no frame is missing, delete the column of the time, and give --rate HZ."
        )


def together(step: np.ndarray) -> np.ndarray:
    """Mask (n,) of steps in time (n,) that are 0, or far shorter than those of a camera."""
    return (step == 0.0) | (step < NEARLY * np.quantile(step, 0.9)) if len(step) else np.zeros(0, bool)


def _pieces(motions: Sequence[Motion], placed: bool) -> list[Motion]:
    """The seen samples of each trial of each recording, as in `join`."""
    pieces = []
    for motion in motions:
        labels = np.zeros(len(motion)) if motion.trial is None else motion.trial
        kept = motion.placed if placed else motion.seen
        pieces += [motion.part((labels == label) & kept) for label in dict.fromkeys(labels.tolist())]
    return [piece for piece in pieces if len(piece)]


def _first_step(
    pieces: Sequence[Motion], wrong: Callable[[np.ndarray], np.ndarray]
) -> tuple[str, float, int, bool] | None:
    """Place and time in s of the first sample after a `wrong` step in time, the number of such samples, and whether the
    place states a trial; None if no step is wrong."""
    found = [(piece, np.flatnonzero(wrong(np.diff(piece.t)))) for piece in pieces]
    for piece, before in found:
        if len(before):
            where = piece.source + ("" if piece.row is None else f", row {piece.row[before[0] + 1]}")
            where += "" if piece.trial is None else f", trial {piece.trial[0]}"
            count = sum(len(rows) for _, rows in found)
            return where, float(piece.t[before[0]]), count, piece.trial is not None
    return None
