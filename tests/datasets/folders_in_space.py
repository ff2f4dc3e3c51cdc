"""Small valid dataset folders of a body in space, for tests to break."""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

RATE = 240.0
BOX = {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}


def header(**changes) -> dict:
    """dataset.yaml of a box as a mapping; a key that is `None` is left out."""
    noise, surface = {"position": 2e-4, "rotation": 3e-3}, {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}
    content = {"schema": 2, "description": "test", "body": body(), "surface": surface, "gravity": [0.0, 0.0, -9.81]}
    content |= {"rate": RATE, "noise": noise} | changes
    return {key: value for key, value in content.items() if value is not None}


def body(**changes) -> dict:
    """The section `body` with changes; a key that is `None` is left out."""
    content = {"shape": BOX, "mass": 0.25, "homogeneous": True} | changes
    return {key: value for key, value in content.items() if value is not None}


def trajectories(trials: int = 3, samples: int = 40, up: np.ndarray | None = None) -> pd.DataFrame:
    """Free flights that turn about the vertical: trial, t, x, y, z, qw, qx, qy, qz; `up` (3, 3) turns the world."""
    trial, i = np.divmod(np.arange(trials * samples), samples)
    t = i / RATE
    place = np.stack([0.1 * trial + 0.5 * t, 0.2 * t, 0.4 - 9.81 * t**2 / 2.0], axis=1)
    turn = Rotation.from_rotvec(np.stack([0 * t, 0 * t, (2.0 + trial) * t], axis=1))
    if up is not None:
        place, turn = place @ up.T, Rotation.from_matrix(up) * turn
    q = turn.as_quat(scalar_first=True, canonical=True)
    return pd.DataFrame(
        {"trial": trial, "t": t, **dict(zip("xyz", place.T)), **dict(zip(("qw", "qx", "qy", "qz"), q.T))}
    )


def impacts(trials: int = 12) -> pd.DataFrame:
    """Hits of the box's lower face, one a trial: velocities reversed at a restitution of 0.5."""
    n = np.arange(trials)
    columns = {"trial": n, "impact": 0 * n, "x": 0.01 * n, "y": 0.0 * n, "z": 0.03 + 0.0 * n}
    columns |= {"qw": np.cos(0.05 * n), "qx": 0.0 * n, "qy": 0.0 * n, "qz": np.sin(0.05 * n)}
    for when, v_z in (("pre", -2.0), ("post", 1.0)):
        columns |= {f"vx_{when}": 0.5 + 0.01 * n, f"vy_{when}": 0.0 * n, f"vz_{when}": v_z + 0.0 * n}
        columns |= {f"w{axis}_{when}": 0.1 * n for axis in "xyz"}
    return pd.DataFrame(columns)


def mesh(half_extents=(0.05, 0.04, 0.03), suffix: str = "obj", closed: bool = True) -> bytes:
    """A box as a file of 12 triangles, or of 11 if it is not closed."""
    import trimesh

    made = trimesh.creation.box(2.0 * np.array(half_extents))
    if not closed:
        made.update_faces(np.arange(12) > 0)
    content = made.export(file_type=suffix)
    return content.encode() if isinstance(content, str) else bytes(content)


def write_mesh(folder: Path, name: str = "body.obj", **options) -> dict:
    """Write a mesh into a folder, and its shape."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(mesh(suffix=Path(name).suffix[1:], **options))
    return {"kind": "mesh", "file": name}
