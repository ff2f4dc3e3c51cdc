"""Published tosses of a box in space: a file of torch tensors for each, and the authors' data on the experiment.

`experiment.json` gives lengths in a unit of its own, which is defined by gravity: `g` in this unit / s² is
9.81 m/s², so the unit is 9.81/g m.

| key        | unit    | becomes                                             |
|------------|---------|-----------------------------------------------------|
| `dt`       | s       | `rate`, and the times of samples                    |
| `g`        | unit/s² | the unit of length                                  |
| `vertices` | unit    | half extents of a box about its centre of mass      |
| `mass`     | kg      | mass                                                |
| `inertia`  | kg unit²| inertia, the same about every axis                  |
| `mu`, `restitution` |  | nothing; the description quotes them               |

A toss is a tensor (1, T, c) whose first columns are the position (3, unit) and the quaternion (w, x, y, z) of the body;
z is up, and the table at z = 0.  The other columns, velocities computed from these poses, are left out.
"""

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.datasets.sources.tables.options import Reading

EXPERIMENT = "params_processed/experiment.json"
G = 9.81  # m/s², which defines the unit of length
DIGITS = 12  # significant digits of computed values; the others are rounding error
COLUMNS = {name: (str(i + 1), 1.0) for i, name in enumerate(("x", "y", "z", "q1", "q2", "q3", "q4"))}


def absent_tosses(count: int, files: Sequence[str]) -> str:
    """Sentence on missing `files` of `count` tosses: '300 of 570 tosses present; missing: 300 to 569'."""
    numbers = np.sort([_number(file) for file in files])
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    shown = ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)
    return f"{count - len(numbers)} of {count} tosses present; missing: {shown}"


def convert_tosses(content: Mapping[str, bytes], out_dir: Path) -> Path:
    """Write the dataset of the tosses in `content` (file name -> bytes, and `EXPERIMENT`), trials numbered as files.

    UserError if the package torch is not installed.
    """
    from thesis_lib.datasets.sources.motion_capture.tensors import (
        read_tensors,  # not needed by jobs that only locate datasets
    )

    header, unit, dt = _experiment(content[EXPERIMENT])
    numbers = {_number(file): file for file in content if file != EXPERIMENT}
    with tempfile.TemporaryDirectory() as folder:  # holds the bytes that were checked; the files may change
        paths = [Path(folder, f"{number}.pt") for number in sorted(numbers)]
        for path in paths:
            path.write_bytes(content[numbers[int(path.stem)]])
        reading = Reading(columns=COLUMNS, quaternion="wxyz", rate=1.0 / dt, scale=repr(1.0 / unit), units="px")
        motions = read_tensors(paths, reading, [])
    tables = [
        pd.DataFrame(
            {"trial": int(path.stem), "t": dt * np.arange(len(motion))}
            | dict(zip(POSE_IN_SPACE, np.c_[motion.position, motion.quaternion[:, [3, 0, 1, 2]]].T, strict=True))
        )
        for path, motion in zip(paths, motions, strict=True)
    ]
    poses = pd.concat(tables, ignore_index=True)
    return write_dataset(Dataset(out_dir.name, header, poses), out_dir, float_format=None)


def _number(file: str) -> int:
    return int(PurePosixPath(file).stem)


def _experiment(content: bytes) -> tuple[SpaceHeader, float, float]:
    """Header, unit of length in m and time step in s; `content` is trusted, as its SHA-256 is the published one."""
    stated = json.loads(content)
    unit = G / float(stated["g"])
    half = np.abs(np.array(stated["vertices"], dtype=float)).max(axis=0)
    inertia, dt = _rounded(float(stated["inertia"]) * unit**2), float(stated["dt"])
    header = {
        "schema": 2,
        "description": DESCRIPTION.format(unit=_rounded(unit), mu=stated["mu"], epsilon=stated["restitution"]),
        "body": {
            "shape": {"kind": "box", "half_extents": [_rounded(unit * length) for length in half]},
            "mass": float(stated["mass"]),
            "inertia": {"xx": inertia, "yy": inertia, "zz": inertia},
        },
        "surface": {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]},
        "gravity": [0.0, 0.0, -G],
        "rate": _rounded(1.0 / dt),
    }
    return SpaceHeader.model_validate(header), unit, dt


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


DESCRIPTION = (
    "Tosses of a cube onto a flat table, Pfrommer, Halm and Posa: poses as published "
    "(github.com/DAIRLab/contact-nets, data/tosses_processed), times the unit of lengths, {unit} m, which follows from "
    "their g = 9.81 m/s². The body is as published: size, mass, inertia, centre of mass in the middle, axes of the "
    "tracked frame along its edges; they state mu = {mu} and restitution = {epsilon}. The stored velocities are left "
    "out. Before publication each component of the rotation vector went through a median of three samples, positions "
    "did not; each recording was turned about the vertical at random and cut from the throw to rest; tosses were kept "
    "only where the lowest corner of the published cube came within 7 mm of the table. Noise is not published."
)
