"""Tangential compliance: beside the normal spring the contact has a tangential one, damped, with a Coulomb slider.

Lumped planar model in the phase s = Ω t of the normal spring, with f = force / Ω, η = k_n / k_t, κ = 1 / (η b):

    f_n = p_c sin s  in compression,  p_c cos(s'/e) in restitution (duration e π/2),  e = c_n / p_c − 1
    dv_t/ds = K_tt f_t + K_tn f_n,   dz/ds = v_t while it sticks,   f_t = −κ z − 2 ζ w v_t / K_tt,   |f_t| ≤ μ f_n

p_c and b = dv_n/dp are those of the rigid path, so that Ω² = k_n b.  A contact that never slips is an oscillator of
frequency w = √(κ K_tt) and damping ratio ζ: the slip comes back with the sign of cos(w π), which no rigid law can do.
Each step has the exact propagator of the stuck contact at constant f_n; its friction impulse and its spring are then
limited to what the slider bears.  η → 0 is the rigid contact.  The friction impulse of the path, against that of the
rigid path, also changes v_n and the end of restitution (impulse_path.py).

| on paper      | in code | unit | shape |                                                                         |
|---------------|---------|------|-------|-------------------------------------------------------------------------|
| η = k_n / k_t | `eta`   | 1    |       | compliance ratio; (2 − ν)/(2(1 − ν)) ≈ 1.2 for smooth elastic bodies     |
| ζ             | `zeta`  | 1    |       | damping ratio of the tangential spring with K_tt                        |
| z             | `z`     | m Ω  | (n,)  | stretch of the tangential spring                                        |
"""

import numpy as np
from numba import njit

from thesis_lib.contact.slip_path import slip_path
from thesis_lib.effects.effect import Effect, Impulse, Parameter
from thesis_lib.effects.impulse_path import NormalPath, added, whole_impulse

STEPS = 20  # in each phase; fewer leave 2.4 instead of 2.0 mm/s against the integrated motion (16)
_NODES = np.linspace(0.0, np.pi / 2.0, STEPS + 1)
_STEP = _NODES[1]
# f_n / p_c: mean over each step, and at its end
_MEAN = np.concatenate([-np.diff(np.cos(_NODES)), np.diff(np.sin(_NODES))]) / _STEP
_END = np.concatenate([np.sin(_NODES[1:]), np.cos(_NODES[1:])])
_SHORTEST = 1e-6  # of restitution against compression, for ε = 0
_CRITICAL = 1e-12  # least 1 − ζ²: critical damping, ζ = 1, is the strongest


class TangentialCompliance(Effect):
    name = "tangential_compliance"
    family = "contact_law"
    title = "tangential compliance"
    equation = "v_t' = K_tt f_t + K_tn f_n, f_t = −z / (η b) − 2 ζ w v_t / K_tt, |f_t| ≤ μ f_n"
    parameters = (
        Parameter("eta", "1", null=0.0, low=0.0, high=30.0, scale=0.05, starts=(0.05, 0.5)),
        Parameter("zeta", "1", null=0.2, low=0.02, high=0.9, scale=0.02, starts=(0.2,)),
    )
    needs_angle = True
    rank = 3
    reference = (
        "Maw, Barber and Fawcett 1976, doi:10.1016/0043-1648(76)90201-5; Stronge 1994, doi:10.1016/0734-743X(94)80027-7"
    )

    def impulse(self, impulse, contact, state, p, rig):
        if not np.any(p["eta"]):
            return impulse
        with np.errstate(all="ignore"):
            paths = _paths(contact, p["eta"], p["zeta"])
        return added(impulse, paths, contact.mu)


def _propagator(w: np.ndarray, zeta: np.ndarray | float, h: np.ndarray | float) -> tuple[np.ndarray, ...]:
    """(z, v) from one end of a step h to the other, stuck: matrix elements zz, zv, vz, vv about the equilibrium."""
    turning = w * np.sqrt(np.maximum(1.0 - zeta * zeta, _CRITICAL))
    decay = np.exp(-zeta * w * h)
    cos, sine = decay * np.cos(turning * h), decay * np.sin(turning * h) / turning
    return cos + zeta * w * sine, sine, -w * w * sine, cos - zeta * w * sine


def _paths(contact, eta, zeta) -> Impulse:
    """Impulses (2, n) at the ends of the compliant path and of the rigid one."""
    K_tt, K_tn, v_t, mu = contact.K_tt, contact.K_tn, contact.v_t, contact.mu
    p_c = slip_path(contact, mu).p_c
    ratio = np.maximum(whole_impulse(contact) / p_c - 1.0, _SHORTEST)
    spring = -p_c / (eta * contact.v_n)  # κ, with b = −v_n / p_c
    w = np.sqrt(spring * K_tt)
    n, durations = len(mu), (_STEP, _STEP * ratio)
    stuck = np.array([[np.broadcast_to(part, n) for part in _propagator(w, zeta, h)] for h in durations])  # (2, 4, n)
    dp = _MEAN[:, None] * np.repeat([p_c * h for h in durations], STEPS, axis=0)
    numbers = K_tt, K_tn, v_t, mu, K_tn / (w * w) * p_c, mu * p_c / spring
    d_t = _slide(np.array([np.broadcast_to(values, n) for values in numbers]), stuck, dp)
    path = NormalPath(contact)
    for pair in zip(dp, d_t):
        path.step(*pair)
    return path.end(contact.epsilon)


@njit(cache=True, error_model="numpy")
def _slide(numbers, stuck, dp):
    """Friction impulses (s, 2, n) of the s steps of both paths, of the normal impulses dp (s, n).

    `numbers` (6, n) are K_tt, K_tn, v_t, μ, and over f_n / p_c the equilibrium of z and what the spring bears.  NaN
    stays NaN: what is compared is the limit.
    """
    d_t = np.empty((len(dp), 2, dp.shape[1]))
    K_tt, K_tn, v_t, mu, rest, bears = numbers
    z, v, rigid = np.zeros(len(v_t)), v_t.copy(), v_t.copy()
    for i in range(len(dp)):
        zz, zv, vz, vv = stuck[i // STEPS]
        for k in range(len(v_t)):
            limit, kick = mu[k] * dp[i, k], K_tn[k] * dp[i, k]
            middle, most = rest[k] * _MEAN[i], bears[k] * _END[i]
            off = z[k] - middle
            # what friction has to end: what the oscillator loses, or all of the slip
            lost = v[k] + kick - (vz[k] * off + vv[k] * v[k])
            z[k] = _within(middle + zz[k] * off + zv[k] * v[k], most)
            d_t[i, 0, k] = _within(lost / -K_tt[k], limit)
            d_t[i, 1, k] = _within((rigid[k] + kick) / -K_tt[k], limit)
            v[k] += kick + K_tt[k] * d_t[i, 0, k]
            rigid[k] += kick + K_tt[k] * d_t[i, 1, k]
    return d_t


@njit(cache=True, error_model="numpy")
def _within(value, limit):
    below = limit if value > limit else value
    return -limit if below < -limit else below


EFFECT = TangentialCompliance()
