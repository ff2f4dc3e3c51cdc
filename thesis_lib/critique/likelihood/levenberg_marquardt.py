"""Least squares by the method of Levenberg and Marquardt, within bounds.

Source: Marquardt 1963, doi:10.1137/0111030.
"""

from collections.abc import Generator, Sequence

import numpy as np

STEPS = 12
ENOUGH = 1e-3  # nats; the search ends below this gain per step, a twentieth of a standard error
NEAR = 3e-2  # the same of a fit that is only compared; the step that gains it ends within a tenth of its length


def levenberg_marquardt(
    x: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    step: np.ndarray,
    enough: float = ENOUGH,
    wider: Sequence[float] = (),
) -> Generator[list[np.ndarray], list[np.ndarray], np.ndarray]:
    """Minimise |r(x)|² over x (p,) within the bounds `low`, `high`.

    It yields the points at which it needs r, gets r (N,) of each, and returns the best point; so several searches can
    share their calls.  `step` (p,) is that of finite differences; a step that gains less than `enough` is the last.
    Before, the differences are so many times `wider`, one after the other, which lead over jumps of r.
    """
    (r,) = yield [x]
    cost, damping, widths = r @ r, 1e-3, [*wider, 1.0]
    for _ in range(STEPS):
        wide = widths[0] * step
        h = np.where(x + wide <= high, wide, -wide)
        moved = yield list(x + np.diag(h))
        J = np.stack([(other - r) / h_i for other, h_i in zip(moved, h)], axis=1)
        JtJ, g = J.T @ J, J.T @ r
        for _ in range(6):
            # keep parameters at a bound if their step leaves the box
            held = ((x <= low) & (g > 0)) | ((x >= high) & (g < 0))
            move = ~held
            d = np.zeros_like(x)
            if not move.any():
                return x
            H = JtJ[np.ix_(move, move)]
            d[move] = -np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-12), g[move], rcond=None)[0]
            new = np.clip(x + d, low, high)
            (r_new,) = yield [new]
            cost_new = r_new @ r_new
            if cost_new < cost:
                gain = cost - cost_new
                x, r, cost, damping = new, r_new, cost_new, max(damping / 10.0, 1e-8)
                break
            damping *= 10.0
        else:
            gain, damping = 0.0, 1e-3
        if gain < enough:
            del widths[0]
        if not widths:
            return x
    return x
