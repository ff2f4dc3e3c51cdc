"""Convex planar shapes and the point with which they touch a level surface (thesis section 3.3, figure 3-1).

| on paper | in code     | unit | shape  |                                                                   |
|----------|-------------|------|--------|-------------------------------------------------------------------|
| θ        | `theta`     | rad  | (n,)   | body angle, counter-clockwise                                     |
| r        | `r`         | m    | (n, 2) | contact point from the body origin, in the axes of the surface    |
| φ_n      | `phi_n`     | m    | (n,)   | gap between body and surface                                      |
| k        | `k_g`       | m    |        | radius of gyration                                                |

The body origin is the believed centre of mass.  Shapes are sections of dataset.yaml; their methods take n angles at
once.
"""

from functools import cached_property, lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.foundation.settings import Section

Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Coordinate = Annotated[float, Field(allow_inf_nan=False)]


class _Shape(Section):
    def contact_point(self, theta: np.ndarray) -> np.ndarray:
        """Lowest point of the body turned by `theta` (n,), from the body origin: r (n, 2) in m."""
        raise NotImplementedError

    def lowest(self, attitude: np.ndarray) -> np.ndarray:
        """As `contact_point`, components first: (2, n) in m at angles (1, n) in rad."""
        return self.contact_point(attitude[0]).T

    def outline(self, points: int = 180) -> np.ndarray:
        """Closed outline in the body frame, (points, 2) in m, for drawing."""
        raise NotImplementedError

    @property
    def radius_of_gyration(self) -> float:
        """Radius of gyration in m of the uniform lamina of this shape about its centroid."""
        raise NotImplementedError

    @property
    def centroid(self) -> np.ndarray:
        """Centroid (2,) in m of the area, from the body origin."""
        return np.zeros(2)

    @property
    def extent(self) -> float:
        """Largest distance in m of the outline from the body origin."""
        return float(np.max(np.linalg.norm(self.outline(), axis=1)))

    def gap(self, y: np.ndarray, theta: np.ndarray, height: float = 0.0) -> np.ndarray:
        """Gap φ_n (n,) in m between the body with origin at height `y` and the surface at `height`."""
        return np.asarray(y) + self.contact_point(theta)[..., 1] - height

    def lying(self, theta: np.ndarray) -> np.ndarray:
        """The nearest angle (n,) in rad to `theta` (n,) at which the body lies still on a level surface."""
        raise NotImplementedError


class Ellipse(_Shape):
    """Ellipse with semi-axes (a, b) in m along body x and y."""

    kind: Literal["ellipse"] = "ellipse"
    semi_axes: tuple[Length, Length]

    def contact_point(self, theta: np.ndarray) -> np.ndarray:
        a2, b2 = (axis**2 for axis in self.semi_axes)
        sin, cos = np.sin(theta), np.cos(theta)
        # support point towards n = (0, -1): r = R A R' n / sqrt(n' R A R' n), A = diag(a², b²)
        h = np.sqrt(a2 * sin**2 + b2 * cos**2)
        r = np.empty((*h.shape, 2))
        r[..., 0], r[..., 1] = -(a2 - b2) * sin * cos / h, -h
        return r

    def gap(self, y: np.ndarray, theta: np.ndarray, height: float = 0.0) -> np.ndarray:
        a2, b2 = (axis**2 for axis in self.semi_axes)
        return np.asarray(y) - np.sqrt(a2 * np.sin(theta) ** 2 + b2 * np.cos(theta) ** 2) - height

    def outline(self, points: int = 180) -> np.ndarray:
        angle = np.linspace(0.0, 2.0 * np.pi, points)
        return np.stack([self.semi_axes[0] * np.cos(angle), self.semi_axes[1] * np.sin(angle)], axis=-1)

    @property
    def radius_of_gyration(self) -> float:
        return float(np.hypot(*self.semi_axes) / 2.0)

    def lying(self, theta: np.ndarray) -> np.ndarray:
        a, b = self.semi_axes
        return _nearest(theta, np.array([0.0 if b <= a else 0.5 * np.pi]), np.pi)


class Disk(_Shape):
    """Disk of a given radius in m about the body origin."""

    kind: Literal["disk"] = "disk"
    radius: Length

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Semi-axes in m of the disk as an ellipse."""
        return self.radius, self.radius

    def contact_point(self, theta: np.ndarray) -> np.ndarray:
        theta = np.asarray(theta, dtype=float)
        return np.stack([np.zeros_like(theta), np.full_like(theta, -self.radius)], axis=-1)

    def outline(self, points: int = 180) -> np.ndarray:
        angle = np.linspace(0.0, 2.0 * np.pi, points)
        return self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    @property
    def radius_of_gyration(self) -> float:
        return self.radius / np.sqrt(2.0)

    def lying(self, theta: np.ndarray) -> np.ndarray:
        return theta


class Polygon(_Shape):
    """Polygon with vertices in m in the body frame, in either order; its convex hull touches the surface."""

    kind: Literal["polygon"] = "polygon"
    vertices: Annotated[tuple[tuple[Coordinate, Coordinate], ...], Field(min_length=3, max_length=1000)]

    @model_validator(mode="after")
    def _has_area(self) -> "Polygon":
        if abs(self._cross().sum() / 2.0) < 1e-12:
            raise ValueError("the polygon has no area: its vertices lie on a line or cross each other")
        return self

    @property
    def corners(self) -> np.ndarray:
        """Corners of the convex hull (k, 2) in m, counter-clockwise, without points on its sides."""
        return _hull(self.vertices)

    def gaps(self, y: np.ndarray, theta: np.ndarray, height: float = 0.0) -> np.ndarray:
        """Gap (k, n) in m of each corner; arguments as in `gap`."""
        x, across = self.corners.T[:, :, None]
        return y + (np.sin(theta) * x + np.cos(theta) * across) - height

    def _cross(self) -> np.ndarray:
        """Cross product of each vertex with the next (k,) in m²; half their sum is the signed area."""
        p = np.array(self.vertices)
        q = np.roll(p, -1, axis=0)
        return p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]

    def contact_point(self, theta: np.ndarray) -> np.ndarray:
        theta = np.asarray(theta, dtype=float)
        vertices, sin, cos = np.array(self.vertices), np.sin(theta), np.cos(theta)
        height = np.multiply.outer(vertices[:, 0], sin) + np.multiply.outer(vertices[:, 1], cos)
        x, y = np.moveaxis(vertices[np.argmin(height, axis=0)], -1, 0)
        r = np.empty((*x.shape, 2))
        r[..., 0], r[..., 1] = cos * x - sin * y, sin * x + cos * y
        return r

    def outline(self, points: int = 180) -> np.ndarray:
        return np.array([*self.vertices, self.vertices[0]])

    @property
    def centroid(self) -> np.ndarray:
        p, cross = np.array(self.vertices), self._cross()
        return ((p + np.roll(p, -1, axis=0)) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())

    @property
    def radius_of_gyration(self) -> float:
        p, centroid = np.array(self.vertices), self.centroid
        q, cross = np.roll(p, -1, axis=0), self._cross()
        area = cross.sum() / 2.0
        # polar second moment of area about the origin, moved to the centroid (parallel axes)
        polar = (cross * ((p * p).sum(1) + (p * q).sum(1) + (q * q).sum(1))).sum() / 12.0
        return float(np.sqrt(polar / area - centroid @ centroid))

    def lying(self, theta: np.ndarray) -> np.ndarray:
        """Nearest angle at which a side of the convex hull is down, with the origin (the centre of mass) above it."""
        corners = self.corners
        along = np.roll(corners, -1, axis=0) - corners
        share = -np.sum(corners * along, axis=1) / np.sum(along**2, axis=1)  # of the side, where the origin is above it
        sides = -np.arctan2(along[:, 1], along[:, 0])[(share > 0.0) & (share < 1.0)]
        return _nearest(theta, sides, 2.0 * np.pi)


class Corner:
    """One corner of a polygon for each of n bodies, used like a shape: `index` (n,) into `polygon.corners`.

    If `index` is a number of bodies, all corners are used: the first corner of all bodies, then the second, and so on;
    the angles of the bodies repeat for each corner.
    """

    def __init__(self, polygon: Polygon, index: np.ndarray | int) -> None:
        self.polygon, self.kind = polygon, polygon.kind
        # x and y (n,), or (k, 1) for k corners of each body
        if isinstance(index, int):
            self._corners, self._bodies = polygon.corners.T[:, :, None], index
        else:
            self._corners, self._bodies, self.index = polygon.corners[index].T, len(index), index
        self._theta: np.ndarray | None = None
        self._key: tuple = ()
        self._cos = self._sin = self._turned = np.empty(0)

    @cached_property
    def index(self) -> np.ndarray:
        """Corner (n,) of each body."""
        return np.repeat(np.arange(len(self.polygon.corners)), self._bodies)

    def contact_point(self, theta: np.ndarray) -> np.ndarray:
        """Contact point r (n, 2) in m from the body origin: the chosen corner of the body turned by `theta` (n,)."""
        self._turn(theta)
        return self._turned

    def lowest(self, attitude: np.ndarray) -> np.ndarray:
        """As `contact_point`, components first: (2, n) in m at angles (1, n) in rad."""
        return self.contact_point(attitude[0]).T

    def turned(self, points: np.ndarray, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x and y (n,) of a point that belongs to the corner, turned by `theta` (n,); `points` (k, 2) by corner."""
        self._turn(theta)
        x, y = points.T[:, :, None] if self._corners.ndim == 3 else points[self.index].T
        return (self._cos * x - self._sin * y).ravel(), (self._sin * x + self._cos * y).ravel()

    def _turn(self, theta: np.ndarray) -> None:
        where = theta.__array_interface__
        key = where["data"], where["strides"], theta.shape
        # a prediction uses the same angles again; as `_theta` is kept, no other array has their address
        if self._key == key:
            return
        (x, y), cos, sin = self._corners, np.cos(theta[: self._bodies]), np.sin(theta[: self._bodies])
        self._turned = np.array(((cos * x - sin * y).ravel(), (sin * x + cos * y).ravel())).T
        self._theta, self._key, self._cos, self._sin = theta, key, cos, sin

    def gap(self, y: np.ndarray, theta: np.ndarray, height: float = 0.0) -> np.ndarray:
        """Distance (n,) in m of the corner above the surface at `height`."""
        return y + self.contact_point(theta)[:, 1] - height


def _nearest(theta: np.ndarray, angles: np.ndarray, turn: float) -> np.ndarray:
    """Angles (n,) nearest to `theta` (n,) among `angles` (k,), which repeat after a `turn`; all in rad."""
    off = np.remainder(np.subtract.outer(theta, angles) + 0.5 * turn, turn) - 0.5 * turn
    return theta - off[np.arange(len(theta)), np.abs(off).argmin(axis=1)]


@lru_cache(maxsize=32)
def _hull(vertices: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Corners of the convex hull, counter-clockwise from the leftmost one, the lowest of these."""
    from scipy.spatial import ConvexHull

    corners = np.array(vertices)[ConvexHull(np.array(vertices)).vertices]
    return np.roll(corners, -np.lexsort(corners.T[::-1])[0], axis=0)


Shape = Annotated[Ellipse | Disk | Polygon, Field(discriminator="kind")]
