"""Read a dataset folder, or arrays, and check all of it before anything is computed."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Disk
from thesis_lib.datasets.checks import impacts as plausible_impacts
from thesis_lib.datasets.checks import trajectories as plausible
from thesis_lib.datasets.checks.known_body import KnownBody
from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, unwrap
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.header_file import header_of, load_header, salvage_shape
from thesis_lib.datasets.format.impacts import COVARIANCE_COLUMNS, IMPACT_COLUMNS
from thesis_lib.datasets.format.tables import load_table, table_of
from thesis_lib.datasets.format.validate import (
    DatasetError,
    UsableRows,
    ValidationReport,
    check_impacts,
    check_trajectories,
    read_checked,
)

OPTIONAL_IMPACT_COLUMNS = ("t", "r_x", "r_y", "flags", *COVARIANCE_COLUMNS)
Columns = Mapping[str, Sequence[float] | np.ndarray] | pd.DataFrame
Load = Callable[[str, Sequence[str], Sequence[str]], UsableRows | None]


def read_dataset(path: str | Path) -> Dataset:
    """The dataset in the folder `path`; θ of trajectories is made continuous within each trial.

    DatasetError: something is wrong; its `problems` list everything.  Doubts are in `Dataset.warnings`.
    """
    return read_checked(path, "dataset.yaml and the tables", _read)


def dataset_of(
    header: Mapping[str, object],
    *,
    trajectories: Columns | None = None,
    impacts: Columns | None = None,
    name: str = "drops",
) -> Dataset:
    """The dataset of arrays, checked as one that is read from a folder.

    Args:
        header: keys of dataset.yaml, in SI units; `schema` may be left out.
        trajectories: columns trial, t, x, y, theta (n,) in s, m and rad.
        impacts: columns of impacts.csv (n,): trial, impact, x, y, theta and the velocities before and after.
        name: of the dataset, in results.

    Raises:
        DatasetError: something is wrong; its `problems` list everything, with rows counted from 1.
    """
    report, raw = ValidationReport(), {"schema": 1, **header}
    tables = {
        stem: pd.DataFrame(of) for stem, of in (("trajectories", trajectories), ("impacts", impacts)) if of is not None
    }

    def load(stem: str, needed: Sequence[str], optional: Sequence[str]) -> UsableRows | None:
        if stem not in tables:
            return None
        return table_of(stem, tables[stem], np.zeros(len(tables[stem]), bool), needed, optional, report)

    if not tables:
        report.error("trajectories, impacts", "", "neither is given", "give at least one of them")
    made = _checked(name, header_of(raw, report), raw, load, report)
    if report.errors or made is None:
        raise DatasetError(name, report.errors)
    return made


def _read(folder: Path, name: str, report: ValidationReport) -> Dataset | None:
    header, raw = load_header(folder, report)
    files = [f"{stem}{suffix}" for stem in ("trajectories", "impacts") for suffix in (".csv", ".parquet")]
    if not any(os.path.lexists(folder / file) for file in files):
        remedy = "write at least one of them (the init command converts a log into trajectories.csv)"
        report.error("trajectories.csv, impacts.csv", "", "neither is there", remedy)
    made = _checked(name, header, raw, partial(load_table, folder, report=report), report)
    return made and replace(made, path=folder)


def _checked(name: str, header: Header | None, raw: Mapping, load: Load, report: ValidationReport) -> Dataset | None:
    """The dataset of a header and of the tables that `load` gives by name, needed and optional columns."""
    turns_unseen = isinstance(salvage_shape(raw), Disk)  # theta moves no contact point
    optional = ("theta",) if turns_unseen else ()
    needed = tuple(column for column in TRAJECTORY_COLUMNS if column not in optional)
    trajectories = load("trajectories", needed, optional)
    has_angle = trajectories is None or "theta" in trajectories.data
    impacts = load("impacts", IMPACT_COLUMNS, OPTIONAL_IMPACT_COLUMNS)
    if header is not None:
        plausible.check_header(header, report)
    body = KnownBody.of(header, salvage_shape(raw))
    if trajectories is not None:
        check_trajectories(trajectories, None if header is None else header.rate)
        if not has_angle:
            trajectories = replace(trajectories, data=trajectories.data.assign(theta=0.0))
        plausible.check_trajectories(trajectories, body)
    if impacts is not None and header is not None and header.surfaces is not None:
        remedy = "leave impacts.csv out: from trajectories.csv the program finds which wall was hit"
        impacts.error("", "impacts at several surfaces cannot be given", remedy)
    elif impacts is not None:
        check_impacts(impacts)
        plausible_impacts.check_impacts(impacts, body)
    if report.errors or header is None:
        return None

    poses = None
    if trajectories is not None:
        poses = trajectories.data.reset_index(drop=True)[list(TRAJECTORY_COLUMNS)]
        poses["theta"] = unwrap(poses["theta"].to_numpy(), poses["trial"].to_numpy())
    hits = None if impacts is None else impacts.data.reset_index(drop=True)
    if trajectories is not None and impacts is not None:
        what = f"these trials are not in {trajectories.file}"
        unknown = ~impacts.data["trial"].isin(trajectories.data["trial"]).to_numpy()
        impacts.warn("column trial", what, "use the same trial numbers in both files", unknown)
    return Dataset(name, header, poses, hits, None, tuple(report.warnings), has_angle)
