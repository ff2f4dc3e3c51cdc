"""The first slip of impacts in space, step by step, compiled; its equations stand in `contact/slip_hodograph.py`.

numba compiles this file at the first call, in some seconds, and keeps the result beside it.  What is compiled must
stand here, since numba does not see changes of functions in other files.
"""

import numpy as np
from numba import njit

NEWTON, POISSON, STRONGE = range(3)
SHORTER = 0.4  # of the turn of a step, by which slip may change instead
KEPT_DIRECTION = 1e-13  # of the rates: rounding, as that of an impact in a plane
LEFT_TO_TURN = 1e-10  # rad
NO_SLIP = 1e-12  # of the contact speed
REFINEMENTS = 40  # Newton steps, bracketed, to the end of a phase within a step; some 4 are needed
FOUND = 1e-11  # of the step; Newton squares it

compiled = njit(cache=True, error_model="numpy")


@compiled
def _rate(x, y, path):
    """dx/dp along the principal axes."""
    k_1, k_2, f_1, f_2 = path[:4]
    V = np.sqrt(x * x + y * y)
    return k_1 - f_1 * (x / V), k_2 - f_2 * (y / V)


@compiled
def _stepped(state, h, path):
    """Slip, p and W after the normal impulse h, by the Runge-Kutta method of order 4."""
    x, y, p, W = state
    a_1, a_2, S, C = path[4:]
    half = 0.5 * h
    r1, s1 = _rate(x, y, path)
    r2, s2 = _rate(x + half * r1, y + half * s1, path)
    r3, s3 = _rate(x + half * r2, y + half * s2, path)
    r4, s4 = _rate(x + h * r3, y + h * s3, path)
    # ∫ v_n dp by the same stages; S p is exact
    sixth = h / 6.0
    v_n = a_1 * (x + sixth * (r1 + r2 + r3)) + a_2 * (y + sixth * (s1 + s2 + s3)) + S * (p + half) + C
    x, y = x + sixth * (r1 + 2.0 * (r2 + r3) + r4), y + sixth * (s1 + 2.0 * (s2 + s3) + s4)
    return x, y, p + h, W + h * v_n


@compiled
def _missing(rule, state, path, epsilon, v_n0, p_c, W_c):
    """What is negative until the phase ends, and its derivative by p."""
    x, y, p, W = state
    a_1, a_2, S, C = path[4:]
    v_n = a_1 * x + a_2 * y + S * p + C
    if rule == NEWTON or np.isnan(p_c):
        r, s = _rate(x, y, path)
        b = a_1 * r + a_2 * s + S
        return (v_n if np.isnan(p_c) else v_n + epsilon * v_n0), b
    if rule == POISSON:
        return p - (1.0 + epsilon) * p_c, 1.0
    return W + epsilon * epsilon * W_c, v_n


@compiled
def follow(rule, turn, steps, paths, epsilon, v_n0, x, p, W, p_c, W_c, ended):
    """Follow n slips until they are straight or the impact ends; writes into the arrays from `x` (2, n) on, (n,) each.

    `paths` (8, n): k, μ κ and α along both axes, S and C; x and C are those at the beginning.
    """
    for i in range(len(p)):
        column = paths[:, i]
        path = (column[0], column[1], column[2], column[3], column[4], column[5], column[6], column[7])
        state = (x[0, i], x[1, i], 0.0, 0.0)
        p_c[i] = W_c[i] = np.nan
        speed = np.sqrt(state[0] * state[0] + state[1] * state[1] + v_n0[i] * v_n0[i])
        for _ in range(steps):
            V = np.sqrt(state[0] * state[0] + state[1] * state[1])
            if not NO_SLIP * speed < V:  # NaN, too
                break
            u_1, u_2 = state[0] / V, state[1] / V
            r_1, r_2 = _rate(state[0], state[1], path)
            g, f = u_1 * r_1 + u_2 * r_2, abs(u_1 * r_2 - u_2 * r_1)
            # df/dθ: negative where the direction is drawn to the one that keeps itself
            drawn = -g - path[2] * u_2 * u_2 - path[3] * u_1 * u_1
            if f <= KEPT_DIRECTION * (abs(path[0]) + abs(path[1]) + path[2]) or f <= LEFT_TO_TURN * -drawn:
                break
            h = turn * V / max(f, SHORTER * max(abs(g), abs(drawn)))
            after = _stepped(state, h, path)
            value, slope = _missing(rule, after, path, epsilon[i], v_n0[i], p_c[i], W_c[i])
            if value < 0.0:
                state = after
                continue
            low, high, at = 0.0, h, h
            for _ in range(REFINEMENTS):
                low, high = (at, high) if value < 0.0 else (low, at)
                newton = at - value / slope
                found = newton if low <= newton <= high else 0.5 * (low + high)
                moved, at = abs(found - at), found
                after = _stepped(state, at, path)
                value, slope = _missing(rule, after, path, epsilon[i], v_n0[i], p_c[i], W_c[i])
                if moved <= FOUND * h:
                    break
            state = after
            if np.isnan(p_c[i]) and epsilon[i] > 0.0:
                p_c[i], W_c[i] = state[2], state[3]
                state = (state[0], state[1], state[2], 0.0)
            else:
                ended[i] = True
                break
        x[0, i], x[1, i], p[i], W[i] = state
