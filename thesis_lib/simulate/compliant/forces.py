"""Forces on a planar body with compliant contact: outline, plate, flight, normal force, friction, couple, adhesion.

At each contact point (every vertex of a polygon, the lowest point of a smooth body), with depth δ below the plate:

    normal      loading  f = k δⁿ;   unloading  f = k δ_mⁿ ((δ − δ_0)₊ / (δ_m − δ_0))ⁿ,  δ_0 = (1 − ε²) δ_m
                δ_m is the deepest so far: the share ε² of the work is returned, at any speed (Walton and Braun)
                times (1 + d δ̇)₊ (Hunt and Crossley), minus 2 (W/a) (1 − s/a) at s < a beyond δ_0 (adhesion)
    friction    rigid: the force that ends the slip within the step, at most μ f;  compliant: a bristle with a damper,
                k_t s + c ṡ, at most μ f, beyond which it slides;  μ may depend on the slip
    couple      a f against ω, at most what stops it within the step

Step: half a drift, then a kick at the forces there (normal force, friction on the resulting velocity, couple), then the
second half of the drift.

Impulses follow from integrating the forces, without an impact law.
"""

from dataclasses import dataclass, fields

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

EPSILON_LOW, EPSILON_HIGH = 0.05, 1.0  # limits where slopes and sectors would exceed them
SOFTEST = 0.1  # of the stiffness, where its slope would go below
SPOT = 0.3  # 1 − cos of the angle at which a soft spot is a third as soft: 46°, so that one corner of a square has it


@dataclass
class Memory:
    """State of the contact points of n bodies during one contact; arrays (n, p)."""

    deepest: np.ndarray  # δ_m, m
    bristle: np.ndarray  # s, m
    epsilon: np.ndarray  # epsilon, mu, stiffness: fixed at touch
    mu: np.ndarray
    stiffness: np.ndarray  # k, N/mⁿ

    def keep(self, rows: np.ndarray) -> "Memory":
        """The memory of the bodies `rows`, a mask or indices."""
        return Memory(*(getattr(self, item.name)[rows] for item in fields(self)))

    def join(self, other: "Memory") -> "Memory":
        """The memory of these bodies, then of the `other` ones."""
        parts = ((getattr(self, item.name), getattr(other, item.name)) for item in fields(self))
        return Memory(*map(np.concatenate, parts))


class Mechanics:
    """Forces on the n drops of one run.

    `body` and `gravity` (m/s²) are as believed, `phase` (n,) is that of the vibrating plate in rad.  States q, v (n, 5)
    in m, rad and per s are x, y, θ of the true centre of mass and x, y of a loose mass; contact points r_x, r_y and
    depths (n, p) are in m.
    """

    def __init__(
        self, body: Body, contact: CompliantContact, hidden: HiddenCauses, gravity: float, n: int, phase: np.ndarray
    ) -> None:
        assert body.mass is not None  # `check_request` refuses bodies without one
        m = hidden
        self.hidden, self.contact, self.phase = m, contact, phase
        self.mass = body.mass
        self.inertia = body.mass * body.radius_of_gyration**2 * (1.0 + m.inertia_error)
        self.shell = body.mass * (1.0 - m.loose_mass)
        self.stiffness = contact.stiffness(body.mass)
        self.com = np.array([m.com_offset_x, m.com_offset_y])
        g = gravity + m.gravity_error
        self.gravity = g * np.array([np.sin(m.tilt), -np.cos(m.tilt)])
        ramp = np.arange(n) / max(n - 1, 1) - 0.5
        self.epsilon = contact.epsilon * (1.0 + m.wear * ramp)
        self.shape, self.vertices = body.shape, None
        if isinstance(body.shape, Polygon):
            corners = np.array(body.shape.vertices) * (1.0 + m.size_error)
            self.vertices = rounded_centres(corners, m.corner_radius) - self.com

    # --- geometry ---

    def points(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Contact points r_x, r_y (n, p) from the true centre of mass at angles theta (n,) in rad."""
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        if self.vertices is not None:
            x, y = self.vertices.T
            return cos * x - sin * y, sin * x + cos * y - self.hidden.corner_radius
        r = self.shape.contact_point(theta) * (1.0 + self.hidden.size_error) - self.origin(theta)
        return r[:, :1], r[:, 1:]

    def origin(self, theta: np.ndarray) -> np.ndarray:
        """Vector (n, 2) from the body's origin to the true centre of mass, in the axes of the surface."""
        cos, sin = np.cos(theta), np.sin(theta)
        x, y = self.com
        return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)

    def centre_state(self, pose: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (n, 2) of the true centre of mass from pose and velocity (n, 3) of the origin."""
        c, omega = self.origin(pose[:, 2]), velocity[:, 2:3]
        return pose[:, :2] + c, velocity[:, :2] + omega * np.stack([-c[:, 1], c[:, 0]], axis=-1)

    def origin_state(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pose and velocity (n, 3) of the origin from those of the true centre of mass, q and v (n, 3 or more)."""
        c, omega = self.origin(q[:, 2]), v[:, 2:3]
        rate = v[:, :2] - omega * np.stack([-c[:, 1], c[:, 0]], axis=-1)
        return np.column_stack([q[:, :2] - c, q[:, 2]]), np.column_stack([rate, v[:, 2]])

    def lowest_point(self, theta: np.ndarray) -> np.ndarray:
        """Lowest contact point (n, 2) from the true centre of mass at angles theta (n,) in rad."""
        r_x, r_y = self.points(theta)
        rows, lowest = np.arange(len(theta)), r_y.argmin(axis=1)
        return np.stack([r_x[rows, lowest], r_y[rows, lowest]], axis=-1)

    def approach(self, q: np.ndarray, v: np.ndarray, t: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Speed (n,) in m/s at which plate and lowest point of the drops `rows` approach at times t (n,)."""
        return self.plate(t, rows)[1][:, 0] - v[:, 1] - self.lowest_point(q[:, 2])[:, 0] * v[:, 2]

    def plate(self, t: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height and vertical velocity, each (n, 1), of the plate at times t (n,) of the drops `rows`."""
        m = self.hidden
        if m.plate_amplitude == 0.0:
            return np.full((len(t), 1), m.surface_height), np.zeros((len(t), 1))
        w = 2.0 * np.pi * m.plate_frequency
        angle = (w * t + self.phase[rows])[:, None]
        return m.surface_height + m.plate_amplitude * np.sin(angle), m.plate_amplitude * w * np.cos(angle)

    def gap(self, q: np.ndarray, t: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Height (n,) in m of the lowest contact point above the plate."""
        _, r_y = self.points(q[:, 2])
        return q[:, 1] + r_y.min(axis=1) - self.plate(t, rows)[0][:, 0]

    # --- forces ---

    def acceleration(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Acceleration (n, 5) without contact."""
        m = self.hidden
        a = np.zeros_like(q)
        a[:, :2] = self.gravity
        a[:, 3:] = self.gravity
        if m.linear_drag:
            a[:, :2] -= m.linear_drag * v[:, :2]
        if m.quadratic_drag:
            a[:, :2] -= m.quadratic_drag * np.hypot(v[:, 0], v[:, 1])[:, None] * v[:, :2]
        if m.magnus:
            a[:, 0] -= m.magnus * v[:, 2] * v[:, 1]
            a[:, 1] += m.magnus * v[:, 2] * v[:, 0]
        if m.spin_damping:
            a[:, 2] -= m.spin_damping * v[:, 2]
        if m.loose_mass:
            w = 2.0 * np.pi * m.loose_frequency
            pull = -(w**2) * (q[:, 3:] - q[:, :2]) - 2.0 * m.loose_damping * w * (v[:, 3:] - v[:, :2])
            a[:, 3:] += pull
            a[:, :2] -= pull * m.loose_mass / (1.0 - m.loose_mass)
        return a

    def touch(self, q: np.ndarray, rows: np.ndarray) -> Memory:
        """Memory of a contact that begins at poses q (n, 5) of the drops `rows`."""
        m = self.hidden
        r_x, r_y = self.points(q[:, 2])
        epsilon = np.broadcast_to(self.epsilon[rows][:, None], r_x.shape)
        c = self.origin(q[:, 2])
        place = np.arctan2(r_y + c[:, 1:], r_x + c[:, :1]) - q[:, 2:3] - m.orientation_axis
        if m.orientation_restitution:
            epsilon = epsilon * (1.0 + m.orientation_restitution * np.cos(2.0 * place))
        x = q[:, :1] + r_x
        patch, bump, step = _profiles(x, m)
        by_place = 1.0 + m.restitution_slope * x
        by_place = by_place + m.restitution_patch * patch + m.restitution_bump * bump + m.restitution_step * step
        epsilon = np.clip(epsilon * by_place, EPSILON_LOW, EPSILON_HIGH)
        by_place = 1.0 + m.friction_slope * x
        by_place = by_place + m.friction_patch * patch + m.friction_bump * bump + m.friction_step * step
        mu = np.maximum(self.contact.mu * by_place, 0.0)
        stiffness = self.stiffness * np.maximum(1.0 + m.stiffness_slope * x + m.stiffness_patch * patch, SOFTEST)
        stiffness = stiffness * (1.0 - m.soft_spot * np.exp(-(1.0 - np.cos(place)) / SPOT))
        return Memory(np.zeros_like(r_x), np.zeros_like(r_x), epsilon, mu, stiffness)

    def step(
        self, q: np.ndarray, v: np.ndarray, t: np.ndarray, memory: Memory, rows: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """One time step of bodies in contact; `q`, `v` (n, 5) at time t (n,) s are kept, their `memory` changes.

        Returns q, v after the step, impulse (n, 2) = (c_t, c_n) in N s, and mask (n,) of bodies without contact.
        """
        h, m = self.contact.dt, self.hidden
        q = q + 0.5 * h * v
        r_x, r_y = self.points(q[:, 2])
        height, rise = self.plate(t + 0.5 * h, rows)
        depth = height - q[:, 1:2] - r_y
        rate = rise - v[:, 1:2] - r_x * v[:, 2:3]
        v = v + h * self.acceleration(q, v)

        push, pull, free = self._normal(depth, rate, memory)
        f_n = push - pull
        total = f_n.sum(axis=1)
        v[:, 1] += h / self.shell * total
        v[:, 2] += h / self.inertia * (r_x * f_n).sum(axis=1)
        f_t = self._friction(v, r_y, push, memory)
        v[:, 0] += h / self.shell * f_t.sum(axis=1)
        v[:, 2] -= h / self.inertia * (r_y * f_t).sum(axis=1)
        if m.rolling_lever:
            kick = h / self.inertia * m.rolling_lever * push.sum(axis=1)
            v[:, 2] -= np.sign(v[:, 2]) * np.minimum(kick, np.abs(v[:, 2]))
        return q + 0.5 * h * v, v, h * np.stack([f_t.sum(axis=1), total], axis=-1), free

    def _normal(self, depth: np.ndarray, rate: np.ndarray, memory: Memory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Repulsion and adhesion in N (n, p), and mask (n,) of bodies without a point that touches or sticks."""
        m, n = self.hidden, self.contact.exponent
        deepest = memory.deepest = np.maximum(memory.deepest, depth)
        share = memory.epsilon**2
        lift = (1.0 - share) * deepest - depth  # distance beyond δ_0; negative while the contact pushes
        pressed = deepest > 0.0
        part = np.divide(-lift, share * deepest, out=np.zeros_like(lift), where=pressed & (lift < 0.0))
        push = memory.stiffness * (deepest * part if n == 1.0 else (deepest * part) ** n)
        if m.hunt_crossley:
            push = push * np.maximum(1.0 + m.hunt_crossley * rate, 0.0)
        reach, pull = 0.0, 0.0
        if m.adhesion_energy:
            reach = m.adhesion_range
            bonded = pressed & (lift >= 0.0) & (lift < reach)
            pull = np.where(bonded, 2.0 * m.adhesion_energy / reach * (1.0 - lift / reach), 0.0)
        over = (depth <= 0.0) & (lift >= reach)
        memory.deepest = np.where(over, 0.0, deepest)
        memory.bristle = np.where(over, 0.0, memory.bristle)
        return push, pull, over.all(axis=1)  # pyright: ignore[reportReturnType]

    def _friction(self, v: np.ndarray, r_y: np.ndarray, push: np.ndarray, memory: Memory) -> np.ndarray:
        """Friction forces in N (n, p) on bodies with velocity v (n, 5) after the kick of the normal forces."""
        h, m = self.contact.dt, self.hidden
        slip = v[:, :1] - r_y * v[:, 2:3] - m.plate_velocity
        mu = memory.mu
        if m.stribeck:
            mu = mu * (1.0 + m.stribeck * np.exp(-((slip / m.stribeck_speed) ** 2)))
        if m.friction_anisotropy:
            mu = mu * (1.0 + m.friction_anisotropy * np.sign(slip))
        limit = mu * push
        mobility = 1.0 / self.shell + r_y**2 / self.inertia
        if m.tangential_compliance == 0.0:
            # points that touch together share the force, or the sum would overshoot
            sharing = np.maximum((push > 0.0).sum(axis=1, keepdims=True), 1)
            return np.clip(-slip / (mobility * h * sharing), -limit, limit)
        k = memory.stiffness / m.tangential_compliance
        if self.contact.exponent != 1.0:
            # a Hertz contact grows with depth, and both its stiffnesses with its width
            k = k * self.contact.exponent * np.maximum(memory.deepest, 1e-12) ** (self.contact.exponent - 1.0)
        damping = 2.0 * m.tangential_damping * np.sqrt(k / mobility)
        force = np.clip(-k * (memory.bristle + h * slip) - damping * slip, -limit, limit)
        # spring and damper carry the force together, sliding or not: k s + c ṡ = −force
        memory.bristle = (damping / h * memory.bristle - force) / (k + damping / h)
        return force


def _profiles(x: np.ndarray, m: HiddenCauses) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Patch, bump and step at places x (n, p) in m, of height 1."""
    u = (x - m.patch_centre) / (0.5 * m.patch_width)
    return (np.abs(u) < 1.0).astype(float), np.exp(-(u**2)), np.tanh(u)


def rounded_centres(corners: np.ndarray, radius: float) -> np.ndarray:
    """Centres (p, 2) of the arcs that round a polygon's corners (p, 2) with `radius`, both in m.

    Each is `radius` inside both edges of its corner; with radius 0, a corner of the convex hull.  Raises UserError if
    the radius does not fit into the polygon.
    """
    from scipy.spatial import ConvexHull

    hull = corners[ConvexHull(corners).vertices]  # counter-clockwise
    edge = np.roll(hull, -1, axis=0) - hull
    normal = np.stack([edge[:, 1], -edge[:, 0]], axis=-1) / np.linalg.norm(edge, axis=1)[:, None]
    # normals of the edges before and after each corner
    sides = np.stack([np.roll(normal, 1, axis=0), normal], axis=1)
    level = np.einsum("pij,pj->pi", sides, hull) - radius
    centres = np.linalg.solve(sides, level[..., None])[..., 0]
    shrunk = np.roll(centres, -1, axis=0) - centres
    if radius > 0.0 and not ((shrunk * edge).sum(axis=1) > 0.0).all():
        raise UserError(f"Corners of {radius} m radius do not fit into the polygon; take a smaller radius.")
    return centres
