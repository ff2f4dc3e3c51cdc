"""Read a recording folder and check all of it before anything is computed."""

from pathlib import Path

import numpy as np

from thesis_lib.datasets.format.dataset import unwrap
from thesis_lib.datasets.format.header_file import mapping_in, validated
from thesis_lib.datasets.format.table_forms import TableForm
from thesis_lib.datasets.format.tables import load_table
from thesis_lib.datasets.format.validate import UsableRows, ValidationReport, check_trajectories, read_checked
from thesis_lib.datasets.recordings.header import RecordingHeader
from thesis_lib.datasets.recordings.recording import HEADER_FILE, STATES, Recording
from thesis_lib.foundation.mistakes import Mistake

STEP_TOLERANCE = 0.02  # of a time step: beyond it velocities and the equations of a step disagree
ANGLES = ("theta", "q_1", "q_2")


def read_recording(path: str | Path) -> Recording:
    """The recording in `path`, with angles continuous within each trial; DatasetError lists everything wrong in it."""
    return read_checked(path, f"{HEADER_FILE} and {STATES}.csv", _read)


def _read(folder: Path, name: str, report: ValidationReport) -> Recording | None:
    if (folder / "dataset.yaml").exists():
        what = "stands beside dataset.yaml, so it is unclear what the folder holds"
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
    # a last row that may have been cut off holds a wrong number, which is an error in a recording
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
    """Samples of a trial must follow at the stated rate: the equations of motion are summed over the steps."""
    trial, t = table.data["trial"].to_numpy(), table.data["t"].to_numpy(float)
    step = np.diff(t, prepend=t[0])
    off = np.abs(step * rate - 1.0) > STEP_TOLERANCE
    off[np.flatnonzero(np.diff(trial, prepend=trial[0] - 1))] = False
    if not table.complete:  # a row that is left out makes a gap
        return
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0
    what = f"the time step is not the {1.0 / rate:.6g} s of rate: {rate:g} in {HEADER_FILE}, but {usual:.6g} s"
    table.error("column t", what, "correct rate; where samples are missing, begin a new trial after the gap", off)
