"""Location and files of a dataset that is named in the configuration.

| origin      | what it is                                           | folder that the pipeline reads         |
|-------------|------------------------------------------------------|----------------------------------------|
| simulated   | made by the pipeline                                 | data/simulated/<name>                  |
| folder      | a user's dataset, or a published set that was fetched | <searched folder>/<name>              |
| published   | a published set as its authors' files                | results/datasets/<name>, converted     |
| absent      | a published set that is not found: it is left out    |                                        |
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from thesis_lib.bodies.mesh import SUFFIXES
from thesis_lib.datasets.sources.published import SOURCES, find_source, source_files
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.regular_file import is_file

SIMULATED = ("drops",)


@dataclass(frozen=True)
class Located:
    """Location and files of one dataset of the pipeline."""

    name: str
    origin: Literal["simulated", "folder", "published", "absent"]  # see the table above
    folder: str = ""  # in our format, relative to the working directory; '' if absent
    source: str = ""  # folder with the published files, for origin "published"
    files: tuple[str, ...] = ()  # inputs of a workflow rule that reads the dataset
    has_trajectories: bool = False  # whether impacts are detected in trajectories rather than read

    @property
    def present(self) -> bool:
        """Whether the dataset can be read."""
        return self.origin != "absent"

    @property
    def source_files(self) -> list[str]:
        """The published files that are converted."""
        return list(map(str, source_files(self.name, self.source))) if self.source else []


def locate(name: str, search: Sequence[str | Path]) -> Located:
    """Find a simulated set, a published set or a folder in one of `search` by its name; UserError if there is none."""
    if name in SIMULATED:
        folder = f"data/simulated/{name}"
        return Located(name, "simulated", folder, "", (f"{folder}/dataset.yaml", f"{folder}/trajectories.csv"), True)
    for base in map(Path, search):
        folder = base / name
        if is_file(folder / "dataset.yaml"):
            files = sorted(str(p) for p in folder.iterdir() if p.suffix in (".yaml", ".csv", ".parquet", *SUFFIXES))
            stems = {Path(p).stem for p in files}
            return Located(name, "folder", str(folder), "", tuple(files), "impacts" not in stems)
        if name in SOURCES and (source := find_source(name, base)) is not None:
            folder = f"results/datasets/{name}"
            trajectories = bool(SOURCES[name].archive)
            return Located(name, "published", folder, str(source), (f"{folder}/dataset.yaml",), trajectories)
    if name in SOURCES:
        return Located(name, "absent")
    places, known = ", ".join(f"{base}/{name}" for base in search), ", ".join((*SOURCES, *SIMULATED))
    raise UserError(
        f"There is no dataset {name!r}: no dataset.yaml in {places}. Available by name: {known}. A dataset of your "
        "own is a folder in a searched directory (measured: in the configuration; thesis-lib datasets init "
        "creates one from a log file)."
    )
