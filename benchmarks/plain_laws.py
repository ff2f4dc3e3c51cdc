"""The six impact laws for one impact at a time, in plain Python floats: what the batched laws are compared with.

The same closed forms as in `thesis_lib.contact` (see there for equations and symbols), written as one would write
them without arrays: branches instead of masks, so that no work is done for the branch not taken.
"""

import math
from collections.abc import Callable

# (v_t, v_n, K_tt, K_nn, K_tn, μ, ε) -> (c_t, c_n)
PlainLaw = Callable[[float, float, float, float, float, float, float], tuple[float, float]]


def drumwright_shell(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    det = K_tt * K_nn - K_tn * K_tn
    stick_t = (K_tn * v_n - K_nn * v_t) / det
    kappa = -v_n / K_nn
    if stick_t * K_tn > 0.0:  # friction lifts
        stick_n = (K_tn * v_t - K_tt * v_n) / det
        if abs(stick_t) <= mu * stick_n:
            return stick_t, (1.0 + epsilon) * stick_n
        slope = math.copysign(mu, K_tn)
        reach = K_nn + slope * K_tn
        least = -(v_n + slope * v_t) / (reach + slope * (K_tn + slope * K_tt))
        t = min(max(least, -v_n / reach), kappa)
        return slope * t, (1.0 + epsilon) * t
    limit = mu * kappa
    c_t = -(v_t + K_tn * kappa) / K_tt
    lower = 0.0 if K_tn > 0.0 else -limit
    upper = 0.0 if K_tn < 0.0 else limit
    return min(max(c_t, lower), upper), (1.0 + epsilon) * kappa


def _to_normal_velocity(v_t, dv_n, K_tt, K_nn, K_tn, mu):
    det = K_tt * K_nn - K_tn * K_tn
    c_t = -(K_nn * v_t + K_tn * dv_n) / det
    c_n = (K_tt * dv_n + K_tn * v_t) / det
    if abs(c_t) <= mu * c_n:
        return c_t, c_n
    slope = math.copysign(mu, c_t)
    c_n = dv_n / (K_nn + slope * K_tn)
    return slope * c_n, c_n


def anitescu_potra_newton(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    return _to_normal_velocity(v_t, -(1.0 + epsilon) * v_n, K_tt, K_nn, K_tn, mu)


def anitescu_potra_poisson(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    c_t, c_n = _to_normal_velocity(v_t, -v_n, K_tt, K_nn, K_tn, mu)
    normal = epsilon * c_n
    limit = mu * normal
    tangential = -(v_t + K_tt * c_t + K_tn * (c_n + normal)) / K_tt
    return c_t + min(max(tangential, -limit), limit), c_n + normal


def _path(v_t, v_n, K_tt, K_nn, K_tn, mu):
    """(slope, b, p_slip, slope2, b2, u, p_c) of Routh's path."""
    slope = -math.copysign(mu, v_t)
    a, b = K_tn + slope * K_tt, K_nn + slope * K_tn
    p_slip = -v_t / a if a * math.copysign(1.0, v_t) < 0.0 else math.inf
    slope2 = -K_tn / K_tt if abs(K_tn) <= mu * K_tt else -math.copysign(mu, K_tn)
    b2 = K_nn + slope2 * K_tn
    u = v_n + b * p_slip
    p_c = -v_n / b if u >= 0.0 else p_slip - u / b2
    return slope, b, p_slip, slope2, b2, u, p_c


def mirtich(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    slope, b, p, slope2, b2, u, p_c = _path(v_t, v_n, K_tt, K_nn, K_tn, mu)
    c_n = (1.0 + epsilon) * p_c
    if p >= c_n:
        return slope * c_n, c_n
    W_s = p * (v_n + 0.5 * b * p)
    if u < 0.0:
        v_end = epsilon * math.sqrt(-2.0 * b2 * (W_s - 0.5 * u * u / b2))
    else:
        W_c = -v_n * v_n / (2.0 * b)
        v_end = math.sqrt(max(u * u + 2.0 * b2 * ((1.0 - epsilon * epsilon) * W_c - W_s), 0.0))
    rest = (v_end - u) / b2
    return slope * p + slope2 * rest, p + rest


def wang_mason(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    slope, _, p_slip, slope2, _, _, p_c = _path(v_t, v_n, K_tt, K_nn, K_tn, mu)
    c_n = (1.0 + epsilon) * p_c
    if p_slip >= c_n:
        return slope * c_n, c_n
    return slope * p_slip + slope2 * (c_n - p_slip), c_n


def whittaker(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon):
    dv_n = -(1.0 + epsilon) * v_n
    slope = -math.copysign(mu, v_t)
    reach = K_nn + slope * K_tn
    if reach > 0.0 and v_t != 0.0:
        c_n = dv_n / reach
        c_t = slope * c_n
        if (v_t + K_tt * c_t + K_tn * c_n) * v_t >= 0.0:
            return c_t, c_n
    det = K_tt * K_nn - K_tn * K_tn
    return -(K_nn * v_t + K_tn * dv_n) / det, (K_tt * dv_n + K_tn * v_t) / det


PLAIN_LAWS: dict[str, PlainLaw] = {
    law.__name__: law
    for law in (drumwright_shell, anitescu_potra_poisson, anitescu_potra_newton, mirtich, wang_mason, whittaker)
}


def resolve_all(law: PlainLaw, v_pre, r, *, mass: float, k_g: float, mu: float, epsilon: float):
    """Resolve a list of impacts one by one: lists of (v_x, v_y, ω) and (r_x, r_y) in; v_post and impulses out.

    Does what the batched call does: contact space, check of the state, impulse, and velocity after.
    """
    w, w_I = 1.0 / mass, 1.0 / (mass * k_g * k_g)
    v_post, impulses = [], []
    for (v_x, v_y, omega), (r_x, r_y) in zip(v_pre, r):
        v_t, v_n = v_x - r_y * omega, v_y + r_x * omega
        if not v_n < 0.0:
            v_post.append((v_x, v_y, omega))
            impulses.append((0.0, 0.0))
            continue
        K_tt, K_nn, K_tn = w + r_y * r_y * w_I, w + r_x * r_x * w_I, -r_x * r_y * w_I
        c_t, c_n = law(v_t, v_n, K_tt, K_nn, K_tn, mu, epsilon)
        v_post.append((v_x + w * c_t, v_y + w * c_n, omega + w_I * (r_x * c_n - r_y * c_t)))
        impulses.append((c_t, c_n))
    return v_post, impulses
