"""Restitution that differs from impact to impact, with nothing that is recorded.

Where something is left that no feature predicts, each impact is given an ε of its own.  With R the residual of its
velocity after impact, S its covariance from the measured noise and g = ∂R/∂ε,

    δε = − gᵀS⁻¹R / gᵀS⁻¹g,    variance 1 / gᵀS⁻¹g,

what is left has d² = RᵀS⁻¹R − (gᵀS⁻¹R)² / gᵀS⁻¹g.  If its median is that of noise, restitution is all that differs.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.drops.covariance import residual_covariance
from thesis_lib.critique.drops.fit import Fit
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import impact_residuals
from thesis_lib.statistics.spread import robust_std
from thesis_lib.statistics.tails import chi_square_quantile

STEP = 1e-3  # of ε, for slopes
FAR = 3.0  # times the noise: the least scatter that is worth a sentence
LEAST = 10  # impacts whose scatter is judged
WITHIN = 0.5  # of the scatter of all: that within trials, below which it differs from trial to trial


@dataclass(frozen=True)
class OwnRestitution:
    """ε (n,) of each single hit with its standard error (n,), and the mean square of what it leaves, over noise."""

    trial: np.ndarray
    epsilon: np.ndarray
    std: np.ndarray
    left: float

    def differs(self, limit: float) -> str | None:
        """What it differs by, "trial" or "impact"; None if it is one number, or other things differ, too.

        `limit`: of the rest, in units of noise.
        """
        if len(self.epsilon) < LEAST:
            return None
        spread = float(robust_std(self.epsilon[:, None] - np.median(self.epsilon))[0])
        if not (spread > FAR * float(np.median(self.std)) and self.left < limit**2):
            return None
        _, of, count = np.unique(self.trial, return_inverse=True, return_counts=True)
        mean = np.bincount(of, self.epsilon) / count
        several = count[of] > 1
        if not several.any():
            return "trial"
        within = np.sqrt(np.mean(((self.epsilon - mean[of]) ** 2 * count[of] / np.maximum(count[of] - 1, 1))[several]))
        return "trial" if within < WITHIN * spread else "impact"


def own_restitution(fitted: Fit, observations: Observations) -> OwnRestitution:
    """An ε for each single hit, all else as fitted."""
    o, model, values = observations.single, fitted.model, fitted.values
    known = 3 if o.rig.has_angle else 2  # components of the velocity that are measured
    inward = -STEP if values["epsilon"] + STEP > 1.0 else STEP
    R, moved = (
        impact_residuals(model, {**values, "epsilon": values["epsilon"] + step}, o)[:, :known] for step in (0.0, inward)
    )
    g = (moved - R) / inward
    inverse = np.linalg.inv(residual_covariance(model, values, o)[:, :known, :known])
    information = np.einsum("ni,nij,nj->n", g, inverse, g)
    across = np.einsum("ni,nij,nj->n", g, inverse, R)
    rows = np.flatnonzero(information > 0.0)
    if not len(rows):
        return OwnRestitution(o.trial[rows], np.zeros(0), np.zeros(0), np.inf)
    information, across = information[rows], across[rows]
    d2 = np.einsum("ni,nij,nj->n", R[rows], inverse[rows], R[rows]) - across**2 / information
    left = float(np.median(d2)) / float(chi_square_quantile(np.array([0.5]), known - 1)[0])
    return OwnRestitution(o.trial[rows], values["epsilon"] - across / information, information**-0.5, left)
