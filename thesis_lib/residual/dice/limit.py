"""The limit of prediction: how far the noise of the measured start alone moves the end of a simulated throw.

Each throw is simulated from its measured state and from states drawn from that state's covariance, by the same
deterministic model.  What moves then is no fault of a model: no prediction from these measurements can be better.  (A
model whose throws are less sensitive than the true ones gives too low a limit.)

    spread = median over throws of the standard deviation of (x_end − x_end of the measured state)
    kept   = share of all drawn starts that end on the side on which the measured state ends
"""

import numpy as np
import pandas as pd

from thesis_lib.residual.dice.data import Releases
from thesis_lib.residual.dice.fit import DiceModel
from thesis_lib.residual.throwing.belief import covariance_root
from thesis_lib.residual.throwing.settings import ThrowSettings
from thesis_lib.residual.throwing.throw import ImpactModel, simulate_throws


def perturbed(releases: Releases, copies: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Poses and velocities (n copies, 3) drawn from the covariance of each start, throws slowest."""
    root = covariance_root(releases.cov)
    noise = np.einsum("nij,ncj->nci", root, rng.standard_normal((len(root), copies, 6)))
    state = np.hstack([releases.q, releases.v])[:, None, :] + noise
    state = state.reshape(-1, 6)
    return state[:, :3], state[:, 3:]


def noise_limit(
    releases: Releases,
    model: DiceModel,
    impact: ImpactModel,
    side: float,
    copies: int,
    settings: ThrowSettings,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """One row for each throw: trial, spread (standard deviation of the end, in sides of length `side` m), face_kept."""
    mu = model.mu
    still = simulate_throws(model.body, model.seen(releases.q), releases.v, impact, mu, settings, rng)
    q, v = perturbed(releases, copies, rng)
    moved = simulate_throws(model.body, model.seen(q), v, impact, mu, settings, rng)
    away = (moved.q[:, 0].reshape(-1, copies) - still.q[:, :1]) / side
    kept = moved.face.reshape(-1, copies) == still.face[:, None]
    return pd.DataFrame(
        {"trial": releases.trial, "spread": np.sqrt((away**2).mean(1)), "face_kept": kept.mean(1)}
    )
