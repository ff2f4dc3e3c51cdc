"""Convert a rig's own logs into a dataset folder: units, column names, signs, one file per trial or for many.

`Conversion.notes` lists everything that was changed or left out, `Conversion.warnings` what may be wrong with a log.
"row" is the line in the file, the header being row 1.
"""

import csv
import difflib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from pydantic import ValidationError

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, median_step, unwrap
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.validate import SHOWN, row_text
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import MissingFile, read_bytes

UNITS = {  # name -> (quantity, factor to SI)
    **{"m": ("length", 1.0), "cm": ("length", 1e-2), "mm": ("length", 1e-3)},
    **{"rad": ("angle", 1.0), "deg": ("angle", np.pi / 180.0)},
    **{"s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6)},
}
MAX_COLUMNS = 1000
MAX_LOG = 200_000_000  # bytes; as lists of cells a log takes about ten times that
_OPTIONS = {"size": "homogeneous"}  # keys of dataset.yaml whose option has another name
QUANTITY = {"t": "time", "x": "length", "y": "length", "theta": "angle"}


@dataclass
class Conversion:
    """A converted log; `notes` and `warnings` are sentences."""

    dataset: Dataset
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


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
        if not equals or not log_column or name not in TRAJECTORY_COLUMNS or name in columns:
            raise UserError(
                f"--columns: '{part}' is not OURS=YOURS with OURS one of {', '.join(TRAJECTORY_COLUMNS)}, each once "
                "(for example --columns t=time_s,x=X,y=-Z,theta=angle; a minus sign flips the axis)."
            )
        sign = -1.0 if log_column.startswith("-") and name in ("x", "y", "theta") else 1.0
        columns[name] = (log_column[1:] if sign < 0 else log_column, sign)
    return columns


def parse_shape(text: str) -> Shape:
    """'ellipse:A,B' | 'disk:R' | 'square:SIDE' | 'polygon:x1,y1;x2,y2;…' in m; UserError for anything else."""
    kind, _, rest = text.partition(":")
    try:
        points = [tuple(float(value) for value in point.split(",")) for point in rest.split(";")]
        if kind == "ellipse":
            return Ellipse(semi_axes=points[0])  # pyright: ignore[reportArgumentType]
        if kind == "disk":
            return Disk(radius=points[0][0])
        if kind == "square":
            h = points[0][0] / 2.0
            return Polygon(vertices=((h, h), (-h, h), (-h, -h), (h, -h)))
        if kind == "polygon":
            return Polygon(vertices=tuple(points))  # pyright: ignore[reportArgumentType]
    except (ValueError, ValidationError) as error:
        reason = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
        raise UserError(f"--shape: '{text}' is not a shape ({reason}).") from error
    known = "ellipse:A,B (semi-axes), disk:R, square:SIDE or polygon:x1,y1;x2,y2;…"
    raise UserError(f"--shape: '{kind}' is unknown; give {known} in m.")


def convert_logs(
    files: Sequence[str | Path],
    name: str,
    units: Mapping[str, float],
    columns: Mapping[str, tuple[str, float]],
    shape: Shape,
    *,
    mass: float | None = None,
    k_g: float | None = None,
    size_uncertainty: float | None = None,
    rate: float | None = None,
    gravity: float = 9.81,
    surface_height: float = 0.0,
    delimiter: str = ",",
    per_trial_files: bool = False,
) -> Conversion:
    """A dataset of trajectories from CSV logs with a header line each and the same columns.

    `units` are factors to SI by quantity (`parse_units`), `columns` our column -> (column of the log, sign); others are
    expected under our names.  Mass is in kg, k_g (by default that of a uniform lamina) and surface_height in m, gravity
    in m/s², rate (needed if the log has no time) in Hz.  `size_uncertainty` (relative, one sigma) says that the body is
    homogeneous and how well its size is known.  With `per_trial_files` each file is one trial, whatever its
    trial column.  UserError: a file or column is missing, a row is too long, a cell is not a number, or a value of the
    experiment is impossible.
    """
    if rate is not None and not (np.isfinite(rate) and rate > 0):
        raise UserError(f"--rate: {rate} Hz is impossible; give a number above 0.")
    notes, warnings = [], []
    source = {column: columns.get(column, (column, 1.0)) for column in TRAJECTORY_COLUMNS}
    logs = [_read_log(Path(file), delimiter, warnings) for file in files]
    tables = []
    for number, (file, log) in enumerate(zip(files, logs)):
        needed = ["x", "y", "theta", *(column for column in columns if column in ("trial", "t"))]
        _require(Path(file), log, [source[column][0] for column in needed], columns)
        tables.append(_poses(Path(file), log, source, units, rate, number, per_trial_files))
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
    poses["t"] -= poses.groupby("trial", sort=False)["t"].transform("first")
    before = poses["theta"].to_numpy(copy=True)
    poses["theta"] = unwrap(before, poses["trial"].to_numpy())
    if wrapped := int(np.sum(before != poses["theta"].to_numpy())):
        notes.append(f"theta made continuous within trials ({wrapped} rows moved by whole turns)")

    lamina, step = shape.radius_of_gyration, median_step(poses)
    body: dict = {"shape": shape, "mass": mass, "radius_of_gyration": lamina if k_g is None else k_g}
    if size_uncertainty is not None:
        body |= {"homogeneous": True, "uncertainty": {"size": size_uncertainty}}
    elif k_g is None:
        notes.append(f"radius of gyration {lamina:.5g} m, that of a uniform lamina (--k-g to change)")
    others = f" and {len(files) - 1} more" if len(files) > 1 else ""
    content = {
        "schema": 1,
        "description": f"converted from {Path(files[0]).name}{others}",
        "body": body,
        "surface": {"height": surface_height},
        "gravity": gravity,
        "rate": rate if rate is not None else (float(f"{1.0 / step:.6g}") if step > 0 else None),
    }
    try:
        header = Header.model_validate(content)
    except ValidationError as error:
        mistake = error.errors()[0]
        option = _OPTIONS.get(str(mistake["loc"][-1]), str(mistake["loc"][-1]).replace("_", "-"))
        raise UserError(f"--{option}: {mistake['input']}: {mistake['msg']}.") from error
    return Conversion(Dataset(name, header, poses), notes, warnings)


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
        table[column] = sign * units[QUANTITY[column]] * _numbers(path, log, log_column)
    if not has_t and rate is not None:
        table["t"] = table.groupby("trial", sort=False).cumcount() / rate
    return table


def _read_log(path: Path, delimiter: str, warnings: list[str]) -> pd.DataFrame:
    """The cells of a log as text, indexed by their row in the file; a last row that was cut off is left out."""
    try:
        content = read_bytes(path, MAX_LOG)
        reader = csv.reader(
            io.StringIO(content.decode("utf-8-sig"), newline=""), delimiter=delimiter, skipinitialspace=True
        )
        # blank lines are skipped; `line_num` still gives the row numbers
        lines = [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells)) or len(cells) > 1]
        complete = content.endswith((b"\n", b"\r"))
    except MissingFile as error:
        raise UserError(f"{path} does not exist; give the log as a CSV file with a header line.") from error
    except (ValueError, csv.Error) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise UserError(f"{path} cannot be read as a table ({reason}). Is --delimiter right?") from error
    if not lines:
        raise UserError(f"{path} is empty; give the log as a CSV file with a header line.")
    (_, names), *lines = lines
    width = len(names)
    if width > MAX_COLUMNS:
        raise UserError(f"{path} has {width:,} columns; the limit is {MAX_COLUMNS:,}. Is --delimiter right?")
    for row, cells in lines:
        if any(map(str.strip, cells[width:])):  # a delimiter at the end of a row starts no further cell
            raise UserError(
                f"{path}, row {row}: {len(cells)} cells, but the header names {width} columns. Give each row one cell "
                "for each column; write decimal points, not commas, and check --delimiter."
            )
    if lines and len(lines[-1][1]) < width:
        row, cells = lines.pop()
        warnings.append(
            f"{path.name}, row {row}: the last row has {len(cells)} of {width} cells, so the file was cut off; the row "
            "is left out. Check that the log is whole."
        )
    elif lines and not complete:
        warnings.append(
            f"{path.name}, row {lines[-1][0]}: the last row does not end with a line break, so its last number may "
            "have been cut off; the row is kept. Check it, and that the log is whole."
        )
    cells = [(cells + [""] * width)[:width] for _, cells in lines]
    return pd.DataFrame(cells, index=[row for row, _ in lines], columns=_distinct(names), dtype=str)


def _distinct(names: Sequence[str]) -> list[str]:
    """Stripped column names; a name that occurs again becomes name.1, so that `name` is the first."""
    seen: dict[str, int] = {}
    result = []
    for name in map(str.strip, names):
        seen[name] = seen.get(name, -1) + 1
        result.append(f"{name}.{seen[name]}" if name and seen[name] else name)
    return result


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


def _require(path: Path, log: pd.DataFrame, needed: Sequence[str], columns: Mapping) -> None:
    missing = [name for name in needed if name not in log.columns]
    if not missing:
        return
    close = difflib.get_close_matches(missing[0], list(log.columns), n=1, cutoff=0.6)
    hint = f" (did you mean '{close[0]}'?)" if close else ""
    raise UserError(
        f"{path} has no column {', '.join(missing)}{hint}. It has: {', '.join(map(str, log.columns))}. Name yours with "
        "--columns trial=…,t=…,x=…,y=…,theta=…" + ("" if len(log.columns) > 1 else ", and check --delimiter") + "."
    )


def _numbers(path: Path, log: pd.DataFrame, name: str) -> np.ndarray:
    """A column as floats (n,); empty cells and NaN are NaN."""
    text = log[name].str.strip()
    numbers = pd.to_numeric(text, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    bad = np.isnan(numbers) & ~text.str.lower().isin(["", "nan", "na", "null", "none"]).to_numpy()
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise UserError(
            f"{path}, column {name}, row {log.index[first]}: {str(text.iloc[first])[:40]!r} is not a number "
            f"({int(bad.sum())} such cells). Remove text and units from the cells; write decimal points."
        )
    return numbers


def _number_trials(trial: pd.Series, notes: list[str]) -> np.ndarray:
    """Trials as integers: the log's whole numbers, else counted in order of appearance."""
    numbers = pd.to_numeric(trial, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    if np.all(np.isfinite(numbers)) and np.all(numbers == np.rint(numbers)) and np.all(np.abs(numbers) < 2**53):
        return numbers.astype(np.int64)
    codes, labels = pd.factorize(trial)
    notes.append(f"trials numbered in order of appearance: 0 = {labels[0]}, …, {len(labels) - 1} = {labels[-1]}")
    return codes.astype(np.int64)
