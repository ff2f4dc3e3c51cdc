"""Covariance of fitted parameters that is robust to errors of noise and model: the sandwich of an M-estimator.

Impacts of one trial share model errors (the same side of the body, the same place, the same spin); therefore trials
are treated as independent, not impacts.
"""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from scipy.stats import chi2

from thesis_lib.critique.contacts.model import Model, inward
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.whitening import NU, SIGMA_LOW, Whitening

# least curvature of the likelihood relative to a normal one, for tails heavier than Student's t
LEAST_CURVATURE = 0.1
STEP = 1e-3  # relative to a parameter's scale: step of central differences


def sandwich(whitening: Whitening, values: Mapping[str, float], step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sandwich covariance (p, p) of the fitted parameters, as for an M-estimator, and standard errors (p,) by trial.

    Both use finite differences over `step` (p,).

    With weights w = (ν + m)/(ν + d²) of the likelihood's gradient and J the Jacobian of the whitened residuals z,

        H⁻¹ B H⁻¹,   H = Σ a JᵀJ,  a = ⟨w + 2 w' d²/m⟩,   B = Σ b JᵀJ,  b = ⟨w² d²/m⟩

    summed over impacts and flights, with the mean ⟨⟩ over each.  For normal residuals this is 1.02 times the Cramér-Rao
    bound.  Residuals larger than S predicts widen it; smaller ones do not narrow it.  The standard errors are the roots
    of its diagonal, or of the following diagonal where

        H⁻¹ B_n H⁻¹,   B_n = n/(n − 1) Σ_k g_k g_kᵀ,   g_k = Σ w Jᵀz over the impacts and flights of trial k

    over the n trials is larger (Liang and Zeger 1986, doi:10.1093/biomet/73.1.13).
    """
    free, o = whitening.model.fitted_parameters, whitening.observations
    steps = [inward(p, values[name], h) for h, (name, p) in zip(step.tolist(), free.items())]
    others = [-h if p.low <= values[name] - h <= p.high else h for h, (name, p) in zip(steps, free.items())]
    points = [{**values, name: values[name] + h} for side in (steps, others) for name, h in zip(free, side)]
    here, *moved = whitening.many([values, *points])
    secants = [[(m[part] - here[part]) / h for m, h in zip(moved, steps + others)] for part in range(len(here))]
    columns = [[_lesser(*pair) for pair in zip(part, part[len(free) :])] for part in secants]
    trials, of_trial = np.unique(np.concatenate([o.trial, *(beside.trial for beside in o.beside)]), return_inverse=True)
    H, B, own = np.zeros((3, len(free), len(free)))
    scores = np.zeros((len(trials), len(free)))
    for part, z, rows in zip(columns, here, np.split(of_trial, np.cumsum([len(z) for z in here])[:-1])):
        if not len(z):
            continue
        J, m = np.stack(part, axis=2), z.shape[1]
        d2 = np.einsum("nm,nm->n", z, z)
        w, Jz = (NU + m) / (NU + d2), np.einsum("nmp,nm->np", J, z)
        a, b = max(_curvature_and_variance(d2, m), _of_normal(m), key=lambda pair: pair[1] / pair[0] ** 2)
        information = np.einsum("nmp,nmq->pq", J, J)
        H += a * information
        B += b * information
        own += np.einsum("n,nmp,nmq->pq", w, J, J) - np.einsum("n,np,nq->pq", 2.0 * w / (NU + d2), Jz, Jz)
        np.add.at(scores, rows, w[:, None] * Jz)
    unseen = whitening.model.unseen(o.rig)  # directions that are not fitted do not scatter
    H, own = H + unseen.T @ unseen, own + unseen.T @ unseen
    # scaled by the information of each parameter: independent of units
    unit = np.sqrt(np.diag(H))
    unit = np.outer(unit, unit) + (unit == 0.0) + (unit == 0.0)[:, None]
    inverse = np.linalg.pinv(H / unit, hermitian=True) / unit
    assumed = inverse @ B @ inverse
    by_trial = scores @ (_inverse_above(own / unit, LEAST_CURVATURE * H / unit) / unit)
    seen = (by_trial**2).sum(axis=0) * len(trials) / max(len(trials) - 1, 1)
    return assumed, np.sqrt(np.maximum(seen, np.diag(assumed)))


def _inverse_above(H: np.ndarray, least: np.ndarray) -> np.ndarray:
    """Inverse of the symmetric H, with curvatures raised to at least those of `least`; both (p, p)."""
    values, axes = np.linalg.eigh(least)
    kept = values > values.max(initial=0.0) * 1e-12
    root = axes[:, kept] / np.sqrt(values[kept])
    curvature, turned = np.linalg.eigh(root.T @ H @ root)
    root = root @ turned
    return (root / np.maximum(curvature, 1.0)) @ root.T


def _lesser(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The flatter of the slopes to both sides: one side may cross a jump, for example where a body hits once more."""
    return np.where(np.abs(one) < np.abs(other), one, other)


@lru_cache
def _of_normal(m: int) -> tuple[float, float]:
    """a and b of `sandwich` for normal residuals in m dimensions."""
    return _curvature_and_variance(chi2.ppf((np.arange(2000) + 0.5) / 2000, m), m)


def _curvature_and_variance(d2: np.ndarray, m: int) -> tuple[float, float]:
    """a and b of `sandwich` from d² (n,) in m dimensions."""
    w = (NU + m) / (NU + d2)
    a = max(float(np.mean(w - 2.0 * w / (NU + d2) * d2 / m)), LEAST_CURVATURE)
    return a, float(np.mean(w * w * d2 / m))


def cramer_rao(model: Model, true: Mapping[str, float], observations: Observations) -> dict[str, float]:
    """Cramér-Rao bound on the standard deviation of each parameter, by name.

    The Fisher information is JᵀJ of the whitened residuals at the true values, with measured noise and no scatter.
    """
    whitening = Whitening(model, observations, Comparison(model, true, observations).covariance(), SIGMA_LOW)
    free, columns = model.fitted_parameters, []
    for name, p in free.items():
        h = STEP * p.scale
        up, down = (whitening.stacked({**true, name: true[name] + step}) for step in (h, -h))
        columns.append((up - down) / (2.0 * h))
    J = np.stack(columns, axis=1)
    return dict(zip(free, np.sqrt(np.diag(np.linalg.pinv(J.T @ J, hermitian=True))).tolist()))
