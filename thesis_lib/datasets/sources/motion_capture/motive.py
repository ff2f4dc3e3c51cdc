"""Exports of OptiTrack Motive: CSV of rigid bodies and markers (https://docs.optitrack.com, Data Export: CSV).

    Format Version,1.23,Take Name,drops,…,Export Frame Rate,240,…,Rotation Type,Quaternion,Length Units,Meters,…
    (empty)
    ,Type,Rigid Body,Rigid Body,…,Marker,…
    ,Name,plate,plate,…,plate:Marker1,…
    ,ID,1,1,…
    ,,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,…
    Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,…
    0,0.000000,0.01,…

Lines of other names (`Parent`) may stand among those of the columns.  A frame in which a body is lost has empty cells.
Euler angles are in degrees, about the body's own axes in the sequence that Rotation Type names.  y is up, unless the
export's axis convention says otherwise, which the file does not.
"""

import re
from collections.abc import Mapping
from pathlib import Path

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

UP = "y"
BEGINS = re.compile('"*format version', re.I)  # the first line of such a file
HEADER_ROWS = 20  # within which the line of the axes must stand
MARKERS = ("marker", "rigid body marker")


def read_motive(path: Path, body: str | None, rotation: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one) in an export; `rotation` overrides the sequence of Euler angles.

    UserError if the header lines are not those of the format, the body is not in it or is not named, or a cell is
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
    groups: dict[str, dict[str, dict[tuple[str, str], int]]] = {"body": {}, "marker": {}}
    for column in range(2, len(axes)):
        cell = [line[column] if column < len(line) else "" for line in (kinds, names, what, axes)]
        kind = cell[0].lower()
        place = "body" if kind == "rigid body" else "marker" if kind in MARKERS else ""
        if place and cell[3].lower() in ("x", "y", "z", "w"):
            groups[place].setdefault(cell[1], {}).setdefault((cell[2].lower(), cell[3].lower()), column)
    t = columns_of(path, data, [time if time is not None else 0])[:, 0]
    if time is None:
        mistake = "'export frame rate' is missing or no rate in Hz; export it again with header information."
        t = t / rate_in_hertz(facts.get("export frame rate", ""), f"{path}, row 1: {mistake}")
    scale = length_unit(path, facts.get("length units", "meters"), "row 1, Length Units")
    frames = Frames(path, data, t, scale, notes)
    if groups["body"]:
        chosen = choose_body(path, list(groups["body"]), body)
        place, turn = (
            {axis: column for (of, axis), column in groups["body"][chosen].items() if of == quantity}
            for quantity in ("position", "rotation")
        )
        if set(place) != set("xyz") or not set("xyz") <= set(turn):
            raise UserError(f"{path}: body {chosen} lacks columns of its Rotation or Position; export both.")
        return frames.motion_of_body(chosen, place, turn, rotation or _sequence(path, facts))
    places = {name: {axis: column for (_, axis), column in of.items()} for name, of in groups["marker"].items()}
    return frames.motion_in_markers(places, body)


def _facts(path: Path, rows: list[Row]) -> dict[str, str]:
    """The pairs of the first line, names in small letters."""
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
