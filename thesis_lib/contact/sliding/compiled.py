"""Compiled path of impacts in space; see `contact/slip_hodograph.py` for the equations.

numba compiles this file at the first call, in a few seconds, and caches the result next to it.  All compiled functions
must be in this file, because numba does not detect changes to functions in other files.
"""

import numpy as np
from numba import njit

NEWTON, POISSON, STRONGE = range(3)
SHORTER = 0.4  # weight of a relative change of slip, against a turn, in the length of a step
KEPT_DIRECTION = 1e-13  # relative to the rates: rounding error, as in a planar impact
LEFT_TO_TURN = 1e-10  # rad
NO_SLIP = 1e-12  # relative to the contact speed
REFINEMENTS = 40  # bracketed Newton steps to the end of a phase within a step; about 4 are needed
FOUND = 1e-11  # relative to the step; Newton squares the error

compiled = njit(cache=True, error_model="numpy")


@compiled
def _rate(x, y, path):
    """Rate dx/dp of the slip along the principal axes."""
    k_1, k_2, f_1, f_2 = path[:4]
    V = np.sqrt(x * x + y * y)
    return k_1 - f_1 * (x / V), k_2 - f_2 * (y / V)


@compiled
def _stepped(state, h, path):
    """Slip, p and W after an increment h of the normal impulse, by the Runge-Kutta method of order 4."""
    x, y, p, W = state
    a_1, a_2, S, C = path[4:]
    half = 0.5 * h
    r1, s1 = _rate(x, y, path)
    r2, s2 = _rate(x + half * r1, y + half * s1, path)
    r3, s3 = _rate(x + half * r2, y + half * s2, path)
    r4, s4 = _rate(x + h * r3, y + h * s3, path)
    # ∫ v_n dp from the same stages; S p is exact
    sixth = h / 6.0
    v_n = a_1 * (x + sixth * (r1 + r2 + r3)) + a_2 * (y + sixth * (s1 + s2 + s3)) + S * (p + half) + C
    x, y = x + sixth * (r1 + 2.0 * (r2 + r3) + r4), y + sixth * (s1 + 2.0 * (s2 + s3) + s4)
    return x, y, p + h, W + h * v_n


@compiled
def _missing(rule, state, path, epsilon, v_n0, p_c, W_c):
    """Quantity that is negative until the phase ends, and its derivative with respect to p."""
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
def _turning(rule, turn, steps, x, y, path, epsilon, v_n0):
    """Follow turning slip until it is straight or the impact ends; state, p_c, W_c, and whether the impact ended."""
    state, p_c, W_c = (x, y, 0.0, 0.0), np.nan, np.nan
    speed = np.sqrt(x * x + y * y + v_n0 * v_n0)
    for _ in range(steps):
        V = np.sqrt(state[0] * state[0] + state[1] * state[1])
        if not NO_SLIP * speed < V:  # also for NaN
            break
        u_1, u_2 = state[0] / V, state[1] / V
        r_1, r_2 = _rate(state[0], state[1], path)
        g, f = u_1 * r_1 + u_2 * r_2, abs(u_1 * r_2 - u_2 * r_1)
        # df/dθ: negative where the slip is attracted to the stationary direction
        drawn = -g - path[2] * u_2 * u_2 - path[3] * u_1 * u_1
        if f <= KEPT_DIRECTION * (abs(path[0]) + abs(path[1]) + path[2]) or f <= LEFT_TO_TURN * -drawn:
            break
        h = turn * V / max(f, SHORTER * max(abs(g), abs(drawn)))
        after = _stepped(state, h, path)
        value, slope = _missing(rule, after, path, epsilon, v_n0, p_c, W_c)
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
            value, slope = _missing(rule, after, path, epsilon, v_n0, p_c, W_c)
            if moved <= FOUND * h:
                break
        state = after
        if np.isnan(p_c) and epsilon > 0.0:
            p_c, W_c = state[2], state[3]
            state = (state[0], state[1], state[2], 0.0)
        else:
            return state, p_c, W_c, True
    return state, p_c, W_c, False


@compiled
def _until(work, v, b):
    """Normal impulse d ≥ 0 for which v d + b d²/2 = work."""
    return 2.0 * work / (v + np.sqrt(v * v + 2.0 * b * work)) if abs(work) > 0.0 else 0.0


@compiled
def _straight(rule, state, path, kappa, start, after, epsilon, v_n0, p_c, W_c):
    """Impulse along the principal axes at the end of a path that is straight from the current state on.

    `after` (2) is dc/dp after slip has ended.
    """
    x, y, p, W = state
    k_1, k_2, f_1, f_2, a_1, a_2, S, C = path
    V = np.hypot(x, y)
    u_1 = u_2 = 0.0
    # the first slip lasts for the normal impulse L, with dV/dp = g and dv_n/dp = b; then dv_n/dp = b_2
    g, b, L = -1.0, 1.0, 0.0
    if V > 0.0:
        u_1, u_2 = x / V, y / V
        r_1, r_2 = k_1 - f_1 * u_1, k_2 - f_2 * u_2
        g, b = u_1 * r_1 + u_2 * r_2, a_1 * r_1 + a_2 * r_2 + S
        L = V / -g if g < 0.0 else np.inf
    b_2 = a_1 * (k_1 + kappa[0] * after[0]) + a_2 * (k_2 + kappa[1] * after[1]) + S
    v, d = a_1 * x + a_2 * y + S * p + C, 0.0
    if np.isnan(p_c):  # if compression has not ended
        v_L = v + b * L
        if v_L >= 0.0:
            W_c, d = W + v * v / (-2.0 * b), v / -b
        else:
            W_c, d = W + (L * (v + 0.5 * b * L) - v_L * v_L / (2.0 * b_2)), L - v_L / b_2
        p_c, v, W = p + d, 0.0, 0.0
    # restitution: starts at v_n = v; the first slip continues for L − d
    rest = max(L - d, 0.0)
    v_L = v + b * rest
    if rule == NEWTON:
        wanted = -epsilon * v_n0
        more = (wanted - v) / b if v_L >= wanted else rest + (wanted - v_L) / b_2
    elif rule == POISSON:
        more = (1.0 + epsilon) * p_c - (p + d)
    else:
        work = -epsilon * epsilon * W_c - W
        more = _until(work, v, b)
        if not 0.0 <= more <= rest:
            more = rest + _until(work - rest * (v + 0.5 * b * rest), v_L, b_2)
    d += more
    # slip x = x_0 + K_tt c + k p; dc/dp = `after` when slip has ended
    slipped = min(d, L)
    if d >= L:
        x = y = 0.0
    else:
        x, y = x + u_1 * (g * slipped), y + u_2 * (g * slipped)
    left = d - slipped
    c_1 = (x - start[0] - k_1 * (p + slipped)) / kappa[0] + after[0] * left
    c_2 = (y - start[1] - k_2 * (p + slipped)) / kappa[1] + after[1] * left
    return c_1, c_2, p + d


@compiled
def impulses(rule, turn, steps, constants, slips, epsilon, v_n0, after, into):
    """Write to `into` (3, n) the impulses of n impacts along the principal axes and the normal.

    `constants` (8, n) are k, μ κ and α along both axes, S and C; `slips` (2, n) the initial slip; `after` (4, n) κ, and
    dc/dp after slip has ended.
    """
    for i in range(into.shape[1]):
        path = (
            *(constants[0, i], constants[1, i], constants[2, i], constants[3, i]),
            *(constants[4, i], constants[5, i], constants[6, i], constants[7, i]),
        )
        kappa, start = (after[0, i], after[1, i]), (slips[0, i], slips[1, i])
        state, p_c, W_c, ended = _turning(rule, turn, steps, start[0], start[1], path, epsilon[i], v_n0[i])
        if ended:
            x, y, p, _ = state
            into[0, i] = (x - start[0] - path[0] * p) / kappa[0]
            into[1, i] = (y - start[1] - path[1] * p) / kappa[1]
            into[2, i] = p
        else:
            into[0, i], into[1, i], into[2, i] = _straight(
                rule, state, path, kappa, start, (after[2, i], after[3, i]), epsilon[i], v_n0[i], p_c, W_c
            )
