"""A recording in memory, with functions to read, write and summarise it (format: `header`)."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import unwrap
from thesis_lib.datasets.format.header_file import mapping_in, validated
from thesis_lib.datasets.format.table_forms import TableForm
from thesis_lib.datasets.format.tables import load_table
from thesis_lib.datasets.format.validate import Problem, UsableRows, ValidationReport, check_trajectories, read_checked
from thesis_lib.datasets.format.write import header_text
from thesis_lib.datasets.recordings.header import RecordingHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table, write_text
from thesis_lib.foundation.mistakes import Mistake

HEADER_FILE, STATES = "recording.yaml", "states"
STEP_TOLERANCE = 0.02  # of a time step: larger deviations contradict the equations of a step
ANGLES = ("theta", "q_1", "q_2")


@dataclass(frozen=True, eq=False)
class Recording:
    """Measured motion of a mechanism: `states` has the columns `header.columns`, in SI units and radians.

    `name` is the name of the folder, used in the names of results; `warnings` list what is suspicious but not wrong.
    """

    name: str
    header: RecordingHeader
    states: pd.DataFrame
    warnings: tuple[Problem, ...] = ()

    @property
    def trials(self) -> np.ndarray:
        """Sorted trial numbers, integers (n_trials,)."""
        return np.unique(self.states["trial"].to_numpy())

    def digest(self) -> str:
        """SHA-256 (hex) of the content without folder, file type and description; seeds derive from it."""
        content = self.header.model_dump(mode="json", by_alias=True, exclude={"description"})
        sha = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
        for column in self.header.columns:
            sha.update(column.encode())
            sha.update(np.ascontiguousarray(self.states[column].to_numpy(float)).tobytes())
        return sha.hexdigest()


def is_recording(folder: str | Path) -> bool:
    """Whether a folder contains the recording of a mechanism rather than a dataset of drops."""
    return (Path(folder) / HEADER_FILE).exists()


def write_recording(recording: Recording, folder: str | Path) -> Path:
    """Write recording.yaml and states.csv into `folder`, which is created if needed, and return it.

    recording.yaml is written last: an interrupted run leaves no recording without states.  UserError if `folder`
    contains a states.parquet, which would be read beside states.csv.
    """
    folder = Path(folder)
    if (stale := folder / f"{STATES}.parquet").exists():
        raise UserError(
            f"{stale} exists and would be read as part of the recording. Delete it, or choose another folder."
        )
    (folder / HEADER_FILE).unlink(missing_ok=True)
    write_table(recording.states[list(recording.header.columns)], folder / f"{STATES}.csv")
    write_text(header_text(recording.header), folder / HEADER_FILE)
    return folder


def recording_facts(recording: Recording) -> dict:
    """Counts, mechanism, noise and warnings of a recording, ready for JSON."""
    samples = recording.states.groupby("trial").size()
    h = recording.header
    return {
        "dataset": recording.name,
        "description": h.description,
        "mechanism": h.mechanism.model_dump(mode="json"),
        "gravity": h.gravity,
        "rate": h.rate,
        "noise": h.noise.model_dump(mode="json"),
        "trials": len(samples),
        "samples": int(samples.sum()),
        "samples_per_trial": [int(samples.min()), int(samples.max())],
        "warnings": [vars(problem) for problem in recording.warnings],
    }


def recording_text(recording: Recording) -> str:
    """Summary of a recording as text."""
    facts, noise = recording_facts(recording), recording.header.noise
    believed = {k: v for k, v in facts["mechanism"].items() if k != "kind"}
    low, high = facts["samples_per_trial"]
    lines = [
        f"recording   {facts['dataset']}",
        f"mechanism   {facts['mechanism']['kind']}: {', '.join(f'{k} {v}' for k, v in believed.items())}",
        f"trials      {facts['trials']}, {facts['samples']} samples, {low} to {high} a trial, {facts['rate']:g} Hz",
        f"noise       position {noise.position:g} m, angle {noise.angle:g} rad, velocity {noise.velocity:g} m/s, "
        f"angular velocity {noise.angular_velocity:g} rad/s",
        *(f"warning {i}: {problem}" for i, problem in enumerate(recording.warnings, 1)),
        f"The recording is valid{', with the warnings above' if recording.warnings else ''}.",
    ]
    return "\n".join(lines)


def read_recording(path: str | Path) -> Recording:
    """The recording in `path`, with angles continuous within each trial; a DatasetError lists all errors in it."""
    return read_checked(path, f"{HEADER_FILE} and {STATES}.csv", _read)


def _read(folder: Path, name: str, report: ValidationReport) -> Recording | None:
    if (folder / "dataset.yaml").exists():
        what = "stands beside dataset.yaml, so it is unclear which of the two the folder holds"
        report.error(HEADER_FILE, "", what, "keep drops and recordings in folders of their own")
    raw, lines = mapping_in(folder, HEADER_FILE, report)
    header = None if raw is None else validated(raw, lines, HEADER_FILE, RecordingHeader, report, _remedy)
    if header is None or report.errors:  # it defines the columns
        return None
    table = load_table(folder, STATES, TableForm(header.columns), report)
    if table is None:
        if not report.errors:
            report.error(f"{STATES}.csv", "", "the file is missing", f"write {','.join(header.columns)}")
        return None
    # a last row that may have been cut off may hold a wrong number, which is an error in a recording
    report.errors += report.warnings
    report.warnings.clear()
    check_trajectories(table, None)
    _check_steps(table, header.rate)
    if report.errors:
        return None
    states = table.data.reset_index(drop=True)[list(header.columns)]
    for angle in set(ANGLES) & set(header.mechanism.coordinates):
        states[angle] = unwrap(states[angle].to_numpy(), states["trial"].to_numpy())
    return Recording(name, header, states, tuple(report.warnings))


def _remedy(mistake: Mistake) -> str:
    key = mistake.place[-1] if mistake.place else "it"
    return (
        mistake.remedy
        or f"give {key}{f' ({mistake.meaning})' if mistake.meaning else ''}, see docs/reference_dataset.md"
    )


def _check_steps(table: UsableRows, rate: float) -> None:
    """Report samples of a trial that are not at the stated rate: the equations of motion are summed over the steps."""
    trial, t = table.data["trial"].to_numpy(), table.data["t"].to_numpy(float)
    step = np.diff(t, prepend=t[0])
    off = np.abs(step * rate - 1.0) > STEP_TOLERANCE
    off[np.flatnonzero(np.diff(trial, prepend=trial[0] - 1))] = False
    if not table.complete:  # a row that is left out makes a gap
        return
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0
    what = f"the time step is not the {1.0 / rate:.6g} s of rate: {rate:g} in {HEADER_FILE}, but {usual:.6g} s"
    table.error("column t", what, "correct rate; where samples are missing, begin a new trial after the gap", off)
