"""Least squares with weights that follow the residuals, by the method of Levenberg and Marquardt, within bounds.

The cost is any function of the residuals z whose gradient is Jᵀ W z, as −2 log t_ν is with the weights of the t
distribution.  Weights stay those of the point from which a step goes out (iteratively reweighted least squares):
where models err by many standard deviations, residuals that are transformed so that their squares add up to the cost
give steps that are too short by the logarithm of the error.

Sources: Marquardt 1963, doi:10.1137/0111030; Holland and Welsch 1977, doi:10.1080/03610927708827533.
"""

from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np

STEPS = 12
TRIES, SHORTER, STRONGER = 4, 0.1, 30.0  # of one step; the damping of the second one at least, and its growth from then
ENOUGH = 1e-3  # nats; the search ends below this gain per step, a twentieth of a standard error
NEAR = 3e-2  # the same of a fit that is only compared; the step that gains it ends within a tenth of its length


class Weighted(NamedTuple):
    """What a model leaves at one point: its cost, residuals z (N,), and the square roots (N,) of their weights."""

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

    It yields the points at which it needs residuals, gets those of each, and returns the best point; so several
    searches can share their calls.  `step` (p,) is that of finite differences; a step that gains less than `enough` is
    the last.  Before, the differences are so many times `wider`, one after the other, which lead over jumps of z.
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
            # keep parameters at a bound if their step leaves the box
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
