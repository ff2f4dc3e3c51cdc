"""Exports of OptiTrack: CSV of rigid bodies and markers of Motive (https://docs.optitrack.com, Data Export: CSV).

    Format Version,1.23,Take Name,drops,…,Export Frame Rate,240,…,Rotation Type,Quaternion,Length Units,Meters,…
    (empty)
    ,Type,Rigid Body,Rigid Body,…,Marker,…
    ,Name,plate,plate,…,plate:Marker1,…
    ,ID,1,1,…
    ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,…
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,…
    0,0.000000,0.01,…

Other lines (`Parent`) may stand among the header lines.  A frame in which a body is lost has empty cells.
Euler angles are in degrees, about the body's own axes in the sequence given by Rotation Type.  y is up, unless the
axis convention of the export differs, which the file does not state.

In older exports, of Tracking Tools and Motive 1 (version 1.1), each row begins with its kind:

    comment,"…"
    righthanded
    info,version,1.1
    info,rigidbodycount,2
    rigidbody,"plate",1,3,…
    frame,0,0.00000000,2,1,x,y,z,qx,qy,qz,qw,yaw,pitch,roll,2,x,…,markers…

A frame has its number, its time in s and the number of tracked bodies; then, for each body, its ID, its position in m,
its quaternion and its angles in degrees.  A lost body is missing, or has cells like 1.#QNAN.  Before version 1.1 a body
is called `trackable`.  Rows `rigidbody` with a number in the second cell repeat a body with its markers.
"""

import re
from collections.abc import Mapping
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
from thesis_lib.datasets.space.motion import Motion, mirrored, unit
from thesis_lib.foundation.errors import UserError

BEGINS = re.compile('"*format version', re.I)  # the first line of such a file
HEADER_ROWS = 20  # among which the line of the axes must be
MARKERS = ("marker", "rigid body marker")
KINDS_OLDER = ("comment", "righthanded", "lefthanded", "info", "rigidbody", "trackable", "frame")
BEGINS_OLDER = re.compile(r'\s*(comment,"|righthanded|lefthanded|info,version|info,framecount)', re.I)
BODIES = ("rigidbody", "trackable")
FIRST, WIDTH = 4, 11  # column of the first body in a frame, columns of a body


def read_motive(path: Path, body: str | None, rotation: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one) in an export; `rotation` overrides the sequence of Euler angles.

    UserError if the header lines are not those of the format, the body is not in it or must be named, or a cell is
    not a number.
    """
    rows = read_rows(path)
    facts = _facts(path, rows)
    at = next((i for i, (_, cells) in enumerate(rows[:HEADER_ROWS]) if cells and cells[0].lower() == "frame"), None)
    names = _line(rows, "name")
    kinds = _line(rows, "type")
    if at is None or names is None or kinds is None or at == 0:
        raise UserError(
            f"{path} begins like an export of Motive, but has no lines 'Type', 'Name' and 'Frame,Time "
            f"(Seconds),…' in its first {HEADER_ROWS}; export it again, with header information."
        )
    axes, what = rows[at][1], rows[at - 1][1]
    data = [row for row in rows[at + 1 :] if any(row[1])]
    if not data:
        raise UserError(f"{path} has header lines but no frames; export it again.")
    time = next((i for i, cell in enumerate(axes) if cell.lower().startswith("time")), None)
    bodies: dict[str, dict[str, dict[str, int]]] = {}
    markers: dict[str, dict[str, int]] = {}
    for column in range(2, len(axes)):
        kind, name, quantity, axis = (line[column] if column < len(line) else "" for line in (kinds, names, what, axes))
        if axis.lower() in ("x", "y", "z", "w") and kind.lower() == "rigid body":
            bodies.setdefault(name, {}).setdefault(quantity.lower(), {}).setdefault(axis.lower(), column)
        elif axis.lower() in ("x", "y", "z", "w") and kind.lower() in MARKERS:
            markers.setdefault(name, {}).setdefault(axis.lower(), column)
    t = columns_of(path, data, [time if time is not None else 0])[:, 0]
    if time is None:
        mistake = "'export frame rate' is missing or not a rate in Hz; export it again with header information."
        t = t / rate_in_hertz(facts.get("export frame rate", ""), f"{path}, row 1: {mistake}")
    scale = length_unit(path, facts.get("length units", "meters"), "row 1, Length Units")
    frames = Frames(path, data, t, scale, notes)
    if bodies:
        chosen = choose_body(path, list(bodies), body)
        place, turn = (bodies[chosen].get(quantity, {}) for quantity in ("position", "rotation"))
        if set(place) != set("xyz") or not set("xyz") <= set(turn):
            raise UserError(f"{path}: body {chosen} lacks columns of its Rotation or Position; export both.")
        return frames.motion_of_body(chosen, place, turn, rotation or _sequence(path, facts))
    return frames.motion_in_markers(markers, body)


def _facts(path: Path, rows: list[Row]) -> dict[str, str]:
    """The names (in lower case) and values of the first line."""
    cells = rows[0][1] if rows else []
    facts = {name.lower(): value for name, value in zip(cells[::2], cells[1::2])}
    if (space := facts.get("coordinate space", "global").lower()) != "global":
        raise UserError(f"{path} is exported in '{space[:40]}' coordinates; export it in the Global coordinate space.")
    return facts


def _sequence(path: Path, facts: Mapping[str, str]) -> str:
    text = facts.get("rotation type", "quaternion")
    if text.lower() == "quaternion":
        return "XYZ"
    if sorted(text.upper()) != ["X", "Y", "Z"]:
        raise UserError(f"{path}, row 1: Rotation Type '{text[:40]}' is unknown; export quaternions.")
    return text.upper()


def _line(rows: list[Row], name: str) -> list[str] | None:
    return next((cells for _, cells in rows[:HEADER_ROWS] if len(cells) > 1 and cells[1].lower() == name), None)


def read_optitrack(path: Path, body: str | None, rotation: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one) in an older export.

    UserError if there are no rows of bodies or frames, the body is not among them or must be named, or a cell is
    not a number.
    """
    rows = [row for row in read_rows(path) if row[1] and row[1][0].lower() in KINDS_OLDER]
    frames = [
        (row, ["" if "#" in cell else cell for cell in cells]) for row, cells in rows if cells[0].lower() == "frame"
    ]
    told = [cells for _, cells in rows if cells[0].lower() in BODIES and len(cells) > 2]
    bodies = {cells[1]: cells[2] for cells in told if not cells[1].isdigit() and cells[2].isdigit()}
    if not bodies or not frames:
        raise UserError(
            f"{path} begins like an older export of OptiTrack, but has no rows 'rigidbody,NAME,ID,…' or no rows "
            "'frame,…'; export it again with its rigid bodies."
        )
    chosen = choose_body(path, list(bodies), body)
    t = columns_of(path, frames, [2])[:, 0]
    moved = [(number, _cells_of(cells, bodies[chosen])) for number, cells in frames]
    cells = columns_of(path, moved, range(1, 8))
    cells[~np.any(np.nan_to_num(cells[:, 3:]) != 0.0, axis=1)] = np.nan
    position, quaternion = cells[:, :3], unit(cells[:, 3:], f"{path}, body {chosen}")
    if any(cells[0].lower() == "lefthanded" for _, cells in rows):
        notes.append("the export is left-handed: its z axis is reversed")
        position, quaternion = position * [1.0, 1.0, -1.0], mirrored(quaternion, 2)
    return Motion(chosen, str(path), t, position, quaternion)


def _cells_of(cells: list[str], body: str) -> list[str]:
    """The cells of the body with this ID in a row of a frame; empty if it is lost."""
    count = int(cells[3]) if len(cells) > 3 and cells[3].isdigit() else 0
    last = min(FIRST + count * WIDTH, len(cells))
    return next((cells[at : at + WIDTH] for at in range(FIRST, last, WIDTH) if cells[at] == body), [])
