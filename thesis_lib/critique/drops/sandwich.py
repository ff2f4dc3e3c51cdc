"""Covariance of fitted parameters that does not trust the noise that was assumed: the sandwich of an M-estimator."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from thesis_lib.critique.drops.model import inward
from thesis_lib.critique.drops.whitening import NU, Whitening
from thesis_lib.statistics.tails import chi_square_quantile

# of the likelihood, over that of a normal one: the floor for tails heavier than Student's t
LEAST_CURVATURE = 0.1


def sandwich(whitening: Whitening, values: Mapping[str, float], step: np.ndarray) -> np.ndarray:
    """Sandwich covariance (p, p) of the fitted parameters, as of an M-estimator, from slopes over `step` (p,).

    With weights w = (ν + m)/(ν + d²) of the likelihood's gradient and J the Jacobian of the whitened residuals,

        H⁻¹ B H⁻¹,   H = Σ a JᵀJ,  a = ⟨w + 2 w' d²/m⟩,   B = Σ b JᵀJ,  b = ⟨w² d²/m⟩

    summed over impacts and flights, with the mean ⟨⟩ over each.  For normal residuals this is 1.02 times the Cramér-Rao
    bound.  Residuals larger than S predicts widen it; smaller ones do not narrow it.
    """
    free = whitening.model.fitted_parameters
    steps = [inward(p, values[name], h) for h, (name, p) in zip(step.tolist(), free.items())]
    others = [-h if p.low <= values[name] - h <= p.high else h for h, (name, p) in zip(steps, free.items())]
    points = [{**values, name: values[name] + h} for side in (steps, others) for name, h in zip(free, side)]
    here, *moved = whitening.many([values, *points])
    secants = [[(m[part] - here[part]).ravel() / h for m, h in zip(moved, steps + others)] for part in (0, 1)]
    columns = [[_lesser(*pair) for pair in zip(part, part[len(free) :])] for part in secants]
    H, B = np.zeros((2, len(free), len(free)))
    for part, z in zip(columns, here):
        if not len(z):
            continue
        J, m = np.stack(part, axis=1), z.shape[1]
        normal = _of_normal(m)
        measured = _curvature_and_variance(np.einsum("nm,nm->n", z, z), m)
        a, b = max(measured, normal, key=lambda pair: pair[1] / pair[0] ** 2)
        information = J.T @ J
        H += a * information
        B += b * information
    # scaled by the information of each parameter, so that units do not matter
    unit = np.sqrt(np.diag(H))
    unit = np.outer(unit, unit) + (unit == 0.0) + (unit == 0.0)[:, None]
    inverse = np.linalg.pinv(H / unit, hermitian=True) / unit
    return inverse @ B @ inverse


def _lesser(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Of the slopes to either side the flatter one: one side may cross a jump, as where a body hits once more."""
    return np.where(np.abs(one) < np.abs(other), one, other)


@lru_cache
def _of_normal(m: int) -> tuple[float, float]:
    """The same for normal residuals."""
    return _curvature_and_variance(chi_square_quantile((np.arange(2000) + 0.5) / 2000, m), m)


def _curvature_and_variance(d2: np.ndarray, m: int) -> tuple[float, float]:
    """a and b of `sandwich` from d² (n,) in m dimensions."""
    w = (NU + m) / (NU + d2)
    a = max(float(np.mean(w - 2.0 * w / (NU + d2) * d2 / m)), LEAST_CURVATURE)
    return a, float(np.mean(w * w * d2 / m))
