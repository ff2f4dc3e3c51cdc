"""Free flight of many thrown polygons in closed form, and the time at which each first touches the surface.

Between contacts only gravity and linear drag act, and a flight needs no time steps:

    x(t) = x + v_x s,   y(t) = y + (v_y + g/c_v) s − g t/c_v,   θ(t) = θ + ω s_w,
    s = (1 − e^{−c_v t})/c_v,   s_w = (1 − e^{−c_w t})/c_w                        (s → t where c → 0)

A corner is a disk of radius ρ about u_i (body frame, from the centre of mass).  Its gap, and the gap's rate, are

    φ_i = y + u_i,x sin θ + u_i,y cos θ − ρ − h,      φ̇_i = v_y + ω (u_i,x cos θ − u_i,y sin θ)

Conservative advancement finds the first touch.  In a flight φ̈_i ≥ −A with A = g + c_v max(v_y, 0) + R (ω² + c_w |ω|),
R = max |u_i|, so no corner touches before the positive root of φ_i + φ̇_i t − A t²/2 = 0.  Steps of the least of these
roots never pass a touch and converge near it like Newton's method.

Source: conservative advancement, Mirtich, Impulse-based Dynamic Simulation, thesis, UC Berkeley 1996, section 2.3;
the bound for flight with linear drag is derived here.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

TOUCH = 1e-7  # m, gap at which a corner touches: far below the resolution of a camera, far above rounding
_ADVANCES = 200  # steps of the advancement; ten are usual, and bodies that need more count as touching


@dataclass(frozen=True)
class ThrownBody:
    """A thrown polygon with rounded corners over a level surface.

    Poses (n, 3) in m, rad and velocities (n, 3) in m/s, rad/s are those of its centre of mass.
    """

    corners: tuple[tuple[float, float], ...]  # m, u_i: centres of the corners' arcs from the centre of mass
    rho: float  # m, radius of the arcs
    k_g: float  # m, radius of gyration
    gravity: float  # m/s²
    height: float = 0.0  # m, of the surface
    c_v: float = 0.0  # c_v, c_w: 1/s, linear drag of translation and spin
    c_w: float = 0.0

    @cached_property
    def u(self) -> np.ndarray:
        """Centres of the corners' arcs, (k, 2) in m."""
        return np.array(self.corners)

    @cached_property
    def reach(self) -> float:
        """R = max |u_i| in m."""
        return float(np.max(np.hypot(*self.u.T)))

    @cached_property
    def faces(self) -> np.ndarray:
        """Angles (k,) in rad, within (−π, π], at which the body lies on each side (from corner i to i + 1)."""
        along = np.roll(self.u, -1, axis=0) - self.u
        # the side's outward normal points down: turn it by −π/2 − its direction
        outward = np.arctan2(-along[:, 0], along[:, 1])
        return np.pi - np.mod(outward + 1.5 * np.pi, 2.0 * np.pi)

    @cached_property
    def rest_height(self) -> np.ndarray:
        """Height (k,) in m of the centre of mass above the surface on each side."""
        sin, cos = np.sin(self.faces), np.cos(self.faces)
        return self.rho - (sin * self.u[:, 0] + cos * self.u[:, 1])

    @cached_property
    def barrier(self) -> float:
        """Least rise in m of the centre of mass needed to roll from any side to a neighbour."""
        top = np.hypot(*self.u.T) + self.rho
        return float(np.min(np.minimum(top, np.roll(top, -1)) - self.rest_height))

    def face(self, theta: np.ndarray) -> np.ndarray:
        """Index (n,) of the side nearest to lying on the surface at angle `theta` (n,)."""
        turn = np.abs(np.mod(theta[:, None] - self.faces + np.pi, 2.0 * np.pi) - np.pi)
        return np.argmin(turn, axis=1)

    def lowest(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contact point r (n, 2) of the lowest corner at `theta` (n,), and its index (n,)."""
        sin, cos = np.sin(theta), np.cos(theta)
        heights = np.multiply.outer(sin, self.u[:, 0]) + np.multiply.outer(cos, self.u[:, 1])
        corner = np.argmin(heights, axis=1)
        return self.contact_point(theta, corner), corner

    def contact_point(self, theta: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Lowest point r (n, 2) of the arc of `corner` (n,) at `theta` (n,)."""
        sin, cos = np.sin(theta), np.cos(theta)
        x, y = self.u[corner, 0], self.u[corner, 1]
        return np.stack([cos * x - sin * y, sin * x + cos * y - self.rho], axis=1)

    def gap(self, q: np.ndarray) -> np.ndarray:
        """Distance (n,) in m of the lowest corner from the surface."""
        r, _ = self.lowest(q[:, 2])
        return q[:, 1] + r[:, 1] - self.height


def fly(body: ThrownBody, q: np.ndarray, v: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pose and velocity (n, 3) after free flight of `t` (n,) in s."""
    g, c_v, c_w = body.gravity, body.c_v, body.c_w
    q_t, v_t = np.empty_like(q), np.empty_like(v)
    if c_v > 0.0:
        decay = np.exp(-c_v * t)
        s = -np.expm1(-c_v * t) / c_v
        q_t[:, 1] = q[:, 1] + v[:, 1] * s - g * (t - s) / c_v
        v_t[:, 0], v_t[:, 1] = v[:, 0] * decay, v[:, 1] * decay - g * s
    else:
        s = t
        q_t[:, 1] = q[:, 1] + t * (v[:, 1] - 0.5 * g * t)
        v_t[:, 0], v_t[:, 1] = v[:, 0], v[:, 1] - g * t
    q_t[:, 0] = q[:, 0] + v[:, 0] * s
    s_w = -np.expm1(-c_w * t) / c_w if c_w > 0.0 else t
    q_t[:, 2] = q[:, 2] + v[:, 2] * s_w
    v_t[:, 2] = v[:, 2] * np.exp(-c_w * t) if c_w > 0.0 else v[:, 2]
    return q_t, v_t


def first_touch(body: ThrownBody, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Time t (n,) in s to the first touch, and the corner (n,) that touches.

    A corner that touches at the start counts (t = 0) only if it approaches; of simultaneous touches the fastest counts.
    """
    n = len(q)
    ux, uy = body.u[:, 0], body.u[:, 1]
    # A bounds the downward acceleration of every corner for the whole flight, since drag only slows
    spin = np.abs(v[:, 2])
    A = body.gravity + body.c_v * np.maximum(v[:, 1], 0.0) + body.reach * spin * (spin + body.c_w)
    t, corner = np.zeros(n), np.zeros(n, dtype=np.intp)
    flying = np.arange(n)
    q_0, v_0, A_0, t_0 = q, v, A, t
    for _ in range(_ADVANCES):
        q_t, v_t = fly(body, q_0, v_0, t_0)
        sin, cos = np.sin(q_t[:, 2]), np.cos(q_t[:, 2])
        above = q_t[:, 1] - (body.rho + body.height)
        gap = above[:, None] + (sin[:, None] * ux + cos[:, None] * uy)
        rate = v_t[:, 1, None] + v_t[:, 2, None] * (cos[:, None] * ux - sin[:, None] * uy)
        touching = (gap <= TOUCH) & (rate < 0.0)
        done = touching.any(axis=1)
        if done.any():
            rows = flying[done]
            t[rows] = t_0[done]
            corner[rows] = np.argmin(np.where(touching[done], rate[done], np.inf), axis=1)
            if done.all():
                return t, corner
            keep = ~done
            flying, q_0, v_0, A_0, t_0 = flying[keep], q_0[keep], v_0[keep], A_0[keep], t_0[keep]
            gap, rate = gap[keep], rate[keep]
        # φ + φ̇ t − A t²/2 = 0, in the form without cancellation for φ̇ < 0; TOUCH/2 lets the last step arrive
        gap = np.maximum(gap - 0.5 * TOUCH, 0.0)
        root = np.sqrt(rate * rate + 2.0 * A_0[:, None] * gap) + np.abs(rate)
        step = np.where(rate < 0.0, 2.0 * gap / np.maximum(root, 1e-300), root / A_0[:, None])
        t_0 = t_0 + np.min(step, axis=1)
    t[flying] = t_0
    corner[flying] = np.argmin(gap, axis=1)
    return t, corner
