"""Reading and writing result files: atomic, deterministic, and with errors that name the file.

Every result is written under a temporary name and renamed, so that an interrupted run leaves either the old
file or the whole new one.  Tables are CSV with a fixed float format; JSON has sorted keys; neither holds
times or paths, so that equal inputs give equal bytes.
"""

import contextlib
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import pandas as pd

from thesis_lib.errors import CorruptFileError, UserError

FLOAT_FORMAT = (
    "%.9g"  # finer than any measurement here, coarser than the last bits that differ between BLAS builds
)


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` if the block succeeds.

    The temporary name is fixed, so leftovers of a killed run are overwritten instead of piling up.
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


def write_table(table: pd.DataFrame, path: str | Path) -> None:
    """Write a table as CSV (or Parquet, by suffix), atomically and with reproducible bytes."""
    with atomic(path) as tmp:
        if tmp.suffix == ".parquet":
            table.to_parquet(tmp, index=False)
        else:
            table.to_csv(tmp, index=False, float_format=FLOAT_FORMAT, lineterminator="\n")


def read_table(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """Read a table that this program wrote; `columns` must be present.

    Raises:
        UserError: the file is missing.
        CorruptFileError: it cannot be parsed or lacks a column.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path} does not exist; run the rule that makes it (snakemake {path}).")
    try:
        table = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    except Exception as error:
        raise CorruptFileError(f"{path} cannot be read ({error}); delete it and run again.") from error
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise CorruptFileError(f"{path} lacks column(s) {', '.join(missing)}; delete it and run again.")
    return table


def read_tables(paths: Iterable[str | Path], columns: Sequence[str] = ()) -> pd.DataFrame:
    """Tables of the same kind, one below the other, in the order of `paths`; errors as in `read_table`."""
    return pd.concat([read_table(path, columns) for path in paths], ignore_index=True)


def write_text(text: str, path: str | Path) -> None:
    """Write text atomically."""
    with atomic(path) as tmp:
        tmp.write_text(text, encoding="utf-8", newline="\n")


def write_json(value: object, path: str | Path) -> None:
    """Write JSON atomically with sorted keys; NaN is refused (it is not JSON)."""
    write_text(json.dumps(value, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n", path)


def read_json(path: str | Path) -> dict:
    """Read a JSON object that this program wrote.

    Raises:
        UserError: the file is missing.
        CorruptFileError: it is not JSON.
    """
    path = Path(path)
    if not path.is_file():
        raise UserError(f"{path} does not exist; run the rule that makes it (snakemake {path}).")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise CorruptFileError(f"{path} is not valid JSON ({error}); delete it and run again.") from error
