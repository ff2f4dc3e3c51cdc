"""The limit of prediction: how far noise of the measured start alone moves the end of a simulated throw.

The same deterministic model throws from each measured state and from states drawn from its covariance.  No prediction
from these measurements can be better than the resulting spread.  A model whose throws are less sensitive than the true
ones gives too low a limit.

    spread = median over throws of the standard deviation of (x_end − x_end of the measured state)
    kept   = share of drawn starts that end on the same side as the measured state
"""

import numpy as np
import pandas as pd

from thesis_lib.residual.dice.data import Releases
from thesis_lib.residual.dice.fit import DiceModel
from thesis_lib.residual.throwing.belief import covariance_root
from thesis_lib.residual.throwing.settings import ThrowSettings
from thesis_lib.residual.throwing.throw import ImpactModel, simulate_throws


def perturbed(releases: Releases, copies: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Poses and velocities (n copies, 3) drawn from the covariance of each start, copies of a throw together."""
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
    """Rows per throw: trial, spread (standard deviation of the end, in sides of length `side` m), face_kept."""
    mu = model.mu
    still = simulate_throws(model.body, model.seen(releases.q), releases.v, impact, mu, settings, rng)
    q, v = perturbed(releases, copies, rng)
    moved = simulate_throws(model.body, model.seen(q), v, impact, mu, settings, rng)
    away = (moved.q[:, 0].reshape(-1, copies) - still.q[:, :1]) / side
    kept = moved.face.reshape(-1, copies) == still.face[:, None]
    return pd.DataFrame({"trial": releases.trial, "spread": np.sqrt((away**2).mean(1)), "face_kept": kept.mean(1)})
