"""Tables to which several runs add rows at the same time, each under its key, with a hash of the code and the date.

Cells are text, so that a row that is kept is written as it was read.  Numbers are written in their shortest exact form,
or rounded to `Rows.digits`; unknown values are empty.
"""

import contextlib
import csv
import fcntl
import io
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import MAX_TABLE, write_text
from thesis_lib.foundation.provenance import lib_hash
from thesis_lib.foundation.regular_file import FileProblem, MissingFile, read_bytes

if TYPE_CHECKING:
    import pandas as pd

STAMP = ("code", "made")
Made = TypeVar("Made")


def today() -> str:
    """Today's date, with which a row is stamped, in the form 2026-11-25."""
    return date.today().isoformat()


def stamp(script: str | Path) -> dict[str, str]:
    """Values of `STAMP` for a row made by `script`: hash of all code that it uses, and today's date."""
    return dict(zip(STAMP, (lib_hash(script), today())))


def as_cell(value: Any, digits: int | None = None) -> str:
    """A value as text for a table, a float with `digits` significant digits (None: all)."""
    if not isinstance(value, float):
        return "" if value is None else str(value)
    if math.isnan(value):
        return ""
    value = float(value if digits is None else f"{value:.{digits}g}")
    return repr(int(value) if value.is_integer() else value)


def by_cells(*names: str) -> Callable[[Mapping[str, str]], list[tuple]]:
    """Sort key for rows, from the cells in the columns `names`; numbers are compared as such and precede texts."""

    def comparable(cell: str) -> tuple:
        try:
            return 0, float(cell), ""
        except ValueError:
            return 1, 0.0, cell

    return lambda row: [comparable(row[name]) for name in names]


@dataclass(frozen=True)
class Rows:
    """A table in a file.

    Attributes:
        columns: names of the columns.
        key: columns that identify a row; a new row replaces those with the same key.
        command: command that makes rows, for messages.
        digits: significant digits of numbers; None: all.
        order: sort key, a function of the cells of a row; None: `by_cells` of the key.
    """

    path: Path
    columns: Sequence[str]
    key: Sequence[str]
    command: str
    digits: int | None = None
    order: Callable[[dict[str, str]], Any] | None = None

    def at(self, path: str | Path) -> "Rows":
        """The same table in another file."""
        return replace(self, path=Path(path))

    def parsed(self, make: Callable[[dict[str, str]], Made]) -> list[Made]:
        """Results of `make` for the cells of each row; an empty list if there is no table.

        CorruptFileError with the line if a row cannot be read, or `make` raises a ValueError, KeyError or TypeError.
        """
        try:
            lines = csv.reader(io.StringIO(read_bytes(self.path, MAX_TABLE).decode("utf-8"), newline=""), strict=True)
        except MissingFile:
            return []
        except (FileProblem, UnicodeDecodeError) as error:
            raise CorruptFileError(
                f"{self.path} cannot be read ({error}); delete it and run again: {self.command}."
            ) from error
        try:
            header = next(lines, [])
            if tuple(header) != tuple(self.columns):
                raise ValueError(f"it does not have the columns {', '.join(self.columns)}")
            return [make(dict(zip(header, cells, strict=True))) for cells in lines]
        except (ValueError, KeyError, TypeError, csv.Error) as error:
            raise CorruptFileError(
                f"{self.path}, line {lines.line_num}, is not a row of this table ({type(error).__name__}: "
                f"{str(error)[:200]}); delete the line and run it again with {self.command}."
            ) from error

    def table(self) -> "pd.DataFrame":
        """The rows as a data frame, empty cells as ""; UserError if there are none."""
        import pandas as pd

        if not self.parsed(dict):
            raise UserError(f"{self.path.name} contains no rows; make them with {self.command}.")
        return pd.read_csv(self.path, keep_default_na=False)

    def cells(self, row: Mapping[str, Any]) -> dict[str, str]:
        """The cells of a row, as they are stored."""
        return {name: as_cell(row.get(name), self.digits) for name in self.columns}

    def put(self, *rows: Mapping[str, Any]) -> None:
        """Store rows, replacing those with the same keys; parallel runs wait for each other."""
        new = [self.cells(row) for row in rows]
        with self._locked():
            old = self.parsed(dict)
            taken = set(map(self._key, new))
            kept = [row for row in old if self._key(row) not in taken]
            whole = sorted([*kept, *new], key=self.order or by_cells(*self.key))
            text = io.StringIO(newline="")
            writer = csv.writer(text, lineterminator="\n")
            writer.writerow(self.columns)
            writer.writerows(map(itemgetter(*self.columns), whole))
            write_text(text.getvalue(), self.path)

    def _key(self, row: Mapping[str, str]) -> tuple[str, ...]:
        return tuple(row[name] for name in self.key)

    @contextlib.contextmanager
    def _locked(self) -> Iterator[None]:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)  # the kernel releases it when the process ends
            yield
        finally:
            os.close(folder)
