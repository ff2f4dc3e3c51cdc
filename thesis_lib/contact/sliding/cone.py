"""Compiled solver for the tangential impulse within a circular cone; see `contact/circular_cone.py` for the equations.

numba compiles this file at the first call, in a few seconds, and caches the result next to it.
"""

import numpy as np
from numba import njit

EPS = 2.220446049250313e-16
ROUNDING = 4.0 * EPS  # relative to the terms of |N| = ℓ D − s·N: smaller differences count as 0
FOUND = 1e-11  # relative to λ; Newton squares the error.  Changes below `EPS` of A do not change the impulse
MOST = 100  # Newton needs about 8; bisection alone would need 50 to reach rounding error


@njit(cache=True, error_model="numpy")
def _root(a_1, a_2, b_1, b_2, limit, s_1, s_2):
    """Root λ by bracketed Newton iteration; NaN if it was not found."""
    low, high, root = 0.0, np.inf, np.hypot(b_1, b_2) / limit
    for _ in range(MOST):
        d_1, d_2 = a_1 + root, a_2 + root
        n_1, n_2 = -d_2 * b_1, -d_1 * b_2
        length, room = np.hypot(n_1, n_2), limit * d_1 * d_2
        value = room - s_1 * n_1 - s_2 * n_2 - length
        if abs(value) <= ROUNDING * (room + length):
            return root
        low, high = (root, high) if value < 0.0 else (low, root)
        slope = limit * (d_1 + d_2) + s_1 * b_1 + s_2 * b_2 + (n_1 * b_1 + n_2 * b_2) / length
        newton = root - value / slope
        middle = 0.5 * (low + high) if np.isfinite(high) else 2.0 * root
        found = newton if low <= newton <= high else middle
        step, root = abs(found - root), found
        if step <= FOUND * root + EPS * a_2:
            return root
    return np.nan


@njit(cache=True, error_model="numpy")
def impulses(problems, into):
    """Write to `into` (2, n) the impulses of n problems (7, n): principal values of A (largest first), b, ℓ and s."""
    for i in range(into.shape[1]):
        a_1, a_2, b_1, b_2 = problems[0, i], problems[1, i], problems[2, i], problems[3, i]
        limit, s_1, s_2 = problems[4, i], problems[5, i], problems[6, i]
        c_1, c_2 = b_1 / -a_1, b_2 / -a_2
        if np.hypot(c_1, c_2) > limit - s_1 * c_1 - s_2 * c_2:
            c_1 = c_2 = 0.0  # without friction
            if limit > 0.0:
                root = _root(a_1, a_2, b_1, b_2, limit, s_1, s_2)
                c_1, c_2 = b_1 / -(a_1 + root), b_2 / -(a_2 + root)
        into[0, i], into[1, i] = c_1, c_2
