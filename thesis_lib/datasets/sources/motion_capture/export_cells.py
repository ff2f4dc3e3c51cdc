"""Exports of motion capture as rows of cells (header lines, then frames): what the readers of all makers share."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from thesis_lib.datasets.sources.motion_capture.tracked_bodies import choose_markers, motion_of_markers
from thesis_lib.datasets.sources.tables.log_table import MAX_COLUMNS, MAX_LOG
from thesis_lib.datasets.space.motion import Motion, from_angles, unit
from thesis_lib.foundation.errors import UserError, first_line
from thesis_lib.foundation.regular_file import MissingFile, read_bytes

LENGTHS = {"m": 1.0, "meters": 1.0, "cm": 1e-2, "centimeters": 1e-2, "mm": 1e-3, "millimeters": 1e-3}
DELIMITERS = (",", ";", "\t")
OWN_AXES = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
SEQUENCES = (*OWN_AXES, *map(str.lower, OWN_AXES), "helical")
EMPTY = ("", "nan", "na", "null", "none")
Row = tuple[int, list[str]]  # number of the line in the file, stripped cells


def read_rows(path: Path) -> list[Row]:
    """All rows of an export; a last row without a line break may be incomplete and is left out.

    The delimiter is determined from the first lines.
    UserError if the file is missing, too large, or not text.
    """
    try:
        content = read_bytes(path, MAX_LOG)
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("cp1252")  # from a Windows program: names of bodies with accents
        head = text[:20_000]
        delimiter = max(DELIMITERS, key=head.count)
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
        rows = [(reader.line_num, [cell.strip() for cell in cells]) for cells in reader]
    except MissingFile as error:
        raise UserError(f"{path} does not exist; give the export as a file.") from error
    except (ValueError, csv.Error) as error:
        raise UserError(f"{path} cannot be read as a table ({first_line(error)}); export it again as CSV.") from error
    if not content.endswith((b"\n", b"\r")):
        rows = rows[:-1]
    if any(len(cells) > 10 * MAX_COLUMNS for _, cells in rows[:10]):
        raise UserError(f"{path} has more than {10 * MAX_COLUMNS:,} columns; export only the bodies that are needed.")
    return rows


def columns_of(path: Path, rows: Sequence[Row], wanted: Sequence[int]) -> np.ndarray:
    """The cells of `wanted` columns as floats (n, len(wanted)); empty cells, and cells missing in short rows, are NaN.

    A UserError names the row of a cell that is not a number.
    """
    result = np.full((len(rows), len(wanted)), np.nan)
    for i, (row, cells) in enumerate(rows):
        for j, column in enumerate(wanted):
            cell = cells[column] if column < len(cells) else ""
            if cell.lower() in EMPTY:
                continue
            try:
                value = float(cell.replace(",", "."))  # a comma within a cell is a decimal comma
            except ValueError:
                raise UserError(
                    f"{path}, row {row}, column {column + 1}: {cell[:40]!r} is not a number. Export it again "
                    "with decimal points, and without text in the cells."
                ) from None
            result[i, j] = value if abs(value) < 1e12 else np.nan
    return result


def length_unit(path: Path, text: str, where: str) -> float:
    """Factor from a unit of length, as named in exports, to m; UserError for an unknown unit."""
    if text.lower() not in LENGTHS:
        raise UserError(f"{path}, {where}: '{text[:40]}' is not a known unit of length ({', '.join(LENGTHS)}).")
    return LENGTHS[text.lower()]


def rate_in_hertz(text: str, mistake: str) -> float:
    """A rate in Hz; UserError with the text `mistake` if it is invalid."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < 1e6:
        raise UserError(mistake)
    return value


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames of an export: rows of cells at times `t` (n,) in s, lengths in units of `scale` m, and its `notes`."""

    path: Path
    rows: Sequence[Row]
    t: np.ndarray
    scale: float
    notes: list[str]

    def motion_in_markers(self, places: Mapping[str, Mapping[str, int]], body: str | None) -> Motion:
        """The motion of a body for which an export has only markers; `places`: name -> axis -> column."""
        chosen, names = choose_markers(self.path, [name for name, at in places.items() if set(at) >= set("xyz")], body)
        cells = columns_of(self.path, self.rows, [places[name][axis] for name in names for axis in "xyz"])
        markers = self.scale * cells.reshape(len(cells), -1, 3)
        return motion_of_markers(self.path, chosen, names, markers, self.t, self.notes)

    def seen(self, place: Mapping[str, int], turn: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
        """Positions (n, 3) in m from the columns of x, y, z, and the cells (n, k) of the columns `turn`.

        Frames of zeros only, as some systems write them for a lost body, become NaN; a note reports them.
        """
        cells = columns_of(self.path, self.rows, [*(place[axis] for axis in "xyz"), *turn])
        zeros = ~np.any(np.nan_to_num(cells) != 0.0, axis=1) & np.isfinite(cells).all(axis=1)
        if zeros.any():
            self.notes.append(f"{int(zeros.sum())} frames of zeros treated as lost frames")
            cells[zeros] = np.nan
        return self.scale * cells[:, :3], cells[:, 3:]

    def motion_of_body(
        self, body: str, place: Mapping[str, int], turn: Mapping[str, int], sequence: str, degrees: bool = True
    ) -> Motion:
        """The motion of a body from the columns of its position x, y, z and of its angles or (with w) quaternion.

        Angles are read in the given `sequence`; other sequences become alternative readings of the motion.
        """
        position, angles = self.seen(place, [turn[axis] for axis in "xyzw" if axis in turn])
        if "w" in turn:
            return Motion(body, str(self.path), self.t, position, unit(angles, f"{self.path}, body {body}"))

        def read(letters: str) -> np.ndarray:
            # three columns stand for the axes x, y, z; a sequence takes them in its own order
            own = angles if letters == "helical" else angles[:, ["xyz".index(letter) for letter in letters.lower()]]
            return from_angles(letters, own, degrees)

        others = [name for name in (sequence.swapcase(), "XYZ", "ZYX", "helical") if name in SEQUENCES]
        readings = {f"--rotation {name}": lambda name=name: read(name) for name in others if name != sequence}
        return Motion(body, str(self.path), self.t, position, read(sequence), None, readings)
