"""Times and poses in SI from the tables of a rig: poses in the plane, points of a video tracker, poses in space.

Points of a body that a video tracker follows (DeepLabCut, Lightning Pose, SLEAP) give its pose in the picture.
A point z_j = u_j + i v_j of a rigid body is p + c_j exp(iθ), where c_j is its position in the body, p and θ the pose:

    θ = arg Σ_j (c_j − c̄)* (z_j − z̄),    p = z̄ − c̄ exp(iθ)

summed over the visible points j (bars: their means; Horn 1987, doi:10.1364/JOSAA.4.000629, in the plane).  The c_j are
means over the frames that show all points; their mean is the origin, and θ points from the first to the second.

In space the four columns of the quaternion are q1, q2, q3, q4 in the order given by `--quaternion`, or qx, qy, qz, qw;
without --columns they must be named qx, qy, qz, qw and may stand in any order.  A ball has none.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Disk
from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS
from thesis_lib.datasets.sources.tables.log_table import LIKELY, Log, read_logs
from thesis_lib.datasets.sources.tables.options import PARTS, QUANTITY, SPATIAL, Reading
from thesis_lib.datasets.sources.tables.rig_options import RigOptions, needs_no_angle
from thesis_lib.datasets.sources.tables.several_bodies import one_body
from thesis_lib.datasets.sources.tables.times import times
from thesis_lib.datasets.space.motion import Motion, Readings, mirrored, unit
from thesis_lib.foundation.errors import UserError
from thesis_lib.statistics.wording import plural

ORDERS = {"xyzw": [0, 1, 2, 3], "wxyz": [1, 2, 3, 0]}  # positions of x, y, z, w among the four columns
AXES = ("x", "y", "z")
FILLS = "ffill", "bfill"  # from the last and from the next row that shows the body
NEAR, FAR = 5e-3, 2.0  # m, and usual steps from the origin beyond which a row of zeros beside shows no body
STRAY = 0.1  # share of a body's size by which tracked points may deviate from a rigid body


def read_poses(
    files: Sequence[str | Path],
    options: Reading,
    rig: RigOptions,
    one_trial: bool,
    notes: list[str],
    warnings: list[str],
) -> tuple[list[Log], list[pd.DataFrame]]:
    """The logs, and for each a table of trial (text), t, x, y and, if measured, theta, in SI; NaN where lost.

    A file is one trial if `one_trial` is set or the trial column is missing.  UserError: a file or column is missing, a
    row is too long, a cell is not a number, units contradict each other, or a body other than a disk has no angle.
    """
    if spatial := [column for column in options.columns if column in (*SPATIAL, *PARTS)]:
        raise UserError(f"--columns: {spatial[0]} belongs to a motion in space; give --quaternion for its rotation.")
    source = options.source(*TRAJECTORY_COLUMNS)
    logs = read_logs(files, options, [name for name, _ in source.values()], notes, warnings)
    tracked = bool(logs[0].points) and not {"x", "y", "theta"} & set(options.columns)
    if options.body and not tracked:
        raise UserError(
            f"{logs[0].path} is a table of one body: --body is for files of several bodies, or of a video tracker; "
            "name the columns with --columns."
        )
    pose = () if tracked else _pose_columns(logs[0], options, rig)
    needed = [source[column][0] for column in (*pose, *(c for c in ("trial", "t") if c in options.columns))]
    tables, lost, zeros = [], [], 0
    for number, log in enumerate(logs):
        log.require(needed)
        said = (notes, warnings) if number == 0 else ([], [])
        stamps = source["t"][0]
        if tracked and "t" not in options.columns and log.has("frame"):
            stamps = "frame"
        trial = pd.Series(str(number), index=range(len(log)))
        if not one_trial and log.has(source["trial"][0]):
            trial = log.text(source["trial"][0]).reset_index(drop=True)
        poses = {"trial": trial, "t": times(log, options, trial, stamps, said[0])}
        poses |= _tracked(log, options, lost, *said) if tracked else _columns(log, options, pose, said[1])
        poses = pd.DataFrame(poses)
        zeros += _lose_zeros(poses)
        _need_origin(log, options, rig, poses)
        tables.append(poses)
    if sum(lost):
        notes.append(f"{sum(lost)} points taken as lost: their likelihood is below {LIKELY}, or they are empty")
    if zeros:
        notes.append(f"{plural(zeros, 'row')} of zeros taken as lost: the body is elsewhere just before and after")
    used = {logs[0].find(name) for name, _ in source.values()} | ({"frame"} if tracked else set())
    points = tuple(f"{point}." for point in logs[0].points) if tracked else ()
    if ignored := [c for c in logs[0].cells.columns if c and c not in used and not c.startswith(points or ("\n",))]:
        notes.append(f"columns left out: {', '.join(ignored)}")
    return logs, tables


def _lose_zeros(poses: pd.DataFrame) -> int:
    """Set the poses of rows of zeros to NaN where the rows beside them are far from the origin; the number of rows."""
    names = [name for name in ("x", "y", "theta") if name in poses]
    zero = (poses[names] == 0.0).all(axis=1)
    if not zero.any():
        return 0
    place = poses[["x", "y"]].mask(zero)
    known = place.groupby(poses["trial"])
    beside = [np.hypot(*getattr(known, fill)().to_numpy().T) for fill in FILLS]
    usual = pd.Series(np.hypot(*place.diff().to_numpy().T)).median()  # NaN if no two rows in sequence show the body
    lost = zero & (np.fmin(*beside) > max(FAR * np.nan_to_num(usual), NEAR))
    poses.loc[lost, names] = np.nan
    return int(lost.sum())


def _pose_columns(log: Log, options: Reading, rig: RigOptions) -> tuple[str, ...]:
    """The columns x, y and theta; theta may be missing for a disk; UserError if it is missing for another shape."""
    names = {ours: name for ours, (name, _) in options.source("x", "y", "theta").items()}
    if "theta" in options.columns or log.has("theta"):
        return ("x", "y", "theta")
    if log.has(names["x"]) and log.has(names["y"]):
        needs_no_angle(rig.shape, str(log.path))
    return ("x", "y") if isinstance(rig.shape, Disk) else ("x", "y", "theta")


def _columns(log: Log, options: Reading, pose_columns: Sequence[str], warnings: list[str]) -> dict[str, np.ndarray]:
    """x, y and, if it is among `pose_columns`, theta, in SI."""
    source = options.source(*pose_columns)
    pose, units = {}, {}
    for ours, (name, sign) in source.items():
        units[ours] = options.si.unit(ours, log.unit(name), log.where(name))
        if (cell := log.strange.get(log.find(name) or "")) and QUANTITY[ours] not in options.si.given:
            warnings.append(
                f"{log.path.name}, column {name}: '{cell[:20]}' below the header is not a known unit; read as "
                f"{units[ours]}. If that is wrong, convert the column, or give --units"
            )
        zero = dict(zip("xy", options.zero)).get(ours, 0.0)
        pose[ours] = sign * options.si.factor(units[ours], log.where(name)) * (log.numbers(name) - zero)
    if units["y"] == "px" and "theta" in source and source["x"][1] * source["y"][1] < 0.0 < source["theta"][1]:
        warnings.append(
            f"theta is read as counter-clockwise while an axis of the picture is flipped; an angle measured in the "
            f"picture's own axes needs --columns theta=-{source['theta'][0]}"
        )
    return pose


def _tracked(
    log: Log, options: Reading, lost: list[int], notes: list[str], warnings: list[str]
) -> dict[str, np.ndarray]:
    """x, y and, with several points, theta from the points of a video tracker in a picture with y downwards.

    Appends the number of lost points to `lost`.
    """
    wanted = [name.strip() for name in options.body.split(",")] if options.body else list(log.points)
    chosen = {name: [p for p in log.points if p == name or p.startswith(f"{name}.")] for name in wanted}
    if strange := [name for name, points in chosen.items() if not points]:
        raise UserError(f"{log.path} has no point {', '.join(strange)}. It has: {', '.join(log.points)}.")
    points = [p for p in log.points if any(p in of_name for of_name in chosen.values())]
    z = np.stack([log.numbers(f"{p}.x") + 1j * log.numbers(f"{p}.y") for p in points], axis=1)
    try:
        place, theta, stray = pose_of_points(z)
    except ValueError as error:
        raise UserError(f"{log.path}: {error} of {', '.join(points)}; leave some out with --body.") from error
    unit = options.si.given.get("length", "px")
    factor = options.si.factor(unit, f"{log.path}, point {points[0]}")
    x, y = factor * (place - np.array(options.zero)).T
    lost.append(int(np.sum(~np.isfinite(z))))
    notes.append(f"points of a video tracker: {', '.join(points)}; y of the picture points down, and is flipped")
    if len(points) == 1:
        return {"x": x, "y": -y}
    notes.append(f"x and y are the mean of the points, theta the direction from {points[0]} to {points[1]}")
    if stray > STRAY:
        warnings.append(
            f"{log.path.name}: the points {', '.join(points)} deviate by {stray:.0%} of the body's size from a rigid "
            "body; name the points on the body with --body"
        )
    return {"x": x, "y": -y, "theta": -theta}


def pose_of_points(z: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Position p (n, 2) and angle θ (n,) of a body from its points z (n, m), complex and NaN where not seen.

    The third value is the rms deviation of the points from a rigid body, over its size.  A pose needs two points; a
    single point has no angle (NaN).  ValueError if no frame shows all points.
    """
    if z.shape[1] == 1:
        return np.column_stack([np.real(z[:, 0]), np.imag(z[:, 0])]), np.full(len(z), np.nan), 0.0
    whole = z[np.isfinite(z).all(axis=1)]
    if len(whole) == 0:
        raise ValueError("no frame shows all points")
    whole = whole - whole.mean(axis=1, keepdims=True)
    turn = np.angle(np.sum(whole[0].conj() * whole, axis=1))
    c = np.mean(whole * np.exp(-1j * turn)[:, None], axis=0)
    c = c * np.exp(-1j * np.angle(c[1] - c[0]))

    seen = np.isfinite(z)
    count = np.maximum(seen.sum(axis=1), 1)
    c_mean, z_mean = (seen * c).sum(axis=1) / count, np.where(seen, z, 0.0).sum(axis=1) / count
    arms = np.where(seen, (c - c_mean[:, None]).conj() * (np.where(seen, z, 0.0) - z_mean[:, None]), 0.0)
    theta = np.angle(arms.sum(axis=1))
    p = z_mean - c_mean * np.exp(1j * theta)
    few = seen.sum(axis=1) < 2
    p[few], theta[few] = np.nan, np.nan
    off = np.abs(z - p[:, None] - c * np.exp(1j * theta)[:, None])
    size = float(np.sqrt(np.mean(np.abs(c) ** 2)))
    place = np.column_stack([np.real(p), np.imag(p)])
    return place, theta, float(np.sqrt(np.nanmean(off**2))) / size if size > 0.0 else np.inf


def _need_origin(log: Log, options: Reading, rig: RigOptions, poses: pd.DataFrame) -> None:
    """UserError if pixels are counted downwards from the upper corner and --origin is missing."""
    pixels = options.si.scale is not None and options.origin is None
    if pixels and not rig.surface_height and not rig.walls and np.nanmedian(poses["y"]) < 0.0:
        raise UserError(
            f"{log.path}: y is below 0, as pixels are counted from the upper corner. Give the pixel of x = 0, y = 0 "
            "with --origin U,V (v of the surface), or the height of the surface in m with --surface-height."
        )


def read_quaternion_tables(
    files: Sequence[str | Path], options: Reading, notes: list[str], warnings: list[str]
) -> list[Motion]:
    """The motion in each log, of a point if there is no quaternion; adds to `notes` and `warnings`.

    UserError if a column is missing, a cell is not a number, or the four columns are not a unit quaternion.
    """
    source = source_of(options)
    logs = read_logs(files, options, [name for name, _ in source.values()], notes, warnings)
    return [motion_of_table(log, source, options, notes if log is logs[0] else []) for log in logs]


def source_of(options: Reading) -> dict[str, tuple[str, float]]:
    """For each column of a motion in space, the column of the table and its sign; UserError if theta is given."""
    if "theta" in options.columns:
        raise UserError("--columns: theta is the angle of a planar log; with --quaternion give qx, qy, qz and qw.")
    source = options.source("trial", "t", *AXES)
    for i, letter in enumerate(options.quaternion or ""):
        ours = f"q{i + 1}", f"q{letter}"
        if set(ours) <= set(options.columns):
            raise UserError(
                f"--columns: with --quaternion {options.quaternion}, {ours[0]} is {ours[1]}; give one of them."
            )
        source[ours[0]] = next((options.columns[name] for name in ours if name in options.columns), (ours[1], 1.0))
    return source


def motion_of_table(log: Log, source: Mapping[str, tuple[str, float]], options: Reading, notes: list[str]) -> Motion:
    """The motion in one table, of a point if there is no quaternion; errors as in `read_quaternion_tables`."""
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
    rows = np.asarray(log.cells.index)
    if order is None:
        return replace(Motion.of_point("", str(path), t, position, trial), row=rows)
    raw = unit(np.stack([cells(name) for name in four], axis=1), f"{path}, {', '.join(source[q][0] for q in four)}")

    quaternion = raw[:, ORDERS[order]]
    readings: Readings = {
        f"--quaternion {other}": lambda other=other: raw[:, ORDERS[other]] for other in ORDERS if other != order
    }
    # if one axis of the frame is reversed, the two other components change their sign
    for flipped in range(3):
        turned = [four[ORDERS[order][other]] for other in range(3) if other != flipped]
        option = ",".join(f"{q}={'-' if source[q][1] > 0 else ''}{source[q][0]}" for q in sorted(turned))
        readings |= {f"--columns {option}": partial(mirrored, quaternion, flipped)}
    return Motion("", str(path), t, position, quaternion, trial, readings, row=rows)
