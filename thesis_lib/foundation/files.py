"""Reading and writing result files: atomic, deterministic, and with errors that name the file.

Results are written under a temporary name and renamed, so that an interrupted run leaves either the old file or the
whole new one.  Tables are CSV with a fixed float format, JSON has sorted keys, and neither holds times or paths: equal
inputs give equal bytes.
"""

import contextlib
import csv
import json
import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.foundation.columns import explain, meanings
from thesis_lib.foundation.errors import CorruptFileError, UserError, first_line
from thesis_lib.foundation.regular_file import FileProblem, MissingFile, read_bytes, regular_size

# finer than any measurement here, coarser than the last bits, which differ between BLAS builds
FLOAT_FORMAT = "%.9g"
MAX_TABLE = 200_000_000  # bytes; the largest table of a full run has 7 MB
MAX_CELLS_READ = 30_000_000  # bytes; in memory, texts take about thirty times as much
MAX_HEADER = 100_000  # characters in the first line
MAX_JSON = 50_000_000  # bytes
TEXT = ("", "")  # unit and meaning of a column that the column dictionary does not contain


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` if the block succeeds.

    Its name is fixed, so that leftovers of a killed run are overwritten and do not accumulate.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    tmp = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield tmp
        tmp.replace(path)
    except BaseException:
        tmp.unlink(missing_ok=True)
        raise


def write_table(table: pd.DataFrame, path: str | Path, float_format: str | None = FLOAT_FORMAT) -> None:
    """Write a table as CSV (or Parquet, by suffix), atomically and with reproducible bytes.

    Without `float_format`, numbers are written as the shortest text that reads back to the same bits.
    """
    with atomic(path) as tmp:
        if tmp.suffix == ".parquet":
            table.to_parquet(tmp, index=False)
        else:
            table.to_csv(tmp, index=False, float_format=float_format, lineterminator="\n")


def write_result(table: pd.DataFrame, path: str | Path) -> None:
    """Write a table of results; KeyError if a column is not explained in columns.yaml."""
    explain(Path(path).stem, table.columns)
    write_table(table, path)


def read_table(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table that this program wrote as CSV; `columns` must be present.

    UserError if the file is missing; CorruptFileError if it cannot be parsed, was cut off, has rows of different
    lengths, contains text in a column of numbers, or lacks a column.
    """
    path = Path(path)
    with _named(path):
        # pandas fills a short row with NaN, so that a truncated table would pass for a whole one
        deque(_rows(path, regular_size(path, MAX_TABLE)), maxlen=0)
        table = pd.read_csv(path)
        _check_numbers(path.stem, table)
    if missing := [name for name in columns if name not in table.columns]:
        raise CorruptFileError(f"{path} lacks column(s) {', '.join(missing)}; delete it and run again.")
    return table


def read_cells(path: str | Path) -> pd.DataFrame:
    """Read such a table with all cells as text: pandas would take a law called "NA" for NaN."""
    path = Path(path)
    with _named(path):
        names, *rows = _rows(path, regular_size(path, MAX_CELLS_READ))
        return pd.DataFrame(rows, columns=names, dtype=object)


def _rows(path: Path, size: int) -> Iterator[list[str]]:
    """Header and rows of a whole CSV file."""
    with path.open("rb") as file:
        head = file.readline(MAX_HEADER)
        if len(head) == MAX_HEADER:
            raise ValueError(f"its first line is longer than {MAX_HEADER:,} characters")
        file.seek(max(0, size - 1))
        if file.read(1) != b"\n":
            raise ValueError("the last row was cut off" if size else "it is empty")
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file, strict=True)
        yield (names := next(rows))
        if len(set(names)) < len(names):
            raise ValueError("two columns have the same name")
        for row in rows:
            if len(row) != len(names):
                raise ValueError(f"line {rows.line_num} has {len(row)} cells instead of {len(names)}")
            yield row


def _check_numbers(name: str, table: pd.DataFrame) -> None:
    """Raise a ValueError for text in a column that has a unit in the column dictionary."""
    columns, tables = meanings()
    for column in table.columns[[not pd.api.types.is_numeric_dtype(kind) for kind in table.dtypes]]:
        unit, _ = tables.get(name, {}).get(column) or columns.get(column) or TEXT
        cells = table[column].dropna()
        stray = cells[pd.to_numeric(cells, errors="coerce").isna()]
        if len(stray) and unit not in ("", "see figure"):
            raise ValueError(f"column {column} holds the text {str(stray.iloc[0])[:40]!r}, expected numbers")


@contextlib.contextmanager
def _named(path: Path) -> Iterator[None]:
    """Convert any failure to read one of our files into an error that names the file and the remedy."""
    try:
        yield
    except MissingFile as error:
        raise UserError(f"{path} does not exist; run the rule that makes it (snakemake {path}).") from error
    except FileProblem as error:
        raise CorruptFileError(f"{path} {error.what}; delete it and run again.") from error
    # parsers raise errors of many kinds, RecursionError and MemoryError among them
    except Exception as error:
        kind = "valid JSON" if path.suffix == ".json" else f"a {path.suffix.lstrip('.').upper()} table"
        raise CorruptFileError(f"{path} is not {kind} ({first_line(error)}); delete it and run again.") from error


def read_tables(paths: Iterable[str | Path], columns: Sequence[str] = ()) -> pd.DataFrame:
    """Tables of the same kind, concatenated in the order of `paths`; errors as in `read_table`."""
    return pd.concat([read_table(path, columns) for path in paths], ignore_index=True)


def column_dictionary(
    paths: Iterable[str | Path], recorded: Mapping[str, Mapping[str, tuple[str, str]]]
) -> pd.DataFrame:
    """Explanations of all columns in the CSV files `paths`, one set of rows for each kind of table.

    `recorded` (table -> column -> (unit, meaning)) explains columns that are not in columns.yaml.
    """
    parts = {}
    for path in sorted(map(Path, paths)):
        columns = pd.read_csv(path, nrows=0).columns
        parts[path.stem] = explain(path.stem, columns, recorded.get(path.stem))
    return pd.concat([parts[name] for name in sorted(parts)], ignore_index=True)


def write_text(text: str, path: str | Path) -> None:
    """Write text atomically."""
    with atomic(path) as tmp:
        tmp.write_text(text, encoding="utf-8", newline="\n")


def write_json(value: object, path: str | Path) -> None:
    """Write JSON atomically with sorted keys; NaN is refused (it is not JSON)."""
    write_text(json.dumps(value, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n", path)


def six_digits(value: Any) -> Any:
    """`value` with every float rounded to six significant digits and NaN or infinity as None.

    Six digits are finer than any measurement here, and coarser than differences between processors.
    """
    if isinstance(value, dict):
        return {str(key): six_digits(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [six_digits(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") + 0.0 if math.isfinite(value) else None
    return value


def read_json(path: str | Path) -> dict:
    """Read a JSON object that this program wrote.

    UserError if the file is missing; CorruptFileError if it contains NaN, a repeated key, or is not a JSON object.
    """
    path = Path(path)
    with _named(path):
        text = read_bytes(path, MAX_JSON).decode("utf-8")
        value = json.loads(text, parse_constant=_no_number, object_pairs_hook=_each_once)
        if not isinstance(value, dict):
            raise ValueError(f"it holds a {type(value).__name__}, expected keys and values")
    return value


def _no_number(name: str) -> None:
    raise ValueError(f"{name} is not a number of JSON")


def _each_once(pairs: list[tuple[str, object]]) -> dict:
    value = dict(pairs)
    if len(value) < len(pairs):
        raise ValueError(f"a key occurs twice among {', '.join(key for key, _ in pairs)[:100]}")
    return value
