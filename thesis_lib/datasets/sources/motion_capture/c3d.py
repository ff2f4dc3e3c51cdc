"""Reader of C3D files (https://www.c3d.org): positions of markers from Vicon, Qualisys, OptiTrack and many others.

Markers are named body:marker, or just marker; the markers of a body give its motion, a single one is a ball.  If the
file has a group ROTATION (4 × 4 matrices: axes and origin of a body), its entries are the bodies.  Unit and rate are
taken from the file.  Lost markers are NaN, or zeros throughout.  z is up, unless --up states otherwise.

The package ezc3d reads the file, in a separate process (`own_process`).
"""

import struct
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.sources.motion_capture.export_cells import length_unit
from thesis_lib.datasets.sources.motion_capture.own_process import arrays_of
from thesis_lib.datasets.sources.motion_capture.tracked_bodies import choose_markers, motion_of_markers
from thesis_lib.datasets.sources.tables.several_bodies import choose_body
from thesis_lib.datasets.space.motion import Motion, quaternions
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import MissingFile, read_bytes

MAX_C3D = 200_000_000  # bytes
PACKAGE = "ezc3d"
BLOCK = 512  # bytes
PROCESSORS = {84: ("<", 3), 85: ("<", 1), 86: (">", 0)}  # Intel, DEC, MIPS: byte order, byte with a float's sign


def is_c3d(path: Path, begin: bytes) -> bool:
    """Whether a file is a C3D file, by its ending or its first bytes: a block number, and 0x50."""
    return path.suffix.lower() == ".c3d" or (len(begin) > 1 and 1 < begin[0] < 9 and begin[1] == 0x50)


def read_c3d(path: Path, body: str | None, notes: list[str]) -> Motion:
    """The motion of `body` (by default the only one): a prefix of markers, a marker, or a rotation.

    UserError if the package is not installed, the file is damaged, or the body is not in it or must be named.
    """
    if find_spec(PACKAGE) is None:
        raise UserError(
            f"{path} is a C3D file, which is binary; reading it needs a package: pip install {PACKAGE}. Or export it "
            "as CSV from the program that recorded it."
        )
    file = _read(path)
    points, turns, rates = file["points"].astype(float), file["rotations"].astype(float), file["rates"]
    labels, bodies, units = (file[name].tolist() for name in ("labels", "bodies", "units"))
    scale = length_unit(path, units[0] if units else "mm", "POINT:UNITS")
    rate = rates[1] if turns.size else rates[0]
    if not 0.0 < rate < 1e6:
        raise _damaged(path, f"its rate is {rate:g} Hz")
    if turns.size:
        names = [name.strip() or f"body {i + 1}" for i, name in enumerate(_named(bodies, turns.shape[2]))]
        chosen = choose_body(path, names, body)
        return _rotated(path, chosen, turns[:, :, names.index(chosen)], scale, rate)
    chosen, wanted = choose_markers(path, names := _named(labels, points.shape[1]), body)
    markers = scale * points[:, [names.index(name) for name in wanted]].transpose(2, 1, 0)
    return motion_of_markers(path, chosen, wanted, markers, np.arange(len(markers)) / rate, notes)


def _named(labels: list[str], count: int) -> list[str]:
    """A label for each of `count` columns; columns without one are labelled *i and belong to no body."""
    labels = [label.strip() for label in labels[:count]]
    return labels + [f"*{i}" for i in range(len(labels), count)]


def _rotated(path: Path, name: str, matrices: np.ndarray, scale: float, rate: float) -> Motion:
    """The motion of a body from matrices (4, 4, n) that map its frame to the frame of the recording."""
    turn, position = matrices[:3, :3].transpose(2, 0, 1), scale * matrices[:3, 3].T
    whole = np.isfinite(np.sum(matrices[:3], axis=(0, 1)))
    whole &= np.linalg.det(np.where(whole[:, None, None], turn, 0.0)) > 0.5  # zeros where lost
    quaternion = quaternions(np.where(whole[:, None, None], turn, np.nan), Rotation.from_matrix)
    return Motion(name, str(path), np.arange(len(turn)) / rate, position, quaternion)


def _read(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file, as `own_process` reads them; UserError if that fails."""
    try:
        _check(path, read_bytes(path, MAX_C3D))
        return arrays_of("c3d", [path])
    except MissingFile as error:
        raise UserError(f"{path} does not exist; give a C3D file.") from error
    except ValueError as error:
        raise _damaged(path, str(error)) from error


def _check(path: Path, content: bytes) -> None:
    """UserError if a file is too short for the content that its first block states."""
    if len(content) < 2 * BLOCK or content[1] != 0x50 or len(content) < (start := BLOCK * (content[0] - 1)) + 4:
        raise _damaged(path, "its first bytes are not those of such a file, or it is too short")
    if start < BLOCK or content[start + 3] not in PROCESSORS:
        raise _damaged(path, "the kind of computer that wrote it is unknown")
    order, sign = PROCESSORS[content[start + 3]]
    points, analog, first, last = struct.unpack(f"{order}4H", content[2:10])
    (data,) = struct.unpack(f"{order}H", content[16:18])
    size = (4 if content[12 + sign] & 0x80 else 2) * (4 * points + analog)  # a negative scale: floats
    if data < 2 or BLOCK * (data - 1) + size * max(0, last - first + 1) > len(content):
        raise _damaged(path, "it is shorter than its first block states")


def _damaged(path: Path, reason: str) -> UserError:
    return UserError(
        f"{path} is a C3D file (binary, read with {PACKAGE}), but cannot be read: {reason}. Is it complete? Export it "
        "again, or as CSV."
    )
