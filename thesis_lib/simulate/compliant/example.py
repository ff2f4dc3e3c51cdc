"""An example dataset for learning and trying the critique: the log of a rig with one hidden cause.

The folder holds only data that the owner of a rig would have: dataset.yaml as believed, trajectories.csv with noise,
and `NEW_IMPACTS`, the first impacts of further drops (`compliant.drops`).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_table
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.compliant.drops import Engine, simulate_compliant_drops
from thesis_lib.simulate.rig.camera import reported
from thesis_lib.simulate.rig.hidden_causes import (
    CAUSES,
    ELLIPSE_BODY,
    NO_SIZE,
    PROOF_RELEASE,
    RIG_NOISE,
    SQUARE,
    CompliantContact,
    HiddenCauses,
    of_size,
)
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.simulate.rig.tracker import Tracker

NOTHING = "nothing"
BODIES = {"ellipse": ELLIPSE_BODY, "square": SQUARE}
NEW_IMPACTS = "new_impacts.csv"
NEW_DROPS = 40
DESCRIPTION = "example: simulated drops of a rig that may not be what dataset.yaml says"
FLOAT_FORMAT = "%.6f"  # resolves poses to a micrometre and a microradian, far below the noise


@dataclass(frozen=True)
class Example:
    """Log of a rig with a hidden cause."""

    dataset: Dataset  # the drops, with the header as believed
    # x,y,theta,vx,vy,omega (m, rad, m/s, rad/s) just before the first impacts of `NEW_DROPS` further drops, and
    # vx_seen,vy_seen,omega_seen just after them, as the camera would see them without noise
    new_impacts: pd.DataFrame


def simulate_example(
    name: str,
    hidden: str,
    *,
    size: float | None = None,
    drops: int = 150,
    seed: int = 0,
    tracker: Tracker | None = None,
    engine: Engine | None = None,
    contact: CompliantContact | None = None,
    shape: str = "",
) -> Example:
    """Simulate an example with the cause `hidden` of `CAUSES`, or "nothing"; `size`: in its unit, default in `CAUSES`.

    `tracker` holds the settings of the recording; if None, poses are recorded as the camera sees them.  `engine` is the
    simulator that moves the bodies, `contact` its contact settings; if None, the default ones.
    `shape` is "ellipse" or "square"; by default the ellipse unless the cause needs corners.

    Raises:
        UserError: the cause is unknown or needs corners, its size is out of range, the engine cannot model it, or there
            are no drops.
    """
    causes = _hidden_causes(hidden, size)
    if drops < 1:
        raise UserError(f"An example needs at least one drop; got {drops}.")
    if seed < 0:
        raise UserError(f"The seed must be 0 or more; got {seed}.")
    cornered = hidden in CAUSES and CAUSES[hidden].polygon_only
    if cornered and shape == "ellipse":
        raise UserError(f"{hidden} needs corners, and an ellipse has none; omit --shape, or give --shape square.")
    body = BODIES[shape or ("square" if cornered else "ellipse")]

    def released(n: int, part: str) -> DropsWithTruth:
        chosen: dict = {"hidden": causes, "noise": RIG_NOISE, "tracker": tracker, "contact": contact, "engine": engine}
        return simulate_compliant_drops(body, PROOF_RELEASE, n, rng=generator(seed, "example", part), **chosen)

    made = released(drops, "drops")
    header = made.header.model_copy(update={"description": DESCRIPTION})
    truth = released(NEW_DROPS, "new").impacts
    first = truth[(truth["impact"] == 0) & truth["separated"]].reset_index(drop=True)
    return Example(Dataset(name, header, made.trajectories), _new_impacts(first, causes))


def _new_impacts(truth: pd.DataFrame, m: HiddenCauses) -> pd.DataFrame:
    """States before and after impact as the camera reports them, from true states of the body's origin."""
    q, t = truth[list(POSE)].to_numpy(), truth["t"].to_numpy()
    (pose, before), (_, after) = (_camera(q, truth[list(names)].to_numpy(), t, m) for names in (V_PRE, V_POST))
    columns = dict(zip(POSE, pose.T))
    columns |= dict(zip(("vx", "vy", "omega"), before.T))
    columns |= dict(zip(("vx_seen", "vy_seen", "omega_seen"), after.T))
    return pd.DataFrame(columns)


def _camera(q: np.ndarray, v: np.ndarray, t: np.ndarray, m: HiddenCauses) -> tuple[np.ndarray, np.ndarray]:
    """Pose and velocity as the camera reports them, from the true ones (n, 3) at times `t` (n,) in s."""
    step = np.array([0.0, 1e-3])  # s; any step gives the same velocity along a straight path
    poses = q[:, None] + step[:, None] * v[:, None]
    late = poses[..., 2] - m.time_lag * v[:, 2:]
    seen = reported(poses, late, t[:, None] + step, m)
    return seen[:, 0], (seen[:, 1] - seen[:, 0]) / step[1]


def write_example(example: Example, folder: str | Path) -> Path:
    """Write dataset.yaml, trajectories.csv and `NEW_IMPACTS`; UserError if `folder` holds other tables of a dataset."""
    folder = write_dataset(example.dataset, folder, float_format=FLOAT_FORMAT)
    write_table(example.new_impacts, folder / NEW_IMPACTS, FLOAT_FORMAT)
    return folder


def causes_text() -> str:
    """Hidden causes with default size and meaning, one per line."""
    width = max(map(len, CAUSES))
    lines = []
    for name, cause in CAUSES.items():
        meaning = HiddenCauses.model_fields[name].description
        size = "on" if name == "mirrored" else f"{cause.size:g}"
        lines.append(f"  {name:<{width}}  {size:<8} {meaning}{'' if cause.effects else ' (no effect fits)'}")
    return "\n".join([*lines, f"  {NOTHING:<{width}}  {'':<8} a rig that agrees with its dataset.yaml"])


def _hidden_causes(hidden: str, size: float | None) -> HiddenCauses:
    if hidden == NOTHING:
        if size is not None:
            raise UserError(NO_SIZE)
        return HiddenCauses()
    if hidden not in CAUSES:
        raise UserError(f"There is no hidden cause {hidden!r}; known are {', '.join(CAUSES)} and {NOTHING}.")
    if hidden == "mirrored":
        if size not in (None, 1.0):
            raise UserError("A mirrored camera is either on or off; omit --size.")
        return HiddenCauses(mirrored=True)
    return of_size(HiddenCauses, hidden, CAUSES[hidden].size if size is None else size)
