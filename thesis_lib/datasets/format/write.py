"""Write a dataset into a folder from which `read_dataset` reads it back."""

from pathlib import Path

import yaml

from thesis_lib.bodies.mesh import Mesh
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.table_forms import QUATERNION
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import FLOAT_FORMAT, atomic, write_table, write_text
from thesis_lib.foundation.settings import Section


def write_dataset(dataset: Dataset, folder: str | Path, float_format: str | None = FLOAT_FORMAT) -> Path:
    """Write dataset.yaml, trajectories.csv, impacts.csv and a mesh into `folder` (made if needed) and return its path.

    dataset.yaml is written last, so that an interrupted run leaves no incomplete dataset.  Existing tables of the same
    names are replaced; UserError if the folder has a table that the dataset lacks (it would be read as part of it).
    Without `float_format`, numbers are written as the shortest text that reads back to the same bits.
    """
    folder = Path(folder)
    poses = dataset.trajectories
    if poses is not None and not dataset.has_angle:
        poses = poses.drop(columns="theta" if dataset.space.is_plane else list(QUATERNION))
    tables = {"trajectories": poses, "impacts": dataset.impacts}
    for stem, table in tables.items():
        stale = [f"{stem}.parquet"] + ([f"{stem}.csv"] if table is None else [])
        for name in stale:
            if (folder / name).exists():
                raise UserError(
                    f"{folder / name} already exists and would be read as part of the dataset {dataset.name}. "
                    "Delete it, or choose another folder."
                )
    for stem, table in tables.items():
        if table is not None:
            write_table(table, folder / f"{stem}.csv", float_format)
    if isinstance(mesh := dataset.header.body.shape, Mesh):
        with atomic(folder / mesh.file) as tmp:
            Path(tmp).write_bytes(mesh.content)
    write_text(header_text(dataset.header), folder / "dataset.yaml")
    return folder


def header_text(header: Section) -> str:
    """dataset.yaml or recording.yaml as text, with the keys in the documented order."""
    content = header.model_dump(mode="json", by_alias=True, exclude_none=True)
    if "surfaces" in content:
        del content["surface"]  # must not be given beside walls or named surfaces
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110, default_flow_style=None)
