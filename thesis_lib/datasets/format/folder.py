"""Which folders hold a dataset, or the recording of a mechanism: those with one of the files that are read."""

import os
from pathlib import Path

# any of these files makes a folder a dataset, though perhaps a bad one
STEMS = ("trajectories", "impacts", "states")
INPUTS = (
    *("dataset.yaml", "recording.yaml"),
    *(f"{stem}{suffix}" for stem in STEMS for suffix in (".csv", ".parquet")),
)


# a table of states alone may be a user's own, for predictions
MARKS = tuple(name for name in INPUTS if not name.startswith("states."))


def holds_data(folder: str | Path) -> bool:
    """Whether a folder is one that is passed on as data, so that nothing in it may run."""
    return any(os.path.lexists(Path(folder) / name) for name in MARKS)


def looks_like_dataset(folder: str | Path) -> bool:
    """Whether a folder holds a file, or a link, with the name of one that a dataset or a recording has."""
    return any(os.path.lexists(Path(folder) / name) for name in INPUTS)
