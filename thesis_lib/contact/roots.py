"""Roots of n increasing functions at once: Newton's method, bracketed."""

from collections.abc import Callable

import numpy as np

MAX_STEPS = 100  # Newton needs about 8; bisection alone would need 50 to reach rounding error
RELATIVE_STEP = 1e-11  # of the unknown: above the rounding error of most functions; Newton squares it


def increasing_root(
    function: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    low: np.ndarray,
    start: np.ndarray,
    floor: float | np.ndarray = 0.0,
) -> np.ndarray:
    """Roots (n,) above `low` of functions that are negative before and positive after; NaN where none was found.

    `function` gives values and slopes, each (n,).  A step below `floor` ends the search.
    """
    p, high = start, np.full(np.shape(start), np.inf)
    for _ in range(MAX_STEPS):
        f, slope = function(p)
        low, high = np.where(f < 0.0, p, low), np.where(f < 0.0, high, p)
        newton = p - f / slope
        inside = (newton >= low) & (newton <= high)
        middle = np.where(np.isfinite(high), 0.5 * (low + high), 2.0 * p)
        step = np.where(f == 0.0, 0.0, np.where(inside, newton, middle) - p)
        p = p + step
        moved = np.abs(step) > RELATIVE_STEP * p + floor
        if not np.any(moved):
            return p
    return np.where(moved, np.nan, p)  # becomes NO_SOLUTION
