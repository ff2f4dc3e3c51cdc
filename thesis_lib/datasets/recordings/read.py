"""Read a recording folder and check all of it before anything is computed."""

from pathlib import Path

import numpy as np
from pydantic import ValidationError

from thesis_lib.datasets.format.dataset import unwrap
from thesis_lib.datasets.format.tables import load_table
from thesis_lib.datasets.format.validate import UsableRows, ValidationReport, check_trajectories, read_checked
from thesis_lib.datasets.recordings.header import Arm, RecordingHeader, Wheel
from thesis_lib.datasets.recordings.recording import HEADER_FILE, STATES, Recording
from thesis_lib.foundation.regular_file import FileProblem
from thesis_lib.foundation.yaml_file import YamlProblem, read_yaml

STEP_TOLERANCE = 0.02  # of a time step: beyond it velocities and the equations of a step disagree
ANGLES = ("theta", "q_1", "q_2")


def read_recording(path: str | Path) -> Recording:
    """The recording in `path`, with angles continuous within each trial; DatasetError lists everything wrong in it."""
    return read_checked(path, f"{HEADER_FILE} and {STATES}.csv", _read)


def _read(folder: Path, name: str, report: ValidationReport) -> Recording | None:
    if (folder / "dataset.yaml").exists():
        what = "stands beside dataset.yaml, so it is unclear what the folder holds"
        report.error(HEADER_FILE, "", what, "keep drops and recordings in folders of their own")
    header = _header(folder, report)
    if header is None:  # it defines the columns
        return None
    table = load_table(folder, STATES, header.columns, (), report)
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


def _header(folder: Path, report: ValidationReport) -> RecordingHeader | None:
    """The content of recording.yaml; a problem for each wrong key and value goes to `report`."""
    try:
        document = read_yaml(folder / HEADER_FILE, folder, aliases=False)
    except (FileProblem, YamlProblem) as error:
        report.error(HEADER_FILE, getattr(error, "where", ""), error.what, error.remedy)
        return None
    for key, line in document.repeated:
        report.error(HEADER_FILE, f"line {line}, {key[-1]}", "the key stands twice", "keep one of them")
    try:
        header = RecordingHeader.model_validate(document.content)
    except ValidationError as error:
        for entry in error.errors(include_url=False):
            # pydantic adds the kind of mechanism to the place of a key
            key = tuple(part for part in entry["loc"] if part not in ("arm", "wheel"))
            line = next((document.lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in document.lines), 1)
            where = f"line {line}, {'.'.join(map(str, key))}" if key else ""
            what, remedy = _mistake(entry["type"], entry["msg"], key)
            report.error(HEADER_FILE, where, what, remedy)
        return None
    return None if report.errors else header


def _mistake(kind: str, message: str, key: tuple) -> tuple[str, str]:
    """What is wrong with a key and what to do, from an error of pydantic."""
    if kind == "extra_forbidden":
        return "unknown key", "remove it; docs/reference_dataset.md lists the keys of a recording"
    sections = [RecordingHeader, Arm, Wheel, RecordingHeader.model_fields["noise"].annotation]
    fields = {f.alias or name: f.description for s in sections for name, f in s.model_fields.items()}
    meaning = next((fields[part] for part in reversed(key) if fields.get(part)), "")
    what = "the key is missing" if kind == "missing" else message[0].lower() + message[1:]
    return (what, f"give {key[-1] if key else 'it'}{f' ({meaning})' if meaning else ''}, see docs/reference_dataset.md")


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
