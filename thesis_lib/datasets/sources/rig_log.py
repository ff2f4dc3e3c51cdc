"""Convert a rig's own logs into a dataset folder: units, column names, signs, one file per trial or for many.

"row" is the line in the file, the header being row 1.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS
from thesis_lib.datasets.format.validate import SHOWN, row_text
from thesis_lib.datasets.sources.conversion import Conversion, Rig, as_dataset
from thesis_lib.datasets.sources.log_table import numbers, read_log, require
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.datasets.space.plane import Plane
from thesis_lib.foundation.errors import UserError

UNITS = {  # name -> (quantity, factor to SI)
    **{"m": ("length", 1.0), "cm": ("length", 1e-2), "mm": ("length", 1e-3)},
    **{"rad": ("angle", 1.0), "deg": ("angle", np.pi / 180.0)},
    **{"s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6)},
}
QUANTITY = {"t": "time", "x": "length", "y": "length", "theta": "angle"}
FLAT = Plane.of(np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0]))  # the plane of a planar log, in space
SPATIAL = ("z", "q1", "q2", "q3", "q4")  # columns of a log with quaternions, beside those of a planar one


def parse_units(text: str) -> dict[str, float]:
    """'mm,deg,ms' -> factor to SI for each of length, angle, time (SI by default); UserError for wrong units."""
    factors: dict[str, float] = {}
    for unit in filter(None, (part.strip() for part in text.split(","))):
        if unit not in UNITS:
            raise UserError(f"--units: '{unit}' is unknown; known are {', '.join(UNITS)} (for example --units mm,deg).")
        quantity, factor = UNITS[unit]
        if quantity in factors:
            raise UserError(f"--units: '{text}' gives two units of {quantity}; give one for each quantity.")
        factors[quantity] = factor
    return {"length": 1.0, "angle": 1.0, "time": 1.0} | factors


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


def convert_logs(
    files: Sequence[str | Path],
    name: str,
    units: Mapping[str, float],
    columns: Mapping[str, tuple[str, float]],
    rig: Rig,
    *,
    delimiter: str = ",",
    per_trial_files: bool = False,
) -> Conversion:
    """A dataset of trajectories from CSV logs with a header line each and the same columns.

    `units` are factors to SI by quantity (`parse_units`), `columns` our column -> (column of the log, sign); others are
    expected under our names.  A log without times needs `rig.rate`.  With `per_trial_files` each file is one trial,
    whatever its trial column.  UserError: a file or column is missing, a row is too long, a cell is not a number, or a
    value of the experiment is impossible.
    """
    if spatial := [column for column in columns if column in SPATIAL]:
        raise UserError(f"--columns: {spatial[0]} belongs to a motion in space; say how it turns with --quaternion.")
    notes, warnings = [], []
    source = {column: columns.get(column, (column, 1.0)) for column in TRAJECTORY_COLUMNS}
    logs = [read_log(Path(file), delimiter, warnings) for file in files]
    tables = []
    for number, (file, log) in enumerate(zip(files, logs)):
        needed = ["x", "y", "theta", *(column for column in columns if column in ("trial", "t"))]
        require(Path(file), log, [source[column][0] for column in needed], columns)
        tables.append(_poses(Path(file), log, source, units, rig.rate, number, per_trial_files))
    used = {log_column for log_column, _ in source.values()}
    if ignored := [column for column in logs[0].columns if column and column not in used]:
        notes.append(f"columns left out: {', '.join(ignored)}")

    poses = pd.concat(tables, ignore_index=True)[list(TRAJECTORY_COLUMNS)]
    poses["trial"] = _number_trials(poses["trial"], notes)
    lost = poses[["t", "x", "y", "theta"]].isna().any(axis=1)
    if lost.any():
        notes.append(
            f"{int(lost.sum())} of {len(poses)} rows left out: a pose or time is empty, as where frames are lost "
            f"({_lost_rows(files, logs, lost.to_numpy())})"
        )
        poses = poses[~lost].reset_index(drop=True)
    if len(poses) == 0:
        raise UserError(f"{files[0]} holds no row with a complete pose; nothing was converted.")
    return Conversion(as_dataset(poses, name, files, rig, notes), notes, warnings)


def read_planar_motions(
    files: Sequence[str | Path],
    units: Mapping[str, float],
    columns: Mapping[str, tuple[str, float]],
    *,
    rate: float | None = None,
    delimiter: str = ",",
    warnings: list[str],
) -> list[Motion]:
    """Each log as one long recording in a plane of space: x along `FLAT.x`, y up; arguments as in `convert_logs`."""
    from scipy.spatial.transform import Rotation

    source = {column: columns.get(column, (column, 1.0)) for column in TRAJECTORY_COLUMNS}
    motions = []
    for number, file in enumerate(files):
        log = read_log(Path(file), delimiter, warnings)
        require(Path(file), log, [source[column][0] for column in ("x", "y", "theta")], columns)
        poses = _poses(Path(file), log, source, units, rate, number, True)
        q = poses[["x", "y", "theta"]].to_numpy()
        whole = np.isfinite(q[:, 2])
        quaternion = np.full((len(q), 4), np.nan)
        frame = Rotation.from_matrix(np.stack([FLAT.x, FLAT.y, FLAT.normal], axis=1))
        if whole.any():
            quaternion[whole] = (frame * Rotation.from_rotvec(np.outer(q[whole, 2], [0.0, 0.0, 1.0]))).as_quat()
        position = np.outer(q[:, 0], FLAT.x) + np.outer(q[:, 1], FLAT.y)
        motions.append(Motion("", str(file), poses["t"].to_numpy(), position, quaternion))
    return motions


def _poses(
    path: Path,
    log: pd.DataFrame,
    source: Mapping[str, tuple[str, float]],
    units: Mapping[str, float],
    rate: float | None,
    number: int,
    one_trial: bool,
) -> pd.DataFrame:
    """Trial (text), t, x, y, theta of a log in SI; it is trial `number` if `one_trial` or without a trial column."""
    has_t = source["t"][0] in log.columns
    if not has_t and rate is None:
        raise UserError(f"{path} has no time column: give --columns t=NAME, or --rate HZ for evenly spaced rows.")
    if not one_trial and source["trial"][0] in log.columns:
        trial = log[source["trial"][0]].to_numpy(dtype=str)
    else:
        trial = np.full(len(log), str(number))
    table = pd.DataFrame({"trial": trial})
    for column in ("t", "x", "y", "theta") if has_t else ("x", "y", "theta"):
        log_column, sign = source[column]
        table[column] = sign * units[QUANTITY[column]] * numbers(path, log, log_column)
    if not has_t and rate is not None:
        table["t"] = table.groupby("trial", sort=False).cumcount() / rate
    return table


def _lost_rows(files: Sequence[str | Path], logs: Sequence[pd.DataFrame], lost: np.ndarray) -> str:
    """Row numbers of the `lost` (N,) of all logs together, with the file if there are several."""
    parts = np.split(lost, np.cumsum([len(log) for log in logs])[:-1])
    by_file = [
        (Path(file).name, row_text(np.asarray(log.index[part])))
        for file, log, part in zip(files, logs, parts)
        if part.any()
    ]
    if len(files) == 1:
        return by_file[0][1]
    more = f"; and {len(by_file) - SHOWN} more files" if len(by_file) > SHOWN else ""
    return "; ".join(f"{name} {rows}" for name, rows in by_file[:SHOWN]) + more


def _number_trials(trial: pd.Series, notes: list[str]) -> np.ndarray:
    """Trials as integers: the log's whole numbers, else counted in order of appearance."""
    numbers = pd.to_numeric(trial, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    if np.all(np.isfinite(numbers)) and np.all(numbers == np.rint(numbers)) and np.all(np.abs(numbers) < 2**53):
        return numbers.astype(np.int64)
    codes, labels = pd.factorize(trial)
    notes.append(f"trials numbered in order of appearance: 0 = {labels[0]}, …, {len(labels) - 1} = {labels[-1]}")
    return codes.astype(np.int64)
