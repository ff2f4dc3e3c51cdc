"""Tables of a rig's log as text cells: read whole, with the row of each, and turned into numbers where asked for.

"row" is the line in the file, the header being row 1.
"""

import csv
import difflib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import MissingFile, read_bytes

MAX_COLUMNS = 1000
MAX_LOG = 200_000_000  # bytes; as lists of cells a log takes about ten times that


def read_log(path: Path, delimiter: str, warnings: list[str]) -> pd.DataFrame:
    """The cells of a log as text, indexed by their row in the file; a last row that was cut off is left out."""
    try:
        content = read_bytes(path, MAX_LOG)
        reader = csv.reader(
            io.StringIO(content.decode("utf-8-sig"), newline=""), delimiter=delimiter, skipinitialspace=True
        )
        # blank lines are skipped; `line_num` still gives the row numbers
        lines = [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells)) or len(cells) > 1]
        complete = content.endswith((b"\n", b"\r"))
    except MissingFile as error:
        raise UserError(f"{path} does not exist; give the log as a CSV file with a header line.") from error
    except (ValueError, csv.Error) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise UserError(f"{path} cannot be read as a table ({reason}). Is --delimiter right?") from error
    if not lines:
        raise UserError(f"{path} is empty; give the log as a CSV file with a header line.")
    (_, names), *lines = lines
    width = len(names)
    if width > MAX_COLUMNS:
        raise UserError(f"{path} has {width:,} columns; the limit is {MAX_COLUMNS:,}. Is --delimiter right?")
    for row, cells in lines:
        if any(map(str.strip, cells[width:])):  # a delimiter at the end of a row starts no further cell
            raise UserError(
                f"{path}, row {row}: {len(cells)} cells, but the header names {width} columns. Give each row one cell "
                "for each column; write decimal points, not commas, and check --delimiter."
            )
    if lines and len(lines[-1][1]) < width:
        row, cells = lines.pop()
        warnings.append(
            f"{path.name}, row {row}: the last row has {len(cells)} of {width} cells, so the file was cut off; the row "
            "is left out. Check that the log is whole."
        )
    elif lines and not complete:
        warnings.append(
            f"{path.name}, row {lines[-1][0]}: the last row does not end with a line break, so its last number may "
            "have been cut off; the row is kept. Check it, and that the log is whole."
        )
    cells = [(cells + [""] * width)[:width] for _, cells in lines]
    return pd.DataFrame(cells, index=[row for row, _ in lines], columns=_distinct(names), dtype=str)


def _distinct(names: Sequence[str]) -> list[str]:
    """Stripped column names; a name that occurs again becomes name.1, so that `name` is the first."""
    seen: dict[str, int] = {}
    result = []
    for name in map(str.strip, names):
        seen[name] = seen.get(name, -1) + 1
        result.append(f"{name}.{seen[name]}" if name and seen[name] else name)
    return result


def require(path: Path, log: pd.DataFrame, needed: Sequence[str], columns: Mapping) -> None:
    missing = [name for name in needed if name not in log.columns]
    if not missing:
        return
    close = difflib.get_close_matches(missing[0], list(log.columns), n=1, cutoff=0.6)
    hint = f" (did you mean '{close[0]}'?)" if close else ""
    raise UserError(
        f"{path} has no column {', '.join(missing)}{hint}. It has: {', '.join(map(str, log.columns))}. Name yours with "
        "--columns trial=…,t=…,x=…,y=…,theta=…" + ("" if len(log.columns) > 1 else ", and check --delimiter") + "."
    )


def numbers(path: Path, log: pd.DataFrame, name: str) -> np.ndarray:
    """A column as floats (n,); empty cells and NaN are NaN."""
    text = log[name].str.strip()
    numbers = pd.to_numeric(text, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    bad = np.isnan(numbers) & ~text.str.lower().isin(["", "nan", "na", "null", "none"]).to_numpy()
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise UserError(
            f"{path}, column {name}, row {log.index[first]}: {str(text.iloc[first])[:40]!r} is not a number "
            f"({int(bad.sum())} such cells). Remove text and units from the cells; write decimal points."
        )
    return numbers
