"""Comparison of the figures' CSVs with small stored copies, column by column, within stated tolerances.

Each figure's record (`thesis_lib.thesis.records`) states the columns to compare and their tolerances.  A picture
without a record, a column without a tolerance, a missing CSV and a missing copy count as failures.

A number agrees if abs(ours − stored) ≤ abs + rel · abs(stored).  NaN agrees only with NaN, an infinity only with the
same infinity.  Rows are compared by position, and their number must not change.

Copies are at config/figures/<scale>/<dataset, or common>/<name>.csv.  Their first column, `row`, is the position in
the figure's CSV.  The last row is always kept, so that its position gives the number of rows.
"""

import fnmatch
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_cells, write_table
from thesis_lib.thesis.ledger.reading import number
from thesis_lib.thesis.records.record import Figure, Tolerance

NO_FIGURES = {  # pictures among the results, and the reason why they have no record
    "chapter2/hidden/*": "critiques of mechanisms; tests/critique checks their numbers",
    "critique/*": "critiques of drops; tests/critique checks their numbers and their bytes",
}
ROW = "row"  # column of a stored copy: position in the figure's CSV, from 0
COMMON = "common"  # folder of figures that do not belong to a dataset
AGREES, DIFFERS, NO_DATA, ERROR = "agrees", "differs", "data not present", "error"
REMEDY = "if this is intended: thesis-lib claims update"


def kept_rows(total: int, most: int) -> list[int]:
    """Positions of at most `most` evenly spaced rows out of `total`, including the first and the last."""
    if total <= most:
        return list(range(total))
    # integer form of linspace, without rounding of halves, which could differ between machines
    return [i * (total - 1) // (most - 1) for i in range(most)]


def store_figure(csv: str | Path, stored: str | Path, figure: Figure) -> None:
    """Write the thinned copy of a figure's CSV; UserError if it is missing or has invalid columns or cells."""
    cells = read_cells(csv)
    if problems := _form(cells, csv, figure):
        raise UserError(f"{csv} cannot be stored: " + "; ".join(problems))
    thinned = cells.iloc[kept_rows(len(cells), figure.most_rows)]
    write_table(thinned[_columns(figure)].rename_axis(ROW).reset_index(), stored)


def check_figure(csv: str | Path, stored: str | Path, figure: Figure) -> list[str]:
    """List the differences between a figure's CSV and its stored copy; UserError if one is missing or unreadable."""
    if not Path(stored).is_file():
        raise UserError(f"{stored} does not exist; store it: thesis-lib claims update")
    cells, copy = read_cells(csv), read_cells(stored)
    if problems := _form(cells, csv, figure) or _copy_form(copy, stored, figure):
        return problems
    copy = copy.set_index(copy.pop(ROW).astype(int))
    before, now = copy.index[-1] + 1, len(cells)
    if now != before:
        return [f"has {now} rows, the stored copy had {before}"]
    ours = cells.iloc[copy.index]
    found = {name: _compare_text(ours[name], copy[name]) for name in figure.text_columns}
    found |= {name: _compare_numbers(ours[name], copy[name], limit) for name, limit in figure.number_columns.items()}
    return [f"column {name}: {text}" for name, text in found.items() if text]


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
    """Store copies that are missing or no longer agree; return one line for each.

    Copies that agree are kept: this avoids noise in the history, and small drifts cannot accumulate unnoticed.
    UserError, and nothing is written, if some cannot be stored; the message lists all of these.
    """
    results_dir, stored_dir = Path(results_dir), Path(stored_dir)
    todo, refused = [], []
    for name, dataset, figure, csv in _compared(figures):
        copy = stored_dir / dataset / f"{name}.csv"
        status, finding = _check_one(results_dir / csv, copy, figure, dataset, present)
        if status not in (AGREES, NO_DATA):
            try:
                refused += _form(read_cells(results_dir / csv), results_dir / csv, figure)
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
        raise UserError(f"the run does not report on the dataset {dataset} (known: {known})")


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
            text = f"{path} has no record in thesis_lib/thesis/records (delete it if it is no longer needed)"
            rows.append((picture.stem, picture.parent.name, ERROR, text))
    return rows


def _unused_copies(stored_dir: Path, figures: Iterable[Figure]) -> list[tuple[str, str, str, str]]:
    used = {(dataset, name) for name, dataset, _, _ in _compared(figures)}
    return [
        (copy.stem, copy.parent.name, ERROR, f"{copy} does not belong to a figure: delete it")
        for copy in sorted(stored_dir.glob("*/*.csv"))
        if (copy.parent.name, copy.stem) not in used
    ]


def _form(cells: pd.DataFrame, path: str | Path, figure: Figure) -> list[str]:
    """List mistakes in a figure's CSV itself."""
    wanted = _columns(figure)
    problems = [f"column {name} is missing in {path}" for name in wanted if name not in cells.columns]
    extra = [name for name in cells.columns if name not in wanted]
    problems += [f"column {name} of {path} has no tolerance and is not a key" for name in extra]
    if cells.empty:
        problems.append(f"{path} has no rows")
    for name in () if problems else figure.number_columns:
        bad = [(i, cell) for i, cell in enumerate(cells[name]) if _number(cell) is None]
        if bad:
            problems.append(f"column {name} has {bad[0][1]!r} in row {bad[0][0]}, not a number (make it a key?)")
        elif cells[name].map(number).isna().all():
            problems.append(f"column {name} is NaN in every row")
    return problems


def _copy_form(copy: pd.DataFrame, path: str | Path, figure: Figure) -> list[str]:
    """List mistakes in a stored copy itself: wrong columns, text instead of numbers, or rows removed by hand."""
    wanted = [ROW, *_columns(figure)]
    if sorted(copy.columns) != sorted(wanted):
        mistake = f"has the columns {', '.join(copy.columns)} instead of {', '.join(wanted)}"
    elif any(_number(cell) is None for name in figure.number_columns for cell in copy[name]):
        mistake = "contains text instead of a number"
    else:
        positions = [int(cell) if cell.isdecimal() else -1 for cell in copy[ROW]]
        if positions and positions == kept_rows(positions[-1] + 1, figure.most_rows):
            return []
        mistake = "is not the evenly spaced copy that would be stored"
    return [f"{path} {mistake}; {REMEDY}"]


def _number(cell: str) -> float | None:
    try:
        return number(cell)
    except ValueError:
        return None


def _compare_text(ours: pd.Series, stored: pd.Series) -> str:
    bad = np.flatnonzero(ours != stored)
    if not len(bad):
        return ""
    first = bad[0]
    differs = f"row {stored.index[first]}: {ours.iloc[first]!r}, stored {stored.iloc[first]!r}"
    return f"{len(bad)} of {len(stored)} rows differ; {differs}"


def _compare_numbers(ours: pd.Series, stored: pd.Series, tolerance: Tolerance) -> str:
    a, b = ours.map(number).to_numpy(float), stored.map(number).to_numpy(float)
    bad = np.flatnonzero(~np.isclose(a, b, rtol=tolerance.rel, atol=tolerance.abs, equal_nan=True))
    if not len(bad):
        return ""
    with np.errstate(invalid="ignore"):  # infinity and NaN count as the largest difference
        allowed = tolerance.abs + tolerance.rel * np.abs(b)
        excess = np.nan_to_num(np.abs(a - b) - allowed, nan=np.inf)
    worst = bad[np.argmax(excess[bad])]
    return (
        f"{len(bad)} of {len(a)} rows differ; worst in row {stored.index[worst]}: {a[worst]:.6g}, "
        f"stored {b[worst]:.6g}, allowed ±{allowed[worst]:.2g}"
    )
