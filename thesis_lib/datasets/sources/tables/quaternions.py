"""Tables of positions in space, with quaternions or, of a ball, without.

The four columns of the quaternion are q1, q2, q3, q4 in the order that `--quaternion` names; without --columns they are
expected as qx, qy, qz, qw, wherever they stand.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.sources.tables.log_table import Log, read_log, say_of_logs
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.datasets.sources.tables.pose import times
from thesis_lib.datasets.sources.tables.several_bodies import one_body
from thesis_lib.datasets.space.motion import Motion, Readings, mirrored, unit
from thesis_lib.foundation.errors import UserError

ORDERS = {"xyzw": [0, 1, 2, 3], "wxyz": [1, 2, 3, 0]}  # where x, y, z, w stand among the four columns
AXES = ("x", "y", "z")


def read_quaternion_tables(
    files: Sequence[str | Path], options: Reading, notes: list[str], warnings: list[str]
) -> list[Motion]:
    """The motion in each log, that of a point without a quaternion; adds to `notes` and `warnings`.

    UserError if a column is missing, a cell is not a number, or the four columns are not a unit quaternion.
    """
    source = source_of(options)
    logs = [read_log(Path(file), options, [name for name, _ in source.values()], warnings) for file in files]
    say_of_logs(logs, notes)
    return [motion_of_table(log, source, options, notes if log is logs[0] else []) for log in logs]


def source_of(options: Reading) -> dict[str, tuple[str, float]]:
    """For each column of a motion in space that of the table, and its sign; UserError for that of a planar one."""
    if "theta" in options.columns:
        raise UserError("--columns: theta is the angle of a planar log; with --quaternion give q1, q2, q3 and q4.")
    source = options.source("trial", "t", *AXES)
    for i, letter in enumerate(options.quaternion or ""):
        source[f"q{i + 1}"] = options.columns.get(f"q{i + 1}", (f"q{letter}", 1.0))
    return source


def motion_of_table(log: Log, source: Mapping[str, tuple[str, float]], options: Reading, notes: list[str]) -> Motion:
    """The motion in one table, that of a point without a quaternion; errors as of `read_quaternion_tables`."""
    path, order = log.path, options.quaternion
    log, source = one_body(log, source, options.body)
    four = [name for name in source if name.startswith("q")]
    log.require([source[name][0] for name in (*AXES, *four, *(set(options.columns) & {"t", "trial"}))])

    def cells(name: str) -> np.ndarray:
        column, sign = source[name]
        return sign * log.numbers(column)

    labels = log.text(source["trial"][0]) if log.has(source["trial"][0]) else None
    trial = None if labels is None else labels.to_numpy(dtype=str)
    one = pd.Series("0", index=range(len(log))) if trial is None else pd.Series(trial)
    t = times(log, options, one, source["t"][0], notes)
    scales = [options.si.to_si(axis, log.unit(source[axis][0]), log.where(source[axis][0])) for axis in AXES]
    position = np.array(scales) * np.stack([cells(axis) for axis in AXES], axis=1)
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
