"""Impacts integrated along the normal impulse p, from the differential equations alone.

dv_C/dp = M_C⁻¹ (f, 1),   dc_t/dp = f,   dW/dp = v_n

with f from the law of friction.  Written for one impact at a time with plain floats and event location; nothing
here is shared with `thesis_lib.contact`, whose closed forms it checks.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

MAX_PHASES = 10  # two changes of slip and two of restitution are the most there can be


def coulomb_rate(direction: float, K_tt: float, K_tn: float, mu: float) -> tuple[float, float]:
    """Friction rate f and direction of slip (0: sticks) of a contact that moves, or is about to, in `direction`."""
    if direction == 0.0:
        hold = -K_tn / K_tt  # keeps v_t = 0
        if abs(hold) <= mu:
            return hold, 0.0
        direction = math.copysign(1.0, K_tn)  # friction −sign μ cannot hold: the normal impulse wins
    return -direction * mu, direction


def coulomb_impact(
    v_t: float, v_n: float, K_tt: float, K_nn: float, K_tn: float, mu: float, epsilon: float, *, work: bool
) -> tuple[float, float]:
    """Impulse (c_t, c_n) on the path of Coulomb's law with Poisson's or (`work`) Stronge's restitution.

    In each phase the rates are constant, so v is linear and W quadratic in p; a phase ends where slip ends, at
    maximum compression, or where the condition of restitution is met, found by bisection.
    """
    p = c_t = W = 0.0
    direction = (v_t > 0) - (v_t < 0)
    target = None  # of p or W, known after compression
    for _ in range(MAX_PHASES):
        f, direction = coulomb_rate(direction, K_tt, K_tn, mu)
        a, b = K_tn + K_tt * f, K_nn + K_tn * f
        until = math.inf
        if direction and a * direction < 0.0:
            until = -v_t / a
        slip_ends = True
        if target is None:
            if b > 0.0 and -v_n / b <= until:
                until, slip_ends = -v_n / b, False
        else:
            end = phase_end(target, p, W, v_n, b, until, work)
            if end is not None:
                return c_t + f * end, p + end
        W += v_n * until + 0.5 * b * until * until
        p, c_t = p + until, c_t + f * until
        v_t, v_n = v_t + a * until, v_n + b * until
        if slip_ends:
            direction = v_t = 0.0
        else:
            v_n = 0.0
            target = (1.0 - epsilon**2) * W if work else (1.0 + epsilon) * p
    raise AssertionError("the impact does not end")


def phase_end(target, p, W, v_n, b, until, work):
    """Impulse in this phase at which the condition of restitution is met, None if that is in a later one."""

    def missing(d):
        return target - (W + v_n * d + 0.5 * b * d * d if work else p + d)

    high = until
    if math.isinf(until):
        high = 1e-3 * (1.0 + p)
        while missing(high) > 0.0:
            high *= 2.0
    elif missing(high) > 0.0:
        return None
    low = 0.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if missing(middle) > 0.0 else (low, middle)
    return high


def viscous_impact(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    """Impulse (c_t, c_n) with the viscous rate dc_t/dp = −μ v_t and Stronge's restitution, by Runge-Kutta."""

    def rates(_, state):
        f = -mu * state[0]
        return [K_tn + K_tt * f, K_nn + K_tn * f, f, state[1]]

    def compressed(_, state):
        return state[1]

    compressed.terminal, compressed.direction = True, 1.0
    options = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-13}
    far = 1e3 * (abs(v_t) + abs(v_n))
    first = solve_ivp(rates, (0.0, far), [v_t, v_n, 0.0, 0.0], events=compressed, **options)
    p_c, state = first.t_events[0][0], first.y_events[0][0]
    if epsilon == 0.0:
        return state[2], p_c
    target = (1.0 - epsilon**2) * state[3]

    def restored(_, state):
        return state[3] - target

    restored.terminal, restored.direction = True, 1.0
    second = solve_ivp(rates, (p_c, far), state, events=restored, **options)
    return second.y_events[0][0][2], second.t_events[0][0]


def integrate_all(space, mu, epsilon, integrate, **options) -> np.ndarray:
    """(n, 2) impulses of `integrate` for each impact of a contact space."""
    columns = (space.v_t, space.v_n, space.K_tt, space.K_nn, space.K_tn, mu, epsilon)
    return np.array([integrate(*map(float, row), **options) for row in zip(*columns)])
