"""Options for reading a table: the columns of the quantities, their units, and the scale and origin of pixels."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS
from thesis_lib.foundation.errors import UserError

UNITS = {  # name -> (quantity, factor to SI); for pixels the factor follows from --scale
    **{"m": ("length", 1.0), "cm": ("length", 1e-2), "mm": ("length", 1e-3), "px": ("length", np.nan)},
    **{"rad": ("angle", 1.0), "deg": ("angle", np.pi / 180.0)},
    **{"s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "ns": ("time", 1e-9)},
}
SI = {"length": "m", "angle": "rad", "time": "s"}
QUANTITY = {"t": "time", "x": "length", "y": "length", "z": "length", "theta": "angle"}
SPATIAL = ("z", "q1", "q2", "q3", "q4")  # columns of tables with quaternions, in addition to those of planar tables
PARTS = ("qx", "qy", "qz", "qw")  # other names of q1 to q4, in any order
OTHER_NAMES = {  # of units, as other programs write them
    **{"meter": "m", "meters": "m", "metre": "m", "metres": "m", "pixel": "px", "pixels": "px"},
    **{"centimeters": "cm", "millimeters": "mm", "centimetres": "cm", "millimetres": "mm"},
    **{"°": "deg", "º": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad"},
    **{"sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "milliseconds": "ms", "nsec": "ns"},
    **{"µs": "us", "μs": "us", "usec": "us", "microseconds": "us", "nanoseconds": "ns"},
}
SPACES = r"\s+"  # the delimiter of columns separated by blanks
BRACKETED = re.compile(r"[(\[]([^()\[\]]*)[)\]]\s*$")  # theta (°), timestamp [ns]
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
WORDS = {"length": "a length", "angle": "an angle", "time": "a time"}


def unit_of(text: str) -> str | None:
    """The unit that a cell below a header names, with brackets or without: one of `UNITS`, or None."""
    bare = text.strip().strip("()[]").strip()
    name = OTHER_NAMES.get(bare.lower(), bare)
    return name if name in UNITS else None


def unit_in(name: str) -> str | None:
    """The unit in brackets at the end of a column's name, or None."""
    found = BRACKETED.search(name)
    return unit_of(found.group(1)) if found else None


def without_unit(name: str) -> str:
    """A column's name without the brackets at its end."""
    return BRACKETED.sub("", name).strip()


@dataclass(frozen=True)
class Units:
    """The units of --units by quantity, and `scale` in pixels per metre."""

    given: Mapping[str, str] = field(default_factory=dict)
    scale: float | None = None

    def unit(self, ours: str, stated: str | None, where: str) -> str:
        """The unit of our column `ours`, for which the table states the unit `stated`; `where` is for messages.

        UserError if that contradicts --units or the column.
        """
        quantity = QUANTITY[ours]
        given = self.given.get(quantity)
        if stated is not None and UNITS[stated][0] != quantity:
            raise UserError(
                f"{where} is in {stated}, but {ours} is {WORDS[quantity]}. Name the right column, --columns {ours}=…."
            )
        if stated is not None and given not in (None, stated):
            raise UserError(
                f"{where} is in {stated}, but --units states {given}. Correct the wrong unit; without a unit of "
                f"{quantity} in --units, the unit of the table is used."
            )
        return given or stated or SI[quantity]

    def factor(self, unit: str, where: str) -> float:
        """Factor to SI; UserError if pixels have no scale."""
        if unit != "px":
            return UNITS[unit][1]
        if self.scale is None:
            raise UserError(
                f"{where} is in pixels: give the pixels per metre with --scale (for example --scale 900, or --scale "
                "450/0.5 if 0.5 m of a ruler in the picture are 450 px), and the pixel of x = 0, y = 0 with --origin "
                "U,V."
            )
        return 1.0 / self.scale

    def to_si(self, ours: str, stated: str | None, where: str) -> float:
        """Factor to SI of our column `ours`; arguments and errors as in `unit` and `factor`."""
        return self.factor(self.unit(ours, stated, where), where)


@dataclass(frozen=True)
class Reading:
    """Options of `datasets init` for reading logs; None or "" where the log itself decides."""

    units: str = ""
    columns: Mapping[str, tuple[str, float]] = field(default_factory=dict)  # our column -> column of the table, sign
    delimiter: str | None = None
    decimal: str | None = None
    scale: str | None = None  # pixels per metre
    origin: str | None = None  # U,V: x and y, as the table writes them, of the point that becomes (0, 0)
    rate: float | None = None  # Hz
    per_trial_files: bool = False
    quaternion: str | None = None  # xyzw or wxyz
    left_handed: bool = False
    rotation: str | None = None  # one of `export_cells.SEQUENCES`
    up: str | None = None
    plane: str | None = None
    body: str | None = None  # for a video tracker: the points on the body
    frame: str | None = None  # X,Y,ANGLE
    cut: bool | None = None
    tracked: str | None = None  # "shape": the tracked frame is the frame of the shape

    def __post_init__(self) -> None:
        _ = self.si, self.zero  # raises UserError for wrong values at once

    @cached_property
    def si(self) -> Units:
        """The units by quantity; UserError for invalid units."""
        return parse_units(self.units, self.scale)

    @cached_property
    def zero(self) -> tuple[float, float]:
        """Offset subtracted from x and y of a table, in its own units; UserError if it is not two numbers."""
        what = "is not U,V, two numbers as the table writes them (for example 320,410)."
        u, v = parse_numbers(self.origin or "0,0", 2, f"--origin: '{self.origin}' {what}")
        return u, v

    def source(self, *ours: str) -> dict[str, tuple[str, float]]:
        """For each of our columns, the column of the table (by default of the same name) and its sign."""
        return {name: self.columns.get(name, (name, 1.0)) for name in ours}


def parse_units(text: str, scale: str | None = None) -> Units:
    """'mm,deg,ms' -> `Units` (SI where none is given), `scale` as '900' or '450/0.5'; UserError if invalid."""
    given: dict[str, str] = {}
    for unit in filter(None, (part.strip() for part in text.split(","))):
        if unit not in UNITS:
            raise UserError(f"--units: '{unit}' is unknown; give {', '.join(UNITS)} (for example --units mm,deg).")
        quantity = UNITS[unit][0]
        if quantity in given:
            raise UserError(f"--units: '{text}' gives two units of {quantity}; give one for each quantity.")
        given[quantity] = unit
    if scale is not None:
        given.setdefault("length", "px")
    if scale is not None and given["length"] != "px":
        raise UserError(f"--scale is for pixels, but --units states {given['length']}; leave one of them out.")
    return Units(given, None if scale is None else _parse_scale(scale))


def _parse_scale(text: str) -> float:
    pixels, _, metres = text.partition("/")
    try:
        value = float(pixels) / float(metres or 1.0)
    except (ValueError, ZeroDivisionError):
        value = np.nan
    if not (np.isfinite(value) and value > 0.0):
        raise UserError(f"--scale: '{text}' is not a number of pixels per metre (900), or pixels / metres (450/0.5).")
    return value


def parse_numbers(text: str, many: int, mistake: str) -> list[float]:
    """The finite numbers of '1,2.5', of which there must be `many`; UserError with the text `mistake` otherwise."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != many or not np.isfinite(values).all():
        raise UserError(mistake)
    return values


def parse_direction(text: str, option: str) -> np.ndarray:
    """Unit vector (3,) of the direction 'z', '-y' or '0.1,0,1'; UserError for anything else."""
    mistake = f"{option}: '{text}' is not a direction; give an axis such as z or -y, or three numbers X,Y,Z."
    sign, name = (-1.0, text[1:]) if text.startswith("-") and text[1:] in AXES else (1.0, text)
    vector = sign * np.array(AXES.get(name) or parse_numbers(text, 3, mistake))
    if not 1e-9 < (length := np.linalg.norm(vector)) < 1e9:
        raise UserError(mistake)
    return vector / length


def parse_delimiter(text: str | None) -> str | None:
    """The delimiter for the typed text (such as tab or space); None if it is to be determined."""
    if text is None:
        return None
    delimiter = {"\\t": "\t", "tab": "\t", "space": " "}.get(text, text)
    if len(delimiter) != 1 or delimiter in '\r\n\x00"':
        raise UserError(f"--delimiter: {text!r} is not one character.")
    return SPACES if delimiter == " " else delimiter


def parse_columns(text: str) -> dict[str, tuple[str, float]]:
    """'t=time_s,y=-Z' -> {'t': ('time_s', 1.0), 'y': ('Z', -1.0)}: our column -> (column of the log, sign)."""
    columns: dict[str, tuple[str, float]] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, log_column = (piece.strip() for piece in part.partition("="))
        if not equals or not log_column or name not in (*TRAJECTORY_COLUMNS, *SPATIAL, *PARTS) or name in columns:
            raise UserError(
                f"--columns: '{part}' is not OURS=YOURS with OURS one of {', '.join(TRAJECTORY_COLUMNS)}, each once "
                "(for example --columns t=time_s,x=X,y=-Z,theta=angle; a minus sign flips the axis). With "
                f"--quaternion, {', '.join(SPATIAL)} (or "
                f"z, {', '.join(PARTS)}) take the place of theta."
            )
        sign = -1.0 if log_column.startswith("-") and name not in ("trial", "t") else 1.0
        columns[name] = (log_column[1:] if sign < 0 else log_column, sign)
    return columns
