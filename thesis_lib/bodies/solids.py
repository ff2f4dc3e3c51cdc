"""Convex solids in space, described by support functions, and the point with which they touch a surface.

| on paper | in code       | unit | shape   |                                                                       |
|----------|---------------|------|---------|-----------------------------------------------------------------------|
| d        | `direction`   | 1    | (3, n)  | direction in axes of the body, of any length above 0                  |
| s(d)     | `support(d)`  | m    | (3, n)  | point of the solid that lies farthest along d, in axes of the body    |
| ρ        | `edge_radius` | m    |         | radius of all edges and corners                                       |
| q        | `attitude`    | 1    | (4, n)  | unit quaternion, scalar first, axes of the body into those of the world |
| G        | `inertia_per_mass` | m² | (3, 3) | ∫ (|r|² 1 − r rᵀ) dm / m about the centre of mass, axes of the body |

Solids are centred on the body's origin (a hull keeps the origin of its vertices).  An edge radius rounds *inside* the
stated measures: the solid is the sharp one moved in by ρ, then swept by a ball of radius ρ,

    s(d) = s_in(d) + ρ d / |d|,

so that the half extents of a box are those that a caliper gives.  If a whole edge or face lies farthest, the support is
its middle; mirrored solids then touch in mirrored points.  Volume, centre of mass and inertia are those of the
homogeneous solid with sharp edges.
"""

from dataclasses import replace
from functools import cached_property
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.bodies.minkowski import LEVEL, MinkowskiSum
from thesis_lib.bodies.moments import Moments, moments_within
from thesis_lib.bodies.shapes import Coordinate, Length
from thesis_lib.foundation.settings import Section
from thesis_lib.mechanics.space import SPACE

UP = np.array([[0.0], [0.0], [1.0]])
LEVELLED = 4e-3  # m above the lowest corner, within which another corner counts as hitting with it
CONTACT_KINDS = ("corner", "edge", "face")


class Solid(Section):
    """A convex body in space."""

    def support(self, direction: np.ndarray) -> np.ndarray:
        """Point (3, n) in m that lies farthest along `direction` (3, n), both in axes of the body."""
        return self.minkowski.support(direction)

    @property
    def moments(self) -> Moments:
        """Volume, centre of mass and inertia per mass of the homogeneous solid with sharp edges."""
        raise NotImplementedError

    @property
    def minkowski(self) -> MinkowskiSum:
        """The solid as a Minkowski sum, which gives its possible contact points and its extent."""
        raise NotImplementedError

    @property
    def extent(self) -> float:
        """Largest distance in m of a point of the solid from the body's origin."""
        return self.minkowski.extent

    def about(self, point: np.ndarray) -> "Solid":
        """The same solid with its origin at `point` (3,) in m."""
        return Recentred(solid=self, origin=tuple(point.tolist())) if point.any() else self

    @property
    def corners(self) -> np.ndarray:
        """Corners (3, k) in m of the solid with sharp edges; a smooth solid has none."""
        return np.empty((3, 0))

    @property
    def faces(self) -> np.ndarray:
        """Unit normals (k, 3) of the flat faces; for a primitive, its axes in both directions."""
        return np.concatenate([np.eye(3), -np.eye(3)])

    def scaled(self, factor: float) -> "Solid":
        """The similar solid with all lengths times `factor`."""
        return type(self)(**{name: _times(value, factor) for name, value in self.model_dump().items()})

    def lowest(self, attitude: np.ndarray, up: np.ndarray = UP) -> np.ndarray:
        """Lowest point (3, n) in m from the body's origin, in axes of the world.

        Args:
            attitude: (4, n) unit quaternions.
            up: (3, n) or (3, 1) normal of the surface, in axes of the world.
        """
        return SPACE.turned(attitude, self.support(SPACE.turned_back(attitude, -up)))


class Sphere(Solid):
    """Sphere about the body's origin."""

    kind: Literal["sphere"] = "sphere"
    radius: Length = Field(description="m")

    @property
    def minkowski(self) -> MinkowskiSum:
        return MinkowskiSum(np.zeros((3, 1)), np.zeros(3), self.radius)

    @property
    def moments(self) -> Moments:
        return _central(4.0 / 3.0 * np.pi * self.radius**3, np.full(3, 0.4 * self.radius**2))


class Ellipsoid(Solid):
    """Ellipsoid with semi-axes along the axes of the body."""

    kind: Literal["ellipsoid"] = "ellipsoid"
    semi_axes: tuple[Length, Length, Length] = Field(description="m, along x, y, z")

    @property
    def minkowski(self) -> MinkowskiSum:
        return MinkowskiSum(np.zeros((3, 1)), np.square(self.semi_axes), 0.0)

    @property
    def moments(self) -> Moments:
        squares = np.square(self.semi_axes)
        return _central(4.0 / 3.0 * np.pi * float(np.prod(self.semi_axes)), 0.2 * (squares.sum() - squares))


class Capsule(Solid):
    """Cylinder along z with a half ball at each end."""

    kind: Literal["capsule"] = "capsule"
    radius: Length = Field(description="m")
    half_length: Length = Field(description="m, of the cylinder without its caps")

    @property
    def minkowski(self) -> MinkowskiSum:
        return MinkowskiSum(_ends(self.half_length), np.zeros(3), self.radius)

    @property
    def moments(self) -> Moments:
        R, h = self.radius, self.half_length
        tube, ball = 2.0 * np.pi * R**2 * h, 4.0 / 3.0 * np.pi * R**3
        # a half ball's centre of mass lies 3 R / 8 from its flat side
        across = tube * (R**2 / 4.0 + h**2 / 3.0) + ball * (0.4 * R**2 + h**2 + 0.75 * h * R)
        along = tube * R**2 / 2.0 + ball * 0.4 * R**2
        return _central(tube + ball, np.array([across, across, along]) / (tube + ball))


class Edged(Solid):
    """A solid whose edges and corners may be rounded."""

    edge_radius: Annotated[float, Field(ge=0, allow_inf_nan=False)] = Field(0.0, description="m, of all edges")

    def rounded(self, edge_radius: float) -> "Edged":
        """The same solid with another edge radius in m, within the same outer dimensions."""
        return type(self)(**{**self.model_dump(), "edge_radius": edge_radius})

    @model_validator(mode="after")
    def _has_room_for_its_edges(self) -> "Edged":
        if self.edge_radius and self.edge_radius > self.inradius:
            raise ValueError(f"edge_radius is larger than the solid allows, at most {self.inradius:.4g} m")
        return self

    @property
    def inradius(self) -> float:
        """Radius in m of the largest ball inside."""
        raise NotImplementedError


class Box(Edged):
    """Box with faces across the axes of the body."""

    kind: Literal["box"] = "box"
    half_extents: tuple[Length, Length, Length] = Field(description="m, along x, y, z")

    @cached_property
    def minkowski(self) -> MinkowskiSum:
        inner = np.sign(self.corners) * (np.array(self.half_extents) - self.edge_radius)[:, None]
        return MinkowskiSum(inner, np.zeros(3), self.edge_radius)

    @property
    def moments(self) -> Moments:
        squares = np.square(self.half_extents)
        return _central(8.0 * float(np.prod(self.half_extents)), (squares.sum() - squares) / 3.0)

    @property
    def inradius(self) -> float:
        return min(self.half_extents)

    @property
    def corners(self) -> np.ndarray:
        signs = np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0], indexing="ij")).reshape(3, 8)
        return np.array(self.half_extents)[:, None] * signs


class Cylinder(Edged):
    """Cylinder along z with flat ends."""

    kind: Literal["cylinder"] = "cylinder"
    radius: Length = Field(description="m")
    half_length: Length = Field(description="m")

    @cached_property
    def minkowski(self) -> MinkowskiSum:
        squares = np.array([1.0, 1.0, 0.0]) * (self.radius - self.edge_radius) ** 2
        return MinkowskiSum(_ends(self.half_length - self.edge_radius), squares, self.edge_radius)

    @property
    def moments(self) -> Moments:
        R, h = self.radius, self.half_length
        across = R**2 / 4.0 + h**2 / 3.0
        return _central(2.0 * np.pi * R**2 * h, np.array([across, across, R**2 / 2.0]))

    @property
    def inradius(self) -> float:
        return min(self.radius, self.half_length)


class Hull(Edged):
    """Convex hull of vertices; points inside it have no effect."""

    kind: Literal["hull"] = "hull"
    vertices: Annotated[tuple[tuple[Coordinate, Coordinate, Coordinate], ...], Field(min_length=4)] = Field(
        description="m, in axes of the body"
    )

    @cached_property
    def _hull(self):
        """The hull by qhull; `equations` (f, 4) are outward unit normals, and offsets, of its triangles."""
        from scipy.spatial import ConvexHull, QhullError  # takes half a second, not needed for planar data

        points = np.array(self.vertices)
        if np.ptp(points, axis=0).min() == 0.0:
            raise ValueError("the vertices lie in a plane: the solid has no volume")
        try:
            return ConvexHull(points)
        except QhullError:
            raise ValueError("the vertices lie in a plane: the solid has no volume") from None

    @cached_property
    def _planes(self) -> np.ndarray:
        """Planes (f, 4) of the faces, each once: outward unit normal, and offset."""
        return _distinct(self._hull.equations)

    @property
    def corners(self) -> np.ndarray:
        return self._hull.points[self._hull.vertices].T

    @property
    def faces(self) -> np.ndarray:
        return self._planes[:, :3]

    @cached_property
    def inradius(self) -> float:
        return self._ball[1]

    @cached_property
    def _ball(self) -> tuple[np.ndarray, float]:
        """Centre (3,) and radius in m of the largest ball inside: the linear program of Chebyshev's centre."""
        from scipy.optimize import linprog

        planes = self._planes
        found = linprog(
            [0.0, 0.0, 0.0, -1.0],
            A_ub=np.column_stack([planes[:, :3], np.ones(len(planes))]),
            b_ub=-planes[:, 3],
            bounds=[(None, None)] * 3 + [(0.0, None)],
        )
        return found.x[:3], float(found.x[3])

    @cached_property
    def _inner(self) -> np.ndarray:
        """Corners (3, k) in m of the inner hull, whose faces are moved inwards by the edge radius ρ."""
        if not self.edge_radius:
            return self.corners
        from scipy.spatial import HalfspaceIntersection

        centre, radius = self._ball
        if self.edge_radius > radius * (1.0 - 1e-9):  # nothing but the centre of the ball is left
            return centre[:, None]
        planes = self._planes + [0.0, 0.0, 0.0, self.edge_radius]
        return _distinct(HalfspaceIntersection(planes, centre).intersections).T

    @cached_property
    def minkowski(self) -> MinkowskiSum:
        return MinkowskiSum(self._inner, np.zeros(3), self.edge_radius)

    @cached_property
    def moments(self) -> Moments:
        hull = self._hull
        triangles = hull.points[hull.simplices]
        # qhull does not order the corners of a triangle: turn those whose normal points in
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        inwards = np.einsum("fi,fi->f", normal, hull.equations[:, :3]) < 0.0
        triangles[inwards] = triangles[inwards][:, ::-1]
        return moments_within(triangles)

    @model_validator(mode="after")
    def _has_volume(self) -> "Hull":
        _ = self._hull
        return self


class Recentred(Solid):
    """A solid whose origin is another point of the body, such as its centre of mass."""

    kind: Literal["recentred"] = "recentred"
    solid: Solid
    origin: tuple[Coordinate, Coordinate, Coordinate] = Field(description="m, in the frame of the solid")

    def rounded(self, edge_radius: float) -> "Recentred":
        """The same solid with another edge radius in m; AttributeError if it has no edges."""
        return Recentred(solid=self.solid.rounded(edge_radius), origin=self.origin)  # pyright: ignore[reportAttributeAccessIssue]

    @cached_property
    def minkowski(self) -> MinkowskiSum:
        own = self.solid.minkowski
        return replace(own, centres=own.centres - self._shift)

    @property
    def _shift(self) -> np.ndarray:
        return np.array(self.origin)[:, None]

    @property
    def moments(self) -> Moments:
        own = self.solid.moments
        return own._replace(centre=own.centre - self.origin)

    @property
    def extent(self) -> float:
        """Upper bound in m on the distance of a point of the solid from the origin."""
        if self.corners.size:
            return float(np.linalg.norm(self.corners, axis=0).max())
        return self.solid.extent + float(np.linalg.norm(self.origin))

    @property
    def corners(self) -> np.ndarray:
        return self.solid.corners - self._shift

    @property
    def faces(self) -> np.ndarray:
        return self.solid.faces

    def scaled(self, factor: float) -> "Recentred":
        return Recentred(solid=self.solid.scaled(factor), origin=tuple(factor * np.array(self.origin)))


def contact_kind(solid: Solid, attitude: np.ndarray) -> np.ndarray:
    """Part of the sharp solid that hits a level surface at attitudes (4, n): "corner", "edge", "face", "" if smooth.

    An edge has two corners within `LEVELLED` of the lowest one, a face three or more.
    """
    if not solid.corners.size:
        return np.full(attitude.shape[1], "", dtype=object)
    heights = np.stack([SPACE.turned(attitude, corner[:, None])[2] for corner in solid.corners.T])
    low = (heights <= heights.min(axis=0) + LEVELLED).sum(axis=0)
    return np.array(CONTACT_KINDS, dtype=object)[np.minimum(low, 3) - 1]


def _central(volume: float, principal: np.ndarray) -> Moments:
    """Moments of a solid with its centre at the origin and the principal moments (3,) in m² along its axes."""
    return Moments(volume, np.zeros(3), np.diag(principal))


def _ends(half_length: float) -> np.ndarray:
    """The points (3, 2) on the z axis at both ends of a centred solid."""
    return half_length * np.array([[0.0, 0.0], [0.0, 0.0], [1.0, -1.0]])


def _distinct(rows: np.ndarray) -> np.ndarray:
    """Rows that differ by more than rounding."""
    size = np.abs(rows).max()
    return rows[np.unique(np.round(rows / (size * LEVEL)), axis=0, return_index=True)[1]]


def _times(value, factor: float):
    if isinstance(value, str):
        return value
    return tuple(_times(part, factor) for part in value) if isinstance(value, tuple) else factor * value
