"""Restitution that differs from impact to impact without a recorded cause.

If an error remains that no feature predicts, each impact is given its own ε.  With R the residual of an impact, S the
covariance of R from the measured noise and g = ∂R/∂ε,

    δε = − gᵀS⁻¹R / gᵀS⁻¹g,    variance 1 / gᵀS⁻¹g,

the rest has d² = RᵀS⁻¹R − (gᵀS⁻¹R)² / gᵀS⁻¹g.  If the median of d² is that of noise, only restitution differs.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.statistics.spread import robust_std

STEP = 1e-3  # of ε, for slopes
UNKNOWN = 1e-4  # (m/s)², for weights where the noise is not known
FAR = 3.0  # times the noise: the least scatter that is worth a sentence
LEAST = 10  # impacts, to judge their scatter
WITHIN = 0.5  # scatter within trials over that of all; below, restitution differs from trial to trial


@dataclass(frozen=True)
class OwnRestitution:
    """ε (n,) of each single hit with its standard error (n,), and `left`, the median d² over that of noise.

    `rows` (n,) are indices into the single hits; hits that do not determine restitution are omitted.
    """

    rows: np.ndarray
    trial: np.ndarray
    epsilon: np.ndarray
    std: np.ndarray
    left: float

    def differs(self, limit: float) -> str | None:
        """Return "trial" or "impact" if restitution, and nothing else, differs between these; None otherwise.

        `limit`: largest rest, in units of noise.
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

    def mean(self) -> tuple[float, float]:
        """Mean ε and its standard error, which includes the scatter of impacts and trials; NaN if unknown.

        Impacts of a trial are averaged with their weights, and so are trials; at each level the weights are 1/(σ² + τ²)
        with the scatter τ² beyond σ² by the method of moments (DerSimonian and Laird 1986,
        doi:10.1016/0197-2456(86)90046-2).
        """
        trials = np.unique(self.trial)
        levels = [_weighted(self.epsilon[self.trial == i], self.std[self.trial == i]) for i in trials]
        return _weighted(*np.array(levels).T)


def _weighted(value: np.ndarray, std: np.ndarray) -> tuple[float, float]:
    """Mean of values (n,) that scatter beyond their standard errors (n,; NaN if unknown), and its standard error."""
    n, w = len(value), std**-2.0
    if not np.isfinite(std).all():
        return float(value.mean()), float(value.std(ddof=1) / np.sqrt(n)) if n > 1 else np.nan
    mean = w @ value / w.sum()
    beyond = w @ (value - mean) ** 2 - (n - 1)
    scatter = max(beyond, 0.0) / (w.sum() - w @ w / w.sum()) if n > 1 else 0.0
    w = 1.0 / (std**2 + scatter)
    return float(w @ value / w.sum()), float(w.sum() ** -0.5)


def own_restitution(fitted: Fit, observations: Observations) -> OwnRestitution:
    """Estimate ε of each single hit, all else as fitted; the standard errors are NaN if the noise is unknown."""
    o, values = observations.single, fitted.values
    if not len(o):  # episodes alone
        return OwnRestitution(np.zeros(0, int), o.trial, np.zeros(0), np.zeros(0), np.inf)
    inward = -STEP if values["epsilon"] + STEP > 1.0 else STEP
    here = fitted.on(o)
    moved = Comparison(fitted.model, {**values, "epsilon": values["epsilon"] + inward}, o, (here.before, here.after)).R
    d, m = o.space.dimension, o.space.motions
    # spin, and continuity of the angle, are known only if the angle is measured
    of_angle = set() if o.rig.has_angle else {*range(d, m), *range(m + d, 2 * m)}
    known = [i for i in range(moved.shape[1]) if i not in of_angle]
    R, g = here.R[:, known], ((moved - here.R) / inward)[:, known]
    S = here.covariance()
    if not o.noise_known:
        S[:, range(m), range(m)] += UNKNOWN * np.repeat([1.0, o.rig.k_g**-2.0], [d, o.space.turns])
    inverse = np.linalg.inv(S[:, known][:, :, known])
    information = np.einsum("ni,nij,nj->n", g, inverse, g)
    across = np.einsum("ni,nij,nj->n", g, inverse, R)
    rows = np.flatnonzero(information > 0.0)
    if not len(rows):
        return OwnRestitution(rows, o.trial[rows], np.zeros(0), np.zeros(0), np.inf)
    information, across = information[rows], across[rows]
    d2 = np.einsum("ni,nij,nj->n", R[rows], inverse[rows], R[rows]) - across**2 / information
    left = float(np.median(d2)) / float(chi2.median(len(known) - 1))
    std = information**-0.5 if o.noise_known else np.full(len(rows), np.nan)
    return OwnRestitution(rows, o.trial[rows], values["epsilon"] - across / information, std, left)
