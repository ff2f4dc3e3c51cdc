"""Read trajectories and impacts from CSV or Parquet, and say row by row what cannot be read.

"row" is the line in the file.  A row that cannot be used is told and left out of the later checks, so that one
reading finds all that is wrong.
"""

import csv
import difflib
import os
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.validate import SHOWN, Report, Table, row_text
from thesis_lib.foundation.regular_file import FileProblem, regular_size

MAX_BYTES = 2_000_000_000  # 25 million samples; as arrays they take half of a 4 GB machine
MAX_VALUES = 250_000_000  # cells, 8 bytes each in memory: Parquet and rows of bare commas take little on disk
MAX_BAD_ROWS = 100_000  # a file with more of them is not a table
MAX_COLUMNS = 1000
MAX_HEADER = 100_000  # characters in the header line; the widest table here has 60 columns
LARGEST = {"t": 1e12, None: 1e9}  # epoch times in microseconds pass; no SI value of a drop comes near 1e9
INTEGERS = ("trial", "impact")
LARGEST_INTEGER = 2**53  # beyond it CSV readers that go through floats mix numbers up
TEXT = ("flags",)
SPATIAL = (
    "z",
    "vz",
    "roll",
    "pitch",
    "yaw",
    "qx",
    "qy",
    "qz",
    "qw",
    "omega_x",
    "omega_y",
    "wx",
    "wy",
)  # names of what a motion in space has and a planar one has not
MAY_BE_EMPTY = ("t",)  # impacts.csv: the instant may be unknown


def load_table(
    folder: Path, stem: str, required: Sequence[str], optional: Sequence[str], report: Report
) -> Table | None:
    """The usable rows of `<stem>.csv` or `<stem>.parquet`, or None; problems go to `report`."""
    paths = [path for path in (folder / f"{stem}.csv", folder / f"{stem}.parquet") if os.path.lexists(path)]
    if not paths:
        return None
    if len(paths) == 2:
        report.error(
            f"{stem}.csv",
            "",
            f"{stem}.parquet is there too, so it is unclear which counts",
            "delete one of the two",
        )
    path = paths[0]
    try:
        size = regular_size(path, MAX_BYTES, folder)
    except FileProblem as problem:
        report.error(path.name, "", problem.what, "put a table there that is a file of its own, or delete it")
        return None
    if size == 0:
        report.error(path.name, "", "is empty", "write the header line and the rows, or delete the file")
        return None
    read = _read_csv if path.suffix == ".csv" else _read_parquet
    frame, ragged = read(path, report)
    if frame is None or not _check_columns(path.name, list(frame.columns), required, optional, report):
        return None
    return _usable(path, frame, ragged, required, optional, report)


def _read_csv(path: Path, report: Report) -> tuple[pd.DataFrame | None, np.ndarray]:
    none = (None, np.zeros(0, dtype=bool))
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            head = file.readline(MAX_HEADER)
        names = [name.strip() for name in next(csv.reader([head], skipinitialspace=True, strict=True), [])]
    except (UnicodeDecodeError, csv.Error) as error:
        where = "row 1" if isinstance(error, csv.Error) else ""
        report.error(path.name, where, f"is not CSV text ({error})", "export it again as CSV in UTF-8")
        return none
    if "\x00" in head or not any(names):
        report.error(
            path.name, "row 1", "is not a header line of CSV text", "export it again as CSV in UTF-8"
        )
        return none
    if len(names) == 1 and (other := next((mark for mark in ";\t|" if mark in head), None)):
        shown = "tabs" if other == "\t" else f"'{other}'"
        report.error(
            path.name,
            "row 1",
            f"columns are separated by {shown}, expected commas",
            "export with commas and decimal points (or use the init command with --delimiter)",
        )
        return none
    if all(_is_number(name) for name in names):
        report.error(
            path.name,
            "row 1",
            "holds numbers, expected the column names",
            "put the column names in the first line",
        )
        return none
    if len(names) > MAX_COLUMNS:
        what = f"has {len(names):,} columns; the limit is {MAX_COLUMNS:,}"
        report.error(path.name, "row 1", what, "keep the columns of the documented format")
        return none
    if repeated := sorted(name for name, count in Counter(names).items() if count > 1):
        report.error(
            path.name,
            f"column {', '.join(repeated)}",
            "the name stands more than once in row 1",
            "keep one of them",
        )
        return none
    try:
        bad_rows, rows = _ragged(path, len(names), report)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.ParserWarning)  # rows too long, told by _ragged
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
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        report.error(path.name, "", f"cannot be read as CSV ({reason})", "export it again as CSV in UTF-8")
        return none
    ragged = np.zeros(len(frame), dtype=bool)
    ragged[bad_rows[bad_rows < len(frame)]] = True
    return frame, ragged


def _ragged(path: Path, width: int, report: Report) -> tuple[np.ndarray, int]:
    """Index of the data rows with too few or too many cells, and the number of rows without blank ones at the end."""
    bad, cells, blank = [], [], []
    last = -1
    with path.open("rb") as file:
        next(file)
        for i, line in enumerate(file):
            count = line.count(b",") + 1
            if b'"' in line:
                count = len(next(csv.reader([line.decode("utf-8")], skipinitialspace=True), []))
            if len(bad) + len(blank) > MAX_BAD_ROWS:
                raise ValueError(f"more than {MAX_BAD_ROWS:,} rows are empty or have another number of cells")
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
        report.warn(
            path.name,
            row_text([last + 2]),
            "the last row does not end with a line break: its last number may have been cut off",
            "check that the file is whole, and end it with a line break",
        )
    if blank := [i for i in blank if i < rows]:
        report.error(path.name, row_text(np.array(blank) + 2), "the row is empty", "delete empty lines")
    if bad:
        seen = ", ".join(str(count) for count in cells[:SHOWN])
        end = (
            " (the last row: the file may have been cut off)" if bad[-1] == last and cells[-1] < width else ""
        )
        report.error(
            path.name,
            row_text(np.array(bad) + 2),
            f"{seen} cells instead of {width}{end}",
            "give each row one cell for each column; write decimal points, not commas",
        )
    return np.array(bad + blank, dtype=int), rows


def _read_parquet(path: Path, report: Report) -> tuple[pd.DataFrame | None, np.ndarray]:
    import pyarrow.parquet

    none = (None, np.zeros(0, dtype=bool))
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            meta = file.metadata
            if meta.num_columns > MAX_COLUMNS:
                raise ValueError(f"{meta.num_columns:,} columns; the limit is {MAX_COLUMNS:,}")
            if meta.num_rows * meta.num_columns > MAX_VALUES:
                what = f"claims {meta.num_rows:,} rows of {meta.num_columns} columns; the limit is {MAX_VALUES:,} cells"
                report.error(path.name, "", what, "split the dataset into several folders")
                return none
            size = sum(meta.row_group(i).total_byte_size for i in range(meta.num_row_groups))
            if size > MAX_BYTES:
                raise ValueError(f"it claims {size:,} bytes; the limit is {MAX_BYTES:,}")
            if nested := [kind.name for kind in file.schema_arrow if pyarrow.types.is_nested(kind.type)]:
                raise ValueError(f"column {nested[0]} holds lists, expected numbers")
            frame = file.read().to_pandas(ignore_metadata=True)
    except Exception as error:  # whatever the library says of a broken file, it is the file's fault
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        report.error(path.name, "", f"cannot be read as Parquet ({reason})", "write it again, or use CSV")
        return none
    frame.columns = [str(name) for name in frame.columns]
    if len(set(frame.columns)) < len(frame.columns):
        report.error(path.name, "", "column names stand more than once", "keep one of each")
        return none
    return frame, np.zeros(len(frame), dtype=bool)


def _check_columns(
    file: str, names: Sequence[str], required: Sequence[str], optional: Sequence[str], report: Report
) -> bool:
    missing = [name for name in required if name not in names]
    unknown = [name for name in names if name not in required and name not in optional]
    if spatial := [name for name in unknown if name.lower() in SPATIAL]:
        report.error(
            file,
            f"column{'s' if len(spatial) > 1 else ''} {', '.join(spatial)}",
            "the motion is one in space; this program takes planar only: x, y and one angle theta",
            "if the body moves in a plane, project it (x along the surface, y up, theta about the normal of the "
            "plane: README, 'Your own drops'); a body that leaves its plane cannot be analysed",
        )
    for name in (name for name in unknown if name not in spatial):
        candidates = missing + [other for other in optional if other not in names]
        close = difflib.get_close_matches(name, candidates, n=1, cutoff=0.6)
        lower = next((other for other in candidates if other == name.lower()), None)
        hint = lower or (close[0] if close else None)
        remedy = f"did you mean '{hint}'?" if hint else f"remove it; columns are {', '.join(required)}"
        report.error(file, f"column {name[:60] or '(no name)'}", "unknown column", remedy)
    if missing:
        report.error(
            file,
            f"column{'s' if len(missing) > 1 else ''} {', '.join(missing)}",
            "missing",
            f"the first row must be {','.join(required)} (or use the init command to convert a log)",
        )
    return not missing


def _usable(
    path: Path,
    frame: pd.DataFrame,
    ragged: np.ndarray,
    required: Sequence[str],
    optional: Sequence[str],
    report: Report,
) -> Table | None:
    first_row = 2 if path.suffix == ".csv" else 1
    if len(frame) == 0:
        report.error(path.name, "", "has a header but no rows", "write the rows, or delete the file")
        return None
    usable, columns = ~ragged, {}
    for name in [name for name in frame.columns if name in required or name in optional]:
        if name in TEXT:
            columns[name] = (
                frame[name].astype(object).where(frame[name].notna(), "").astype(str).astype(object)
            )
            continue
        values, bad = _numbers(frame[name], name, ragged, path.name, first_row, name not in required, report)
        columns[name] = values
        usable &= ~bad
    data = pd.DataFrame(columns)[usable]
    if len(data) == 0:
        return None
    data = data.astype({name: np.int64 for name in INTEGERS if name in data})
    return Table(path.name, data, first_row, complete=bool(usable.all()))


def _numbers(
    column: pd.Series,
    name: str,
    ragged: np.ndarray,
    file: str,
    first_row: int,
    optional: bool,
    report: Report,
) -> tuple[np.ndarray, np.ndarray]:
    """A column as floats (n,), and the rows (n,) in which it is unusable."""
    if pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column):
        numbers, text = column, np.zeros(len(column), dtype=bool)
    else:
        as_text = column.astype(object).where(column.notna(), None)
        as_text = as_text.map(lambda cell: cell if cell is None else str(cell).strip())
        numbers = pd.to_numeric(as_text, errors="coerce")
        text = (numbers.isna() & as_text.notna()).to_numpy() & ~ragged
    values = _as_float(numbers)

    def tell(bad: np.ndarray, what: str, remedy: str) -> None:
        if np.any(bad):
            rows = np.flatnonzero(bad)
            report.error(file, f"column {name}, {row_text(rows + first_row)}", what, remedy)

    first = repr(str(column[text].iloc[0])[:40]) if text.any() else ""
    tell(
        text, f"is not a number (first: {first})", "write numbers with a decimal point, no units in the cell"
    )
    empty = np.isnan(values) & ~text & ~ragged
    if optional and name in MAY_BE_EMPTY:
        empty[:] = False
    tell(
        empty, "is empty or NaN", "remove these rows (lost frames are simply left out), or measure them again"
    )
    infinite = np.isinf(values) & ~ragged
    tell(infinite, "is infinite", "remove these rows, or measure them again")
    limit = LARGEST_INTEGER if name in INTEGERS else LARGEST.get(name, LARGEST[None])
    with np.errstate(invalid="ignore"):
        huge = np.isfinite(values) & (np.abs(values) > limit) & ~ragged
        tell(huge, f"is beyond ±{limit:.0e}", "give SI units (m, rad, s, m/s, rad/s)")
        fraction = np.isfinite(values) & ~huge & (values != np.rint(values)) & ~ragged
    if name not in INTEGERS:
        fraction[:] = False
    tell(fraction, "is not a whole number", f"number the {name}s 0, 1, 2, …")
    return values, text | empty | infinite | huge | fraction


def _as_float(numbers: pd.Series) -> np.ndarray:
    try:
        return numbers.to_numpy(dtype=float, na_value=np.nan).copy()
    except (OverflowError, ValueError, TypeError):  # integers beyond the range of floats, complex numbers
        return (
            pd.to_numeric(numbers.astype(str), errors="coerce").to_numpy(dtype=float, na_value=np.nan).copy()
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
