"""A dataset in memory: header, poses and impacts (dataset format, schema 1)."""

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.foundation.errors import UserError

if TYPE_CHECKING:
    from thesis_lib.datasets.format.validate import Problem

# what is said about the data is none of them: it changes no split and no seed
_NOT_DATA = {"description": True, "body": {"homogeneous", "uncertainty"}}
_ABSENT = ("surfaces", "spin")  # keys that most datasets lack: without them the digest is what it was before
TRAJECTORY_COLUMNS = ("trial", "t", "x", "y", "theta")


@dataclass(frozen=True, eq=False)
class Dataset:
    """Measured or simulated drops of one body."""

    name: str  # of the folder, used in the names of results
    header: Header
    trajectories: pd.DataFrame | None = None  # `TRAJECTORY_COLUMNS` (s, m, m, rad); θ is continuous within a trial
    impacts: pd.DataFrame | None = None  # at least `IMPACT_COLUMNS` (m, rad, m/s, rad/s)
    path: Path | None = None  # the folder it was read from
    warnings: tuple["Problem", ...] = ()  # what is suspicious but not wrong
    has_angle: bool = True  # False: trajectories.csv has no theta, which is 0 in `trajectories`

    @property
    def shape(self) -> Shape:
        """The body's outline, m."""
        return self.header.body.shape

    @property
    def k_g(self) -> float:
        """Radius of gyration, m."""
        return self.header.body.radius_of_gyration

    @property
    def mass(self) -> float | None:
        """kg; None if the dataset states none."""
        return self.header.body.mass

    @property
    def height(self) -> float:
        """Height of the surface, m."""
        return self.header.surface.height

    @property
    def gravity(self) -> float:
        """m/s²."""
        return self.header.gravity

    @property
    def rate(self) -> float | None:
        """Sampling rate in Hz: as stated, else one over the median time step, else None."""
        if self.header.rate is not None or self.trajectories is None:
            return self.header.rate
        return 1.0 / median_step(self.trajectories)

    @property
    def trials(self) -> np.ndarray:
        """Sorted trial numbers, integers (n_trials,)."""
        tables = [table for table in (self.trajectories, self.impacts) if table is not None]
        return np.unique(np.concatenate([table["trial"].to_numpy() for table in tables]))

    def first_trials(self, count: int | None) -> "Dataset":
        """The dataset cut to its first `count` trials; None for all."""
        if count is None or count >= len(self.trials):
            return self
        kept = self.trials[:count]
        tables = {
            name: None if table is None else table[table["trial"].isin(kept)].reset_index(drop=True)
            for name, table in (("trajectories", self.trajectories), ("impacts", self.impacts))
        }
        return replace(self, **tables)

    def stated_impacts(self) -> Impacts:
        """The impacts of impacts.csv as arrays, whatever the trajectories; UserError without impacts.csv."""
        if self.impacts is None:
            raise UserError(f"The dataset {self.name} has no impacts.csv; use find_impacts on its trajectories.")
        return Impacts.from_table(self.impacts, self.shape, self.k_g, self.mass)

    def digest(self) -> str:
        """SHA-256 (hex) of the content, whatever its folder, file type or description; seeds derive from it."""
        content = self.header.model_dump(mode="json", by_alias=True, exclude=_NOT_DATA)
        content = {key: value for key, value in content.items() if key not in _ABSENT or value is not None}
        sha = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
        for kind, table in (("trajectories", self.trajectories), ("impacts", self.impacts)):
            if table is None:
                continue
            for column in sorted(set(table.columns) - {"flags"}):
                sha.update(f"{kind}.{column}".encode())
                sha.update(np.ascontiguousarray(table[column].to_numpy(float)).tobytes())
        return sha.hexdigest()


def median_step(trajectories: pd.DataFrame) -> float:
    """Median time step in s between samples of the same trial; NaN if no trial has two samples."""
    trial, t = trajectories["trial"].to_numpy(), trajectories["t"].to_numpy(float)
    step = np.diff(t)[trial[1:] == trial[:-1]]
    return float(np.median(step)) if len(step) else float("nan")


def unwrap(theta: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """θ (n,) in rad made continuous within each trial: jumps above π lose whole turns.

    Samples before a trial's first jump keep every bit.
    """
    theta = np.asarray(theta, dtype=float)
    if len(theta) == 0:
        return theta
    step = np.diff(theta, prepend=theta[0])
    start = np.diff(trial, prepend=trial[0]) != 0
    turns = np.where((np.abs(step) > np.pi) & ~start, -np.rint(step / (2.0 * np.pi)), 0.0)
    total = np.cumsum(turns)
    # turns made in earlier trials do not count
    start[0] = True
    carried = total[start][np.cumsum(start) - 1]
    return theta + 2.0 * np.pi * (total - carried)
