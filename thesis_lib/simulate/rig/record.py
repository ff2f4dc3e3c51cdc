"""Output of simulated drops: a dataset as its owner would have it, and the ground truth.

All engines (time stepping, compliant contact, Drake, MuJoCo) return `DropsWithTruth` and add columns to the truth.
Arrays hold n drops or contacts in SI units; poses are x, y, θ of the body's origin.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.camera import as_trajectories
from thesis_lib.simulate.rig.release import Release
from thesis_lib.simulate.rig.tracker import Tracker

CONTACT = ("trial", "impact", "t", *POSE, *V_PRE, *V_POST, "r_x", "r_y", "c_t", "c_n")


@dataclass(frozen=True)
class DropsWithTruth:
    """Simulated drops as a rig records them, and the ground truth."""

    header: Header  # content of dataset.yaml as its owner believes it, without hidden causes
    trajectories: pd.DataFrame  # trial,t,x,y,theta as the camera reports them, with noise, sorted by trial and t
    # the truth, a row per contact: columns of impacts.csv for the body's origin, t (of the touch), r_x, r_y (contact
    # point from the origin), c_t, c_n (N s), energy_change (J, kinetic), and further columns of the engine
    impacts: pd.DataFrame
    trials: pd.DataFrame  # the truth, a row per drop: release x,y,theta,vx,vy,omega of the origin, and more


def check_request(body: Body, release: Release, reach: float, **positive: float) -> None:
    """Raise UserError for drops that cannot be simulated.

    Reasons: the body has no mass, a value of `positive` is not positive and finite, or a release can touch the surface.
    `reach` (m): largest distance from the body's origin to any part of the body, plus the surface's largest height.
    """
    if body.mass is None:
        raise UserError("Simulated drops need the mass of the body; give `mass` in kg in the body section.")
    for name, value in positive.items():
        if not 0 < value < np.inf:
            raise UserError(f"Simulated drops need a positive {name}; got {value}.")
    if release.height.low <= reach:
        raise UserError(
            f"A release at {release.height.low} m can touch the surface: the body reaches {reach:.4g} m from its "
            "origin. Raise the lower end of the release height."
        )


def sample_times(duration: float, rate: float) -> np.ndarray:
    """Times 0, 1/rate, ... up to `duration` in s."""
    return np.arange(int(duration * rate + 1e-9) + 1) / rate


def as_dataset(
    poses: np.ndarray,
    description: str,
    body: Body,
    gravity: float,
    rate: float,
    noise: Noise | None,
    rng: np.random.Generator,
    tracker: Tracker | None = None,
) -> tuple[Header, pd.DataFrame]:
    """Header and trajectories of reported poses (n, samples, 3), to which `noise` is added.

    If a `tracker` is given, the poses are those in its pictures, and the header states no noise, as the owner of the
    rig sees only the recorded poses.
    """
    poses, stated = (tracker or Tracker()).record(poses, noise, rate, rng), None if tracker else noise
    header = Header(schema=1, description=description, body=body, gravity=gravity, rate=rate, noise=stated)  # pyright: ignore[reportCallIssue]
    return header, as_trajectories(poses, np.arange(poses.shape[1]) / rate)


def contact_columns(
    trial: np.ndarray,
    t: np.ndarray,
    states: tuple[np.ndarray, np.ndarray, np.ndarray],
    r: np.ndarray,
    c: np.ndarray,
    **more: np.ndarray,
) -> dict[str, np.ndarray]:
    """Columns of m contacts: trial and t (m,), pose and velocities before and after (m, 3), r and impulse (m, 2)."""
    named = zip((POSE, V_PRE, V_POST, ("r_x", "r_y"), ("c_t", "c_n")), (*states, r, c))
    columns = {name: column for names, values in named for name, column in zip(names, values.T)}
    return {"trial": trial, "t": t} | columns | more


def contact_table(parts: list[dict[str, np.ndarray]], columns: tuple[str, ...], kinds: dict[str, type]) -> pd.DataFrame:
    """All contacts, sorted by trial and time and numbered from 0 in each trial; `kinds`: types other than float."""
    if parts:
        table = pd.concat([pd.DataFrame(part) for part in parts]).astype(kinds)
    else:
        table = pd.DataFrame(columns=columns, dtype=float).astype({"trial": int, **kinds})
    table = table.sort_values(["trial", "t"], kind="stable", ignore_index=True)
    table["impact"] = table.groupby("trial").cumcount()
    return table[list(columns)]


def trial_table(pose: np.ndarray, velocity: np.ndarray, **more: np.ndarray) -> pd.DataFrame:
    """A row per drop: number, release state from pose and velocity (n, 3), and further columns (n,)."""
    states = dict(zip((*POSE, "vx", "vy", "omega"), [*pose.T, *velocity.T]))
    return pd.DataFrame({"trial": np.arange(len(pose))} | states | more)
