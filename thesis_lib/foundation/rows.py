"""A table to which several runs add rows at once, each under its key, with the code that made them and the date."""

import fcntl
import os
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_text
from thesis_lib.foundation.provenance import lib_hash

if TYPE_CHECKING:
    import pandas as pd

STAMP = ("code", "made")


def today() -> str:
    """The day on which a row is made, as 2026-11-25."""
    return date.today().isoformat()


def stamp(script: str | Path) -> dict[str, str]:
    """`STAMP` of a row that `script` makes: hash of all code that it uses, and today's date."""
    return dict(zip(STAMP, (lib_hash(script), today())))


def read_rows(path: Path, columns: Sequence[str]) -> "pd.DataFrame":
    """The stored rows, none if there is no table; UserError if it holds other columns."""
    import pandas as pd

    if not path.exists():
        return pd.DataFrame(columns=list(columns))
    table = pd.read_csv(path, keep_default_na=False)
    if tuple(table.columns) != tuple(columns):
        raise UserError(f"{path} does not have the columns {', '.join(columns)}; delete it and run the proof again.")
    return table


def put_row(row: Mapping[str, object], key: Sequence[str], path: Path, columns: Sequence[str]) -> None:
    """Store a row in place of an earlier one of the same `key`; rows are sorted by it, parallel runs wait."""
    import pandas as pd

    path.parent.mkdir(parents=True, exist_ok=True)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)  # the kernel releases it when the process ends
        table = read_rows(path, columns)
        same = (table[list(key)] == [row[name] for name in key]).all(axis=1)
        rows = [*table[~same].to_dict("records"), row]
        ordered = pd.DataFrame(rows, columns=list(columns)).sort_values(list(key))
        write_text(ordered.to_csv(index=False, lineterminator="\n"), path)
    finally:
        os.close(folder)
