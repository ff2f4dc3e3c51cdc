"""Exports of Vicon Nexus and Tracker: CSV with a block for each kind of data (Nexus: Export ASCII).

    Segments
    200
    ,,plate:plate,,,,,
    Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ
    ,,deg,deg,deg,mm,mm,mm
    1,0,10.2,…
    (empty)
    Trajectories
    200
    ,,plate:m1,,,plate:m2,,
    Frame,Sub Frame,X,Y,Z,X,Y,Z
    ,,mm,mm,mm,mm,mm,mm

The second line of a block is its rate in Hz.  Segments (Tracker: Objects) have positions and rotations: angles about
the body's own axes x, y, z in this sequence, the axis times the angle (`helical`), or with a column RW a quaternion;
the file does not state which of the first two.  Trajectories hold markers.  A lost body has empty cells, or zeros
throughout.  z is up.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

import numpy as np

from thesis_lib.datasets.sources.motion_capture.export_cells import (
    Frames,
    Row,
    columns_of,
    length_unit,
    rate_in_hertz,
    read_rows,
)
from thesis_lib.datasets.sources.tables.several_bodies import choose_body
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError

BODIES, MARKERS = ("segments", "objects"), ("trajectories",)
# blocks that an export may begin with
BLOCKS = (*BODIES, *MARKERS, "model outputs", "devices", "joints", "events", "global angle")
BEGINS = re.compile(rf"""[\s",;]*({"|".join(BLOCKS)})[\s",;]*$""", re.I)
ANGLES = {"deg": True, "rad": False}


@dataclass(frozen=True)
class _Block:
    name: str
    rate: float
    names: list[str]  # of the body or marker, for each column
    axes: list[str]  # for each column, in lower case
    units: list[str]
    rows: list[Row]


def read_vicon(path: Path, body: str | None, rotation: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one) in an export; `rotation` is the sequence of its angles.

    UserError if no block is as described above, the body is not in it or must be named, or a cell is not a number.
    """
    rows = read_rows(path)
    blocks = {block.name: block for block in _blocks(path, rows)}
    found = next((blocks[name] for name in (*BODIES, *MARKERS) if name in blocks), None)
    if found is None:
        raise UserError(f"{path} has no block 'Segments', 'Objects' or 'Trajectories' with frames; export them.")
    if not found.rows:
        raise UserError(f"{path}: its block '{found.name}' has no frames; export it again.")
    frames = columns_of(path, found.rows, [0, 1])
    sub = np.nan_to_num(frames[:, 1])
    each = float(np.max(sub)) + 1.0
    t = (frames[:, 0] * each + sub) / found.rate
    columns: dict[str, dict[str, dict[str, int]]] = {}  # name -> kind (r or t for bodies) -> axis -> column
    for column, (name, axis) in enumerate(zip(found.names, found.axes)):
        if column > 1 and name:
            kind = axis[:1] if len(axis) == 2 else ""
            columns.setdefault(name, {}).setdefault(kind, {}).setdefault(axis[-1:], column)
    if found.name in MARKERS:
        places = {name: of.get("", {}) for name, of in columns.items()}
        units = {found.units[n] for of in places.values() for axis, n in of.items() if axis in "xyz"}
        scale = length_unit(path, units.pop() if len(units) == 1 else "mm", "line of units")
        return Frames(path, found.rows, t, scale, notes).motion_in_markers(places, body)
    bodies = {name: of for name, of in columns.items() if all(set("xyz") <= set(of.get(kind, ())) for kind in "rt")}
    if not bodies:
        raise UserError(f"{path}: its block '{found.name}' lacks columns RX, RY, RZ, TX, TY, TZ; export them.")
    chosen = choose_body(path, list(bodies), body)
    place, turn = (bodies[chosen][kind] for kind in "tr")
    unit = found.units[turn["x"]].lower()
    if "w" not in turn and unit not in ANGLES:
        raise UserError(f"{path}, line of units: '{unit[:40]}' is not a unit of RX; expected deg or rad.")
    frames = Frames(path, found.rows, t, length_unit(path, found.units[place["x"]], "line of units"), notes)
    return frames.motion_of_body(chosen, place, turn, rotation or "XYZ", ANGLES.get(unit, False))


def _blocks(path: Path, rows: Sequence[Row]) -> list[_Block]:
    """The usable blocks of frames; each begins with its name, its rate and three lines of columns."""
    blocks, i = [], 0
    while i < len(rows):
        name = _alone(rows[i][1]).lower()
        if name not in (*BODIES, *MARKERS):
            i += 1
            continue
        head = rows[i + 1 : i + 5]
        if len(head) < 4:
            raise UserError(f"{path}, row {rows[i][0]}: the block '{name}' breaks off in its header; export it again.")
        (row, rate), names, axes, units = head[0], *(cells for _, cells in head[1:])
        mistake = f"{path}, row {row}: expected the rate of the block '{name}' in Hz; export it again."
        hertz = rate_in_hertz(_alone(rate), mistake)
        if not axes or axes[0].lower() != "frame":
            raise UserError(f"{path}, row {head[2][0]}: expected the columns of '{name}', Frame, Sub Frame, …")
        width = len(axes)
        end = next((k for k in range(i + 5, len(rows)) if not any(rows[k][1])), len(rows))
        names, units = ((cells + [""] * width)[:width] for cells in (names, units))
        names = list(accumulate(names, lambda last, name: name or last))  # a name stands only over its first column
        small = [axis.lower() for axis in axes]
        blocks.append(_Block(name, hertz, names, small, units, list(rows[i + 5 : end])))
        i = end
    return blocks


def _alone(cells: Sequence[str]) -> str:
    """The only non-empty cell of a row; "" if there are none or several."""
    filled = [cell for cell in cells if cell]
    return filled[0] if len(filled) == 1 else ""
