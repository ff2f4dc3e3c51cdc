"""Read a dataset from a folder or from arrays, and check all of it before any computation."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thesis_lib.bodies.shapes import Shape
from thesis_lib.datasets.checks import impacts as plausible_impacts
from thesis_lib.datasets.checks import in_space
from thesis_lib.datasets.checks import trajectories as plausible
from thesis_lib.datasets.checks.known_body import KnownBody
from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, unwrap
from thesis_lib.datasets.format.header import Header, SpaceHeader
from thesis_lib.datasets.format.header_file import (
    header_of,
    is_round,
    load_header,
    salvage_shape,
    schema_of,
    states_schema,
)
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE, TableForm, impact_form, trajectory_form
from thesis_lib.datasets.format.tables import load_table, table_of
from thesis_lib.datasets.format.validate import (
    DatasetError,
    UsableRows,
    ValidationReport,
    check_impacts,
    check_trajectories,
    read_checked,
    whole_poses,
)

Columns = Mapping[str, Sequence[float] | np.ndarray] | pd.DataFrame
Load = Callable[[str, TableForm], UsableRows | None]


def read_dataset(path: str | Path) -> Dataset:
    """The dataset in the folder `path`, with θ made continuous within each trial and quaternions of length 1.

    Raises a DatasetError if the dataset has faults; its `problems` list all of them.  Doubts are `Dataset.warnings`.
    """
    return read_checked(path, "dataset.yaml and the tables", _read)


def dataset_of(
    header: Mapping[str, object],
    *,
    trajectories: Columns | None = None,
    impacts: Columns | None = None,
    name: str = "drops",
    folder: str | Path | None = None,
) -> Dataset:
    """Dataset made from arrays, with the same checks as a dataset read from a folder.

    Args:
        header: keys of dataset.yaml, in SI units; `schema` may be left out if it is 1.
        trajectories: columns trial, t, x, y, theta (n,) in s, m and rad; in space the columns of schema 2.
        impacts: columns of impacts.csv (n,): trial, impact, x, y, theta and the velocities before and after.
        name: name of the dataset in results.
        folder: folder that contains the mesh of a body in space.

    Raises:
        DatasetError: the dataset has faults; its `problems` list all of them, with rows counted from 1.
    """
    report, raw = ValidationReport(), {"schema": 1, **header}
    tables = {
        stem: pd.DataFrame(of) for stem, of in (("trajectories", trajectories), ("impacts", impacts)) if of is not None
    }

    def load(stem: str, form: TableForm) -> UsableRows | None:
        if stem not in tables:
            return None
        return table_of(stem, tables[stem], np.zeros(len(tables[stem]), bool), form, report)

    if not tables:
        report.error("trajectories, impacts", "", "neither is given", "give at least one of them")
    made = _checked(name, header_of(raw, report, None if folder is None else Path(folder)), raw, load, report)
    if report.errors or made is None:
        raise DatasetError(name, report.errors)
    return made


def _read(folder: Path, name: str, report: ValidationReport) -> Dataset | None:
    header, raw = load_header(folder, report)
    files = [f"{stem}{suffix}" for stem in ("trajectories", "impacts") for suffix in (".csv", ".parquet")]
    if not any(os.path.lexists(folder / file) for file in files):
        remedy = "write at least one of them (the init command converts a log into trajectories.csv)"
        report.error("trajectories.csv, impacts.csv", "", "neither file exists", remedy)
    made = _checked(name, header, raw, partial(load_table, folder, report=report), report)
    return made and replace(made, path=folder)


def _checked(name: str, header: Any, raw: Mapping, load: Load, report: ValidationReport) -> Dataset | None:
    """Dataset from a header (of either schema; None if invalid) and the tables that `load` returns by name and form."""
    schema, turns_unseen = schema_of(raw), is_round(raw)
    forms = [trajectory_form(schema, turns_unseen), impact_form(schema, turns_unseen)]
    if not states_schema(raw):  # the columns then show the schema
        forms = [replace(form(1, True), instead=form(2, True)) for form in (trajectory_form, impact_form)]
    trajectories = load("trajectories", forms[0])
    if trajectories is not None and not states_schema(raw):
        schema = 2 if "z" in trajectories.data else 1
        forms[1] = impact_form(schema, True)
    impacts = load("impacts", forms[1])
    if impacts is not None and "z" in impacts.data:
        schema = 2
    check = _checked_in_space if schema == 2 else partial(_checked_in_plane, shape=salvage_shape(raw))
    made = check(name, header, trajectories, impacts, report)
    if made is not None and trajectories is not None and impacts is not None:
        what = f"these trials are not in {trajectories.file}"
        unknown = ~impacts.data["trial"].isin(trajectories.data["trial"]).to_numpy()
        impacts.warn("column trial", what, "use the same trial numbers in both files", unknown)
    return made and replace(made, warnings=tuple(report.warnings))


def _checked_in_plane(
    name: str,
    header: Header | None,
    trajectories: UsableRows | None,
    impacts: UsableRows | None,
    report: ValidationReport,
    shape: Shape | None,
) -> Dataset | None:
    has_angle = trajectories is None or "theta" in trajectories.data
    if header is not None:
        plausible.check_header(header, report)
    body = KnownBody.of(header, shape)
    if trajectories is not None:
        check_trajectories(trajectories, None if header is None else header.rate)
        if not has_angle:
            trajectories = replace(trajectories, data=trajectories.data.assign(theta=0.0))
        plausible.check_trajectories(trajectories, body)
    if impacts is not None and header is not None and header.surfaces is not None:
        remedy = "leave impacts.csv out: the program determines from trajectories.csv which wall was hit"
        impacts.error("", "stated impacts are not supported for several surfaces", remedy)
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
    return Dataset(name, header, poses, hits, has_angle=has_angle)


def _checked_in_space(
    name: str,
    header: SpaceHeader | None,
    trajectories: UsableRows | None,
    impacts: UsableRows | None,
    report: ValidationReport,
) -> Dataset | None:
    has_angle, tables = trajectories is None or "qw" in trajectories.data, []
    if header is not None:
        in_space.check_header(header, report)
    in_order = partial(check_trajectories, rate=header and header.rate)
    judged = ((trajectories, in_order, in_space.check_motion), (impacts, check_impacts, in_space.check_hits))
    for table, check_order, check_units in judged:
        whole = None if table is None else whole_poses(table)
        if whole is not None and len(whole.data):
            check_order(whole)
            if header is not None and not report.errors:
                check_units(whole, header)
        tables.append(None if whole is None else whole.data.reset_index(drop=True))
    if report.errors or header is None:
        return None
    poses, hits = tables
    if poses is not None:
        poses = poses[["trial", "t", *POSE_IN_SPACE]]
    return Dataset(name, header, poses, hits, has_angle=has_angle)
