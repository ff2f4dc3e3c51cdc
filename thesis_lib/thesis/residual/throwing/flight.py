"""Free flight of many thrown polygons in closed form, and the time of first touch of each.

Between contacts only gravity and linear drag act, so no time steps are needed:

    x(t) = x + v_x s,   y(t) = y + (v_y + g/c_v) s − g t/c_v,   θ(t) = θ + ω s_w,
    s = (1 − e^{−c_v t})/c_v,   s_w = (1 − e^{−c_w t})/c_w                        (s → t where c → 0)

A corner is a disk of radius ρ around u_i (body frame, from the centre of mass).  Its gap and rate of the gap are

    φ_i = y + u_i,x sin θ + u_i,y cos θ − ρ − h,      φ̇_i = v_y + ω (u_i,x cos θ − u_i,y sin θ)

Conservative advancement finds the first touch.  In a flight φ̈_i ≥ −A with A = g + c_v max(v_y, 0) + R (ω² + c_w |ω|),
R = max |u_i|, so no corner touches before the positive root of φ_i + φ̇_i t − A t²/2 = 0.  Steps of the least of these
roots never pass a touch and converge near it like Newton's method.  The search is compiled, as it takes most of the
time of a throw.

Source: conservative advancement, Mirtich, Impulse-based Dynamic Simulation, thesis, UC Berkeley 1996, section 2.3;
the bound for flight with linear drag is derived here.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

TOUCH = 1e-7  # m, gap at which a corner counts as touching: far below the resolution of a camera, far above rounding
_ADVANCES = 200  # most steps of the advancement; ten are usual, and bodies that need more than this count as touching


@dataclass(frozen=True)
class ThrownBody:
    """Thrown polygon with rounded corners over a level surface.

    Poses (n, 3) in m, rad and velocities (n, 3) in m/s, rad/s refer to its centre of mass.
    """

    u: np.ndarray  # (k, 2) m, centres of the corners' arcs from the centre of mass
    rho: float  # m, radius of the arcs
    k_g: float  # m, radius of gyration
    gravity: float  # m/s²
    height: float = 0.0  # m, of the surface
    c_v: float = 0.0  # c_v, c_w: 1/s, linear drag of translation and spin
    c_w: float = 0.0

    @cached_property
    def reach(self) -> float:
        """Largest distance R = max |u_i| in m."""
        return float(np.max(np.hypot(*self.u.T)))

    @cached_property
    def faces(self) -> np.ndarray:
        """Angles (k,) in rad, within (−π, π], at which the body lies on each side (from corner i to i + 1)."""
        along = np.roll(self.u, -1, axis=0) - self.u
        # the side's outward normal must point down: rotate it by −π/2 − its direction
        outward = np.arctan2(-along[:, 0], along[:, 1])
        return np.pi - np.mod(outward + 1.5 * np.pi, 2.0 * np.pi)

    @cached_property
    def rest_height(self) -> np.ndarray:
        """Height (k,) in m of the centre of mass above the surface on each side."""
        sin, cos = np.sin(self.faces), np.cos(self.faces)
        return self.rho - (sin * self.u[:, 0] + cos * self.u[:, 1])

    @cached_property
    def barrier(self) -> float:
        """Least rise in m of the centre of mass that is needed to roll from any side to its neighbour."""
        top = np.hypot(*self.u.T) + self.rho
        return float(np.min(np.minimum(top, np.roll(top, -1)) - self.rest_height))

    def face(self, theta: np.ndarray) -> np.ndarray:
        """Index (n,) of the side that is nearest to lying on the surface at angle `theta` (n,)."""
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
    constants = np.array([body.rho, body.height, body.reach, body.gravity, body.c_v, body.c_w])
    return _first_touch(constants, body.u, np.ascontiguousarray(q, float), np.ascontiguousarray(v, float))


@njit(cache=True, error_model="numpy")
def _first_touch(constants, u, q, v):
    """Conservative advancement of each body."""
    rho, height, reach, g, c_v, c_w = constants
    n, corners = len(q), len(u)
    t, corner = np.zeros(n), np.zeros(n, np.int64)
    for i in range(n):
        v_y, spin = v[i, 1], abs(v[i, 2])
        # A bounds the downward acceleration of every corner for the whole flight, since drag only decelerates
        A = g + c_v * max(v_y, 0.0) + reach * spin * (spin + c_w)
        for _ in range(_ADVANCES):
            # `fly`, of y and θ alone
            if c_v > 0.0:
                s = -np.expm1(-c_v * t[i]) / c_v
                y, y_rate = q[i, 1] + v_y * s - g * (t[i] - s) / c_v, v_y * np.exp(-c_v * t[i]) - g * s
            else:
                y, y_rate = q[i, 1] + t[i] * (v_y - 0.5 * g * t[i]), v_y - g * t[i]
            s_w = -np.expm1(-c_w * t[i]) / c_w if c_w > 0.0 else t[i]
            theta, omega = q[i, 2] + v[i, 2] * s_w, v[i, 2] * np.exp(-c_w * t[i])
            sin, cos = np.sin(theta), np.cos(theta)
            step, fastest, lowest, touches = np.inf, 0.0, np.inf, False
            for k in range(corners):
                gap = y - (rho + height) + sin * u[k, 0] + cos * u[k, 1]
                rate = y_rate + omega * (cos * u[k, 0] - sin * u[k, 1])
                if gap <= TOUCH and rate < 0.0:
                    touches = True
                    if rate < fastest:
                        fastest, corner[i] = rate, k
                # φ + φ̇ t − A t²/2 = 0, in the form without cancellation for φ̇ < 0; TOUCH/2 lets the last step arrive
                above = max(gap - 0.5 * TOUCH, 0.0)
                root = np.sqrt(rate * rate + 2.0 * A * above) + abs(rate)
                step = min(step, 2.0 * above / max(root, 1e-300) if rate < 0.0 else root / A)
                if not touches and gap < lowest:
                    lowest, corner[i] = gap, k
            if touches:
                break
            t[i] += step
    return t, corner
