"""Tables of a rig's log as cells of text with their row numbers; columns are converted to numbers on demand.

A "row" in a message is the line in the file, counted from 1.
"""

import io
import re
import warnings
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.validate import first_of, row_text
from thesis_lib.datasets.sources.tables.layout import COMMENT, HEAD, LONGEST, NAMES, NO_NUMBER, find_layout, split
from thesis_lib.datasets.sources.tables.options import Reading, unit_in, unit_of, without_unit
from thesis_lib.foundation.errors import UserError, first_line, suggest
from thesis_lib.foundation.regular_file import MissingFile, read_bytes

MAX_COLUMNS = 1000
MAX_LOG = 200_000_000  # bytes; as cells of text a log takes several times as much
EXACT = 2**53  # larger integers are not exact as floats
DIGITS = 30  # of an integer; nanoseconds since 1970 have 19
SURE = ("likelihood", "score")  # columns of DeepLabCut and SLEAP beside the x and y of a point
LIKELY = 0.6  # likelihood from which DeepLabCut itself regards a point as seen (pcutoff)
_LINES = re.compile(r"\r\n|\n|\r")
_BINARY = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")


@dataclass(frozen=True, eq=False)
class Log:
    """A table as text, indexed by the row in the file, with the units and points that it states.

    `units`: column -> unit given in brackets in the header or in the row below it; `strange`: column -> cell of that
    row that is not a known unit.  `points` are the points of a video tracker, with columns POINT.x, POINT.y and a
    confidence.  `notes` report what was skipped or repaired.
    """

    path: Path
    cells: pd.DataFrame
    decimal: str
    units: dict[str, str]
    strange: dict[str, str]
    points: tuple[str, ...]
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.cells)

    def find(self, name: str) -> str | None:
        """The column for `name`, which may begin with a comment mark or lack the unit in brackets; None if no column
        or several columns match."""
        for one in (name, COMMENT.sub("", name, count=1)):
            if one in self.cells.columns:
                return one
        bare = [column for column in self.cells.columns if without_unit(column) == name]
        return bare[0] if len(bare) == 1 else None

    def has(self, name: str) -> bool:
        """Whether the table has such a column."""
        return self.find(name) is not None

    def text(self, name: str) -> pd.Series:
        """Cells of an existing column."""
        return self.cells[self.find(name)]

    def where(self, name: str) -> str:
        """Description of a column for error messages."""
        return f"{self.path}, column {self.find(name)}"

    def unit(self, name: str) -> str | None:
        """The unit that the table states for a column."""
        return self.units.get(self.find(name) or "")

    def require(self, needed: Sequence[str]) -> None:
        """UserError if a column is missing."""
        missing = [name for name in needed if not self.has(name)]
        if not missing:
            return
        columns = list(map(str, self.cells.columns))
        hint = f" ({said})" if (said := suggest(missing[0], columns)) else ""
        text = f"{self.path} has no column {', '.join(missing)}{hint}. It has: {', '.join(columns)}. "
        if self.points:
            raise UserError(
                f"{text}It is from a video tracker, with the points {', '.join(self.points)}: leave x, y and theta out "
                "of --columns, and the pose follows from the points (--body POINT,POINT,… if some are not on the body)."
            )
        in_space = any(name == "z" or name.lower().startswith("q") for name in needed)
        ours = "z=…,qx=…,qy=…,qz=…,qw=…" if in_space else "theta=…"
        text += f"Name yours with --columns trial=…,t=…,x=…,y=…,{ours}"
        raise UserError(text + ("" if len(columns) > 1 else ", and check --delimiter") + ".")

    def numbers(self, name: str) -> np.ndarray:
        """A column as floats (n,); empty cells and NaN are NaN."""
        text = self.text(name).str.strip()
        plain = text.str.replace(",", ".", regex=False).where(~text.str.contains(".", regex=False), "?")
        plain = text if self.decimal == "." else plain
        numbers = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float, na_value=np.nan, copy=True)
        bad = np.isnan(numbers) & ~_missing(text)
        if bad.any():
            first = int(np.flatnonzero(bad)[0])
            mark = {".": "decimal points (or give --decimal ,)", ",": "decimal commas (or give --decimal .)"}
            raise UserError(
                f"{self.where(name)}, row {text.index[first]}: {str(text.iloc[first])[:40]!r} is not a number "
                f"({int(bad.sum())} such cells). Remove text and units from the cells; write {mark[self.decimal]}."
            )
        point = name[:-2]
        if point in self.points and name != (sure := sureness(point, self.cells.columns)) and sure is not None:
            numbers[~(self.numbers(sure) >= LIKELY)] = np.nan
        return numbers

    def times(self, name: str) -> np.ndarray:
        """A column of times as floats (n,), in its own unit; integers too large for floats count from the first one
        that is not 0."""
        text = self.text(name).str.strip()
        there = ~_missing(text)
        whole = text[there]
        integers = len(whole) > 0 and bool(whole.str.fullmatch(rf"[+-]?\d{{1,{DIGITS}}}").all())
        if not integers or whole.str.len().max() < len(str(EXACT)):
            return self.numbers(name)
        stamps = np.array([int(cell) for cell in whole], dtype=object)
        times = np.full(len(text), np.nan)
        times[there] = (stamps - next(filter(None, stamps), 0)).astype(float)
        return times


def _missing(text: pd.Series) -> np.ndarray:
    """Mask (n,) of the stripped cells that stand for a missing value."""
    return text.str.fullmatch(NO_NUMBER).to_numpy(dtype=bool)


def read_log(path: Path, options: Reading, wanted: Collection[str], doubts: list[str]) -> Log:
    """The cells of a log as text; an incomplete last row is left out and reported in `doubts`.

    `wanted` are the expected columns.

    UserError if the file is missing, too large, or not a table.
    """
    try:
        text, notes = _decode(read_bytes(path, MAX_LOG))
        lines = _LINES.split(text[:LONGEST], maxsplit=HEAD)
        lines = lines[:HEAD] if len(lines) > 1 else lines
        layout = find_layout(lines, options.delimiter, options.decimal, wanted)
        names = _distinct(layout.names)
        if len(names) > MAX_COLUMNS:
            raise UserError(f"{path} has {len(names):,} columns; the limit is {MAX_COLUMNS:,}. Is --delimiter right?")
        body, comments = _body(text, layout.start)
        cells = _cells(path, body, layout.delimiter, len(names), layout.start)
    except MissingFile as error:
        raise UserError(f"{path} does not exist; give the log as a CSV file with a header line.") from error
    except (ValueError, OverflowError) as error:
        raise UserError(f"{path} cannot be read as a table ({first_line(error)}). Is --delimiter right?") from error
    if not text.strip():
        raise UserError(f"{path} is empty; give the log as a CSV file with a header line.")
    if layout.header is None:
        notes.append(f"no header line: columns are named by their number, 1 to {len(names)}")
    if (layout.delimiter, layout.decimal) != (options.delimiter or ",", options.decimal or "."):
        mark = " and decimal commas" if layout.decimal == "," else ""
        notes.append(f"read with {NAMES.get(layout.delimiter, layout.delimiter)} between cells{mark}")
    if layout.skipped:
        shown = lines[layout.skipped[0]].strip()[:40]
        notes.append(f"{row_text([i + 1 for i in layout.skipped])} skipped, text around the header: '{shown}'")
    if comments:
        notes.append(f"{comments} comment line{'s' if comments > 1 else ''} below the header left out")
    cells.columns = names
    ends_cleanly = text.endswith(("\n", "\r"))
    cells = _last_row(path, cells, body, layout.delimiter, ends_cleanly, doubts)
    units = {name: unit for name in names if (unit := unit_in(name))}
    if named := [
        f"{without_unit(name)} in {units[name]}"
        for name in names
        if name in units and not {name, without_unit(name)}.isdisjoint(wanted)
    ]:
        notes.append(f"units read from the names of the columns: {', '.join(named)}")
    below = {name: unit for name, cell in zip(names, layout.units) if (unit := unit_of(cell))}
    if below:
        shown = ", ".join(f"{name} in {unit}" for name, unit in below.items())
        notes.append(f"units read from the row below the header: {shown}")
    strange = {name: cell for name, cell in zip(names, layout.units) if cell and name not in below}
    return Log(path, cells, layout.decimal, units | below, strange, points_of(names), tuple(notes))


def sureness(point: str, columns: Collection[str]) -> str | None:
    """The column with the confidence of a point, or None."""
    return next((f"{point}.{word}" for word in SURE if f"{point}.{word}" in columns), None)


def points_of(columns: Sequence[str]) -> tuple[str, ...]:
    """The points among columns named POINT.x, POINT.y, POINT.likelihood."""
    names = [name[:-2] for name in columns if name.endswith(".x")]
    return tuple(name for name in names if f"{name}.y" in columns and sureness(name, columns) is not None)


def read_logs(
    files: Sequence[str | Path], options: Reading, wanted: Collection[str], notes: list[str], doubts: list[str]
) -> list[Log]:
    """Each log as by `read_log`; adds the notes of the logs to `notes`, each sentence once, with its files."""
    logs = [read_log(Path(file), options, wanted, doubts) for file in files]
    said: dict[str, list[str]] = {}
    for log in logs:
        for note in log.notes:
            said.setdefault(note, []).append(log.path.name)
    for note, names in said.items():
        notes.append(f"{first_of(names, 1)}: {note}")
    return logs


def _decode(content: bytes) -> tuple[str, list[str]]:
    """Text of a file, and a note if it is not UTF-8; ValueError if it is not text."""
    zeros = [content[start:2000:2].count(0) for start in (0, 1)]
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif max(zeros) > len(content[:2000]) // 4:
        encoding = "utf-16-le" if zeros[1] > zeros[0] else "utf-16-be"
    else:
        encoding = "utf-8-sig"
    notes = []
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        encoding = "cp1252"
        text = content.decode(encoding, "replace")
    if "\ufffd" in text or _BINARY.search(text):
        raise ValueError("it is not text")
    if encoding != "utf-8-sig":
        notes.append(f"not in UTF-8; read as {encoding}" + (" (Windows)" if encoding == "cp1252" else ""))
    return text, notes


def _body(text: str, start: int) -> tuple[str, int]:
    """The text from line `start` on, with comments replaced by empty lines, and the number of comments."""
    at = 0
    for _ in range(start):
        found = _LINES.search(text, at)
        at = len(text) if found is None else found.end()
    return re.subn(r"(?m)^[ \t]*(?:#|%|//).*$", "", text[at:])


def _cells(path: Path, body: str, delimiter: str, width: int, start: int) -> pd.DataFrame:
    """The cells of the rows below the header, indexed by row; empty lines are left out.

    UserError for a row with more cells than `width`, ValueError if it cannot be read.
    """

    def too_long(row: int) -> UserError:
        count = len(split(_LINES.split(body)[row - start - 1], delimiter))
        return UserError(
            f"{path}, row {row}: {count} cells, but the header names {width} columns. Give each row one cell for each "
            "column; write decimal points, not commas, and check --delimiter."
        )

    if not body.strip():
        return pd.DataFrame(np.empty((0, width), dtype=str), dtype=str)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pd.errors.ParserWarning)  # about a first row that is too long
            cells = pd.read_csv(
                io.StringIO(body),
                sep=delimiter,
                header=None,
                names=range(width + 1),  # a delimiter at the end of a row starts no further cell
                index_col=False,
                skip_blank_lines=False,  # so that the index counts lines
                skipinitialspace=True,
                dtype=str,
                keep_default_na=False,
            )
    except pd.errors.ParserError as error:
        if found := re.search(r"in line (\d+), saw", str(error)):
            raise too_long(start + int(found[1])) from error
        raise
    cells.index = pd.RangeIndex(start + 1, start + 1 + len(cells))
    if (extra := cells[width].str.strip() != "").any():
        raise too_long(int(cells.index[extra][0]))
    empty = (cells == "").all(axis=1).to_numpy(copy=True)
    if empty.any():  # a row of delimiters alone is a row of lost cells
        lines = _LINES.split(body)
        empty[empty] = [not lines[i].strip(" \t" if delimiter != "\t" else " ") for i in np.flatnonzero(empty)]
    return cells.loc[~empty, range(width)]


def _last_row(
    path: Path, cells: pd.DataFrame, body: str, delimiter: str, ends_cleanly: bool, doubts: list[str]
) -> pd.DataFrame:
    """The cells without a last row that was cut off; adds to `doubts`."""
    width = len(cells.columns)
    if not len(cells):
        return cells
    row = cells.index[-1]
    found = len(split(body.rstrip("\r\n").rpartition("\n")[2].rpartition("\r")[2], delimiter))
    if found < width:
        doubts.append(
            f"{path.name}, row {row}: the last row has {found} of {width} cells, so the file was cut off; the row is "
            "left out. Check that the log is whole."
        )
        return cells.iloc[:-1]
    if not ends_cleanly:
        doubts.append(
            f"{path.name}, row {row}: the last row does not end with a line break, so its last number may have been "
            "cut off; the row is kept. Check it, and that the log is whole."
        )
    return cells


def _distinct(names: Sequence[str]) -> list[str]:
    """Unique column names: a name that occurs again becomes name.1, name.2, …; `name` is its first column."""
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, -1) + 1
        result.append(f"{name}.{seen[name]}" if name and seen[name] else name)
    return result
