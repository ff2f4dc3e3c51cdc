"""Figures' CSVs against small stored copies, column by column within stated tolerances.

Each figure's record (`thesis_lib.records`) states the columns to compare and their tolerances.  A picture without a
record, a column without a tolerance, a missing CSV and a missing copy are failures.

A number agrees if abs(ours − stored) ≤ abs + rel · abs(stored).  NaN agrees only with NaN, an infinity only with the
same infinity.  Rows are compared by position, and their number must not change.

Copies are at config/figures/<scale>/<dataset, or common>/<name>.csv.  Their first column, `row`, is the position in
the figure's CSV.  The last row is always kept, so that its position gives the number of rows.
"""

import fnmatch
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table
from thesis_lib.ledger.reading import Cells, number
from thesis_lib.records.record import Figure, Tolerance

SCALES = ("quick", "default")  # scales with stored copies; others are not compared
NO_FIGURES = {  # pictures among the results, and why they have no record
    "chapter2/hidden/*": "critiques of mechanisms; tests/critique checks their numbers",
    "critique/*": "critiques of drops; tests/critique checks their numbers and their bytes",
}
ROW = "row"  # column of a stored copy: position in the figure's CSV, from 0
COMMON = "common"  # folder of the figures that belong to no dataset
AGREES, DIFFERS, NO_DATA, ERROR = "agrees", "differs", "data not present", "error"
REMEDY = "if this is intended: python -m thesis_lib claims update"


def kept_rows(total: int, most: int) -> list[int]:
    """Positions of at most `most` evenly spaced rows out of `total`, including the first and the last."""
    if total <= most:
        return list(range(total))
    # the integer form of linspace: no rounding of halves that could differ between machines
    return [i * (total - 1) // (most - 1) for i in range(most)]


def store_figure(csv: str | Path, stored: str | Path, figure: Figure) -> None:
    """Write the thinned copy of a figure's CSV; UserError if it is missing or has columns or cells to be refused."""
    cells = Cells.read(csv)
    if problems := _form(cells, figure):
        raise UserError(f"{csv} cannot be stored: " + "; ".join(problems))
    rows = kept_rows(len(cells.rows), figure.most_rows)
    table = pd.DataFrame({ROW: rows})
    for name in _columns(figure):
        column = cells.column(name)
        table[name] = pd.Series([column[i] for i in rows], dtype=object)
    write_table(table, stored)


def check_figure(csv: str | Path, stored: str | Path, figure: Figure) -> list[str]:
    """Differences between a figure's CSV and its stored copy; UserError if one is missing or cannot be read."""
    if not Path(stored).is_file():
        raise UserError(f"{stored} does not exist; store it: python -m thesis_lib claims update")
    cells, copy = Cells.read(csv), Cells.read(stored)
    if problems := _form(cells, figure) or _copy_form(copy, figure):
        return problems
    positions = [int(cell) for cell in copy.column(ROW)]
    before, now = positions[-1] + 1, len(cells.rows)
    if now != before:
        return [f"has {now} rows, the stored copy had {before}"]
    pairs = {name: ([cells.column(name)[i] for i in positions], copy.column(name)) for name in _columns(figure)}
    found = [_compare_text(*pairs[name], positions) for name in figure.text_columns]
    found += [_compare_numbers(*pairs[name], positions, limit) for name, limit in figure.number_columns.items()]
    return [f"column {name}: {text}" for name, text in zip(_columns(figure), found) if text]


def check_figures(
    results_dir: str | Path, stored_dir: str | Path, figures: Sequence[Figure], present: Mapping[str, bool]
) -> pd.DataFrame:
    """Compare every figure with its stored copy; `present`: whether this run had each dataset.

    Returns a row for each figure and dataset, sorted by name: figure, dataset, status (agrees, differs, error, or data
    not present), finding.  Pictures without a record and unused copies are rows of status error.
    """
    results_dir, stored_dir = Path(results_dir), Path(stored_dir)
    rows = []
    for name, dataset, figure, csv in _compared(figures):
        status, finding = _check_one(results_dir / csv, stored_dir / dataset / f"{name}.csv", figure, dataset, present)
        rows.append((name, dataset, status, finding))
    rows += _unknown_pictures(results_dir, figures) + _unused_copies(stored_dir, figures)
    table = pd.DataFrame(rows, columns=["figure", "dataset", "status", "finding"], dtype=object)
    return table.sort_values(["figure", "dataset"], kind="stable", ignore_index=True)


def update_figures(
    results_dir: str | Path, stored_dir: str | Path, figures: Sequence[Figure], present: Mapping[str, bool]
) -> list[str]:
    """Store the copies that are missing or no longer agree; return one line for each.

    Copies that agree stay: this avoids noise in the history, and small drifts cannot add up unseen.  UserError, and
    nothing is written, if some cannot be stored; all of these are listed.
    """
    results_dir, stored_dir = Path(results_dir), Path(stored_dir)
    todo, refused = [], []
    for name, dataset, figure, csv in _compared(figures):
        copy = stored_dir / dataset / f"{name}.csv"
        status, finding = _check_one(results_dir / csv, copy, figure, dataset, present)
        if status not in (AGREES, NO_DATA):
            try:
                refused += _form(Cells.read(results_dir / csv), figure)
                _known(dataset, present)
                todo.append((results_dir / csv, copy, figure, finding if copy.is_file() else "new"))
            except UserError as error:
                refused.append(str(error))
    if refused:
        raise UserError("No figure was stored:\n" + "\n".join(f"- {text}" for text in refused))
    for csv, copy, figure, _ in todo:
        store_figure(csv, copy, figure)
    return [f"{copy}: {why}" for _, copy, _, why in todo]


def _compared(figures: Iterable[Figure]) -> list[tuple[str, str, Figure, str]]:
    """Name, dataset, record and CSV (relative to the results) of each comparison."""
    return [
        (figure.name, dataset or COMMON, figure, str(Path(path).with_suffix(".csv")))
        for figure in figures
        if not figure.not_compared
        for dataset, path in figure.files.items()
    ]


def _columns(figure: Figure) -> list[str]:
    return [*figure.text_columns, *figure.number_columns]


def _known(dataset: str, present: Mapping[str, bool]) -> None:
    if dataset != COMMON and dataset not in present:
        known = ", ".join(sorted(present)) or "none"
        raise UserError(f"the run reports nothing about the dataset {dataset} (known: {known})")


def _check_one(csv: Path, stored: Path, figure: Figure, dataset: str, present: Mapping[str, bool]) -> tuple[str, str]:
    try:
        _known(dataset, present)
        if dataset != COMMON and not present[dataset]:
            return NO_DATA, f"needs the dataset {dataset}"
        problems = check_figure(csv, stored, figure)
    except UserError as error:
        return ERROR, str(error)
    return (DIFFERS, "; ".join(problems)) if problems else (AGREES, "")


def _unknown_pictures(results_dir: Path, figures: Iterable[Figure]) -> list[tuple[str, str, str, str]]:
    known = {path for figure in figures for path in figure.files.values()}
    rows = []
    for picture in sorted(results_dir.rglob("*.png")):
        path = picture.relative_to(results_dir).as_posix()
        if path not in known and not any(fnmatch.fnmatch(path, pattern) for pattern in NO_FIGURES):
            text = f"{path} has no record in thesis_lib/records (delete it if it is left over)"
            rows.append((picture.stem, picture.parent.name, ERROR, text))
    return rows


def _unused_copies(stored_dir: Path, figures: Iterable[Figure]) -> list[tuple[str, str, str, str]]:
    used = {(dataset, name) for name, dataset, _, _ in _compared(figures)}
    return [
        (copy.stem, copy.parent.name, ERROR, f"{copy} belongs to no figure: delete it")
        for copy in sorted(stored_dir.glob("*/*.csv"))
        if (copy.parent.name, copy.stem) not in used
    ]


def _form(cells: Cells, figure: Figure) -> list[str]:
    """Mistakes in a figure's CSV itself."""
    wanted, path = _columns(figure), cells.path
    problems = [f"column {name} is missing in {path}" for name in wanted if name not in cells.columns]
    extra = [name for name in cells.columns if name not in wanted]
    problems += [f"column {name} of {path} has no tolerance and is no key" for name in extra]
    if not cells.rows:
        problems.append(f"{path} has no rows")
    for name in () if problems else figure.number_columns:
        column = cells.column(name)
        bad = [i for i, cell in enumerate(column) if _number(cell) is None]
        if bad:
            problems.append(f"column {name} holds {column[bad[0]]!r} in row {bad[0]}, no number (make it a key?)")
        elif all(math.isnan(number(cell)) for cell in column):
            problems.append(f"column {name} is NaN in every row")
    return problems


def _copy_form(copy: Cells, figure: Figure) -> list[str]:
    """Mistakes in a stored copy itself: wrong columns, text for numbers, or rows removed by hand."""
    wanted = [ROW, *_columns(figure)]
    if sorted(copy.columns) != sorted(wanted):
        mistake = f"has the columns {', '.join(copy.columns)} instead of {', '.join(wanted)}"
    elif any(_number(cell) is None for name in figure.number_columns for cell in copy.column(name)):
        mistake = "holds text where a number is wanted"
    else:
        positions = copy.column(ROW)
        whole = positions and all(cell.isdecimal() for cell in positions)
        if whole and list(map(int, positions)) == kept_rows(int(positions[-1]) + 1, figure.most_rows):
            return []
        mistake = "is not the evenly spaced copy that would be stored"
    return [f"{copy.path} {mistake}; {REMEDY}"]


def _number(cell: str) -> float | None:
    try:
        return number(cell)
    except ValueError:
        return None


def _compare_text(ours: list[str], stored: list[str], positions: list[int]) -> str:
    bad = [difference for difference in zip(positions, ours, stored) if difference[1] != difference[2]]
    if not bad:
        return ""
    row, now, before = bad[0]
    return f"{len(bad)} of {len(stored)} rows differ; row {row}: {now!r}, stored {before!r}"


def _compare_numbers(ours: list[str], stored: list[str], positions: list[int], tolerance: Tolerance) -> str:
    a, b = np.array(list(map(number, ours))), np.array(list(map(number, stored)))
    same = (a == b) | (np.isnan(a) & np.isnan(b))  # an infinity or NaN agrees only with itself
    with np.errstate(invalid="ignore"):
        # finite: otherwise an infinite stored value would allow everything
        allowed = tolerance.abs + tolerance.rel * np.abs(b)
        difference = np.abs(a - b)
        finite = np.isfinite(a) & np.isfinite(b)
        near = finite & (difference <= allowed)
        excess = np.where(finite, difference - allowed, np.inf)
    bad = np.flatnonzero(~(same | near))
    if not len(bad):
        return ""
    worst = bad[np.argmax(excess[bad])]
    return (
        f"{len(bad)} of {len(a)} rows differ; worst in row {positions[worst]}: {a[worst]:.6g}, "
        f"stored {b[worst]:.6g}, allowed ±{allowed[worst]:.2g}"
    )
