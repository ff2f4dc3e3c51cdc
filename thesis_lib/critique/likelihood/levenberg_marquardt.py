"""Iteratively reweighted least squares within bounds, by the method of Levenberg and Marquardt.

The cost is any function of the residuals z with a gradient Jᵀ W z, such as −2 log t_ν with the weights of the t
distribution.  In each step the weights are fixed at their values at its starting point.  The alternative, residuals
transformed such that their squares add up to the cost, gives steps that are too short by the logarithm of the error
if the model errs by many standard deviations.

Sources: Marquardt 1963, doi:10.1137/0111030; Holland and Welsch 1977, doi:10.1080/03610927708827533.
"""

from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np

STEPS = 12
TRIES, SHORTER, STRONGER = 4, 0.1, 30.0  # tries per step; least damping of the second try, and its growth from there
ENOUGH = 1e-3  # nats; the search ends below this gain per step, a twentieth of a standard error
NEAR = 3e-2  # nats, for a fit that is only compared; the step with this gain ends within a tenth of its length


class Weighted(NamedTuple):
    """Misfit of a model at one point: cost, residuals z (N,), and square roots (N,) of their weights."""

    cost: float
    z: np.ndarray
    weight: np.ndarray


def levenberg_marquardt(
    x: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    step: np.ndarray,
    enough: float = ENOUGH,
    wider: Sequence[float] = (),
) -> Generator[list[np.ndarray], list[Weighted], np.ndarray]:
    """Minimise the cost over x (p,) within the bounds `low`, `high`.

    The generator yields the points at which it needs residuals, receives them, and returns the best point; several
    searches can therefore share their calls.  `step` (p,) is the step of finite differences; a step that gains less
    than `enough` is the last.  Steps multiplied by the factors `wider` are used first, in turn, to pass jumps of z.
    """
    (here,) = yield [x]
    damping, widths = 1e-3, [*wider, 1.0]
    for _ in range(STEPS):
        wide = widths[0] * step
        h = np.where(x + wide <= high, wide, -wide)
        moved = yield list(x + np.diag(h))
        J = np.stack([here.weight * (other.z - here.z) / h_i for other, h_i in zip(moved, h)], axis=1)
        JtJ, g = J.T @ J, J.T @ (here.weight * here.z)
        for _ in range(TRIES):
            # keep parameters at a bound if their step would leave the bounds
            held = ((x <= low) & (g > 0)) | ((x >= high) & (g < 0))
            move = ~held
            d = np.zeros_like(x)
            if not move.any():
                return x
            H = JtJ[np.ix_(move, move)]
            d[move] = -np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-12), g[move], rcond=None)[0]
            new = np.clip(x + d, low, high)
            (there,) = yield [new]
            if there.cost < here.cost:
                gain = here.cost - there.cost
                x, here, damping = new, there, max(damping / 10.0, 1e-8)
                break
            damping = max(STRONGER * damping, SHORTER)
        else:
            gain, damping = 0.0, 1e-3
        if gain < enough:
            del widths[0]
        if not widths:
            return x
    return x
