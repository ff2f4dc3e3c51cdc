"""Fit a physics engine to drops in the plane, with the same likelihood as laws.

The compliant law that approximates the engine (`engine_contact.STAND_INS`) is fitted first.  It gives the start, and
the covariance of the residuals, which depends on the law far less than the residuals do.  From there, least squares use
the engine itself, with steps wide enough for its integrator.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from thesis_lib.critique.contacts.engine_contact import engine_law
from thesis_lib.critique.contacts.model import Model, inward
from thesis_lib.critique.likelihood.bounds import Bound, doubtful, profiled
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.levenberg_marquardt import NEAR, levenberg_marquardt
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.whitening import Whitening, robust, transformed

STEP = 5e-3  # of a parameter's scale, for slopes; an engine's own rounding is below a tenth of the change
ROUNDS = 2  # updates of the scatter beyond noise; one, if its logarithm changes less than this, or if it is negligible
SETTLED, NEGLIGIBLE = 0.2, 1e-3  # 1, m/s
NO_PRIOR = np.zeros(0)


@dataclass(frozen=True)
class EngineFit:
    """An engine fitted to drops; `values` and standard errors `std` by full parameter name.

    `bounds` are of the parameters that the drops only bound (`likelihood.bounds`); their `std` is NaN.
    """

    model: Model
    values: dict[str, float]
    std: dict[str, float]
    bounds: Mapping[str, Bound] = field(default_factory=dict)


def fit_engine(name: str, near: Fit, observations: Observations) -> EngineFit:
    """Fit the engine `name` with the effects of `near`, the fit of its compliant law to the same observations.

    Standard errors are those of least squares with the measured noise and the scatter.  UserError if the engine is not
    installed or fails.
    """
    model = replace(near.model, law=engine_law(name))
    whitening = Whitening(model, observations, near.on(observations).covariance(), near.sigma_m)
    free = model.fitted_parameters
    low, high = (np.array([getattr(p, bound) for p in free.values()]) for bound in ("low", "high"))
    x = np.clip([near.values[key] for key in free], low, high)
    step = np.array([abs(inward(p, value, STEP * p.scale)) for value, p in zip(x.tolist(), free.values())])
    values = dict(near.values)

    def at(point: np.ndarray) -> dict[str, float]:
        return values | dict(zip(free, point.tolist()))

    for _ in range(ROUNDS):
        search = levenberg_marquardt(x, low, high, step, NEAR)
        points = next(search)
        while points:
            found = [transformed(whitening(at(point)), NO_PRIOR) for point in points]
            try:
                points = search.send(found)
            except StopIteration as end:
                x, points = end.value, []
        before, whitening = whitening.sigma_m, whitening.settled(at(x))
        scatter = whitening.sigma_m
        if abs(np.log(scatter / before)) < SETTLED or max(scatter, before) < NEGLIGIBLE:
            break
    here = _residuals(whitening, at(x))
    h = np.where(x + step <= high, step, -step)
    J = np.stack([(_residuals(whitening, at(point)) - here) / d for point, d in zip(x + np.diag(h), h)], axis=1)
    std = dict(zip(free, np.sqrt(np.diag(np.linalg.pinv(J.T @ J, hermitian=True))).tolist()))
    at_end, bounds = at(x), {}
    for key in [key for key, p in free.items() if doubtful(p, at_end[key], std[key])]:
        said = profiled(whitening, at_end, key)
        std[key] = np.nan if isinstance(said, Bound) else said
        bounds |= {key: said} if isinstance(said, Bound) else {}
    return EngineFit(model, at_end, dict.fromkeys(values, 0.0) | std, bounds)


def _residuals(whitening: Whitening, values: dict[str, float]) -> np.ndarray:
    return np.concatenate([robust(part).ravel() for part in whitening(values)])
