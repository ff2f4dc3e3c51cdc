"""Free flights of a tumbling box in space, filmed: trajectories of schema 2 without a hit."""

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.mechanics.free_motion import flown
from thesis_lib.mechanics.space import SPACE, of_rotation_vector

RATE = 240.0
G = np.diag([0.0025, 0.0034, 0.0041]) / 3.0  # of the homogeneous box of `folders_in_space`


def flights(trials: int = 8, frames: int = 60, spin: float = 8.0, seed: int = 0, noise=(2e-4, 3e-3)) -> pd.DataFrame:
    """trial, t, pose: thrown upwards at z = 0.3 m, tracked at the centre, z up."""
    rng = np.random.default_rng(seed)
    attitude = of_rotation_vector(2.0 * rng.standard_normal((3, trials)))
    place = np.concatenate([rng.uniform(-0.1, 0.1, (2, trials)), np.full((1, trials), 0.3)])
    motion = np.concatenate(
        [rng.uniform(-0.5, 0.5, (2, trials)), np.full((1, trials), 1.0), spin * rng.standard_normal((3, trials))]
    )
    t = np.arange(frames) / RATE
    path = flown(np.concatenate([place, attitude]), motion, G, np.array([[0.0], [0.0], [-9.81]]), t).pose
    seen = path.reshape(7, -1)
    turn = noise[1] * rng.standard_normal((3, seen.shape[1]))
    seen = np.concatenate(
        [seen[:3] + noise[0] * rng.standard_normal((3, seen.shape[1])), SPACE.attitude_after(seen[3:], turn)]
    )
    rows = np.moveaxis(seen.reshape(7, frames, trials), 0, -1).swapaxes(0, 1).reshape(-1, 7)
    table = pd.DataFrame(rows, columns=list(POSE_IN_SPACE))
    table.insert(0, "trial", np.repeat(np.arange(trials), frames))
    table.insert(1, "t", np.tile(t, trials))
    return table
