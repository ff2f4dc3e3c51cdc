"""A dataset in memory: header, poses and impacts (dataset format, schema 1 in the plane, 2 in space)."""

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.bodies.mesh import Mesh
from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.format.samples import sampling_period
from thesis_lib.datasets.format.validate import Problem
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import PLANE, SPACE, Space

# metadata, which must change neither splits nor seeds
_NOT_DATA = {"description": True, "body": {"homogeneous", "uncertainty"}}
_NOT_DATA_IN_SPACE = {"description": True, "body": {"uncertainty"}, "tracked": {"uncertainty"}}
_ABSENT = ("surfaces", "spin")  # later keys, left out of the digest if absent: older digests stay valid
TRAJECTORY_COLUMNS = ("trial", "t", "x", "y", "theta")


@dataclass(frozen=True, eq=False)
class Dataset:
    """Measured or simulated drops of one body."""

    name: str  # name of the folder, used in the names of results
    header: Header | Any  # content of dataset.yaml; for schema 2 a `SpaceHeader`
    # `TRAJECTORY_COLUMNS` (s, m, m, rad), θ continuous within a trial; in space trial, t, `POSE_IN_SPACE` (s, m, 1)
    trajectories: pd.DataFrame | None = None
    impacts: pd.DataFrame | None = None  # at least `IMPACT_COLUMNS` (m, rad, m/s, rad/s)
    path: Path | None = None  # the folder it was read from
    warnings: tuple[Problem, ...] = ()  # doubts that are not faults
    has_angle: bool = True  # False: trajectories.csv has no theta, which is 0 in `trajectories`; NaN in space

    @property
    def space(self) -> Space:
        """Space in which the body moves: the plane, or three dimensions."""
        return SPACE if isinstance(self.header, SpaceHeader) else PLANE

    @property
    def in_space(self) -> SpaceHeader:
        """Header of a body in space; only for datasets of schema 2."""
        assert isinstance(self.header, SpaceHeader)
        return self.header

    @property
    def shape(self) -> Shape | Any:
        """The body's outline, m; in space the `Solid` that touches a surface."""
        return self.header.body.shape if self.space.is_plane else self.in_space.body.solid

    @property
    def k_g(self) -> float:
        """Radius of gyration, m; in space the root of the mean principal moment per mass."""
        return self.header.body.radius_of_gyration

    @property
    def mass(self) -> float | None:
        """Mass, kg; None if the dataset states none."""
        return self.header.body.mass

    @property
    def height(self) -> float:
        """Height of the surface, m; 0 in space, where heights count from the surface."""
        return self.header.surface.height if self.space.is_plane else 0.0

    @property
    def gravity(self) -> float:
        """Magnitude of gravity, m/s²."""
        return self.header.gravity if self.space.is_plane else float(np.linalg.norm(self.in_space.gravity))

    @property
    def rate(self) -> float | None:
        """Sampling rate, Hz: as stated, else that of the time stamps; None without trajectories."""
        if self.header.rate is not None or self.trajectories is None:
            return self.header.rate
        return 1.0 / sampling_period(self.trajectories["t"].to_numpy(float), self.trajectories["trial"].to_numpy())

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
        """The impacts of impacts.csv as arrays, independent of trajectories; UserError without impacts.csv."""
        self.require_plane("stated_impacts")
        if self.impacts is None:
            raise UserError(f"The dataset {self.name} has no impacts.csv; use find_impacts on its trajectories.")
        return Impacts.from_table(self.impacts, self.shape, self.k_g, self.mass)

    def require_plane(self, what: str) -> None:
        """Raise a UserError if the body moves in space, where `what` is not available."""
        if not self.space.is_plane:
            raise UserError(
                f"{self.name} is a dataset in space (schema 2). It can be read, written, checked and criticised, but "
                f"{what} is available for motions in a plane only. If the body moves in a plane, project its motion: "
                "datasets init with a planar --shape."
            )

    def digest(self) -> str:
        """SHA-256 (hex) of the content, independent of folder, file type and description; seeds derive from it."""
        without: Any = _NOT_DATA if self.space.is_plane else _NOT_DATA_IN_SPACE
        content = self.header.model_dump(mode="json", by_alias=True, exclude=without)
        content = {key: value for key, value in content.items() if key not in _ABSENT or value is not None}
        parts = [json.dumps(content, sort_keys=True).encode()]
        if isinstance(self.header.body.shape, Mesh):
            parts.append(self.header.body.shape.content)
        for kind, table in (("trajectories", self.trajectories), ("impacts", self.impacts)):
            if table is None:
                continue
            for column in sorted(set(table.columns) - {"flags"}):
                parts += [f"{kind}.{column}".encode(), table[column].to_numpy(float).tobytes()]
        return hashlib.sha256(b"".join(parts)).hexdigest()


def unwrap(theta: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """θ (n,) in rad made continuous within each trial: whole turns are removed from jumps above π.

    Samples before the first jump of a trial remain unchanged to the last bit.
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
