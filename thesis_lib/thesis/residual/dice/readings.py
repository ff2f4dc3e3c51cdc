"""Throws by the law alone over a grid of friction and restitution, to find which values give the thesis's figure 4-8.

All measured throws by Anitescu-Potra (Newton), the law of the thesis's chapter 4, without uncertainty, once with the
rotation as given and once with its sense reversed (θ, ω → −θ, −ω at the same x, y).  Nothing is fitted.  Errors are
measured minus expected along the direction of the throws, so that, as in the thesis, a negative error is an
overshoot; the published throws go along −x.

    χ² = ((m − m_T)/σ_m)² + ((s − s_T)/σ_s)² + ((f − f_T)/σ_f)²                          three degrees of freedom
    σ_m² = s_T² (1/n + 1/n_T),   σ_s² = s_T² (1/n + 1/n_T)/2,   σ_f² = f_T (1 − f_T) (1/n + 1/n_T)

compares mean m and standard deviation s of the errors and the share f of correct sides with the thesis (T).  The
two sets have throws in common, so the σ are rather too large.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.thesis.residual.dice.data import ThrowReleases
from thesis_lib.thesis.residual.dice.fit import DiceModel
from thesis_lib.thesis.residual.dice.models import throw_starts
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings

LAW = "anitescu_potra_newton"
MU = (0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
EPSILON = (0.4, 0.45, 0.5, 0.55, 0.6, 0.65)
# thesis, figure 4-8 and section 4.4: mean and standard deviation in sides, share of right sides; throws
PUBLISHED = (-0.97, 4.44, 0.23)
PUBLISHED_THROWS = 750
MIRRORED = np.array([1.0, 1.0, -1.0])


def readings(
    believed: DiceModel,
    releases: ThrowReleases,
    side: float,
    settings: ThrowSettings,
    mu: Sequence[float] = MU,
    epsilon: Sequence[float] = EPSILON,
) -> pd.DataFrame:
    """Table per rotation (given, mirrored), mu and epsilon: mean, std (sides), face_right and chi2; `side` in m."""
    way = np.sign(np.mean(releases.end[:, 0] - releases.q[:, 0]))
    rows = []
    for rotation, turned in (("given", np.ones(3)), ("mirrored", MIRRORED)):
        q, v, end = releases.q * turned, releases.v * turned, releases.end * turned
        for m in mu:
            for e in epsilon:
                model = replace(believed, law=LAW, mu=float(m), epsilon=float(e))
                out = throw_starts(model, model.impact, q, v, settings, np.random.default_rng(0))
                error = way * (end[:, 0] - out.q[:, 0]) / side
                right = out.face == model.face(end[:, 2])
                found = (float(error.mean()), float(error.std()), float(right.mean()))
                rows.append((rotation, m, e, *found, _chi2(found, len(error))))
    return pd.DataFrame(rows, columns=["rotation", "mu", "epsilon", "mean", "std", "face_right", "chi2"])


def _chi2(found: Sequence[float], n: int) -> float:
    _, s, f = PUBLISHED
    each = 1.0 / n + 1.0 / PUBLISHED_THROWS
    variance = np.array([s**2, s**2 / 2.0, f * (1.0 - f)]) * each
    return float((np.subtract(found, PUBLISHED) ** 2 / variance).sum())
