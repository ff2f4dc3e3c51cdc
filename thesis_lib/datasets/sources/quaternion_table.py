"""Tables of positions in space, with quaternions or, of a ball, without.

The four columns of the quaternion are q1, q2, q3, q4 in the order that `--quaternion` names; without --columns they are
expected as qx, qy, qz, qw, wherever they stand.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from thesis_lib.datasets.sources.log_table import numbers, read_log, require
from thesis_lib.datasets.space.motion import Motion, Readings, mirrored, unit
from thesis_lib.foundation.errors import UserError

ORDERS = {"xyzw": [0, 1, 2, 3], "wxyz": [1, 2, 3, 0]}  # where x, y, z, w stand among the four columns
AXES = ("x", "y", "z")


def read_quaternion_tables(
    files: Sequence[str | Path],
    units: Mapping[str, float],
    columns: Mapping[str, tuple[str, float]],
    order: str | None,
    *,
    rate: float | None = None,
    delimiter: str = ",",
    warnings: list[str],
) -> list[Motion]:
    """The motion in each log, that of a point without an `order`; other arguments as in `convert_logs`.

    Adds to `warnings`.

    UserError if a column is missing, a cell is no number, or the four columns are no unit quaternion.
    """
    if "theta" in columns:
        raise UserError("--columns: theta is the angle of a planar log; with --quaternion give q1, q2, q3 and q4.")
    source = {name: columns.get(name, (name, 1.0)) for name in ("trial", "t", *AXES)}
    source |= {f"q{i + 1}": columns.get(f"q{i + 1}", (f"q{letter}", 1.0)) for i, letter in enumerate(order or "")}
    return [_read(Path(file), source, units, columns, order, rate, delimiter, warnings) for file in files]


def _read(
    path: Path,
    source: Mapping[str, tuple[str, float]],
    units: Mapping[str, float],
    columns: Mapping[str, tuple[str, float]],
    order: str | None,
    rate: float | None,
    delimiter: str,
    warnings: list[str],
) -> Motion:
    log = read_log(path, delimiter, warnings)
    four = [name for name in source if name.startswith("q")]
    require(path, log, [source[name][0] for name in (*AXES, *four, *(set(columns) & {"t", "trial"}))], columns)

    def cells(name: str) -> np.ndarray:
        column, sign = source[name]
        return sign * numbers(path, log, column)

    trial = log[source["trial"][0]].to_numpy(dtype=str) if source["trial"][0] in log.columns else None
    if source["t"][0] in log.columns:
        t = units["time"] * cells("t")
    elif rate is None:
        raise UserError(f"{path} has no time column: give --columns t=NAME, or --rate HZ for evenly spaced rows.")
    else:
        t = np.arange(len(log)) / rate
    position = units["length"] * np.stack([cells(axis) for axis in AXES], axis=1)
    if order is None:
        return Motion.of_point("", str(path), t, position, trial)
    raw = unit(np.stack([cells(name) for name in four], axis=1), f"{path}, {', '.join(source[q][0] for q in four)}")

    quaternion = raw[:, ORDERS[order]]
    readings: Readings = {
        f"--quaternion {other}": lambda other=other: raw[:, ORDERS[other]] for other in ORDERS if other != order
    }
    # a frame one axis of which points the other way: the two other components change their sign
    for flipped in range(3):
        turned = [four[ORDERS[order][other]] for other in range(3) if other != flipped]
        option = ",".join(f"{q}={'-' if source[q][1] > 0 else ''}{source[q][0]}" for q in sorted(turned))
        readings |= {f"--columns {option}": partial(mirrored, quaternion, flipped)}
    return Motion("", str(path), t, position, quaternion, trial, readings)
