"""Conversion of a rig's own logs into a dataset: planar tables, one file for one or many trials.

A "row" in a message is the line in the file, counted from 1.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.checks.known_body import KnownBody
from thesis_lib.datasets.checks.trajectories import check_trajectories
from thesis_lib.datasets.format.samples import Samples, sampling_period
from thesis_lib.datasets.format.validate import SHOWN, UsableRows, ValidationReport, first_of, row_text
from thesis_lib.datasets.samples.stamps import times_of_pictures
from thesis_lib.datasets.sources.conversion import Conversion, as_dataset
from thesis_lib.datasets.sources.tables.log_table import Log
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.datasets.sources.tables.pose import read_poses
from thesis_lib.datasets.sources.tables.rig_options import RigOptions
from thesis_lib.datasets.space.drops import NEAR, cut_drops
from thesis_lib.datasets.space.flights import find_flights, follow
from thesis_lib.datasets.space.motion import Motion, quaternions, refuse_equal_times, together
from thesis_lib.datasets.space.plane import Plane
from thesis_lib.foundation.errors import UserError

FLAT = Plane.of(np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0]))  # the plane of a planar log, in space

Frame = tuple[float, float, float]


def convert_logs(
    files: Sequence[str | Path], name: str, options: Reading, rig: RigOptions, frame: Frame = (0.0, 0.0, 0.0)
) -> Conversion:
    """A dataset of trajectories from tables with the same columns.

    `frame`: x, y (m) of the centre of mass in the tracked frame of the body, and the angle (rad) of the shape relative
    to that frame.  A log without times needs `options.rate`.  The angle may be missing for a disk.
    UserError as in `read_poses`, or if angles in degrees are read as radians, or a value of the experiment is
    impossible.
    """
    notes: list[str] = []
    warnings: list[str] = []
    logs, tables = read_poses(files, options, rig, options.per_trial_files, notes, warnings)
    poses = pd.concat(tables, ignore_index=True)
    lost = poses.drop(columns="trial").isna().any(axis=1)
    if lost.any():
        notes.append(
            f"{int(lost.sum())} of {len(poses)} rows left out: a pose or time is empty, as in lost frames "
            f"({_lost_rows(files, logs, lost.to_numpy())})"
        )
        poses = poses[~lost].reset_index(drop=True)
    if len(poses) == 0:
        raise UserError(f"{files[0]} has no row with a complete pose; nothing was converted.")
    poses["trial"] = _number_trials(poses["trial"], notes)
    repeated = (poses == poses.shift()).all(axis=1)
    if repeated.any():
        notes.append(f"{int(repeated.sum())} of {len(poses)} rows left out: they repeat the one before, with its time")
        poses = poses[~repeated].reset_index(drop=True)
    poses = _apart(poses, rig, notes)
    step = _steps(poses)
    if together(step).any() and (step >= 0.0).all():
        tables = [table.dropna() for table in tables]
        refuse_equal_times([_path(*of_file).distinct() for of_file in zip(files, logs, tables)], placed=False)
    _refuse_degrees(files[0], poses, options, rig)
    if any(frame):
        poses = _of_the_body(poses, frame)
    trial = options.source("trial")["trial"][0]
    if (
        options.cut is None
        and not rig.walls
        and not options.per_trial_files
        and not any(log.has(trial) for log in logs)
    ):
        warnings += _to_be_cut(files, poses, rig)
    return Conversion(as_dataset(poses, name, files, rig, notes), notes, warnings)


def _to_be_cut(files: Sequence[str | Path], poses: pd.DataFrame, rig: RigOptions) -> list[str]:
    """Sentence that recommends --cut, if logs that name no trials hold several releases each; else none."""
    found = {file: _releases(poses[poses["trial"] == trial], rig) for trial, file in enumerate(files)}
    several = [f"{Path(file).name} holds {number} drops" for file, number in found.items() if number > 1]
    if not several:
        return []
    return [
        f"{first_of(several)}, one after the other, but names no trials, so that each file is one trial. With --cut "
        "each drop is a trial, and the motions by hand between them are left out"
    ]


def _releases(poses: pd.DataFrame, rig: RigOptions) -> int:
    """Number of drops in one trial that a hand began: they fall from higher than the flight before them rose."""
    t, place = poses["t"].to_numpy(), poses[["x", "y"]].to_numpy()
    if rig.g == 0.0 or (np.diff(t) <= 0.0).any():
        return 0
    try:
        track = follow(t, place, rig.g)
    except UserError:  # too few samples
        return 0
    flights = find_flights(track, np.array([0.0, -rig.g]))
    theta = poses["theta"].to_numpy() if "theta" in poses else np.zeros(len(t))
    height = rig.shape.gap(place[:, 1], theta, rig.surface_height or 0.0)
    drops = [drop for drop in cut_drops(track, height, flights, rig.shape.extent) if not drop.left_out]
    first = np.array([height[drop.flights[0]].max() for drop in drops])
    last = np.array([height[drop.flights[-1]].max() for drop in drops])
    return int(len(drops) > 0) + int(np.sum(first[1:] > last[:-1] + NEAR * rig.shape.extent))


def _apart(poses: pd.DataFrame, rig: RigOptions, notes: list[str]) -> pd.DataFrame:
    """The poses, with equal times of rows in sequence, or nearly, replaced by those of their pictures, if the times are
    those of arrival; other times stay as they are logged, and are replaced when the dataset is used."""
    trial, t = poses["trial"].to_numpy(), poses["t"].to_numpy()
    step = _steps(poses)
    if not together(step).any() or (step < 0.0).any():
        return poses
    samples = Samples(trial, t, poses[["x", "y"]].to_numpy(), trial)
    if (found := times_of_pictures(samples, rig.rate or 1.0 / sampling_period(t, trial))) is None:
        return poses
    sure, times, said = found
    notes.append(said)
    return poses[sure].assign(t=times)


def _steps(poses: pd.DataFrame) -> np.ndarray:
    """Steps (m,) in s from row to row within trials."""
    trial = poses["trial"].to_numpy()
    return np.diff(poses["t"].to_numpy())[trial[1:] == trial[:-1]]


def _path(file: str | Path, log: Log, poses: pd.DataFrame) -> Motion:
    """The positions of complete poses in a log, in their trials, with their row numbers."""
    position = poses[["x", "y"]].to_numpy() @ np.stack([FLAT.x, FLAT.y])
    motion = Motion.of_point("", str(file), poses["t"].to_numpy(), position, poses["trial"].to_numpy(dtype=str))
    return replace(motion, row=np.asarray(log.cells.index)[poses.index])


def _of_the_body(poses: pd.DataFrame, frame: Frame) -> pd.DataFrame:
    """Poses of the body from poses of its tracked frame (`frame` as in `convert_logs`); UserError without an angle."""
    if "theta" not in poses:
        raise UserError("--frame: locating the centre of mass needs the angle of the body, which is not measured.")
    x, y, turn = frame
    cos, sin = np.cos(poses["theta"]), np.sin(poses["theta"])
    return poses.assign(x=poses["x"] + cos * x - sin * y, y=poses["y"] + sin * x + cos * y, theta=poses["theta"] + turn)


def read_planar_motions(
    files: Sequence[str | Path], options: Reading, rig: RigOptions, notes: list[str], warnings: list[str]
) -> list[Motion]:
    """Each log as one long recording in a plane of space: x along `FLAT.x`, y up; arguments as in `convert_logs`."""
    frame = Rotation.from_matrix(np.stack([FLAT.x, FLAT.y, FLAT.normal], axis=1))
    motions = []
    for file, poses in zip(files, read_poses(files, options, rig, True, notes, warnings)[1]):
        _refuse_degrees(file, poses.dropna(), options, rig)
        position = np.outer(poses["x"], FLAT.x) + np.outer(poses["y"], FLAT.y)
        if "theta" not in poses:
            motions.append(Motion.of_point("", str(file), poses["t"].to_numpy(), position))
            continue
        theta = poses["theta"].to_numpy()
        quaternion = quaternions(theta[:, None], lambda rows: frame * Rotation.from_rotvec(rows * [0.0, 0.0, 1.0]))
        motions.append(Motion("", str(file), poses["t"].to_numpy(), position, quaternion))
    return motions


def _refuse_degrees(file: str | Path, poses: pd.DataFrame, options: Reading, rig: RigOptions) -> None:
    """UserError if complete poses have angles in degrees; to be called before unwrapping, which hides this mistake."""
    if "theta" not in poses:
        return
    report = ValidationReport()
    table = UsableRows(Path(file).name, poses.assign(trial=pd.factorize(poses["trial"])[0]), 2, True, report)
    check_trajectories(table, KnownBody(rig.shape, rig.radius, rig.surface_height or 0.0, rig.g, rig.walls))
    if found := next((problem.what for problem in report.errors if problem.where == "column theta"), None):
        others = [unit for quantity, unit in options.si.given.items() if quantity != "angle"]
        units = ",".join([*others, "deg"])
        raise UserError(f"{file}: the angle {found}, but is read as radians. Give --units {units}.")


def _lost_rows(files: Sequence[str | Path], logs: Sequence[Log], lost: np.ndarray) -> str:
    """Row numbers of `lost` rows (N,), counted over all logs, with the file name if there are several files."""
    parts = np.split(lost, np.cumsum([len(log) for log in logs])[:-1])
    by_file = [
        (Path(file).name, row_text(np.asarray(log.cells.index[part])))
        for file, log, part in zip(files, logs, parts)
        if part.any()
    ]
    if len(files) == 1:
        return by_file[0][1]
    more = f"; and {len(by_file) - SHOWN} more files" if len(by_file) > SHOWN else ""
    return "; ".join(f"{name} {rows}" for name, rows in by_file[:SHOWN]) + more


def _number_trials(trial: pd.Series, notes: list[str]) -> np.ndarray:
    """Trials as integers: the whole numbers of the log, otherwise numbered in order of appearance."""
    numbers = pd.to_numeric(trial, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
    if np.all(np.isfinite(numbers)) and np.all(numbers == np.rint(numbers)) and np.all(np.abs(numbers) < 2**53):
        return numbers.astype(np.int64)
    codes, labels = pd.factorize(trial)
    notes.append(f"trials numbered in order of appearance: 0 = {labels[0]}, …, {len(labels) - 1} = {labels[-1]}")
    return codes.astype(np.int64)
