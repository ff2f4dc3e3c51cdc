"""Read a dataset folder and check all of it before anything is computed from it."""

import os
from pathlib import Path

from thesis_lib.datasets.checks import impacts as plausible_impacts
from thesis_lib.datasets.checks import trajectories as plausible
from thesis_lib.datasets.checks.known_body import Body
from thesis_lib.datasets.format.dataset import TRAJECTORY_COLUMNS, Dataset, unwrap
from thesis_lib.datasets.format.header_file import FILE, load_header, salvage_shape
from thesis_lib.datasets.format.impacts import COVARIANCE_COLUMNS, IMPACT_COLUMNS
from thesis_lib.datasets.format.tables import load_table
from thesis_lib.datasets.format.validate import (
    DatasetError,
    Problem,
    Report,
    check_impacts,
    check_trajectories,
)

OPTIONAL_IMPACT_COLUMNS = ("t", "r_x", "r_y", "flags", *COVARIANCE_COLUMNS)


def read_dataset(path: str | Path) -> Dataset:
    """The dataset in the folder `path`; θ of trajectories is made continuous within each trial.

    Other files in the folder are ignored.  What is suspicious but not wrong is in `Dataset.warnings`.

    Raises:
        DatasetError: something is wrong; its `problems` list everything that is.
    """
    folder = Path(path)
    report = Report()
    try:
        name, is_folder, there = folder.resolve().name, folder.is_dir(), folder.exists()
    except (OSError, ValueError, RuntimeError) as error:  # a loop of links, a name that no file can have
        what = f"cannot be opened ({getattr(error, 'strerror', None) or error})"
        raise DatasetError(folder.name, [Problem(str(path), "", what, "check the path")]) from error
    if not is_folder:
        what = "is a file, expected a folder" if there else "the folder does not exist"
        raise DatasetError(
            name, [Problem(str(path), "", what, "give the folder that holds dataset.yaml and the tables")]
        )
    if not name.isprintable():
        # results carry the name: JSON and HTML cannot hold what is no text, and a terminal obeys what it prints
        what = f"the folder's name {name!a} holds characters that do not print"
        raise DatasetError(ascii(name)[1:-1], [Problem(ascii(str(path)), "", what, "rename the folder")])
    try:
        dataset = _read(folder, name, report)
    except OSError as error:
        report.error(
            str(path), "", f"cannot be read ({error.strerror or error})", "check the rights of the files"
        )
        dataset = None
    if report.errors or dataset is None:
        raise DatasetError(name, report.errors)
    return dataset


def _read(folder: Path, name: str, report: Report) -> Dataset | None:
    header, raw = load_header(folder, report)
    trajectories = load_table(folder, "trajectories", TRAJECTORY_COLUMNS, (), report)
    impacts = load_table(folder, "impacts", IMPACT_COLUMNS, OPTIONAL_IMPACT_COLUMNS, report)
    stems = ("trajectories", "impacts")
    if not any(
        os.path.lexists(folder / f"{stem}{suffix}") for stem in stems for suffix in (".csv", ".parquet")
    ):
        report.error(
            "trajectories.csv, impacts.csv",
            "",
            "neither is there",
            "write at least one of them (the init command converts a log into trajectories.csv)",
        )

    if header is not None:
        plausible.check_header(header, FILE, report)
    body = Body.of(header, salvage_shape(raw))
    if trajectories is not None:
        check_trajectories(trajectories, None if header is None else header.rate, report)
        plausible.check_trajectories(trajectories, body, report)
    if impacts is not None:
        check_impacts(impacts, report)
        plausible_impacts.check_impacts(impacts, body, report)
    if report.errors or header is None:
        return None

    poses = None
    if trajectories is not None:
        poses = trajectories.data.reset_index(drop=True)[list(TRAJECTORY_COLUMNS)]
        poses["theta"] = unwrap(poses["theta"].to_numpy(), poses["trial"].to_numpy())
    hits = None if impacts is None else impacts.data.reset_index(drop=True)
    if poses is not None and hits is not None and impacts is not None and trajectories is not None:
        strangers = ~hits["trial"].isin(poses["trial"]).to_numpy()
        if strangers.any():
            report.warn(
                impacts.file,
                f"column trial, {impacts.rows(strangers)}",
                f"these trials are not in {trajectories.file}",
                "use the same trial numbers in both files",
            )
    return Dataset(name, header, poses, hits, folder, tuple(report.warnings))
