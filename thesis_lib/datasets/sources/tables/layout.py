"""Layout of a table in a text: its first row, delimiter, decimal mark, header and row of units.

Programs write names, dates and settings above the header, units and comments below it; a header may be a comment
(`# timestamp tx ty tz`).  The table is found by its numbers: the delimiter and decimal mark are those with which the
largest share of the first cells are numbers, and the header stands directly above the first row of numbers.
"""

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from thesis_lib.datasets.sources.tables.options import SPACES, unit_of

DELIMITERS = (",", "\t", ";", "|", SPACES)
NAMES = {",": "commas", "\t": "tabs", ";": "semicolons", "|": "bars", SPACES: "spaces"}
HEAD = 200  # lines that are examined
LONGEST = 100_000  # characters that are examined
ABOVE = 6  # lines above the first row of numbers that may be the header
# cells for missing values: names, as of spreadsheets; NaN as C prints it, and as Microsoft's C did (-nan(ind), 1.#QNAN)
NO_NUMBER = re.compile(r"|na|null|none|#n/a|#nv|[+-]?nan(\(\w*\))?|[+-]?1[.,]#(ind|[qs]?nan)0*", re.IGNORECASE)
COMMENT = re.compile(r"\s*(?:#+|%+(?=\s)|//+)\s*")  # not the % of %time, as rostopic names a column
_NUMBER = {mark: re.compile(rf"[+-]?(\d+[{mark}]?\d*|[{mark}]\d+)([eE][+-]?\d+)?") for mark in (".", ",")}


@dataclass(frozen=True)
class Layout:
    """Layout of a table in a text; lines are counted from 0.

    `names` are the column names as written, joined by a dot if there are several header lines; `units` are the cells of
    the row of units, or empty; `header` is the line of the names, None if there is none; `skipped` are other lines of
    text before the samples; the samples begin in line `start`.
    """

    delimiter: str
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    header: int | None
    skipped: tuple[int, ...]
    start: int


def find_layout(lines: Sequence[str], delimiter: str | None, decimal: str | None, wanted: Collection[str]) -> Layout:
    """The layout of a text that begins with `lines`; `wanted` are expected column names.

    `delimiter` and `decimal` are determined if they are not given.
    """
    said = [COMMENT.match(line) is not None for line in lines[:HEAD]]
    lines = [COMMENT.sub("", line, count=1) if comment else line for line, comment in zip(lines, said)]
    ways = [(d, m) for m in ([decimal] if decimal else ".,") for d in ([delimiter] if delimiter else DELIMITERS)]
    delimiter, decimal = max(ways, key=lambda way: _share(lines, *way))
    rows = [[cell.strip() for cell in split(line, delimiter)] for line in lines]
    kinds = [not comment and _is_data(row, decimal) for row, comment in zip(rows, said)]
    filled = [i for i, row in enumerate(rows) if any(row)]
    first = _first_row(rows, kinds, filled)
    if first is None:  # no numbers: the first line is the header, and the cells below it are reported
        header = filled[0] if filled else 0
        return Layout(delimiter, decimal, _names(rows[header : header + 1]), (), header, (), header + 1)
    block: list[int] = []
    for i in reversed([i for i in filled if i < first]):
        if kinds[i] or len(block) == ABOVE:
            break
        if len(rows[i]) > 1 or len(rows[first]) == 1:
            block.insert(0, i)
    if not block:
        names = tuple(str(i + 1) for i in range(len(rows[first])))
        above = tuple(i for i in filled if i < first and not kinds[i])
        start = next((i for i in filled if kinds[i]), first)
        return Layout(delimiter, decimal, names, (), None, above, start)
    points = _point_names(rows, block)
    header = points[-1] if points else _header_of(rows, block, len(rows[first]), wanted)
    below = [i for i in block if i > header]
    units = next((i for i in below if _are_units(rows[i])), None)
    names = _names([rows[i] for i in points or [header]])
    used = {header, *points, *([] if units is None else [units])}
    skipped = tuple(i for i in filled if i <= (below or [header])[-1] and i not in used and not (points and i < header))
    cells = () if units is None else tuple(rows[units])
    return Layout(delimiter, decimal, names, cells, header, skipped, (below or [header])[-1] + 1)


def split(line: str, delimiter: str) -> list[str]:
    """The cells of one line."""
    if delimiter == SPACES:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:  # a cell of many thousand characters
        return line.split(delimiter)


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number with this decimal mark."""
    return _NUMBER[decimal].fullmatch(cell) is not None


def _share(lines: Sequence[str], delimiter: str, decimal: str) -> float:
    """Share of the cells that are numbers, 0 if the delimiter does not split any line."""
    rows = [[cell for cell in map(str.strip, split(line, delimiter)) if cell] for line in lines]
    cells = [cell for row in rows if len(row) > 1 for cell in row]
    return sum(is_number(cell, decimal) for cell in cells) / sum(map(len, rows)) if cells else 0.0


def _is_data(row: Sequence[str], decimal: str) -> bool:
    """Whether a row holds a sample: at least two numbers, or only numbers and missing values."""
    filled = [cell for cell in row if cell]
    numbers = sum(is_number(cell, decimal) for cell in filled)
    return numbers > 0 and (numbers >= 2 or all(is_number(c, decimal) or NO_NUMBER.fullmatch(c) for c in filled))


def _first_row(rows: Sequence[Sequence[str]], kinds: Sequence[bool], filled: Sequence[int]) -> int | None:
    """The first sample with the most frequent number of cells; None if there are no samples."""
    widths = Counter(len(rows[i]) for i in filled if kinds[i])
    if not widths:
        return None
    usual = widths.most_common(1)[0][0]
    return next(i for i in filled if kinds[i] and len(rows[i]) == usual)


def _header_of(rows: Sequence[Sequence[str]], block: Sequence[int], width: int, wanted: Collection[str]) -> int:
    """The line of the column names among the lines of text above the samples."""

    def fits(place: int) -> tuple[int, bool, bool, int]:
        row = rows[block[place]]
        known = sum(COMMENT.sub("", name, count=1) in row for name in wanted)
        whole = len(row) in (width, width - 1)
        above_units = place + 1 < len(block) and _are_units(rows[block[place + 1]]) and not _are_units(row)
        return known, whole, above_units, place

    return block[max(range(len(block)), key=fits)]


def _are_units(row: Sequence[str]) -> bool:
    return any(unit_of(cell) for cell in row)


def _point_names(rows: Sequence[Sequence[str]], block: Sequence[int]) -> list[int]:
    """The header lines with the column names of a DeepLabCut table: (individuals,) bodyparts, coords."""
    first = [rows[i][0].lower() for i in block]
    if "bodyparts" not in first or "coords" not in first:
        return []
    return [i for i, name in zip(block, first) if name in ("individuals", "bodyparts", "coords")]


def _names(headers: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Names of the columns from one header line, or joined from several, where the first column counts frames."""
    if len(headers) == 1:
        names = list(headers[0])
        while len(names) > 1 and not names[-1]:
            names.pop()
        return tuple(names)
    columns = [".".join(filter(None, parts)) for parts in zip(*headers)]
    return ("frame", *columns[1:])
