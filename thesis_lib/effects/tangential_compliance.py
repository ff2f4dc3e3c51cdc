"""Tangential compliance: beside its normal spring the contact has a damped tangential spring with a Coulomb slider.

Lumped planar model in the phase s = Ω t of the normal spring, with f = force / Ω, η = k_n / k_t, κ = 1 / (η b):

    f_n = p_c sin s  in compression,  p_c cos(s'/e) in restitution (duration e π/2),  e = c_n / p_c − 1
    dv_t/ds = K_tt f_t + K_tn f_n,   dz/ds = v_t while it sticks,   f_t = −κ z − 2 ζ w v_t / K_tt,   |f_t| ≤ μ f_n

p_c and b = dv_n/dp are taken from the rigid path, so that Ω² = k_n b.  A contact that never slips is an oscillator of
frequency w = √(κ K_tt) and damping ratio ζ: the slip returns with the sign of cos(w π), which no rigid law describes.
Each step uses the exact propagator of the sticking contact at constant f_n; then the slider limits the friction impulse
and the spring force.  η → 0 is the rigid contact.  The friction impulse of the path, relative to the rigid path, also
changes v_n and the end of restitution (impulse_path.py).

| on paper      | in code | unit | shape |                                                                         |
|---------------|---------|------|-------|-------------------------------------------------------------------------|
| η = k_n / k_t | `eta`   | 1    |       | compliance ratio; (2 − ν)/(2(1 − ν)) ≈ 1.2 for smooth elastic bodies     |
| ζ             | `zeta`  | 1    |       | damping ratio of the tangential spring with K_tt                        |
| z             | `z`     | m Ω  | (n,)  | stretch of the tangential spring                                        |

In space spring and damper are isotropic along the surface, and ζ holds in the direction of the first slip.  A sticking
contact is an oscillator along each principal axis of the tangential K; the slider limits the force to |f_t| ≤ μ f_n.
"""

import numpy as np
from numba import njit

from thesis_lib.contact.compliant.compiled_in_space import in_ball
from thesis_lib.contact.mirtich import impulse as exact_impulse
from thesis_lib.contact.slip_path import slip_path
from thesis_lib.effects.effect import IN_SPACE, Effect, Impulse, Parameter
from thesis_lib.effects.impulse_path import NormalPath, added, whole_impulse
from thesis_lib.effects.path_in_space import added_in_space
from thesis_lib.mechanics.contact import Contact

STEPS = 20  # in each phase; the error against the integrated motion is then 2.0 mm/s (with 16 steps 2.4 mm/s)
_NODES = np.linspace(0.0, np.pi / 2.0, STEPS + 1)
_STEP = _NODES[1]
# f_n / p_c: mean over each step, and at its end
_MEAN = np.concatenate([-np.diff(np.cos(_NODES)), np.diff(np.sin(_NODES))]) / _STEP
_END = np.concatenate([np.sin(_NODES[1:]), np.cos(_NODES[1:])])
_SHORTEST = 1e-6  # lower limit of the duration of restitution over that of compression, for ε = 0
_CRITICAL = 1e-12  # lower limit of 1 − ζ²: critical damping, ζ = 1, is the strongest


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
    dimensions = IN_SPACE
    reference = (
        "Maw, Barber and Fawcett 1976, doi:10.1016/0043-1648(76)90201-5; Stronge 1994, doi:10.1016/0734-743X(94)80027-7"
    )

    def impulse(self, impulse, contact, state, p, rig):
        if not np.any(p["eta"]):
            return impulse
        with np.errstate(all="ignore"):
            if contact.dimension == 3:
                more = _more_in_space(contact, p["eta"], p["zeta"])
                return added_in_space(impulse, more, contact.mu)
            paths = _paths(contact, p["eta"], p["zeta"])
        return added(impulse, paths, contact.mu)


def _propagator(w: np.ndarray, zeta: np.ndarray | float, h: np.ndarray | float) -> tuple[np.ndarray, ...]:
    """Propagator of (z, v) over a step h while sticking: matrix elements zz, zv, vz, vv about the equilibrium."""
    turning = w * np.sqrt(np.maximum(1.0 - zeta * zeta, _CRITICAL))
    decay = np.exp(-zeta * w * h)
    cos, sine = decay * np.cos(turning * h), decay * np.sin(turning * h) / turning
    return cos + zeta * w * sine, sine, -w * w * sine, cos - zeta * w * sine


def _paths(contact, eta, zeta) -> Impulse:
    """Impulses (2, n) at the ends of the compliant and the rigid path."""
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


def _more_in_space(contact, eta, zeta) -> np.ndarray:
    """Impulse (3, n) at the end of the compliant path minus the impulse at the end of the rigid path."""
    n = len(contact.v_n)
    mu = np.broadcast_to(contact.mu, n)
    K = np.array([[np.broadcast_to(part, n) for part in row] for row in contact.K])
    K_tt, turn = np.linalg.eigh(np.moveaxis(K[:2, :2], -1, 0))  # along principal axes (n, 2), (n, 2, 2)
    K_tt, turn = K_tt.T, np.moveaxis(turn, 0, -1)
    K_tn, v_t = (np.einsum("ijn,in->jn", turn, np.array(part)[:2]) for part in (K[:, 2], contact.v))
    p_c = exact_impulse(contact, contact.mu, np.zeros(n))[-1]
    ratio = np.maximum(whole_impulse(contact) / p_c - 1.0, _SHORTEST)
    spring = -p_c / (eta * contact.v_n)
    w = np.sqrt(spring * K_tt)
    along = (K_tt * v_t * v_t).sum(axis=0) / np.maximum((v_t * v_t).sum(axis=0), 1e-30)
    zeta = zeta * np.sqrt(K_tt / along)  # one damper for both directions
    stuck = np.array([_propagator(w, zeta, h) for h in (np.full(n, _STEP), _STEP * ratio)])  # (2, 4, 2, n)
    dp = _MEAN[:, None] * np.repeat([p_c * h for h in (np.full(n, _STEP), _STEP * ratio)], STEPS, axis=0)
    d_t = _slide_in_space(K_tt, K_tn, v_t, np.array(mu), K_tn / (w * w) * p_c, mu * p_c / spring, stuck, dp)
    # friction enters the normal path as one number per step
    path = NormalPath(Contact.planar(None, contact.v_n, None, contact.K_nn, 1.0))
    for pair in zip(dp, np.einsum("spkn,kn->spn", d_t, K_tn)):
        path.step(*pair)
    c_n = path.end(contact.epsilon).c_n
    c_t = d_t.sum(axis=0) + (c_n - dp.sum(axis=0))[:, None] / dp[-1] * d_t[-1]
    more = np.einsum("ijn,jn->in", turn, c_t[0] - c_t[1])
    return np.concatenate([more, (c_n[0] - c_n[1])[None]])


@njit(cache=True, error_model="numpy")
def _slide_in_space(K_tt, K_tn, v_t, mu, rest, bears, stuck, dp):
    """Friction impulses (s, 2, 2, n) of the s steps of both paths; inputs are (2, n), along the principal axes."""
    d_t = np.zeros((len(dp), 2, 2, dp.shape[1]))
    for k in range(dp.shape[1]):
        z, off, lost = np.zeros(2), np.zeros(2), np.zeros(2)
        v, rigid = v_t[:, k].copy(), v_t[:, k].copy()
        for i in range(len(dp)):
            push = mu[k] * dp[i, k]
            for j in range(2):
                zz, zv, vz, vv = stuck[i // STEPS, :, j, k]
                middle = rest[j, k] * _MEAN[i]
                off[j] = z[j] - middle
                kicked = K_tn[j, k] * dp[i, k]
                # friction has to end the velocity that the oscillator loses
                lost[j] = (v[j] + kicked - (vz * off[j] + vv * v[j])) / -K_tt[j, k]
                z[j] = middle + zz * off[j] + zv * v[j]
                v[j], rigid[j] = v[j] + kicked, rigid[j] + kicked
            if _shorten(z, bears[k] * _END[i]):  # it slides, in the direction of the spring
                along = (lost[0] * z[0] + lost[1] * z[1]) / (z[0] * z[0] + z[1] * z[1])
                lost[0], lost[1] = along * z[0], along * z[1]
            _shorten(lost, push)
            d_t[i, 0, 0, k], d_t[i, 0, 1, k] = lost
            x, y, _z = in_ball(K_tt[0, k], 0.0, 0.0, K_tt[1, k], 0.0, 1.0, rigid[0], rigid[1], 0.0, push)
            d_t[i, 1, 0, k], d_t[i, 1, 1, k] = x, y
            for j in range(2):
                v[j] += K_tt[j, k] * d_t[i, 0, j, k]
                rigid[j] += K_tt[j, k] * d_t[i, 1, j, k]
    return d_t


@njit(cache=True, error_model="numpy")
def _shorten(u, most):
    """Shorten the vector u (2,) to at most `most`, in place, and return whether it was longer."""
    length = np.sqrt(u[0] * u[0] + u[1] * u[1])
    if length > most:
        u[0], u[1] = u[0] * most / length, u[1] * most / length
    return length > most


@njit(cache=True, error_model="numpy")
def _slide(numbers, stuck, dp):
    """Friction impulses (s, 2, n) of the s steps of both paths, for the normal impulses dp (s, n).

    `numbers` (6, n) are K_tt, K_tn, v_t, μ, and, per f_n / p_c, the equilibrium of z and the limit of z.  NaN stays
    NaN, because the comparisons with the limit are then false.
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
            # friction has to end the velocity that the oscillator loses, or on the rigid path all of the slip
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
