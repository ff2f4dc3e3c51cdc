"""Small valid dataset folders for tests to break."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from tests.datasets.bouncing import fly
from thesis_lib.datasets import read_dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.validate import DatasetError, Problem

RATE = 250.0
SQUARE = [[0.03, 0.03], [-0.03, 0.03], [-0.03, -0.03], [0.03, -0.03]]


def header(**changes) -> dict:
    """dataset.yaml of a 60 mm square as a mapping."""
    body = {"shape": {"kind": "polygon", "vertices": SQUARE}, "mass": 0.05, "radius_of_gyration": 0.0245}
    content = {"schema": 1, "description": "test", "body": body, "surface": {"height": 0.0}, "gravity": 9.81}
    return content | {"rate": RATE, "noise": {"position": 3.0e-4, "angle": 3.0e-3}} | changes


def trajectories(trials: int = 3, samples: int = 40) -> pd.DataFrame:
    """Free flights: trial, t, x, y, theta."""
    trial, i = np.divmod(np.arange(trials * samples), samples)
    t = i / RATE
    x, y, theta = 0.1 * trial + 0.5 * t, 0.25 - 9.81 * t**2 / 2.0, 0.3 + (2.0 + trial) * t
    return pd.DataFrame({"trial": trial, "t": t, "x": x, "y": y, "theta": theta})


DISK = {"shape": {"kind": "disk", "radius": 0.03}, "radius_of_gyration": 0.021}


def bouncing_disk(
    trials: int = 4, *, rate: float = RATE, position: float = 2e-4, angle: float = 2e-3, spin: float = 0.0
) -> pd.DataFrame:
    """Measured bounces of the disk on y = 0 with noise: trial, t, x, y, theta; `spin` in rad/s is added."""
    head = Header.model_validate(header(body=DISK, rate=rate))
    frame = fly(head, np.random.default_rng(7), trials, int(0.6 * rate), position, angle).table
    return frame.assign(theta=frame["theta"] + spin * frame["t"])


def impacts(trials: int = 12, per_trial: int = 2) -> pd.DataFrame:
    """Central impacts of the square's corner: velocities reversed at a restitution of 0.5."""
    trial, impact = np.divmod(np.arange(trials * per_trial), per_trial)
    n = len(trial)
    theta = np.pi / 4.0 + 0.01 * np.cos(np.arange(n))
    columns = {"trial": trial, "impact": impact, "x": 0.01 * np.arange(n), "y": 0.06 / np.sqrt(2.0), "theta": theta}
    columns |= {"vx_pre": 0.5, "vy_pre": -2.0, "omega_pre": np.linspace(-3.0, 3.0, n)}
    return pd.DataFrame(columns | {"vx_post": 0.4, "vy_post": 1.0, "omega_post": np.linspace(-9.0, 9.0, n)})


def write(folder: Path, head: dict | str | None = None, **tables: pd.DataFrame | str) -> Path:
    """Write a dataset folder from a header (mapping or text) and tables (frames or text) by stem."""
    folder.mkdir(parents=True, exist_ok=True)
    head = header() if head is None else head
    text = head if isinstance(head, str) else yaml.safe_dump(head)
    (folder / "dataset.yaml").write_text(text, encoding="utf-8")
    for stem, table in tables.items():
        content = table if isinstance(table, str) else table.to_csv(index=False)
        (folder / f"{stem}.csv").write_text(content, encoding="utf-8")
    return folder


WALLS = [
    {"name": "south", "point": [0.0, -0.4], "normal": [0.0, 1.0]},
    {"name": "north", "point": [0.0, 0.4], "normal": [0.0, -1.0]},
]


def between_walls(**changes) -> dict:
    """dataset.yaml of a disk between two walls."""
    content = header(body=DISK, gravity=0.0, surfaces=WALLS, noise={"position": 3.0e-4})
    del content["surface"]
    return content | changes


def sliding(trials: int = 3, samples: int = 40) -> pd.DataFrame:
    """A disk that slides from wall to wall: trial, t, x, y; its angle is not measured."""
    poses = trajectories(trials, samples)
    return poses.assign(y=0.3 - 0.5 * poses["t"]).drop(columns="theta")


def problems(folder: Path, read=read_dataset) -> list[Problem]:
    """What is wrong with a folder, each with its remedy."""
    with pytest.raises(DatasetError) as caught:
        read(folder)
    for problem in caught.value.problems:
        assert problem.remedy and problem.what and problem.what in str(caught.value)
    return caught.value.problems


def refusal(folder: Path, read=read_dataset) -> str:
    """The same as text."""
    return "\n".join(map(str, problems(folder, read)))


def only(folder: Path) -> str:
    """The text of the one problem that the folder has."""
    found = problems(folder)
    assert len(found) == 1, "\n".join(map(str, found))
    return str(found[0])
