"""Recognise folders with a dataset, or with the recording of a mechanism, by the names of their files."""

import os
from pathlib import Path

# a folder with any of these files counts as a dataset, even if an invalid one
STEMS = ("trajectories", "impacts", "states")
INPUTS = (
    *("dataset.yaml", "recording.yaml"),
    *(f"{stem}{suffix}" for stem in STEMS for suffix in (".csv", ".parquet")),
)


# a table of states alone may be a user's input for predictions
MARKS = tuple(name for name in INPUTS if not name.startswith("states."))


def holds_data(folder: str | Path) -> bool:
    """Whether a folder contains data that may come from others, so that no code in it may be run."""
    return any(os.path.lexists(Path(folder) / name) for name in MARKS)


def looks_like_dataset(folder: str | Path) -> bool:
    """Whether a folder contains a file or link with a name that datasets or recordings use."""
    return any(os.path.lexists(Path(folder) / name) for name in INPUTS)
