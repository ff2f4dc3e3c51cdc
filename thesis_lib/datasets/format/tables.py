"""Read trajectories and impacts from CSV or Parquet, and report the rows that cannot be read.

A "row" is a line of the file.  Unusable rows are reported and left out of later checks, so that one reading finds all
faults.
"""

import csv
import os
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.table_forms import TableForm
from thesis_lib.datasets.format.validate import SHOWN, UsableRows, ValidationReport, row_text
from thesis_lib.foundation.errors import first_line, suggest
from thesis_lib.foundation.regular_file import FileProblem, regular_size

MAX_BYTES = 2_000_000_000  # 25 million samples; as arrays they take half of a 4 GB machine
MAX_VALUES = 250_000_000  # cells of 8 bytes in memory: Parquet and rows of bare commas are far smaller on disk
MAX_BAD_ROWS = 100_000  # a file with more of them is not a table
MAX_COLUMNS = 1000
MAX_HEADER = 100_000  # characters in the header line; the widest table here has 60 columns
LARGEST = {"t": 1e12, None: 1e9}  # epoch times in microseconds pass; no SI value of a drop comes near 1e9
INTEGERS = ("trial", "impact")
LARGEST_INTEGER = 2**53  # larger integers lose digits in CSV readers that use floats
TEXT = ("flags",)


class _NoTable(Exception):
    """A file contains no table; the arguments are the place, the fault and the remedy."""


def load_table(folder: Path, stem: str, form: TableForm, report: ValidationReport) -> UsableRows | None:
    """The usable rows of `<stem>.csv` or `<stem>.parquet`, or None; problems go to `report`."""
    paths = [path for path in (folder / f"{stem}.csv", folder / f"{stem}.parquet") if os.path.lexists(path)]
    if not paths:
        return None
    if len(paths) == 2:
        what = f"{stem}.parquet exists, too, so it is unclear which one to read"
        report.error(f"{stem}.csv", "", what, "delete one of the two")
    path = paths[0]
    try:
        if regular_size(path, MAX_BYTES, folder) == 0:
            raise _NoTable("", "is empty", "write the header line and the rows, or delete the file")
        frame, ragged = (_read_csv if path.suffix == ".csv" else _read_parquet)(path, report)
    except FileProblem as problem:
        report.error(path.name, "", problem.what, "replace it by a regular file with the table, or delete it")
        return None
    except _NoTable as problem:
        report.error(path.name, *problem.args)
        return None
    return table_of(path.name, frame, ragged, form, report)


def _read_csv(path: Path, report: ValidationReport) -> tuple[pd.DataFrame, np.ndarray]:
    """Cells of a CSV file, and the mask (n,) of the rows that are empty, too short or too long."""
    again = "export it again as CSV in UTF-8"
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            head = file.readline(MAX_HEADER)
        names = [name.strip() for name in next(csv.reader([head], skipinitialspace=True, strict=True), [])]
    except (UnicodeDecodeError, csv.Error) as error:
        where = "row 1" if isinstance(error, csv.Error) else ""
        raise _NoTable(where, f"is not CSV text ({error})", again) from error
    if "\x00" in head or not any(names):
        raise _NoTable("row 1", "is not a header line of CSV text", again)
    if len(names) == 1 and (other := next((mark for mark in ";\t|" if mark in head), None)):
        shown = "tabs" if other == "\t" else f"'{other}'"
        remedy = "export with commas and decimal points (or use the init command with --delimiter)"
        raise _NoTable("row 1", f"columns are separated by {shown}, expected commas", remedy)
    if all(_is_number(name) for name in names):
        raise _NoTable("row 1", "holds numbers, expected the column names", "put the column names in the first line")
    if len(names) > MAX_COLUMNS:
        what = f"has {len(names):,} columns; the limit is {MAX_COLUMNS:,}"
        raise _NoTable("row 1", what, "keep the columns of the documented format")
    if repeated := sorted(name for name, count in Counter(names).items() if count > 1):
        where = f"column {', '.join(repeated)}"
        raise _NoTable(where, "the name occurs more than once in row 1", "keep one of them")
    try:
        bad_rows, rows = _ragged(path, len(names), report)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.ParserWarning)  # _ragged reports long rows
            frame = pd.read_csv(
                path,
                header=None,
                names=names,
                skiprows=1,
                index_col=False,
                skip_blank_lines=False,  # so that the index counts lines
                skipinitialspace=True,
                low_memory=False,
                encoding="utf-8-sig",
                nrows=rows,
            )
    except (ValueError, csv.Error, pd.errors.ParserError, pd.errors.EmptyDataError, OverflowError) as error:
        raise _NoTable("", f"cannot be read as CSV ({first_line(error)})", again) from error
    ragged = np.zeros(len(frame), dtype=bool)
    ragged[bad_rows[bad_rows < len(frame)]] = True
    return frame, ragged


def _ragged(path: Path, width: int, report: ValidationReport) -> tuple[np.ndarray, int]:
    """Index of the data rows with too few or too many cells, and the number of rows before the final blank ones."""
    bad, cells, blank = [], [], []
    last = -1
    with path.open("rb") as file:
        next(file)
        for i, line in enumerate(file):
            count = line.count(b",") + 1
            if b'"' in line:
                count = len(next(csv.reader([line.decode("utf-8")], skipinitialspace=True), []))
            if len(bad) + len(blank) > MAX_BAD_ROWS:
                raise ValueError(f"more than {MAX_BAD_ROWS:,} rows are empty or have a wrong number of cells")
            if i * width > MAX_VALUES:
                raise ValueError(f"more than {MAX_VALUES:,} cells")
            if not line.strip():
                blank.append(i)
                continue
            last = i
            if count != width:
                bad.append(i)
                cells.append(count)
            complete = line.endswith((b"\n", b"\r"))
    rows = last + 1
    if rows and not complete and (last not in bad):
        what = "the last row does not end with a line break: its last number may have been cut off"
        remedy = "check that the file is whole, and end it with a line break"
        report.warn(path.name, row_text([last + 2]), what, remedy)
    if blank := [i for i in blank if i < rows]:
        report.error(path.name, row_text(np.array(blank) + 2), "the row is empty", "delete empty lines")
    if bad:
        what = f"{', '.join(str(count) for count in cells[:SHOWN])} cells instead of {width}"
        if bad[-1] == last and cells[-1] < width:
            what += " (the last row: the file may have been cut off)"
        remedy = "give each row one cell for each column; write decimal points, not commas"
        report.error(path.name, row_text(np.array(bad) + 2), what, remedy)
    return np.array(bad + blank, dtype=int), rows


def _read_parquet(path: Path, report: ValidationReport) -> tuple[pd.DataFrame, np.ndarray]:
    """Cells of a Parquet file, whose rows all have the same length."""
    import pyarrow.parquet

    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            meta = file.metadata
            if meta.num_columns > MAX_COLUMNS:
                raise ValueError(f"{meta.num_columns:,} columns; the limit is {MAX_COLUMNS:,}")
            if meta.num_rows * meta.num_columns > MAX_VALUES:
                what = f"states {meta.num_rows:,} rows of {meta.num_columns} columns; the limit is {MAX_VALUES:,} cells"
                raise _NoTable("", what, "split the dataset into several folders")
            size = sum(meta.row_group(i).total_byte_size for i in range(meta.num_row_groups))
            if size > MAX_BYTES:
                raise ValueError(f"it states {size:,} bytes; the limit is {MAX_BYTES:,}")
            if nested := [kind.name for kind in file.schema_arrow if pyarrow.types.is_nested(kind.type)]:
                raise ValueError(f"column {nested[0]} holds lists, expected numbers")
            frame = file.read().to_pandas(ignore_metadata=True)
    except _NoTable:
        raise
    except Exception as error:  # the library raises many kinds of errors for a broken file
        raise _NoTable("", f"cannot be read as Parquet ({first_line(error)})", "write it again, or use CSV") from error
    frame.columns = [str(name) for name in frame.columns]
    if len(set(frame.columns)) < len(frame.columns):
        raise _NoTable("", "column names occur more than once", "keep one of each")
    return frame, np.zeros(len(frame), dtype=bool)


def _check_columns(file: str, names: Sequence[str], form: TableForm, report: ValidationReport) -> bool:
    """Report missing and unknown columns; return whether all required columns are present."""
    missing = [name for name in form.required if name not in names]
    unknown = [name for name in names if name not in form.required and name not in form.optional]
    if foreign := [name for name in unknown if name.lower() in form.foreign]:
        report.error(file, _columns(foreign), form.what, form.remedy)
    candidates = missing + [name for name in form.optional if name not in names]
    for name in unknown:
        if name in foreign:
            continue
        hint = suggest(name.lower() if name.lower() in candidates else name, candidates)
        remedy = hint or f"remove it; columns are {', '.join(form.required)}"
        report.error(file, f"column {name[:60] or '(no name)'}", "unknown column", remedy)
    if missing:
        remedy = f"the first row must be {','.join(form.required)} (or use the init command to convert a log)"
        report.error(file, _columns(missing), "missing", remedy)
    return not missing


def _columns(names: Sequence[str]) -> str:
    return f"column{'s' if len(names) > 1 else ''} {', '.join(names)}"


def table_of(
    name: str, frame: pd.DataFrame, ragged: np.ndarray, form: TableForm, report: ValidationReport
) -> UsableRows | None:
    """The rows of `frame` with a usable cell in every known column; None without such rows, or if columns are missing.

    `ragged`: mask (n,) of rows with too few or too many cells; problems go to `report`, under the file name `name`.
    """
    if form.instead is not None and any(str(column).lower() in form.foreign for column in frame.columns):
        form = form.instead
    if not _check_columns(name, list(frame.columns), form, report):
        return None
    first_row = 2 if name.endswith(".csv") else 1
    if len(frame) == 0:
        report.error(name, "", "has a header but no rows", "write the rows, or delete the file")
        return None
    usable, columns = ~ragged, {}
    for column in [column for column in frame.columns if column in form.required or column in form.optional]:
        cells = frame[column]
        if column in TEXT:
            columns[column] = cells.astype(object).where(cells.notna(), "").astype(str).astype(object)
            continue
        columns[column], faults = _numbers(cells, column, ragged, column in form.may_be_empty)
        for bad, what, remedy in faults:
            usable &= ~bad
            if bad.any():
                rows = row_text(np.flatnonzero(bad) + first_row)
                report.error(name, f"column {column}, {rows}", what, remedy)
    data = pd.DataFrame(columns)[usable]
    if len(data) == 0:
        return None
    data = data.astype({column: np.int64 for column in INTEGERS if column in data})
    return UsableRows(name, data, first_row, complete=bool(usable.all()), report=report)


def _numbers(
    column: pd.Series, name: str, ragged: np.ndarray, may_be_empty: bool
) -> tuple[np.ndarray, list[tuple[np.ndarray, str, str]]]:
    """A column as floats (n,), and its faults, each with the mask of rows (n,), the message and the remedy."""
    if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
        numbers, text = column, np.zeros(len(column), dtype=bool)
    else:
        as_text = column.astype(object).where(column.notna(), None)
        as_text = as_text.map(lambda cell: cell if cell is None else str(cell).strip())
        numbers = pd.to_numeric(as_text, errors="coerce")
        text = (numbers.isna() & as_text.notna()).to_numpy() & ~ragged
    values = _as_float(numbers)
    finite = np.isfinite(values) & ~ragged
    limit = LARGEST_INTEGER if name in INTEGERS else LARGEST.get(name, LARGEST[None])
    with np.errstate(invalid="ignore"):
        huge = finite & (np.abs(values) > limit)
        fraction = finite & ~huge & (values != np.rint(values)) & (name in INTEGERS)
    empty = np.isnan(values) & ~text & ~ragged & (not may_be_empty)
    first = repr(str(column[text].iloc[0])[:40]) if text.any() else ""
    again = "or measure them again"
    return values, [
        (text, f"is not a number (first: {first})", "write numbers with a decimal point, no units in the cell"),
        (empty, "is empty or NaN", f"remove these rows (lost frames are simply left out), {again}"),
        (np.isinf(values) & ~ragged, "is infinite", f"remove these rows, {again}"),
        (huge, f"is beyond ±{limit:.0e}", "give SI units (m, rad, s, m/s, rad/s)"),
        (fraction, "is not a whole number", f"number the {name}s 0, 1, 2, …"),
    ]


def _as_float(numbers: pd.Series) -> np.ndarray:
    try:
        return numbers.to_numpy(dtype=float, na_value=np.nan).copy()
    except (OverflowError, ValueError, TypeError):  # integers beyond the range of floats, complex numbers
        return pd.to_numeric(numbers.astype(str), errors="coerce").to_numpy(dtype=float, na_value=np.nan).copy()


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
