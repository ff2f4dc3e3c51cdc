"""Compliant contacts of finite duration: each corner is a damped spring with a tangential spring for friction.

Two corners that hit within the few milliseconds of a contact act together, which no sequence of impulses describes.
With the indentation δ = −φ of a corner, per unit mass of the body,

    f_n = max(0, Ω² δ (1 − D v_n) − 2 Z Ω v_n)                    Hunt and Crossley's damping, and a dashpot
    f_t = −τ Ω² z − 2 ζ_t √τ Ω v_t,   |f_t| ≤ μ f_n,   ż = v_t    while it sticks; a sliding spring keeps its length
    D = d p(x; g_d) o(θ; b_d),   Z = ζ p(x; g_ζ) o(θ; b_ζ)
    p(x; g) = 1 + g (1 − exp(−((x − x_0)/w)²)),                   x the place of the contact on the surface
    o(θ; b) = 1 − b cos² 2θ                                       1 on the corner, 1 − b flat on a side

p describes a surface with the largest restitution at one place x_0, like a plate above its support; o a body with
larger restitution when it lands flat.  Symplectic Euler with the step `DT` integrates each body, compiled; flights
between contacts have a closed form.

Sources: Hunt and Crossley 1975, doi:10.1115/1.3423596; Mindlin's tangential spring as in Stronge, Impact Mechanics,
2000, chapter 5.  p and o were found in the residuals of the dice.
"""

from dataclasses import astuple, dataclass

import numpy as np
from numba import njit

from thesis_lib.thesis.residual.throwing.flight import ThrownBody, first_touch, fly

DT = 1e-4  # s; 30 steps in a contact of 3 ms; halving the step changes results by less than the scatter (tests)
LONGEST = 0.012  # s, limit of the duration of a contact
CLEAR = 1e-4  # m, gap above which a corner has left the surface even if it returns
_ROUNDS = 12  # most alternations of flight and contact


@dataclass(frozen=True)
class CornerContact:
    """Parameters of the corners: stiffness, damping and friction."""

    omega: float = 1000.0  # Ω, 1/s: root of a corner's stiffness per mass; a contact lasts about π/Ω
    damping: float = 0.3  # d, s/m, of Hunt and Crossley: restitution falls with speed
    dashpot: float = 0.1  # ζ, damping ratio: restitution at all speeds
    mu: float = 0.15
    tau: float = 0.5  # τ, tangential over normal stiffness
    dashpot_t: float = 0.1  # ζ_t, damping ratio of the tangential spring
    place: float = 0.0  # x_0, m: place of the largest restitution
    width: float = 0.1  # w, m: its width
    far: float = 0.0  # g_d, with g_ζ = far_dashpot: more damping far from x_0
    far_dashpot: float = 0.0
    flat: float = 0.0  # b_d, with b_ζ = flat_dashpot: less damping on a flat side
    flat_dashpot: float = 0.0

    @property
    def margin(self) -> float:
        """Margin of the parameters to their admissible range; negative outside it."""
        stiffness = min(self.omega / 200.0 - 1.0, 3000.0 / self.omega - 1.0)  # a stiffer contact needs smaller steps
        positive = min(self.damping, self.dashpot, self.mu, self.dashpot_t, self.tau - 0.02, self.width - 0.02)
        below_one = min(0.9 - self.dashpot, 1.0 - self.flat, 1.0 - self.flat_dashpot)
        return min(stiffness, positive, below_one, self.far + 1.0, self.far_dashpot + 1.0)


def compliant_path(
    body: ThrownBody, contact: CornerContact, q: np.ndarray, v: np.ndarray, until: np.ndarray, dt: float = DT
) -> tuple[np.ndarray, np.ndarray]:
    """Simulate flights and contacts to times `until` (n,) in s; pose and velocity (n, 3), NaN for too many contacts."""
    n = len(q)
    q, v, remaining = np.array(q, float), np.array(v, float), np.array(np.broadcast_to(until, n), float)
    moving = np.arange(n)
    for _ in range(_ROUNDS):
        t, _ = first_touch(body, q[moving], v[moving])
        t = np.minimum(t, remaining[moving])
        q[moving], v[moving] = fly(body, q[moving], v[moving], t)
        remaining[moving] -= t
        moving = moving[remaining[moving] > 1e-9]
        left = np.minimum(remaining[moving], LONGEST)
        q[moving], v[moving], took = press(body, contact, q[moving], v[moving], left, dt)
        remaining[moving] -= took
        # bodies that still press after `LONGEST` continue from the surface
        pressed = moving[took >= LONGEST - 1e-9]
        q[pressed, 1] += np.maximum(-body.gap(q[pressed]), 0.0)
        moving = moving[remaining[moving] > 1e-9]
        if not len(moving):
            break
    q[moving], v[moving] = np.nan, np.nan
    return q, v


def press(
    body: ThrownBody, contact: CornerContact, q: np.ndarray, v: np.ndarray, left: np.ndarray, dt: float = DT
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Simulate one contact of n touching bodies, until no corner presses or is about to return.

    `q` and `v` (n, 3) are at the touch; the contact is cut off after `left` (n,) in s.  Returns pose and velocity
    (n, 3) and the duration (n,) in s.
    """
    constants = np.array([*astuple(contact), body.height, body.gravity, body.k_g**2, body.rho])
    return _press(constants, np.ascontiguousarray(body.u), np.array(q, float), np.array(v, float), left, dt)


@njit(cache=True, error_model="numpy")
def _press(constants, u, q, v, limit, dt):
    """Step each body until it has left the surface or its time is over; changes `q` and `v`."""
    omega, damping, dashpot, mu, tau, dashpot_t, place, width, far, far_dashpot, flat, flat_dashpot = constants[:12]
    height, gravity, k2, rho = constants[12:]
    stiffness, stiffness_t = omega**2, tau * omega**2
    drag_t = 2.0 * dashpot_t * np.sqrt(stiffness_t)
    corners, took = len(u), np.zeros(len(q))
    r_x, r_y, gap = np.empty(corners), np.empty(corners), np.empty(corners)
    v_n, v_t, z = np.empty(corners), np.empty(corners), np.empty(corners)
    for i in range(len(q)):
        z[:] = 0.0
        t, touched = 0.0, False
        while t < limit[i] - 1e-12:
            theta, spin = q[i, 2], v[i, 2]
            sin, cos = np.sin(theta), np.cos(theta)
            away = True
            for k in range(corners):
                r_x[k] = cos * u[k, 0] - sin * u[k, 1]
                r_y[k] = sin * u[k, 0] + cos * u[k, 1] - rho
                gap[k] = q[i, 1] + r_y[k] - height
                v_n[k], v_t[k] = v[i, 1] + r_x[k] * spin, v[i, 0] - r_y[k] * spin
                away &= gap[k] >= 0.0 and (v_n[k] > 0.0 or gap[k] > CLEAR)
            if away and touched:
                break
            touched = True
            h = min(dt, limit[i] - t)
            cos_flat = np.cos(2.0 * theta) ** 2
            push_x = push_y = couple = 0.0
            for k in range(corners):
                f_n = 0.0
                if gap[k] < 0.0:
                    from_best = -np.expm1(-(((q[i, 0] + r_x[k] - place) / width) ** 2))
                    D = damping * (1.0 + far * from_best) * (1.0 - flat * cos_flat)
                    Z = dashpot * (1.0 + far_dashpot * from_best) * (1.0 - flat_dashpot * cos_flat)
                    f_n = max(-stiffness * gap[k] * (1.0 - D * v_n[k]) - 2.0 * Z * omega * v_n[k], 0.0)
                z[k] += v_t[k] * h
                most = mu * f_n
                f_t = -stiffness_t * z[k] - drag_t * v_t[k]
                if abs(f_t) > most:  # the length of a sliding spring corresponds to its force
                    z[k] = min(max(z[k], -most / stiffness_t), most / stiffness_t)
                    f_t = min(max(f_t, -most), most)
                if gap[k] >= 0.0:
                    z[k] = 0.0  # slack without contact
                push_x += f_t
                push_y += f_n
                couple += r_x[k] * f_n - r_y[k] * f_t
            v[i, 0] += h * push_x
            v[i, 1] += h * (push_y - gravity)
            v[i, 2] += h * couple / k2
            for j in range(3):
                q[i, j] += h * v[i, j]
            t += h
        took[i] = t
    return q, v, took
