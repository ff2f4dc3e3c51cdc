"""Bounds on parameters whose likelihood is flat up to an end of their range.

If no impact slips, every coefficient of friction above the largest ratio of impulses gives the same prediction, and a
standard error from the curvature of the likelihood is meaningless.  The profile is then used: with r(x) the robust
whitened residuals at the value x of one parameter, and P the projector that removes the derivatives by all others,

    loss(x) = ½ (|P r(x)|² − |P r(x̂)|²)    nats,

a parameter has only a bound if loss(x) stays below `EDGE` up to one end of its range; the bound is the point where it
exceeds `EDGE` on the other side (95 %).  If it stays below up to both ends, the data are uninformative, and the bound
is the lower end.  If neither, half the interval replaces the standard error.  Because laws define μ differently, its
lower bound is at most the largest ratio of impulses.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from thesis_lib.critique.contacts.model import inward
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.whitening import Whitening, robust
from thesis_lib.effects.effect import Parameter
from thesis_lib.statistics.intervals import Z95

EDGE = 0.5 * Z95**2  # nats
WIDE = 0.25  # relative to the range of a parameter: a wider 95 % interval is checked with the profile
NO_SLOPE = 1e-6  # relative to a parameter's scale: standard error due to rounding if nothing depends on it
POINTS, STAGES = 16, 4  # of the search for an edge: its error is below 10⁻⁵ of the range
SLOPE_STEP = 1e-3  # relative to a parameter's scale: step of finite differences


@dataclass(frozen=True)
class Bound:
    """Bound on a parameter that the data limit from one side only: a lower or an upper bound."""

    kind: Literal["lower", "upper"]
    value: float


def doubtful(p: Parameter, value: float, std: float) -> bool:
    """Whether a standard error may be meaningless: at an end of the range, with zero derivative, or too wide."""
    if p.discrete is not None:
        return False
    at_end = value in (p.low, p.high) and value != p.null
    return at_end or not NO_SLOPE * p.scale < std < WIDE * (p.high - p.low) / (2.0 * Z95)


def profiled(whitening: Whitening, values: Mapping[str, float], name: str) -> Bound | float:
    """Bound of one parameter, or its standard error, from the profile at fixed covariance."""
    parameters = whitening.model.fitted_parameters
    p, value = parameters[name], values[name]

    def residuals(points: list[dict[str, float]]) -> np.ndarray:
        return np.stack([np.concatenate([robust(z).ravel() for z in part]) for part in whitening.many(points)])

    others = [(n, inward(q, values[n], SLOPE_STEP * q.scale)) for n, q in parameters.items() if n != name]
    here, *moved = residuals([dict(values), *({**values, n: values[n] + step} for n, step in others)])
    columns = [(r - here) / step for r, (_, step) in zip(moved, others)]
    Q = _basis(np.stack(columns, axis=1)) if columns else np.zeros((len(here), 0))

    def cost(r: np.ndarray) -> np.ndarray:
        return 0.5 * ((r**2).sum(axis=-1) - ((r @ Q) ** 2).sum(axis=-1))

    least = cost(here)

    def edge(end: float) -> float | None:
        """Value at which the loss exceeds `EDGE` on the way to an end of the range; None if it does not."""
        near, far = value, end
        for stage in range(STAGES):
            points = np.linspace(near, far, POINTS + 1)[1:]
            loss = cost(residuals([{**values, name: x} for x in points.tolist()])) - least
            beyond = np.flatnonzero(~(loss <= EDGE))
            if not len(beyond):
                return None if stage == 0 else far
            near, far = float(points[beyond[0] - 1]) if beyond[0] else near, float(points[beyond[0]])
        return far

    low, high = (edge(end) if value != end else None for end in (p.low, p.high))
    if low is None:
        return Bound("lower", p.low) if high is None else Bound("upper", high)
    if high is None:
        most = largest_ratio(Comparison(whitening.model, values, whitening.observations)) if name == "mu" else low
        return Bound("lower", min(low, most))
    return (high - low) / (2.0 * Z95)


def slip_is_known(comparison: Comparison) -> bool:
    """Whether at some impact the direction of slip is known despite an unmeasured spin; else friction is unknown."""
    o = comparison.observations
    _, at = comparison.dynamics.measured_contact(comparison.before, o.offset)
    slip = np.sqrt(np.sum(np.square(at.v[:-1]), axis=0))
    return bool(np.any(slip > Z95 * o.spin * np.abs(at.r[-1])))


def largest_ratio(comparison: Comparison) -> float:
    """Largest |c_t|/c_n of the impulses that a model predicts, which friction must support for any definition of μ."""
    dynamics, before = comparison.dynamics, comparison.before
    v = dynamics.measured_contact(before, comparison.observations.offset)[0].v
    after = dynamics.to_contact(dynamics.collide(dynamics.to_true(before))[0])
    c_t, c_n = (after.v - v)[:, :2].T
    return float(np.max(np.abs(c_t[c_n > 0.0]) / c_n[c_n > 0.0], initial=0.0))


def _basis(columns: np.ndarray) -> np.ndarray:
    """Orthonormal basis (N, rank) of columns (N, p), without zero or linearly dependent columns."""
    size = np.linalg.norm(columns, axis=0)
    U, s, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return U[:, s > 1e-6 * s.max(initial=0.0)]
