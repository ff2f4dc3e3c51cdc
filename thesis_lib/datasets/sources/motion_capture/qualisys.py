"""Exports of Qualisys Track Manager: TSV of bodies (6D) and of markers (3D), https://docs.qualisys.com/qtm.

    NO_OF_FRAMES	260
    FREQUENCY	100
    DATA_INCLUDED	6D
    BODY_NAMES	plate	rod
    Frame	Time	plate X	Y	Z	Roll	Pitch	Yaw	Residual	Rot[0]	…	Rot[8]	rod X	…
    1	0.00000	12.1	…

The lines above the columns hold names and values, in any order.  `Frame`, `Time` and the whole line of column names may
be absent.  Positions are in mm; Rot is the rotation matrix, column by column.  A lost body has empty cells, or zeros
throughout.  With DATA_INCLUDED 3D there are MARKER_NAMES, and X, Y, Z of each marker.  z is up.
"""

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.sources.motion_capture.export_cells import Frames, Row, columns_of, rate_in_hertz, read_rows
from thesis_lib.datasets.sources.tables.several_bodies import choose_body
from thesis_lib.datasets.space.motion import Motion, quaternions
from thesis_lib.foundation.errors import UserError

MM = 1e-3
BEGINS = re.compile(r"[ \r]*(file_version|no_of_(frames|cameras|markers|bodies))\s*(\t|$)", re.I)
MATRIX = [f"rot[{i}]" for i in range(9)]
LAYOUTS = {"6d": ["x", "y", "z", "roll", "pitch", "yaw", "residual", *MATRIX], "3d": ["x", "y", "z"]}
NAMES = {"6d": "body_names", "3d": "marker_names"}
ORTHONORMAL = 0.02  # largest deviation of an element of R Rᵀ from the identity matrix


def read_qualisys(path: Path, body: str | None, rotation: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one); `rotation` is the sequence of Roll, Pitch, Yaw if Rot is absent.

    UserError if the header lines are not those of the format, the body is not in it or must be named, or a cell is
    not a number.
    """
    rows = read_rows(path)
    start = next((i for i, (_, cells) in enumerate(rows) if _is_data(cells)), len(rows))
    data = [row for row in rows[start:] if any(row[1])]
    facts = {cells[0].lower(): [cell for cell in cells[1:] if cell] for _, cells in rows[:start] if cells}
    kind = next(iter(facts.get("data_included", [])), "").lower()
    names = facts.get(NAMES.get(kind, ""), [])
    if not names or not data:
        raise UserError(
            f"{path} begins like an export of Qualisys, but has no line DATA_INCLUDED with 6D or 3D, no BODY_NAMES or "
            "MARKER_NAMES, or no frames; export it again as TSV, with its header."
        )
    tokens = _tokens(rows[:start], data, LAYOUTS[kind], len(names))
    starts = [i for i, token in enumerate(tokens) if token == "x"]
    columns = [
        {token: i + at for i, token in enumerate(tokens[at:end])} for at, end in zip(starts, [*starts[1:], len(tokens)])
    ]
    if len(columns) != len(names) or not all(set("xyz") <= set(of) for of in columns):
        raise UserError(
            f"{path}, row {data[0][0]}: {len(names)} names, but no X, Y, Z of each among {len(tokens)} columns; "
            "export it again with the line of column names."
        )
    frames = Frames(path, data, _times(path, data, tokens, facts), MM, notes)
    places = dict(zip(names, columns))
    if kind == "3d":
        return frames.motion_in_markers(places, body)
    chosen = choose_body(path, names, body)
    at = places[chosen]
    turn = [name for name in MATRIX if name in at] or ["roll", "pitch", "yaw"]
    if len(turn) not in (3, 9) or not set(turn) <= set(at):
        raise UserError(f"{path}: body {chosen} lacks columns Rot[0] to Rot[8]; export them.")
    if len(turn) == 3:
        angles = dict(zip("xyz", (at[name] for name in turn)))
        return frames.motion_of_body(chosen, at, angles, rotation or "XYZ")
    position, cells = frames.seen(at, [at[name] for name in turn])
    return Motion(chosen, str(path), frames.t, position, _from_columns(path, chosen, cells))


def _is_data(cells: list[str]) -> bool:
    """Whether a row is a frame: it begins with a number, or with an empty cell and has more than two cells."""
    if not cells or not cells[0]:
        return len(cells) > 2
    return cells[0].lstrip("+-")[:1].isdigit()


def _tokens(head: list[Row], data: list[Row], layout: list[str], bodies: int) -> list[str]:
    """Meaning of each column in lower case: the last word of its name or, without names, from its position."""
    last = [cell.split()[-1].lower() if cell else "" for cell in head[-1][1]] if head else []
    if set("xyz") <= set(last):
        return last
    width = max(len(cells) - (not cells[-1]) for _, cells in data[:100])
    return ["frame", "time"][: max(0, width - bodies * len(layout))] + layout * bodies


def _times(path: Path, data: list[Row], tokens: list[str], facts: dict[str, list[str]]) -> np.ndarray:
    if "time" in tokens:
        return columns_of(path, data, [tokens.index("time")])[:, 0]
    mistake = f"{path}: FREQUENCY is missing or not a rate in Hz; export it again with a column Time."
    rate = rate_in_hertz(next(iter(facts.get("frequency", [])), ""), mistake)
    frame = columns_of(path, data, [tokens.index("frame")])[:, 0] if "frame" in tokens else np.arange(len(data))
    return frame / rate


def _from_columns(path: Path, body: str, cells: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) from matrices (n, 9) written column by column; UserError if they are not rotations."""
    matrices = cells.reshape(-1, 3, 3).transpose(0, 2, 1)
    matrix = matrices[np.isfinite(cells).all(axis=1)]
    off = np.abs(matrix @ matrix.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    if np.any(off > ORTHONORMAL) or np.any(np.linalg.det(matrix) < 0.0):
        raise UserError(f"{path}: Rot[0] to Rot[8] of body {body} are not rotation matrices; export it again.")
    return quaternions(matrices, Rotation.from_matrix)
