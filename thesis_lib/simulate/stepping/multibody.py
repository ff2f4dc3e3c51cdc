"""Mechanisms with planar contact, for time stepping and identification (thesis 2.3.1, 2.4).

    M(q) v̇ + C(q, v) v = g(q) + f_ext + J_n(q)' c_n + J_t(q)' c_t                                     (2.2)

A mechanism provides M, C v, g and, for each of its p contact pairs, the gap φ and the rows J_n = ∂φ/∂q and J_t
(velocity of the contact point along the surface).  For a free body with contact point r from its origin, in the axes of
the surface (2.19, 2.20; equivalent to 2.21 and 2.22 for the ellipse, with the angle β of the contact point):

    φ = y + r_y,      J_n = [0, 1, r_x],      J_t = [1, 0, -r_y]

Each corner, r = R(θ) p, is a pair; a smooth outline has one pair, at its lowest point.  On a surface tilted by α about
the origin, the axes follow the surface and gravity is rotated: g = m g (sin α, -cos α, 0); α > 0 is downhill along +x.

Sources: D. E. Stewart, J. C. Trinkle, Int. J. Numer. Methods Eng. 39 (1996),
doi 10.1002/(SICI)1097-0207(19960815)39:15<2673::AID-NME972>3.0.CO;2-I.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon
from thesis_lib.foundation.errors import UserError


@dataclass(frozen=True)
class ContactGeometry:
    """Gaps and Jacobians of p contact pairs, at one configuration or at n configurations (first axis)."""

    phi: np.ndarray  # (..., p) gaps in m, negative in penetration
    J_n: np.ndarray  # J_n, J_t: (..., p, nv) rows of the normal and tangential contact Jacobian
    J_t: np.ndarray


@dataclass(frozen=True)
class Rod:
    """Thin straight rod of `length` m, centred on the body origin, that touches only with its ends."""

    length: float

    def outline(self, points: int = 2) -> np.ndarray:
        """The two ends in the body frame, (2, 2) in m; `points` is ignored, for compatibility with other shapes."""
        return np.array([[-0.5 * self.length, 0.0], [0.5 * self.length, 0.0]])


class Mechanism(ABC):
    """A planar mechanism with nq = nv coordinates, q̇ = v, and p contact pairs."""

    nv: int
    pairs: tuple[str, ...]  # names of the contact pairs
    constant: bool = False  # whether M and gravity are independent of q and C v = 0 (flight is then a parabola)

    @abstractmethod
    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M (nv, nv) at one configuration q (nq,), in kg, kg m and kg m²."""

    @abstractmethod
    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """C(q, v) v (nv,) at one state, in N and N m."""

    @abstractmethod
    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Generalised force of gravity (nv,) at one configuration, in N and N m."""

    @abstractmethod
    def contacts_of(self, q: np.ndarray) -> ContactGeometry:
        """Gaps and Jacobians at n configurations q (n, nq): phi (n, p), J_n and J_t (n, p, nv)."""

    def contacts(self, q: np.ndarray) -> ContactGeometry:
        """Gaps and Jacobians at one configuration q (nq,): phi (p,), J_n and J_t (p, nv)."""
        out = self.contacts_of(np.asarray(q, dtype=float)[None])
        return ContactGeometry(out.phi[0], out.J_n[0], out.J_t[0])


class PlanarFreeBody(Mechanism):
    """One rigid body over a flat surface, q = (x, y, θ) of its centre of mass in the axes of the surface.

    Polygons have a pair per vertex, rods one per end, ellipse and disk one.  Mass in kg, inertia in kg m² about the
    centre of mass, gravity in m/s²; `tilt` in rad is the surface's slope, downhill along +x if positive.
    `corners` (p, 2) are the points in the body frame that can touch, m; None for a smooth outline.

    Raises:
        UserError: mass, inertia or gravity is not a positive finite number, or the tilt is not finite.
    """

    constant = True
    nv = 3

    def __init__(
        self,
        shape: Polygon | Ellipse | Disk | Rod,
        mass: float,
        inertia: float,
        gravity: float = 9.81,
        tilt: float = 0.0,
    ) -> None:
        require_positive("free body", mass=mass, inertia=inertia)
        if not (0.0 <= gravity < math.inf and math.isfinite(tilt)):
            raise UserError(f"A free body needs gravity >= 0 and a finite tilt; got {gravity} and {tilt}.")
        self.shape, self.mass, self.inertia = shape, float(mass), float(inertia)
        self.g, self.tilt = float(gravity), float(tilt)
        self._M = np.diag([mass, mass, inertia]).astype(float)
        self._gravity = mass * gravity * np.array([math.sin(tilt), -math.cos(tilt), 0.0])
        if isinstance(shape, Polygon | Rod):
            self.corners = np.array(shape.vertices) if isinstance(shape, Polygon) else shape.outline()
            prefix = "vertex" if isinstance(shape, Polygon) else "end"
            self.pairs = tuple(f"{prefix}_{i}" for i in range(len(self.corners)))
        else:
            self.corners, self.pairs = None, ("ground",)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        return self._M

    def bias(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return np.zeros(3)

    def gravity(self, q: np.ndarray) -> np.ndarray:
        return self._gravity

    def contacts(self, q: np.ndarray) -> ContactGeometry:
        # called at every time step: plain floats are several times faster than arrays of length one
        y, theta = float(q[1]), float(q[2])
        sin, cos = math.sin(theta), math.cos(theta)
        if self.corners is not None:
            r_x = cos * self.corners[:, 0] - sin * self.corners[:, 1]
            r_y = sin * self.corners[:, 0] + cos * self.corners[:, 1]
            J_n, J_t = np.zeros((2, len(r_x), 3))
            J_n[:, 1], J_n[:, 2], J_t[:, 0], J_t[:, 2] = 1.0, r_x, 1.0, -r_y
            return ContactGeometry(y + r_y, J_n, J_t)
        if isinstance(self.shape, Ellipse):
            a2, b2 = self.shape.semi_axes[0] ** 2, self.shape.semi_axes[1] ** 2
            depth = math.sqrt(a2 * sin * sin + b2 * cos * cos)
            r_x, r_y = -(a2 - b2) * sin * cos / depth, -depth
        else:
            r_x, r_y = 0.0, -self.shape.radius  # pyright: ignore[reportAttributeAccessIssue]
        return ContactGeometry(np.array([y + r_y]), np.array([[0.0, 1.0, r_x]]), np.array([[1.0, 0.0, -r_y]]))

    def contact_points(self, theta: np.ndarray) -> np.ndarray:
        """Contact points (n, p, 2) in m from the centre of mass at angles `theta` (n,), in the surface's axes."""
        theta = np.asarray(theta, dtype=float)
        if self.corners is None:
            return self.shape.contact_point(theta)[:, None, :]  # pyright: ignore[reportAttributeAccessIssue]
        sin, cos = np.sin(theta)[:, None], np.cos(theta)[:, None]
        x, y = self.corners.T
        return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)

    def contacts_of(self, q: np.ndarray) -> ContactGeometry:
        q = np.asarray(q, dtype=float)
        r = self.contact_points(q[:, 2])
        J_n, J_t = np.zeros((2, *r.shape[:2], 3))
        J_n[..., 1], J_n[..., 2] = 1.0, r[..., 0]
        J_t[..., 0], J_t[..., 2] = 1.0, -r[..., 1]
        return ContactGeometry(q[:, 1, None] + r[..., 1], J_n, J_t)


def require_positive(what: str, **values: float) -> None:
    """Raise a UserError, which names the value, unless all values of `what` are positive and finite."""
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise UserError(f"A {what} needs a positive, finite {name.replace('_', ' ')}; got {value}.")
