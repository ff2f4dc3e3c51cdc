"""Solids as Minkowski sums, and one chosen contact point of a solid for each of n bodies.

Every solid here is the convex hull of equal ellipsoids about centres u_i, swept by a ball of radius ρ.  The points with
which it may touch a level surface are therefore, at the attitude R and with the normal n,

    r_i = R (u_i + s(−Rᵀ n)) − ρ n,    s(d) = A d / √(dᵀ A d),    A = diag(a², b², c²).

| solid             | u_i                       | A            | ρ                  |
|-------------------|---------------------------|--------------|--------------------|
| sphere            | its centre                | 0            | its radius         |
| ellipsoid         | its centre                | of its axes  | 0                  |
| box, hull         | corners, moved in by ρ    | 0            | edge radius        |
| cylinder          | middles of its ends       | a disk's     | edge radius        |
| capsule           | centres of its caps       | 0            | its radius         |
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from thesis_lib.mechanics.space import SPACE

LEVEL = 1e-12  # of a unit direction, or of the extent: smaller differences are rounding, and points equally far
BLOCK = 2**22  # vertices times directions that are compared at once: 32 MiB


@dataclass(frozen=True, eq=False)
class MinkowskiSum:
    """Centres u (3, p) in m, squares (3,) in m² of the semi-axes of the ellipsoid, and the radius of the ball in m."""

    centres: np.ndarray
    squares: np.ndarray
    radius: float

    def support(self, direction: np.ndarray, index: np.ndarray | None = None) -> np.ndarray:
        """Point (3, n) that lies farthest along `direction` (3, n); with `index` (n,) of the part about that centre."""
        unit = direction / np.sqrt((direction * direction).sum(axis=0))
        point = (farthest(self.centres, unit) if index is None else self.centres[:, index]) + self.radius * unit
        if not self.squares.any():
            return point
        stretched = self.squares[:, None] * unit
        length = np.sqrt((unit * stretched).sum(axis=0))
        # the middle of a disk that lies level
        rolls = length > LEVEL * np.sqrt(self.squares.max())
        return point + np.divide(stretched, length, out=np.zeros_like(stretched), where=rolls)

    @property
    def extent(self) -> float:
        """Largest distance in m of a point from the origin, if a longest semi-axis is perpendicular to each u_i."""
        return float(np.sqrt((self.centres**2).sum(axis=0).max() + self.squares.max()) + self.radius)

    def heights(self, attitude: np.ndarray) -> np.ndarray:
        """Heights (p, n) in m of all possible contact points above the body's origin, at attitudes (4, n)."""
        up = SPACE.turned_back(attitude, np.array([[0.0], [0.0], [1.0]]))
        return self.centres.T @ up - np.sqrt(self.squares @ (up * up)) - self.radius


class SupportPoint:
    """One contact point of a solid for each of n bodies, used like a shape; `index` (n,) of its centre."""

    def __init__(self, solid: Any, index: np.ndarray) -> None:
        self.solid, self.kind, self.index = solid, solid.kind, index

    def nearest(self, solid: Any, rows: np.ndarray) -> "SupportPoint":
        """For the bodies at `rows`, the points of a similar solid with the nearest centres."""
        return SupportPoint(solid, _nearest(self.solid, solid)[self.index[rows]])

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


@lru_cache(maxsize=64)
def _nearest(solid: Any, other: Any) -> np.ndarray:
    """Index (p,) of the nearest centre of another solid, for each centre of a solid."""
    own, there = solid.minkowski.centres, other.minkowski.centres
    return ((own[:, :, None] - there[:, None]) ** 2).sum(axis=0).argmin(axis=1)


def farthest(points: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Those (3, n) of `points` (3, k) that lie farthest along unit vectors (3, n); the mean of equally far points."""
    if points.shape[1] == 1:
        return points
    if (block := max(1, BLOCK // points.shape[1])) < direction.shape[1]:
        parts = [farthest(points, direction[:, i : i + block]) for i in range(0, direction.shape[1], block)]
        return np.concatenate(parts, axis=1)
    along = points.T @ direction
    first = along.max(axis=0)
    equal = along >= first - LEVEL * np.abs(points).max()
    if np.count_nonzero(equal) == len(first):  # no two lie equally far
        return points[:, equal.argmax(axis=0)]
    return (points @ equal) / equal.sum(axis=0)
