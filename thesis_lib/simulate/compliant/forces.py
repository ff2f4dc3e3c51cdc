"""Forces on a planar body with compliant contact: outline, plate, flight, normal force, friction, couple, adhesion.

At each contact point (every vertex of a polygon, the lowest point of a smooth body), with depth δ below the plate:

    normal      loading  f = k δⁿ;   unloading  f = k δ_mⁿ ((δ − δ_0)₊ / (δ_m − δ_0))ⁿ,  δ_0 = (1 − ε²) δ_m
                δ_m is the largest depth so far: the share ε² of the work is returned, at any speed (Walton and Braun)
                times (1 + d δ̇)₊ (Hunt and Crossley), minus 2 (W/a) (1 − s/a) at s < a beyond δ_0 (adhesion)
    friction    rigid: the force that ends the slip within the step, at most μ f;  compliant: a bristle with a damper,
                k_t s + c ṡ, at most μ f, beyond which it slides;  μ may depend on the slip
    couple      a f against ω, at most the couple that stops the rotation within the step

Time step: half a drift, a kick by the forces there (normal force, friction on the resulting velocity, couple), and the
second half of the drift.

Impulses result from integrating the forces, without an impact law.
"""

import numpy as np
from scipy.spatial import ConvexHull

from thesis_lib.bodies.body import Body
from thesis_lib.bodies.shapes import Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.compliant import compiled
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

SHARP = 1e-6  # m; radius of the sphere that represents a sharp corner in MuJoCo and Drake
_CAUSES = np.dtype([(name, float) for name in HiddenCauses.model_fields])


class TrueBody:
    """True body and gravity, including the hidden causes; `body` and `gravity` (m/s²) are as believed.

    Attributes:
        mass, shell: kg, total mass, and mass without the loose mass.
        inertia: kg m², about the true centre of mass.
        com: (2,) from the body's origin to the true centre of mass, m, in the body's frame.
        grown: ratio of true to believed lengths, 1.
        gravity: (2,) in m/s², axes of the surface.
    """

    def __init__(self, body: Body, hidden: HiddenCauses, gravity: float) -> None:
        assert body.mass is not None  # `check_request` rejects bodies without a mass
        self.hidden, self.shape, self.mass = hidden, body.shape, body.mass
        self.shell = body.mass * (1.0 - hidden.loose_mass)
        self.inertia = body.mass * body.radius_of_gyration**2 * (1.0 + hidden.inertia_error)
        self.com = np.array([hidden.com_offset_x, hidden.com_offset_y])
        self.grown = 1.0 + hidden.size_error
        g = gravity + hidden.gravity_error
        self.gravity = g * np.array([np.sin(hidden.gravity_angle), -np.cos(hidden.gravity_angle)])

    def corners(self, radius: float) -> np.ndarray:
        """Centres (p, 2) of a polygon's corners with this `radius`, from the true centre of mass, both in m."""
        assert isinstance(self.shape, Polygon)
        return rounded_centres(self.grown * np.array(self.shape.vertices), radius) - self.com


class Mechanics(TrueBody):
    """Forces on the n drops of one run; `world` passes their parameters to the compiled functions.

    `body` and `gravity` (m/s²) are as believed, `phase` (n,) is the phase of the vibrating plate in rad.  States q, v
    (n, 5) in m, rad and per s are x, y, θ of the true centre of mass and x, y of a loose mass; contact points r_x, r_y
    and depths (n, p) are in m.
    """

    def __init__(
        self, body: Body, contact: CompliantContact, hidden: HiddenCauses, gravity: float, n: int, phase: np.ndarray
    ) -> None:
        super().__init__(body, hidden, gravity)
        self.contact, self.phase = contact, phase
        self.believed, self.believed_gravity = body, gravity
        loose = self.mass - self.shell
        self.weights = np.array([self.shell, self.shell, self.inertia, loose, loose])  # inertia of each state component
        self.stiffness = contact.stiffness(self.mass)
        ramp = np.arange(n) / max(n - 1, 1) - 0.5
        self.epsilon = contact.epsilon * (1.0 + hidden.wear * ramp)
        self.vertices, axes = None, (1.0, 1.0)
        if isinstance(body.shape, Polygon):
            self.vertices = self.corners(hidden.corner_radius)
        else:
            axes = body.shape.semi_axes
        self.points = 1 if self.vertices is None else len(self.vertices)
        self.world = compiled.World(
            vertices=np.zeros((0, 2)) if self.vertices is None else self.vertices,
            axes=axes,
            com=(hidden.com_offset_x, hidden.com_offset_y),
            gravity=(float(self.gravity[0]), float(self.gravity[1])),
            mass=self.shell,
            inertia=self.inertia,
            mu=float(contact.mu),
            stiffness=self.stiffness,
            exponent=float(contact.exponent),
            dt=contact.dt,
            law=compiled.NO_LAW,
            causes=np.array([tuple(getattr(hidden, name) for name in HiddenCauses.model_fields)], _CAUSES)[0],
        )

    # --- geometry ---

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
        """Pose and velocity (n, 3) of the origin from q and v (n, 3 or more) of the true centre of mass."""
        c, omega = self.origin(q[:, 2]), v[:, 2:3]
        rate = v[:, :2] - omega * np.stack([-c[:, 1], c[:, 0]], axis=-1)
        return np.column_stack([q[:, :2] - c, q[:, 2]]), np.column_stack([rate, v[:, 2]])

    def lowest_point(self, theta: np.ndarray, x: np.ndarray | None = None) -> np.ndarray:
        """Lowest contact point (n, 2) from the true centre of mass at angles theta (n,) in rad; on a curved plate, the
        point nearest to the plate at places x (n,) in m (default: the middle)."""
        x = np.zeros_like(theta) if x is None else x
        return compiled.lowest_points(self.world, np.ascontiguousarray(theta), np.ascontiguousarray(x))

    def approach(self, q: np.ndarray, v: np.ndarray, t: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Speed (n,) in m/s at which the lowest point of the drops `rows` approaches the plate at times t (n,)."""
        return self.plate(t, rows)[1][:, 0] - v[:, 1] - self.lowest_point(q[:, 2])[:, 0] * v[:, 2]

    def plate(self, t: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height and vertical velocity, each (n, 1), of the plate of the drops `rows` at times t (n,)."""
        of = [compiled.plate(self.world.causes, *at) for at in zip(t.tolist(), self.phase[rows].tolist())]
        height, rise = np.array(of).reshape(-1, 2).T[..., None]
        return height, rise

    def gap(self, q: np.ndarray, t: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Height (n,) in m of the lowest contact point above the plate."""
        return q[:, 1] + self.lowest_point(q[:, 2])[:, 1] - self.plate(t, rows)[0][:, 0]

    # --- forces ---

    def acceleration(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Acceleration (n, 5) without contact."""
        a = np.empty(q.shape)
        for one, motion, found in zip(np.ascontiguousarray(q), np.ascontiguousarray(v), a):
            compiled.accelerate(self.world, one, motion, found)
        return a

    def touch(self, q: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """ε, μ and stiffness in N/mⁿ (3, n, p) at the contact points of the drops `rows`, which touch at q (n, 5)."""
        of = np.empty((3, len(q), self.points))
        r_x, r_y = np.empty((2, self.points))
        for i, (pose, epsilon) in enumerate(zip(np.ascontiguousarray(q), self.epsilon[rows])):
            compiled.place(self.world, pose[2], pose[0], r_x, r_y)
            compiled.touch(self.world, pose, epsilon, r_x, r_y, *of[:, i])
        return of


def rounded_centres(corners: np.ndarray, radius: float) -> np.ndarray:
    """Centres (p, 2) of the arcs that round a polygon's corners (p, 2) with `radius`, both in m.

    Each centre lies `radius` inside both edges of its corner; with radius 0 it is a corner of the convex hull.  Raises
    UserError if the radius does not fit into the polygon.
    """
    hull = corners[ConvexHull(corners).vertices]  # counter-clockwise
    edge = np.roll(hull, -1, axis=0) - hull
    normal = np.stack([edge[:, 1], -edge[:, 0]], axis=-1) / np.linalg.norm(edge, axis=1)[:, None]
    # normals of the edges before and after each corner
    sides = np.stack([np.roll(normal, 1, axis=0), normal], axis=1)
    level = np.einsum("pij,pj->pi", sides, hull) - radius
    centres = np.linalg.solve(sides, level[..., None])[..., 0]
    shrunk = np.roll(centres, -1, axis=0) - centres
    if radius > 0.0 and not ((shrunk * edge).sum(axis=1) > 0.0).all():
        raise UserError(f"Corners of {radius} m radius do not fit into the polygon; use a smaller radius.")
    return centres
