"""Problems of a dataset, and checks of the structure of its tables.

A `ValidationReport` collects all problems found in one reading; errors are raised together as one `DatasetError`,
warnings are kept with the dataset.  A "row" is a line of the file: the header of a CSV file is row 1, the first data
row is row 2.  Units and signs are checked in `datasets.checks`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import pandas as pd

from thesis_lib.bodies.solid_body import UNIT
from thesis_lib.datasets.format.impacts import COVARIANCE_COLUMNS, STATE, V_POST, V_PRE
from thesis_lib.datasets.format.samples import sampling_period
from thesis_lib.datasets.format.table_forms import (
    CONTACT_POINT,
    POSE_IN_SPACE,
    POSITION,
    QUATERNION,
    V_POST_IN_SPACE,
    V_PRE_IN_SPACE,
)
from thesis_lib.foundation.errors import UserError

T = TypeVar("T")
MIN_SAMPLES = 10  # two arcs of 5 samples, the fewest that determine a parabola and its covariance
RATE_TOLERANCE = 0.02  # clocks of cameras agree to 1e-4; 2 % is a typo, a wrong unit, or frames dropped
SLOWEST = 0.1  # s between samples; a bounce of a hand-sized body lasts a few tenths of a second
SHOWN = 4  # row numbers spelled out before "and n more"
SHOWN_PROBLEMS = 100  # problems that are listed; the rest is only counted
# a length this close to 1 is left unchanged, so that a written quaternion is read back exactly
EXACT = 4.0 * np.finfo(float).eps


@dataclass(frozen=True)
class Problem:
    """A fault: the file, the place in the file, what is wrong, and what to do about it."""

    file: str
    where: str
    what: str
    remedy: str

    def __str__(self) -> str:
        place = f"{self.file}, {self.where}" if self.where else self.file
        return f"{place}: {self.what}\n     -> {self.remedy}"


class DatasetError(UserError):
    """A dataset that cannot be used; `problems` lists all its faults."""

    def __init__(self, name: str, problems: Sequence[Problem]):
        self.name = name
        self.problems = list(problems)
        count = len(self.problems)
        lines = [f"The dataset {name} has {count} problem{'s' if count != 1 else ''}:"]
        lines += [f"{i:3d}. {problem}" for i, problem in enumerate(self.problems[:SHOWN_PROBLEMS], 1)]
        if count > SHOWN_PROBLEMS:
            lines.append(f"     ... and {count - SHOWN_PROBLEMS} more")
        super().__init__("\n".join(lines))


@dataclass
class ValidationReport:
    """Collects problems while a dataset is read."""

    errors: list[Problem] = field(default_factory=list)
    warnings: list[Problem] = field(default_factory=list)

    def error(self, file: str, where: str, what: str, remedy: str) -> None:
        self.errors.append(Problem(file, where, what, remedy))

    def warn(self, file: str, where: str, what: str, remedy: str) -> None:
        self.warnings.append(Problem(file, where, what, remedy))


@dataclass(frozen=True)
class UsableRows:
    """The usable rows of a file."""

    file: str  # its name
    data: pd.DataFrame  # the index counts all data rows of the file, unusable ones included
    first_row: int  # row number of index 0
    complete: bool  # False if unusable rows were removed: counts within a trial then mean nothing
    report: ValidationReport  # receives the problems

    def rows(self, mask: np.ndarray) -> str:
        """'row 7' or 'rows 7, 8, 9, 10 and 12 more' for a mask over `data`."""
        return row_text(self.data.index.to_numpy()[np.asarray(mask)] + self.first_row)

    def error(self, where: str, what: str, remedy: str, rows: np.ndarray | None = None) -> None:
        """Report an error at `where`; with a mask `rows` over `data`, only if it selects any."""
        if rows is None or np.any(rows):
            self.report.error(self.file, where if rows is None else f"{where}, {self.rows(rows)}", what, remedy)

    def warn(self, where: str, what: str, remedy: str, rows: np.ndarray | None = None) -> None:
        """Like `error`, for doubts that are not faults."""
        if rows is None or np.any(rows):
            self.report.warn(self.file, where if rows is None else f"{where}, {self.rows(rows)}", what, remedy)


def row_text(rows: Sequence[int] | np.ndarray) -> str:
    """Row numbers as text: 'row 7' or 'rows 7, 8, 9, 10 and 12 more'."""
    return f"row{'s' if len(rows) != 1 else ''} {first_of(rows)}"


def first_of(names: Sequence | np.ndarray, most: int = SHOWN, more: str = "more") -> str:
    """The first names or numbers as text, at most `most` of them: 'a, b and 12 more'."""
    return ", ".join(map(str, names[:most])) + (f" and {len(names) - most} {more}" if len(names) > most else "")


def read_checked(path: str | Path, content: str, read: Callable[[Path, str, ValidationReport], T | None]) -> T:
    """Result of `read(folder, name, report)` for the folder at `path`, whose name is used in results.

    Raises a DatasetError with all faults of the folder, or if there is no such folder (the message then asks for one
    with `content`), or if its name contains unprintable characters.
    """
    folder, report, result = Path(path), ValidationReport(), None
    try:
        name, is_folder, there = folder.resolve().name, folder.is_dir(), folder.exists()
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, an impossible file name
        what = f"cannot be opened ({getattr(error, 'strerror', None) or error})"
        raise DatasetError(folder.name, [Problem(str(path), "", what, "check the path")]) from error
    if not is_folder:
        what = "is a file, expected a folder" if there else "the folder does not exist"
        raise DatasetError(name, [Problem(str(path), "", what, f"give the folder that holds {content}")])
    if not name.isprintable():
        # the name is written into results: JSON and HTML need valid text, and a terminal obeys control characters
        what = f"the name {name!a} of the folder contains characters that do not print"
        raise DatasetError(ascii(name)[1:-1], [Problem(ascii(str(path)), "", what, "rename the folder")])
    try:
        result = read(folder, name, report)
    except OSError as error:
        report.error(str(path), "", f"cannot be read ({error.strerror or error})", "check the permissions of the files")
    if report.errors or result is None:
        raise DatasetError(name, report.errors)
    return result


def check_trajectories(table: UsableRows, rate: float | None) -> None:
    """Check the order, continuity and length of trials, their times, and the stated rate (Hz)."""
    trial, t = table.data["trial"].to_numpy(), table.data["t"].to_numpy(float)
    _check_contiguous(table, trial)

    same = np.zeros(len(t), dtype=bool)
    same[1:] = trial[1:] == trial[:-1]
    step = np.diff(t, prepend=t[0])
    remedy = "delete the duplicated samples, or log t with more digits"
    table.error("column t", "the time is the same as in the row before", remedy, same & (step == 0.0))
    remedy = "delete a row whose time is wrong, or sort each trial by t; give each release its own trial number"
    table.error("column t", "the time goes backwards within a trial", remedy, same & (step < 0.0))
    if table.complete:
        trials, count = np.unique(trial, return_counts=True)
        if np.any(short := count < MIN_SAMPLES):
            where = f"column trial, {row_text(trials[short]).replace('row', 'trial')}"
            what = f"fewer than {MIN_SAMPLES} samples in a trial (the shortest has {count.min()})"
            remedy = (
                "remove these trials, or log them at a higher rate: a fit on either side of an impact needs 5 samples"
            )
            table.error(where, what, remedy)
    _check_copies(table, [name for name in ("x", "y", "theta", *POSE_IN_SPACE[2:]) if name in table.data])
    if np.any(forward := same & (step > 0.0)):
        usual = float(np.median(step[forward]))
        _check_step(table, usual, rate)
        if rate is not None and usual <= SLOWEST:
            _check_rate(table, [sampling_period(t, trial, first) for first in (1, 4)], rate)
        what = "samples are missing before these rows (the time step is more than 1.5 times the usual one)"
        remedy = "none needed if frames were lost: only gaps of more than 8 steps cost impacts"
        table.warn("column t", what, remedy, same & (step > 1.5 * usual))


def _check_copies(table: UsableRows, columns: list[str]) -> None:
    """Report trials that equal another to the last digit: no release can be measured twice."""
    values = table.data[columns].to_numpy(float)
    still = np.ptp(values, axis=0) == 0.0
    # a channel that never changes was not measured, which is reported elsewhere; a body may turn about one axis alone
    if len(values) < 2 or any(still & [name not in QUATERNION for name in columns]):
        return
    trial = table.data["trial"].to_numpy()
    first: dict[bytes, int] = {}
    pairs = []
    for rows in np.split(np.arange(len(trial)), np.flatnonzero(np.diff(trial)) + 1):
        number = int(trial[rows[0]])
        original = first.setdefault(values[rows].tobytes(), number)
        if original != number:
            pairs.append((original, number))
    if not pairs:
        return
    shown = first_of([f"{a} and {b}" for a, b in pairs], more="more pairs")
    remedy = "keep one of each: copies could be both in the training and in the held-out part, and would count twice"
    table.error("column trial", f"trials {shown} contain the same measurements to the last digit", remedy)


def _check_step(table: UsableRows, step: float, rate: float | None) -> None:
    if step > SLOWEST:
        counted = step == round(step) and rate is not None and abs(step * rate / 1000.0 - 1.0) >= 0.1
        hint = "frame numbers" if counted else "milliseconds"
        what = f"the median time step is {step:.4g} s, too long to resolve a bounce; t looks like {hint}"
        table.error("column t", what, "give t in seconds")


def _check_rate(table: UsableRows, periods: Sequence[float], rate: float) -> None:
    """Compare the stated rate with the nearest of several estimates: many lost frames mislead one, bursts another."""
    period = min(periods, key=lambda period: abs(period * rate - 1.0))
    if abs(period * rate - 1.0) > RATE_TOLERANCE:
        what = f"the samples are {period:.4g} s apart ({1.0 / period:.4g} Hz), but dataset.yaml has rate: {rate:g} Hz"
        table.error("column t", what, "correct rate in dataset.yaml (or leave it out), or t if it is not in seconds")


def check_impacts(table: UsableRows) -> None:
    """Check the numbering of impacts, the order of trials, and the optional columns."""
    data = table.data
    trial, impact = data["trial"].to_numpy(), data["impact"].to_numpy()
    _check_contiguous(table, trial)

    duplicated = data.duplicated(["trial", "impact"]).to_numpy()
    what = "the same impact of the same trial occurs in an earlier row"
    remedy = "give each release its own trial number, or delete the copies"
    table.error("columns trial and impact", what, remedy, duplicated)
    if table.complete:
        # gaps are allowed: an impact that could not be measured is left out, and its number with it
        same = np.concatenate([[False], trial[1:] == trial[:-1]])
        falls = np.concatenate([[False], impact[1:] <= impact[:-1]]) & same
        bad = ((impact < 0) | falls) & ~np.isin(trial, trial[duplicated])
        if not np.any(impact == 0):
            bad |= True
        what = "within a trial, impact must count up from 0 (0, 1, 2, …) in order"
        remedy = "renumber it; with one impact per trial, trial counts up and impact is 0 throughout"
        table.error("column impact", what, remedy, bad)
    velocities = V_PRE_IN_SPACE + V_POST_IN_SPACE if "z" in data else V_PRE + V_POST
    _check_copies(table, list(velocities))
    _check_optional(table)


def _check_optional(table: UsableRows) -> None:
    data = table.data
    point = CONTACT_POINT if "z" in data else CONTACT_POINT[:2]
    there, lacking = ([name for name in point if (name in data) == given] for given in (True, False))
    if there and lacking:
        remedy = "give all coordinates of the contact point, or none (the shape and the orientation then determine it)"
        table.error(f"column {lacking[0]}", f"is missing although {there[0]} is given", remedy)
    lacking = [name for name in COVARIANCE_COLUMNS if name not in data]
    if 0 < len(lacking) < len(COVARIANCE_COLUMNS):
        present = len(COVARIANCE_COLUMNS) - len(lacking)
        what = f"only {present} of the {len(COVARIANCE_COLUMNS)} covariance columns are given"
        remedy = "give the whole lower triangle cov_<a>_<b>, or none of it"
        table.error(f"column {first_of(lacking, 1)}", what, remedy)
    for name in (f"cov_{state}_{state}" for state in STATE):
        if name in data:
            negative = data[name].to_numpy(float) < 0.0
            table.error(f"column {name}", "a variance is negative", "give variances of at least 0", negative)
    if "t" in data and table.complete:
        known = data[np.isfinite(data["t"].to_numpy(float))]
        step = known.groupby("trial", sort=False)["t"].diff().to_numpy(float)
        what = "an impact is not later than the one before it in the same trial"
        late = data.index.isin(known.index[step <= 0.0])
        table.error("column t", what, "order the impacts of a trial by time", late)


def _check_contiguous(table: UsableRows, trial: np.ndarray) -> None:
    starts = np.flatnonzero(np.diff(trial, prepend=trial[0] - 1) != 0)
    _, first = np.unique(trial[starts], return_index=True)
    again = np.zeros(len(trial), dtype=bool)
    again[np.delete(starts, first)] = True
    remedy = "keep the rows of a trial together, and give each release its own trial number"
    table.error("column trial", "a trial begins again after rows of another trial", remedy, again)


def whole_poses(table: UsableRows) -> UsableRows:
    """The rows with a position; quaternions (scalar first) get length 1 and a unique sign, and NaN if missing.

    A row may have a position only; rows without one are lost frames and are dropped.  Incomplete poses, and
    quaternions that are not rotations, are reported.
    """
    if lacking := [name for name in QUATERNION if name not in table.data]:
        if len(lacking) < len(QUATERNION):
            remedy = "give all of qw, qx, qy, qz, or none of them"
            table.error(f"column{'s' * (len(lacking) > 1)} {', '.join(lacking)}", "missing", remedy)
        data = table.data.drop(columns=list(QUATERNION), errors="ignore").assign(**dict.fromkeys(QUATERNION, np.nan))
    else:
        data = table.data
    place, q = data[list(POSITION)].to_numpy(float), data[list(QUATERNION)].to_numpy(float)
    placed, turned = np.isfinite(place).sum(axis=1), np.isfinite(q).sum(axis=1)
    lost = "leave all of them empty where the pose was lost, or remove the row"
    table.error("columns x, y, z", "only some of them are given", lost, (placed > 0) & (placed < 3))
    table.error("columns qw, qx, qy, qz", "only some of them are given", lost, (turned > 0) & (turned < 4))
    remedy = "give x, y and z, too, or remove the rows"
    table.error("columns x, y, z", "there is an orientation without a position", remedy, (placed == 0) & (turned == 4))
    length = np.linalg.norm(q, axis=1)
    with np.errstate(invalid="ignore"):
        wrong = np.abs(length - 1.0) > UNIT
    if wrong.any():
        what = f"the length of the quaternion is {length[wrong][0]:.4g}; that of a rotation is 1"
        remedy = "check that these are the four columns of a quaternion, with the scalar in qw"
        table.error("columns qw, qx, qy, qz", what, remedy, wrong)
    data = data.assign(**dict(zip(QUATERNION, of_one_sign(q).T)))
    seen = placed == 3
    if not seen.any() and table.complete:
        table.error("columns x, y, z", "no row has a position", "write the positions, or delete the file")
    return replace(table, data=data[seen])


def of_one_sign(q: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) scaled to length 1, with the sign that makes the first nonzero component positive."""
    length = np.linalg.norm(q, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        unit = np.where((np.abs(length - 1.0) > EXACT)[:, None], q / length[:, None], q)
        first = np.take_along_axis(unit, (unit != 0.0).argmax(axis=1)[:, None], axis=1)
        return np.where(np.isnan(unit), np.nan, np.where(first < 0.0, -unit, unit) + 0.0)
