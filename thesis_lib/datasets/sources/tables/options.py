"""Options on a table: which column has which quantity, their units, the scale and origin of pixels."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS
from thesis_lib.foundation.errors import UserError

UNITS = {  # name -> (quantity, factor to SI); that of a pixel is its scale's
    **{"m": ("length", 1.0), "cm": ("length", 1e-2), "mm": ("length", 1e-3), "px": ("length", np.nan)},
    **{"rad": ("angle", 1.0), "deg": ("angle", np.pi / 180.0)},
    **{"s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "ns": ("time", 1e-9)},
}
SI = {"length": "m", "angle": "rad", "time": "s"}
QUANTITY = {"t": "time", "x": "length", "y": "length", "z": "length", "theta": "angle"}
SPATIAL = ("z", "q1", "q2", "q3", "q4")  # columns of a table with quaternions, beside those of a planar one
OTHER_NAMES = {  # of units, as programs write them above their columns
    **{"meter": "m", "meters": "m", "metre": "m", "metres": "m", "pixel": "px", "pixels": "px"},
    **{"centimeters": "cm", "millimeters": "mm", "centimetres": "cm", "millimetres": "mm"},
    **{"°": "deg", "º": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad"},
    **{"sec": "s", "secs": "s", "second": "s", "seconds": "s", "msec": "ms", "milliseconds": "ms", "nsec": "ns"},
    **{"µs": "us", "μs": "us", "usec": "us", "microseconds": "us", "nanoseconds": "ns"},
}
SPACES = r"\s+"  # the delimiter of columns that are set apart by blanks
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
    """A column's name without what stands in brackets at its end."""
    return BRACKETED.sub("", name).strip()


@dataclass(frozen=True)
class Units:
    """The units of --units by quantity, and `scale` in pixels a metre."""

    given: Mapping[str, str] = field(default_factory=dict)
    scale: float | None = None

    def unit(self, ours: str, stated: str | None, where: str) -> str:
        """The unit of our column `ours`, of which the table says that it is in `stated` (`where`, for messages).

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
                f"{where} is in {stated}, but --units says {given}. Correct the one that is wrong; without a unit of "
                f"{quantity} in --units, that of the table is taken."
            )
        return given or stated or SI[quantity]

    def factor(self, unit: str, where: str) -> float:
        """Factor to SI; UserError if pixels have no scale."""
        if unit != "px":
            return UNITS[unit][1]
        if self.scale is None:
            raise UserError(
                f"{where} is in pixels: say how many make a metre with --scale (for example --scale 900, or --scale "
                "450/0.5 if 0.5 m of a ruler in the picture are 450 px), and with --origin U,V which pixel is x = 0, "
                "y = 0."
            )
        return 1.0 / self.scale

    def to_si(self, ours: str, stated: str | None, where: str) -> float:
        """Factor to SI of our column `ours`; arguments and errors as in `unit` and `factor`."""
        return self.factor(self.unit(ours, stated, where), where)


@dataclass(frozen=True)
class Reading:
    """How logs are to be read, as the options of `datasets init` say it; None or "" where the log itself decides."""

    units: str = ""
    columns: Mapping[str, tuple[str, float]] = field(default_factory=dict)  # ours -> that of the table, and sign
    delimiter: str | None = None
    decimal: str | None = None
    scale: str | None = None  # pixels a metre
    origin: str | None = None  # U,V: x and y, as the table writes them, of the point that becomes (0, 0)
    rate: float | None = None  # Hz
    per_trial_files: bool = False
    quaternion: str | None = None  # xyzw or wxyz
    left_handed: bool = False
    rotation: str | None = None  # one of `export_cells.SEQUENCES`
    up: str | None = None
    plane: str | None = None
    body: str | None = None  # of a video tracker: the points on it
    frame: str | None = None  # X,Y,ANGLE
    cut: bool | None = None
    tracked: str | None = None  # "shape": the tracked frame is that of the shape

    def __post_init__(self) -> None:
        _ = self.si, self.zero  # what is wrong is refused at once

    @cached_property
    def si(self) -> Units:
        """The units by quantity; UserError for wrong ones."""
        return parse_units(self.units, self.scale)

    @cached_property
    def zero(self) -> tuple[float, float]:
        """Offset subtracted from x and y of a table, in its own units; UserError if it is not two numbers."""
        what = "is not U,V, two numbers as the table writes them (for example 320,410)."
        u, v = parse_numbers(self.origin or "0,0", 2, f"--origin: '{self.origin}' {what}")
        return u, v

    def source(self, *ours: str) -> dict[str, tuple[str, float]]:
        """For each of our columns that of the table, by default of the same name, and its sign."""
        return {name: self.columns.get(name, (name, 1.0)) for name in ours}


def parse_units(text: str, scale: str | None = None) -> Units:
    """'mm,deg,ms' -> `Units` (SI where none is given), `scale` as '900' or '450/0.5'; UserError for wrong ones."""
    given: dict[str, str] = {}
    for unit in filter(None, (part.strip() for part in text.split(","))):
        if unit not in UNITS:
            raise UserError(f"--units: '{unit}' is unknown; known are {', '.join(UNITS)} (for example --units mm,deg).")
        quantity = UNITS[unit][0]
        if quantity in given:
            raise UserError(f"--units: '{text}' gives two units of {quantity}; give one for each quantity.")
        given[quantity] = unit
    if scale is not None:
        given.setdefault("length", "px")
    if scale is not None and given["length"] != "px":
        raise UserError(f"--scale is for pixels, but --units says {given['length']}; leave one of them out.")
    return Units(given, None if scale is None else _parse_scale(scale))


def _parse_scale(text: str) -> float:
    pixels, _, metres = text.partition("/")
    try:
        value = float(pixels) / float(metres or 1.0)
    except (ValueError, ZeroDivisionError):
        value = np.nan
    if not (np.isfinite(value) and value > 0.0):
        raise UserError(f"--scale: '{text}' is not a number of pixels a metre (900), or pixels / metres (450/0.5).")
    return value


def parse_numbers(text: str, many: int, mistake: str) -> list[float]:
    """'1,2.5' -> so `many` finite numbers; UserError with the text `mistake` for anything else."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != many or not np.isfinite(values).all():
        raise UserError(mistake)
    return values


def parse_direction(text: str, option: str) -> np.ndarray:
    """'z', '-y' or '0.1,0,1' -> a unit vector (3,); UserError for anything else."""
    mistake = f"{option}: '{text}' is not a direction; give an axis such as z or -y, or three numbers X,Y,Z."
    sign, name = (-1.0, text[1:]) if text.startswith("-") and text[1:] in AXES else (1.0, text)
    vector = sign * np.array(AXES.get(name) or parse_numbers(text, 3, mistake))
    if not 1e-9 < (length := np.linalg.norm(vector)) < 1e9:
        raise UserError(mistake)
    return vector / length


def parse_delimiter(text: str | None) -> str | None:
    """A delimiter as it is typed; None if it is to be found."""
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
        if not equals or not log_column or name not in (*TRAJECTORY_COLUMNS, *SPATIAL) or name in columns:
            raise UserError(
                f"--columns: '{part}' is not OURS=YOURS with OURS one of {', '.join(TRAJECTORY_COLUMNS)}, each once "
                "(for example --columns t=time_s,x=X,y=-Z,theta=angle; a minus sign flips the axis). With "
                f"--quaternion, {', '.join(SPATIAL)} take the place of theta."
            )
        sign = -1.0 if log_column.startswith("-") and name not in ("trial", "t") else 1.0
        columns[name] = (log_column[1:] if sign < 0 else log_column, sign)
    return columns
