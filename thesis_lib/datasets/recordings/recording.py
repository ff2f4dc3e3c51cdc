"""A recording in memory, how it is written, and its summary in words (format: `header`)."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.validate import Problem
from thesis_lib.datasets.format.write import header_text
from thesis_lib.datasets.recordings.header import RecordingHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table, write_text

HEADER_FILE, STATES = "recording.yaml", "states"


@dataclass(frozen=True, eq=False)
class Recording:
    """Measured motion of a mechanism: `states` has the columns `header.columns`, in SI units and radians.

    `name` is that of the folder, used in the names of results; `warnings` hold what is suspicious but not wrong.
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
        """SHA-256 (hex) of the content, whatever its folder, file type or description; seeds derive from it."""
        content = self.header.model_dump(mode="json", by_alias=True, exclude={"description"})
        sha = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
        for column in self.header.columns:
            sha.update(column.encode())
            sha.update(np.ascontiguousarray(self.states[column].to_numpy(float)).tobytes())
        return sha.hexdigest()


def is_recording(folder: str | Path) -> bool:
    """Whether a folder holds the recording of a mechanism rather than a dataset of drops."""
    return (Path(folder) / HEADER_FILE).exists()


def write_recording(recording: Recording, folder: str | Path) -> Path:
    """Write recording.yaml and states.csv into `folder`, which is made if needed, and return it.

    recording.yaml comes last, so that a killed run leaves no recording without its states.  UserError if `folder`
    holds a states.parquet, which would be read beside states.csv.
    """
    folder = Path(folder)
    if (stale := folder / f"{STATES}.parquet").exists():
        raise UserError(
            f"{stale} is in the way: it would be read as part of the recording. Delete it, or choose another folder."
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
    """The same as text."""
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
