"""Times in s of the rows of a log: from its stamps, its dates, the numbers of its frames, or a rate."""

import re

import numpy as np
import pandas as pd

from thesis_lib.datasets.sources.tables.layout import NO_NUMBER
from thesis_lib.datasets.sources.tables.log_table import Log
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.wording import plural

SINCE_1970 = {"ns": 1e17, "us": 1e14, "ms": 1e11}  # larger stamps are in this unit; the present is 1.8e9 s
SECOND = (1.0, 1e3, 1e6, 1e9)  # in s, ms, us, ns
FALLS = 0.9  # of a second, by which the fraction of a second falls from one row to the next
FAR = 1e4  # usual steps of a trial; so long after its first row no trial goes on
DAY = 86400.0  # s
_CLOCK = r"\d{1,2}:[0-5]\d:[0-5]\d([.,]\d+)?"
_TIME_OF_DAY = re.compile(_CLOCK)
_DATE = re.compile(rf"\d{{4}}-\d\d-\d\d[T ]{_CLOCK}( ?(Z|[+-]\d\d:?\d\d))?")


def times(log: Log, options: Reading, trial: pd.Series, name: str, notes: list[str]) -> np.ndarray:
    """Times (n,) in s from column `name` (times, dates, or numbers of frames), or of evenly spaced rows.

    Adds to `notes`.  `trial` is text (n,).  UserError if neither the log nor `options` defines the times, or if the
    column holds only the fractions of seconds.
    """
    if not log.has(name):
        if options.rate is None:
            raise UserError(
                f"{log.path} has no time column: give --columns t=NAME, or --rate HZ for evenly spaced rows."
            )
        return _in_order(trial, options.rate)
    factor, t = 1.0, _since_first(log, name)
    if t is not None:
        notes.append(f"{name} is a date or a time of day: read as seconds since the first row")
    else:
        t, stated = log.times(name), log.unit(name)
        if "time" not in options.si.given and stated is None and _counts(t, trial):
            if options.rate is None:
                raise UserError(f"{log.where(name)} counts rows: give the frame rate, --rate HZ, or the unit of time.")
            notes.append(f"{name} counts frames; times follow from --rate {options.rate:g}")
            return t / options.rate
        if "time" not in options.si.given and stated is None:
            first = np.nanmax(log.numbers(name), initial=0.0)
            if unit := next((unit for unit, least in SINCE_1970.items() if first > least), None):
                raise UserError(f"{log.where(name)} counts {unit} since 1970 ({first:.4g}): give --units {unit}.")
        factor = options.si.to_si("t", stated, log.where(name))
        if unstamped := int(np.sum(zero := _unstamped(log.numbers(name), trial))):
            t = np.where(zero, np.nan, t)
            notes.append(f"{plural(unstamped, 'row')} left out, not stamped: the time is 0 among later ones")
    row, before, step = _steps(t, trial)
    if len(step) and not step.any():
        if options.rate is None:
            raise UserError(
                f"{log.where(name)}: all time stamps are equal ({log.text(name).iloc[row[0]].strip()[:40]}): name "
                "another column (--columns t=NAME), or give --rate HZ if the rows are evenly spaced."
            )
        notes.append(
            f"all time stamps of {name} are equal: the rows are taken in order, evenly spaced at --rate "
            f"{options.rate:g}; lost frames without a row would shift those after them"
        )
        return _in_order(trial, options.rate)
    _refuse_fractions(log, name, t, row, before, step)
    return factor * t


def _in_order(trial: pd.Series, rate: float) -> np.ndarray:
    """Times (n,) in s of rows that follow each other evenly in each trial."""
    return trial.groupby(trial, sort=False).cumcount().to_numpy() / rate


def _steps(t: np.ndarray, trial: pd.Series) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices (m,) of rows and of the rows before them with a time in the same trial, and the steps (m,) between."""
    there = np.flatnonzero(np.isfinite(t))
    label = pd.factorize(trial)[0][there]
    same = label[1:] == label[:-1]
    row, before = there[1:][same], there[:-1][same]
    return row, before, t[row] - t[before]


def _unstamped(stamp: np.ndarray, trial: pd.Series) -> np.ndarray:
    """Mask (n,) of rows with the stamp 0 that follow a later one of their trial, which does not fall without them, or
    are the first of their trial, by far."""
    label = pd.Series(pd.factorize(trial)[0])
    stamped = pd.Series(stamp).where(stamp != 0.0)
    before, after = (getattr(stamped.groupby(label), fill)().to_numpy() for fill in ("ffill", "bfill"))
    usual = stamped.dropna().groupby(label).diff().groupby(label).median().reindex(label).to_numpy()
    first = np.isnan(before) & (usual > 0.0) & (after > FAR * usual)
    return (stamp == 0.0) & ((before > 0.0) & ~(after < before) | first)


def _counts(t: np.ndarray, trial: pd.Series) -> bool:
    """Whether t (n,) counts frames: whole numbers that in most rows increase by one."""
    whole = t[np.isfinite(t)]
    step = np.diff(t)[(trial[1:].to_numpy() == trial[:-1].to_numpy()) & np.isfinite(np.diff(t))]
    return len(step) > 0 and bool(np.all(whole == np.rint(whole))) and float(np.median(step)) == 1.0


def _since_first(log: Log, name: str) -> np.ndarray | None:
    """Times (n,) in s since the first cell of a column of dates or times of day; None if its cells have no colon.

    UserError for cells in another form.
    """
    text = log.text(name).str.strip()
    there = ~text.str.fullmatch(NO_NUMBER).to_numpy(dtype=bool)
    cells = text[there]
    if not cells.str.contains(":", regex=False).any():
        return None
    form = next((form for form in (_TIME_OF_DAY, _DATE) if form.fullmatch(cells.iloc[0])), None)
    points = cells.str.replace(",", ".", regex=False)
    points = points.where(cells.str.fullmatch(form or "").to_numpy(dtype=bool))
    if form is _TIME_OF_DAY:
        since = pd.to_timedelta(points, errors="coerce")
    else:
        at = pd.to_datetime(points, format="ISO8601", utc=True, errors="coerce")
        since = at - at.iloc[0]
    seconds = (since / pd.Timedelta(seconds=1)).to_numpy(float)
    other = cells[np.isnan(seconds)]  # in another form, or of month 13
    if not len(other):
        result = np.full(len(text), np.nan)
        seconds = np.unwrap(seconds, period=DAY) if form is _TIME_OF_DAY else seconds  # across midnight
        result[there] = seconds - seconds[0]
        return result
    raise UserError(
        f"{log.where(name)}, row {other.index[0]}: '{other.iloc[0][:40]}' is not read as a time: convert date and time "
        "to seconds (2025-11-20 10:00:00.126 and 10:00:00.126 are read, if all rows have that form)."
    )


def _refuse_fractions(
    log: Log, name: str, t: np.ndarray, row: np.ndarray, before: np.ndarray, step: np.ndarray
) -> None:
    """UserError if t (n,) falls by a second once a second; arguments as from `_steps`."""
    falls = step < 0.0
    # trials that follow each other without a name begin at the same time, as does the first
    if falls.sum() < 2 or t[before].min() < 0.0 or (t[row[falls]] == t[before[0]]).all():
        return
    second = next((one for one in SECOND if t[before].max() < one and np.median(step[falls]) < -FALLS * one), None)
    if second is not None:
        whole = "t" if second == 1.0 else f"t / 1e{np.log10(second):.0f}"
        raise UserError(
            f"{log.where(name)}, row {log.cells.index[row[falls][0]]}: t falls by about {second:.7g} once a second "
            f"(such rows: {int(falls.sum())}), so it is the fraction of the second only, as nsecs of a ROS stamp. Add "
            f"the column with the seconds (secs + {whole}); do not sort the rows."
        )
