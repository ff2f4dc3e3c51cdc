"""Solids as Minkowski sums, and one of their contact points for each of n bodies.

Every solid here is the convex hull of equal ellipsoids about centres u_i, swept by a ball of radius ρ.  So the points
with which it may touch a level surface are, at the attitude R and with n the normal,

    r_i = R (u_i + s(−Rᵀ n)) − ρ n,    s(d) = A d / √(dᵀ A d),    A = diag(a², b², c²).

| solid             | u_i                       | A            | ρ                  |
|-------------------|---------------------------|--------------|--------------------|
| sphere            | its centre                | 0            | its radius         |
| ellipsoid         | its centre                | of its axes  | 0                  |
| box, hull         | corners, moved in by ρ    | 0            | edge radius        |
| cylinder          | middles of its ends       | a disk's     | edge radius        |
| capsule           | centres of its caps       | 0            | its radius         |
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from thesis_lib.mechanics.space import SPACE


class MinkowskiSum(NamedTuple):
    """Centres u (3, p) in m, squares (3,) in m² of the semi-axes of the ellipsoid, and the radius of the ball in m."""

    centres: np.ndarray
    squares: np.ndarray
    radius: float

    def support(self, direction: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Point (3, n) that lies farthest along `direction` (3, n) of the part about the centre `index` (n,)."""
        stretched = self.squares[:, None] * direction
        length = np.sqrt((direction * stretched).sum(axis=0))
        rolled = np.divide(stretched, length, out=np.zeros_like(stretched), where=length > 0.0)
        unit = direction / np.sqrt((direction * direction).sum(axis=0))
        return self.centres[:, index] + rolled + self.radius * unit

    def heights(self, attitude: np.ndarray) -> np.ndarray:
        """Heights (p, n) in m of all points above the body's origin, at attitudes (4, n)."""
        up = SPACE.turned_back(attitude, np.array([[0.0], [0.0], [1.0]]))
        return self.centres.T @ up - np.sqrt(self.squares @ (up * up)) - self.radius


class SupportPoint:
    """One contact point of a solid for each of n bodies, as a shape of its own: `index` (n,) of its centre."""

    def __init__(self, solid: Any, index: np.ndarray) -> None:
        self.solid, self.kind, self.index = solid, solid.kind, index

    def nearest(self, solid: Any, rows: np.ndarray) -> "SupportPoint":
        """Of the bodies at `rows` the points of a similar solid whose centres are the nearest."""
        own, other = self.solid.minkowski.centres, solid.minkowski.centres
        nearest = ((own[:, :, None] - other[:, None]) ** 2).sum(axis=0).argmin(axis=1)
        return SupportPoint(solid, nearest[self.index[rows]])

    def lowest(self, attitude: np.ndarray) -> np.ndarray:
        """The point (3, n) in m from the body's origin, in axes of the world, at attitudes (4, n)."""
        parts = self.solid.minkowski
        if parts.squares.any():
            down = SPACE.turned_back(attitude, np.array([[0.0], [0.0], [-1.0]]))
            return SPACE.turned(attitude, parts.support(down, self.index))
        point = SPACE.turned(attitude, self._centres)
        point[2] -= parts.radius
        return point

    @cached_property
    def _centres(self) -> np.ndarray:
        return self.solid.minkowski.centres[:, self.index]
