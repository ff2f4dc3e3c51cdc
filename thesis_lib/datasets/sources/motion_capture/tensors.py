"""Reader of files of torch tensors (.pt, .pth): rows of poses, one toss per file, as in published sets of tosses.

A tensor is (T, c), or (n, T, c) for n tosses; its columns are numbered 1 to c, and --columns assigns them
(`x=1,y=2,z=3,q1=4,…`).  Lengths in a unit other than metres need --scale, as pixels do.  The package torch reads the
files, in a separate process (`own_process`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.sources.motion_capture.own_process import arrays_of
from thesis_lib.datasets.sources.tables.log_table import MAX_COLUMNS, Log
from thesis_lib.datasets.sources.tables.options import Reading
from thesis_lib.datasets.sources.tables.pose import motion_of_table, source_of
from thesis_lib.datasets.space.motion import Motion
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import MissingFile, regular_size

SUFFIXES = (".pt", ".pth")
PACKAGE = "torch"
MAX_FILE, MAX_ALL, MAX_FILES = 200_000_000, 2_000_000_000, 20_000  # bytes of one, of all, and how many


@dataclass(frozen=True, eq=False)
class NumberLog(Log):
    """A table of numbers, whose columns are named by their number."""

    def text(self, name: str) -> pd.Series:
        return super().text(name).map(repr)

    def numbers(self, name: str) -> np.ndarray:
        return super().text(name).to_numpy(dtype=float, copy=True)

    def times(self, name: str) -> np.ndarray:
        return self.numbers(name)


def holds_tensors(path: Path) -> bool:
    """Whether a path is a file of tensors, by its ending, or a folder with such files."""
    return path.suffix.lower() in SUFFIXES or (path.is_dir() and bool(_files(path)))


def read_tensors(paths: Sequence[Path], options: Reading, notes: list[str]) -> list[Motion]:
    """The motion in each tensor of files and folders, in the order of the numbers in their names; adds to `notes`.

    UserError if the package is not installed, a file is damaged or holds no rows, or a column is missing.
    """
    if find_spec(PACKAGE) is None:
        raise UserError(
            f"{paths[0]} holds tensors of torch; reading them needs a package: pip install {PACKAGE}. Or export them "
            "as CSV."
        )
    files = [file for path in paths for file in (_files(path) if path.is_dir() else [path])]
    if not 0 < len(files) <= MAX_FILES:
        raise UserError(f"{paths[0]}: {len(files):,} files of tensors; expected 1 to {MAX_FILES:,}.")
    try:
        if (size := sum(regular_size(file, MAX_FILE) for file in files)) > MAX_ALL:
            raise UserError(f"{paths[0]}: the files have {size:,} bytes; the limit is {MAX_ALL:,}. Convert fewer.")
        found = arrays_of("tensors", files)
    except MissingFile as error:
        raise UserError(f"{error} Give a file of tensors, or a folder of such files.") from error
    except ValueError as error:
        raise UserError(
            f"{paths[0]} cannot be read as tensors of torch: {error}. Save each toss as a tensor of rows (torch.save)."
        ) from error
    source, logs = source_of(options), []
    for i, file in enumerate(files):
        for rows in _tosses(file, found[str(i)]):
            cells = pd.DataFrame(rows, columns=[str(n + 1) for n in range(rows.shape[1])])
            logs.append(NumberLog(file, cells, ".", {}, {}, (), ()))
    return [motion_of_table(log, source, options, notes if log is logs[0] else []) for log in logs]


def _tosses(file: Path, tensor: np.ndarray) -> np.ndarray:
    """The tosses (n, T, c) of a tensor."""
    tosses = tensor[None] if tensor.ndim == 2 else tensor
    if tosses.ndim != 3 or not tosses.size or tosses.shape[2] > MAX_COLUMNS:
        raise UserError(f"{file} holds a tensor of size {tensor.shape}; expected rows of columns, (T, c) or (n, T, c).")
    return tosses


def _files(folder: Path) -> list[Path]:
    try:
        files = [path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES]
    except OSError:
        return []
    return sorted(files, key=lambda path: [int(p) if p.isdigit() else p for p in re.split(r"(\d+)", path.name)])
