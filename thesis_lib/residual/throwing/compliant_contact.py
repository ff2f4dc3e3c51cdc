"""Contacts of finite duration: each corner of a thrown body is a damped spring, and friction has a spring too.

Two corners that hit within the few milliseconds of a contact press at once, which no sequence of impulses describes.
With the indentation δ = −φ of a corner, per unit mass of the body,

    f_n = max(0, Ω² δ (1 − D v_n) − 2 Z Ω v_n)                    Hunt and Crossley's damping, and a dashpot
    f_t = −τ Ω² z − 2 ζ_t √τ Ω v_t,   |f_t| ≤ μ f_n,   ż = v_t    while it sticks; a sliding spring keeps its length
    D = d p(x; g_d) o(θ; b_d),   Z = ζ p(x; g_ζ) o(θ; b_ζ)
    p(x; g) = 1 + g (1 − exp(−((x − x_0)/w)²)),                   x the place of the contact on the surface
    o(θ; b) = 1 − b cos² 2θ                                       1 on the corner, 1 − b flat on a side

p describes a surface with the largest restitution at one place x_0, as of a plate above its support; o a body with
larger restitution when it lands flat.  Symplectic Euler with the step `DT` integrates all bodies at once; flights
between contacts have a closed form.

Sources: Hunt and Crossley 1975, doi:10.1115/1.3423596; Mindlin's tangential spring as in Stronge, Impact Mechanics,
2000, chapter 5.  p and o were found in the residuals of the dice.
"""

from dataclasses import dataclass, fields

import numpy as np

from thesis_lib.residual.throwing.flight import ThrownBody, first_touch, fly

DT = 1e-4  # s; 30 steps in a contact of 3 ms; half the step changes results by less than the scatter (tests)
LONGEST = 0.012  # s, after which a contact is cut off
CLEAR = 1e-4  # m, gap above which a corner has left the surface even if it comes back
KEPT = 0.75  # the arrays are compacted once the share of bodies in contact is below this
_ROUNDS = 12  # of flight and contact, at most


@dataclass(frozen=True)
class CompliantContact:
    """Stiffness, damping and friction of the corners."""

    omega: float = 1000.0  # Ω, 1/s: root of a corner's stiffness per mass; a contact takes about π/Ω
    damping: float = 0.3  # d, s/m, Hunt and Crossley's: restitution falls with speed
    dashpot: float = 0.1  # ζ, damping ratio: restitution at all speeds
    mu: float = 0.15
    tau: float = 0.5  # τ, tangential over normal stiffness
    dashpot_t: float = 0.1  # ζ_t, damping ratio of the tangential spring
    place: float = 0.0  # x_0, m: where the surface gives back most
    width: float = 0.1  # w, m: how far that reaches
    far: float = 0.0  # g_d, with g_ζ = far_dashpot: more damping far from x_0
    far_dashpot: float = 0.0
    flat: float = 0.0  # b_d, with b_ζ = flat_dashpot: less damping on a flat side
    flat_dashpot: float = 0.0

    @property
    def margin(self) -> float:
        """Negative by how far a parameter is outside its meaningful range."""
        stiffness = min(self.omega / 200.0 - 1.0, 3000.0 / self.omega - 1.0)  # a stiffer one needs smaller steps
        positive = min(self.damping, self.dashpot, self.mu, self.dashpot_t, self.tau - 0.02, self.width - 0.02)
        below_one = min(0.9 - self.dashpot, 1.0 - self.flat, 1.0 - self.flat_dashpot)
        return min(stiffness, positive, below_one, self.far + 1.0, self.far_dashpot + 1.0)


PARAMETERS = tuple(field.name for field in fields(CompliantContact))


def compliant_path(
    body: ThrownBody, contact: CompliantContact, q: np.ndarray, v: np.ndarray, until: np.ndarray, dt: float = DT
) -> tuple[np.ndarray, np.ndarray]:
    """Pose and velocity (n, 3) at the times `until` (n,) in s, flights and contacts in turn; NaN for too many."""
    n = len(q)
    q, v, remaining = np.array(q, float), np.array(v, float), np.array(np.broadcast_to(until, n), float)
    moving = np.arange(n)
    for _ in range(_ROUNDS):
        t, _ = first_touch(body, q[moving], v[moving])
        t = np.minimum(t, remaining[moving])
        q[moving], v[moving] = fly(body, q[moving], v[moving], t)
        remaining[moving] -= t
        moving = moving[remaining[moving] > 1e-9]
        if not len(moving):
            break
        q[moving], v[moving], took = press(body, contact, q[moving], v[moving], remaining[moving], LONGEST, dt)
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
    body: ThrownBody,
    contact: CompliantContact,
    q: np.ndarray,
    v: np.ndarray,
    left: np.ndarray,
    longest: float = LONGEST,
    dt: float = DT,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One contact of each of n touching bodies, until no corner presses or is about to return.

    `q` and `v` (n, 3) are at the touch; the contact is cut off after `left` (n,) or `longest`, in s.  Returns pose and
    velocity (n, 3) and the duration (n,) in s.
    """
    c = contact
    end_q, end_v, end_t = np.array(q, float), np.array(v, float), np.zeros(len(q))
    limit = np.minimum(left, longest)
    rows, now_q, now_v, t = np.arange(len(q)), end_q.copy(), end_v.copy(), np.zeros(len(q))
    z = np.zeros((len(q), len(body.u)))
    moving = np.ones(len(q), bool)
    stiffness, stiffness_t = c.omega**2, c.tau * c.omega**2
    drag_t = 2.0 * c.dashpot_t * np.sqrt(stiffness_t)
    k2 = body.k_g**2
    for step in range(int(np.ceil(longest / dt)) + 1):
        sin, cos = np.sin(now_q[:, 2:]), np.cos(now_q[:, 2:])
        r_x = cos * body.u[:, 0] - sin * body.u[:, 1]
        r_y = sin * body.u[:, 0] + cos * body.u[:, 1] - body.rho
        gap = now_q[:, 1:2] + r_y - body.height
        v_n, v_t = now_v[:, 1:2] + r_x * now_v[:, 2:], now_v[:, :1] - r_y * now_v[:, 2:]
        moving &= t < limit - 1e-12
        if step > 0:
            moving &= ~((gap >= 0.0).all(1) & ((v_n > 0.0) | (gap > CLEAR)).all(1))
        # finished bodies do not move, and are removed in groups: copying costs more than computing them
        if moving.sum() <= KEPT * len(rows):
            done = rows[~moving]
            end_q[done], end_v[done], end_t[done] = now_q[~moving], now_v[~moving], t[~moving]
            rows, now_q, now_v, t, z, limit = (a[moving] for a in (rows, now_q, now_v, t, z, limit))
            if not len(rows):
                return end_q, end_v, end_t
            r_x, r_y, gap, v_n, v_t = (a[moving] for a in (r_x, r_y, gap, v_n, v_t))
            moving = np.ones(len(rows), bool)
        pressed = np.nonzero(gap < 0.0)
        near_v_n = v_n[pressed]
        D, Z = _damping(c, now_q[pressed[0], 0] + r_x[pressed], now_q[pressed[0], 2])
        f_n = np.zeros_like(gap)
        f_n[pressed] = np.maximum(stiffness * -gap[pressed] * (1.0 - D * near_v_n) - 2.0 * Z * c.omega * near_v_n, 0.0)
        h = np.where(moving, np.minimum(dt, limit - t), 0.0)[:, None]
        z = z + v_t * h
        most = c.mu * f_n
        f_t = -stiffness_t * z - drag_t * v_t
        slides = np.abs(f_t) > most
        f_t = np.clip(f_t, -most, most)
        # a sliding spring has the length of the force it carries; in the air it is slack
        z = np.where(slides, np.clip(z, -most / stiffness_t, most / stiffness_t), z)
        z[gap >= 0.0] = 0.0
        couple = (r_x * f_n - r_y * f_t).sum(1) / k2
        now_v = now_v + h * np.stack([f_t.sum(1), f_n.sum(1) - body.gravity, couple], axis=1)
        now_q = now_q + h * now_v
        t = t + h[:, 0]
    end_q[rows], end_v[rows], end_t[rows] = now_q, now_v, t
    return end_q, end_v, end_t


def _damping(c: CompliantContact, x: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D and Z (m,) of corners at places x (m,) of bodies at angles theta (m,)."""
    away = -np.expm1(-(((x - c.place) / c.width) ** 2))
    flat = np.cos(2.0 * theta) ** 2
    return (
        c.damping * (1.0 + c.far * away) * (1.0 - c.flat * flat),
        c.dashpot * (1.0 + c.far_dashpot * away) * (1.0 - c.flat_dashpot * flat),
    )
