"""Likelihood of m/I given the arcs of a drop, for many hypotheses about its impacts at once.

An impulse (c_t, c_n) at the contact point r changes the velocities by Δv_x = c_t / m, Δv_y = c_n / m and

    Δω_j = (m/I) (r_x Δv_y - r_y Δv_x)_j,     r = r(θ_{k_j}),                                             (1)

which links the arcs of θ to the arcs of x and y, without assumptions on friction or restitution.  The samples determine
the arcs u with information N (`sufficient_statistics`), so maximum likelihood is a small constrained problem,

    minimise χ²_free + (u - û)' N (u - û)   over u, η    subject to  g(u, η) = 0,                              (2)

with η = (m/I, ε, μ) and g the rows (1).  It is solved by Newton steps on the linearised rows G du + G_η dη + g = 0.  As
in multiple shooting, every arc has its own unknowns, so an early error does not grow through later impacts.  A
hypothesis gives the impact steps k_j, the vertex of a polygon that hits and, under a contact law, the mode of each
impact.  Two kinds of rows may be added:

Gap.  The time stepper applies an impulse in the first step that would end below the surface.  The gap at the start of
that step, φ_j = y + r_y at k_j, therefore lies between 0 and the travel h |v_n| of the contact point in the step.  This
is geometry, not a contact law.  Over drops, φ_j is uniform there; it enters as a normal variable of equal mean and
variance,

    √12 (φ_j / (h |v_n|_j) - 1/2) ~ N(0, 1),   with 2 log(h |v_n|_j) in -2 log likelihood.                        (3)

Contact law.  Newton's restitution and Coulomb's friction, with unknown ε and μ shared by a drop's impacts; v- is v_k,
v+ is v_{k+1}:

    J_n v+ + ε J_n v- = 0;     J_t v+ = 0 (stick)   or   Δv_x = ± μ Δv_y (slide).                               (4)

Sources: thesis eq. 2.3, 2.18-2.23; W. A. Fuller, Measurement Error Models, Wiley 1987, doi 10.1002/9780470316665 (m/I
multiplies noisy quantities: least squares on (1) is biased, maximum likelihood not to first order).
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.simulate.stepping.multibody import Rod
from thesis_lib.thesis.identify.mass_ratio.sufficient_statistics import ArcStatistics

BodyShape = Polygon | Ellipse | Disk | Rod

SPEED_FLOOR = 0.05  # m/s; least |v_n| in the scale of the gap, since a trial value of zero would make (3) infinite
RATIO, EPSILON, MU = range(3)  # columns of η
SLIDE_FORWARD, STICK, SLIDE_BACK = 1, 0, -1  # modes: sign of c_t of an impact that slides


def corner_points(shape: BodyShape) -> np.ndarray | None:
    """Points (n, 2) in m of the body that may touch: polygon vertices or rod ends; None for a smooth shape."""
    if isinstance(shape, Polygon):
        return np.array(shape.vertices)
    return shape.outline() if isinstance(shape, Rod) else None


def contact_offset(shape: BodyShape, theta: np.ndarray, vertex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contact point r (n, 2) in m at angles (n,), and the derivative (n,) of r_x by θ; the derivative of r_y is r_x.

    `vertex` (n,) is the touching vertex of a polygon; other shapes ignore it.
    """
    sin, cos = np.sin(theta), np.cos(theta)
    corners = corner_points(shape)
    if corners is not None:
        x, y = corners[vertex].T
        r = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        return r, -r[:, 1]
    r = shape.contact_point(theta)
    if not isinstance(shape, Ellipse):
        return r, np.zeros_like(theta)
    a2, b2 = shape.semi_axes[0] ** 2, shape.semi_axes[1] ** 2
    height = -r[:, 1]
    dr_x = -(a2 - b2) * ((cos**2 - sin**2) / height - (a2 - b2) * (sin * cos) ** 2 / height**3)
    return r, dr_x


@dataclass(frozen=True)
class ImpactMotion:
    """Motion of a body at the J impacts of B hypotheses, arrays (B, J)."""

    r_x: np.ndarray  # r_x, r_y: m, contact point from the centre of mass
    r_y: np.ndarray
    dr_x: np.ndarray  # m/rad, derivative of r_x by θ; the derivative of r_y is r_x
    dv_x: np.ndarray  # dv_x, dv_y, d_omega: change of velocity by the impulse
    dv_y: np.ndarray
    d_omega: np.ndarray
    v_y_before: np.ndarray  # m/s, of the centre before the impulse, gravity included
    omega_before: np.ndarray  # rad/s

    @property
    def lever(self) -> np.ndarray:
        """Lever r_x Δv_y - r_y Δv_x in m²/s, see (1)."""
        return self.r_x * self.dv_y - self.r_y * self.dv_x

    @property
    def v_n_before(self) -> np.ndarray:
        """Normal velocity of the contact point before the impulse, m/s."""
        return self.v_y_before + self.r_x * self.omega_before

    @property
    def omega_after(self) -> np.ndarray:
        """Angular velocity after the impulse, rad/s."""
        return self.omega_before + self.d_omega


@dataclass
class ArcModel:
    """Model of B hypotheses: the rows g of (1), (3) and (4), in this order, and their derivatives.

    There are J rows of each kind; (4) has J rows of restitution, then J of friction.
    `vertices` (B, J) are those that touch; `modes` (B, J) are for the law, or None for free impulses; `use_gap`
    adds (3) to the likelihood.  `h` is in s, `gravity` in m/s².
    """

    s: ArcStatistics
    vertices: np.ndarray
    h: float
    shape: BodyShape
    gravity: float
    modes: np.ndarray | None = None
    use_gap: bool = False

    def __post_init__(self):
        self.B, self.J = self.s.steps.shape
        # linear maps (B, J, 2+J) from a channel of u to the impacts: position, velocity change, before and after
        self.time = self.h * self.s.steps.astype(float)
        delay = np.maximum(self.time[:, :, None] - self.time[:, None, :], 0.0)
        ones = np.ones((self.B, self.J, 1))
        each = np.broadcast_to(np.eye(self.J), (self.B, self.J, self.J))
        earlier = np.broadcast_to(np.tri(self.J, k=-1), (self.B, self.J, self.J))
        self.position = np.concatenate([ones, self.time[:, :, None], delay], axis=2)
        self.change = np.concatenate([0.0 * ones, 0.0 * ones, each], axis=2)
        self.before = np.concatenate([0.0 * ones, ones, earlier], axis=2)
        self.after = self.before + self.change

    def take(self, rows: np.ndarray) -> "ArcModel":
        """Return the hypotheses `rows`."""
        modes = None if self.modes is None else self.modes[rows]
        return replace(self, s=self.s.take(rows), vertices=self.vertices[rows], modes=modes)

    def angles(self, u: np.ndarray) -> np.ndarray:
        """Angles (B, J) in rad at the impacts of arcs u (B, 3, 2+J)."""
        return _apply(self.position, u[:, 2])

    def motion(self, u: np.ndarray) -> ImpactMotion:
        """Motion at the impacts of arcs u (B, 3, 2+J)."""
        r, dr_x = contact_offset(self.shape, self.angles(u).ravel(), self.vertices.ravel())
        r_x, r_y, dr_x = (a.reshape(self.B, self.J) for a in (r[:, 0], r[:, 1], dr_x))
        v_y_before = _apply(self.before, u[:, 1]) - self.gravity * self.time
        changes = (u[:, 0, 2:], u[:, 1, 2:], u[:, 2, 2:])
        return ImpactMotion(r_x, r_y, dr_x, *changes, v_y_before, _apply(self.before, u[:, 2]))

    def travel(self, motion: ImpactMotion) -> np.ndarray:
        """Scale h |v_n| (B, J) of (3) in m, the travel of the contact point in a step; 1 if (3) is not used."""
        if not self.use_gap:
            return np.ones((self.B, self.J))
        return self.h * np.maximum(self.gravity * self.h - motion.v_n_before, SPEED_FLOOR)

    def rows(self, u: np.ndarray, motion: ImpactMotion, eta: np.ndarray, travel: np.ndarray) -> np.ndarray:
        """Rows g (B, n_g) for arcs u (B, 3, 2+J) with their `motion`, η (B, 3) and the scale `travel` (B, J) of (3)."""
        ratio, epsilon, mu = eta.T[:, :, None]
        g = [motion.d_omega - ratio * motion.lever]
        if self.use_gap:
            y = _apply(self.position, u[:, 1]) - self.gravity * self.time * (self.time + self.h) / 2.0
            g.append(np.sqrt(12.0) * ((y + motion.r_y) / travel - 0.5))
        if self.modes is not None:
            v_y_after = motion.v_y_before + motion.dv_y - self.gravity * self.h
            g.append(v_y_after + motion.r_x * motion.omega_after + epsilon * motion.v_n_before)
            sticks = _apply(self.after, u[:, 0]) - motion.r_y * motion.omega_after
            slides = motion.dv_x - self.modes * mu * motion.dv_y
            g.append(np.where(self.modes != STICK, slides, sticks))
        return np.concatenate(g, axis=1)

    def derivatives(self, motion: ImpactMotion, eta: np.ndarray, travel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the rows by u, G (B, n_g, 3, 2+J), and by η, G_η (B, n_g, 3), at constant `travel`."""
        ratio, epsilon, mu = eta.T[:, :, None]
        m, none = motion, np.zeros_like(self.position)
        d_lever = m.dr_x * m.dv_y - m.r_x * m.dv_x
        # each block: derivatives with respect to the arcs of x, y and θ
        blocks = [
            (
                (ratio * m.r_y)[:, :, None] * self.change,
                -(ratio * m.r_x)[:, :, None] * self.change,
                self.change - (ratio * d_lever)[:, :, None] * self.position,
            )
        ]
        by_eta = [{RATIO: -m.lever}]
        if self.use_gap:
            scale = (np.sqrt(12.0) / travel)[:, :, None]
            blocks.append((none, scale * self.position, scale * m.r_x[:, :, None] * self.position))
            by_eta.append({})
        if self.modes is not None:
            both = self.after + epsilon[:, :, None] * self.before
            turn = m.dr_x * (m.omega_after + epsilon * m.omega_before)
            blocks.append((none, both, m.r_x[:, :, None] * both + turn[:, :, None] * self.position))
            by_eta.append({EPSILON: m.v_n_before})
            slides = self.modes != STICK
            stick_turn = -m.r_y[:, :, None] * self.after - (m.r_x * m.omega_after)[:, :, None] * self.position
            blocks.append(
                (
                    np.where(slides[:, :, None], self.change, self.after),
                    np.where(slides[:, :, None], -(self.modes * mu)[:, :, None] * self.change, 0.0),
                    np.where(slides[:, :, None], 0.0, stick_turn),
                )
            )
            by_eta.append({MU: np.where(slides, -self.modes * m.dv_y, 0.0)})
        G = np.concatenate([np.stack(block, axis=2) for block in blocks], axis=1)
        G_eta = np.zeros((self.B, len(blocks), self.J, 3))
        for i, columns in enumerate(by_eta):
            for column, value in columns.items():
                G_eta[:, i, :, column] = value
        return G, G_eta.reshape(self.B, -1, 3)

    @property
    def variance(self) -> np.ndarray:
        """Variance (n_g,) of the rows: 0 for equations, 1 for (3)."""
        blocks = [0.0] + [1.0] * self.use_gap + [0.0, 0.0] * (self.modes is not None)
        return np.repeat(blocks, self.J)

    def start(self) -> np.ndarray:
        """Starting η (B, 3): m/I by least squares on (1), ε as median over impacts, μ as largest |Δv_x| / Δv_y."""
        m = self.motion(self.s.u)
        square = (m.lever**2).sum(axis=1)
        ratio = (m.lever * m.d_omega).sum(axis=1) / np.where(square > 0, square, 1.0)
        v_n = m.v_n_before
        change = m.dv_y + m.r_x * m.d_omega
        epsilon = np.median(np.clip(-change / np.where(v_n < 0, v_n, -1.0) - 1.0, 0.0, 1.0), axis=1)
        mu = np.clip(np.abs(m.dv_x) / np.maximum(m.dv_y, 0.1), 0.0, 2.0).max(axis=1)
        return np.stack([ratio, epsilon, mu], axis=1)


def _apply(linear: np.ndarray, channel: np.ndarray) -> np.ndarray:
    """Apply a linear map (B, J, 2+J) of `ArcModel` to one channel (B, 2+J) of u."""
    return np.einsum("bji,bi->bj", linear, channel)
