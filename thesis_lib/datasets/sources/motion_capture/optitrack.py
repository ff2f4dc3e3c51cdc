"""Older exports of OptiTrack: CSV of Tracking Tools and Motive 1 (version 1.1), whose rows begin with what they are.

    comment,"…"
    righthanded
    info,version,1.1
    info,rigidbodycount,2
    rigidbody,"plate",1,3,…
    frame,0,0.00000000,2,1,x,y,z,qx,qy,qz,qw,yaw,pitch,roll,2,x,…,markers…

A frame has its number, its time in s, and how many bodies are tracked in it: of each its ID, its position in m, its
quaternion and its angles in degrees.  A body that is lost is not among them, or has cells like 1.#QNAN.  Before
version 1.1 a body is a `trackable`.  Rows `rigidbody` with a number in the second cell repeat a body with its markers.
y is up.
"""

import re
from pathlib import Path

import numpy as np

from thesis_lib.datasets.sources.motion_capture.export_cells import columns_of, read_rows
from thesis_lib.datasets.sources.tables.several_bodies import choose_body
from thesis_lib.datasets.space.motion import Motion, mirrored, unit
from thesis_lib.foundation.errors import UserError

UP = "y"
KINDS = ("comment", "righthanded", "lefthanded", "info", "rigidbody", "trackable", "frame")
BEGINS = re.compile(r'\s*(comment,"|righthanded|lefthanded|info,version|info,framecount)', re.I)
BODIES = ("rigidbody", "trackable")
FIRST, WIDTH = 4, 11  # column of the first body in a frame, columns of a body


def read_optitrack(path: Path, body: str | None, rotation: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one).

    UserError if there are no rows of bodies or frames, the body is not among them or is not named, or a cell is
    not a number.
    """
    rows = [row for row in read_rows(path) if row[1] and row[1][0].lower() in KINDS]
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
    """The cells of the body with this ID in a row of a frame, none where it is lost."""
    count = int(cells[3]) if len(cells) > 3 and cells[3].isdigit() else 0
    last = min(FIRST + count * WIDTH, len(cells))
    return next((cells[at : at + WIDTH] for at in range(FIRST, last, WIDTH) if cells[at] == body), [])
