"""A rig in space as stated by its owner: the body, its tracked frame, the surfaces, the noise.

| on paper | in code                      | unit | shape  | axes                                                    |
|----------|------------------------------|------|--------|---------------------------------------------------------|
| S        |                              |      |        | frame of the shape, which is that of the body           |
| T        | `tracked`                    |      |        | frame that the camera reports; its pose in S            |
| W        |                              |      |        | world: axes of the recording, any direction up          |
| G        | `inertia_per_mass`           | m²   | (3, 3) | S: ∫ (|r|² 1 − r rᵀ) dm / m about the centre of mass    |
| c        | `centre`                     | m    | (3,)   | S: believed centre of mass                              |

xy, xz and yz are elements of the tensor, −∫ x y dm and so on, as in URDF, SDF and MuJoCo's fullinertia.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from thesis_lib.bodies.body import Positive, Relative
from thesis_lib.bodies.mesh import Mesh
from thesis_lib.bodies.moments import Moments
from thesis_lib.bodies.shapes import Coordinate, Length
from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Solid, Sphere
from thesis_lib.bodies.walls import FARTHEST, SurfaceName
from thesis_lib.foundation.settings import Section

UNIT = 0.02  # by which the length of a quaternion may differ from 1: files have three digits or more
ROUNDED = 1e-3  # relative; numbers in dataset.yaml may have three digits
OFF_SURFACE = 0.01  # of its size, by which corners of an extent may lie off the surface

Vector = tuple[Coordinate, Coordinate, Coordinate]
SolidShape = Annotated[Box | Sphere | Ellipsoid | Cylinder | Capsule | Mesh, Field(discriminator="kind")]
# one number stands for all three axes
PerAxis = Annotated[
    tuple[Positive, Positive, Positive],
    BeforeValidator(lambda value: value if isinstance(value, list | tuple | str | dict | None) else (value,) * 3),
]


def direction(vector: Vector) -> np.ndarray:
    """The unit vector (3,) along a vector; ValueError if it has none."""
    length = math.sqrt(sum(part * part for part in vector))
    if not 1e-9 < length < 1e9:
        raise ValueError("the vector has no direction")
    return np.array(vector) / length


class InertiaTensor(Section):
    """Moments of inertia about the centre of mass, along the axes of the shape."""

    xx: Positive = Field(description="kg m²")
    yy: Positive = Field(description="kg m²")
    zz: Positive = Field(description="kg m²")
    xy: Coordinate = Field(0.0, description="kg m², −∫ x y dm")
    xz: Coordinate = Field(0.0, description="kg m², −∫ x z dm")
    yz: Coordinate = Field(0.0, description="kg m², −∫ y z dm")

    @property
    def matrix(self) -> np.ndarray:
        """Inertia tensor (3, 3) in kg m²."""
        return np.array([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])

    @model_validator(mode="after")
    def _is_possible(self) -> "InertiaTensor":
        _require_possible(self.matrix)
        return self


def _require_possible(tensor: np.ndarray) -> None:
    """Raise a ValueError if no body can have this inertia tensor (3, 3)."""
    with np.errstate(over="ignore", invalid="ignore"):
        least, middle, largest = np.linalg.eigvalsh(tensor)
    shown = f"principal moments {least:.4g}, {middle:.4g} and {largest:.4g}"
    if not 0.0 < least < np.inf:
        raise ValueError(f"no body has this inertia: {shown} must all be above 0")
    if largest > (least + middle) * (1.0 + 1e-9):
        raise ValueError(f"no body has this inertia: of {shown} the largest is above the sum of the others")


class SolidUncertainty(Section):
    """Standard uncertainties of properties measured on the body itself, not inferred from drops."""

    mass: Relative | None = Field(None, description="of the mass")
    size: Relative | None = Field(None, description="of the lengths of the shape, as a caliper gives them")
    inertia: Relative | None = Field(None, description="of the inertia about the centre of mass")
    center_of_mass: Positive | None = Field(None, description="m, of the centre of mass, along each axis")


class SolidBody(Section):
    """The object that is dropped, in the frame of its shape."""

    shape: SolidShape
    mass: Positive | None = Field(None, description="kg; needed beside inertia")
    center_of_mass: Vector | None = Field(
        None, description="m, believed; default: the centre of the shape; a mesh needs it, or homogeneous"
    )
    inertia: InertiaTensor | None = Field(None, description="needs the mass; this or one of the next two")
    radii_of_gyration: tuple[Length, Length, Length] | None = Field(
        None, description="m, about axes through the centre of mass that are along the shape's, and principal"
    )
    homogeneous: bool | None = Field(
        None, description="true for uniform density: inertia and centre of mass follow from the sharp-edged shape"
    )
    uncertainty: SolidUncertainty | None = Field(None, description="of the known properties of the body; optional")

    def known(self, what: str) -> float | None:
        """Standard uncertainty of "inertia" or "size" (relative) or "centre of mass" (m); None if it is not known."""
        of = self.uncertainty or SolidUncertainty()
        return {"inertia": of.inertia, "size": of.size, "centre of mass": of.center_of_mass}.get(what)

    @property
    def solid(self) -> Solid:
        """Solid that touches a surface; for a mesh, its convex hull."""
        return self.shape.solid if isinstance(self.shape, Mesh) else self.shape

    @property
    def moments(self) -> Moments:
        """Volume, centre of mass and inertia per mass if the body is homogeneous, with sharp edges."""
        return self.shape.moments

    @property
    def centre(self) -> np.ndarray:
        """Believed centre of mass (3,) in m."""
        if self.homogeneous:
            return self.moments.centre
        return np.array(self.center_of_mass or (0.0, 0.0, 0.0))

    @property
    def inertia_per_mass(self) -> np.ndarray:
        """G (3, 3) in m² about the centre of mass."""
        if self.inertia is not None and self.mass is not None:
            return self.inertia.matrix / self.mass
        if self.radii_of_gyration is not None:
            return np.diag(np.square(self.radii_of_gyration))
        return self.moments.inertia_per_mass

    @property
    def radius_of_gyration(self) -> float:
        """Root of the mean principal moment per mass, m."""
        return float(np.sqrt(np.trace(self.inertia_per_mass) / 3.0))

    @model_validator(mode="after")
    def _is_told_once(self) -> "SolidBody":
        ways = {"inertia": self.inertia, "radii_of_gyration": self.radii_of_gyration, "homogeneous": self.homogeneous}
        given = [name for name, value in ways.items() if value]
        if len(given) != 1:
            found = f"there are {' and '.join(given)}" if given else "there is none"
            raise ValueError(f"exactly one of inertia, radii_of_gyration and homogeneous: true is needed; {found}")
        if self.inertia is not None and self.mass is None:
            raise ValueError("inertia needs the mass; give both, or radii_of_gyration")
        if self.radii_of_gyration is not None:
            _require_possible(self.inertia_per_mass)
        if self.homogeneous:
            off = np.linalg.norm(self.moments.centre - np.array(self.center_of_mass or self.moments.centre))
            if off > ROUNDED * self.solid.extent:
                where = ", ".join(f"{value:.6g}" for value in self.moments.centre)
                raise ValueError(f"center_of_mass contradicts homogeneous: this shape has its centre at [{where}]")
        elif isinstance(self.shape, Mesh) and self.center_of_mass is None:
            raise ValueError("a mesh needs center_of_mass, or homogeneous: true")
        return self


class TrackedUncertainty(Section):
    """One sigma of the pose of the tracked frame."""

    position: Positive | None = Field(None, description="m, along each axis")
    rotation: Positive | None = Field(None, description="rad, each component of a small turn")


class Tracked(Section):
    """Pose of the tracked frame T in the frame of the shape S."""

    position: Vector = Field((0.0, 0.0, 0.0), description="m, origin of T in S")
    quaternion: tuple[Coordinate, Coordinate, Coordinate, Coordinate] = Field(
        (1.0, 0.0, 0.0, 0.0), description="scalar first, turns T's axes into S's"
    )
    uncertainty: TrackedUncertainty | None = Field(None, description="optional")

    @property
    def attitude(self) -> np.ndarray:
        """The quaternion (4,), of length 1."""
        return np.array(self.quaternion) / math.hypot(*self.quaternion)

    @model_validator(mode="after")
    def _turns(self) -> "Tracked":
        if not abs((length := math.hypot(*self.quaternion)) - 1.0) <= UNIT:
            raise ValueError(f"the quaternion has the length {length:.4g}, but those of rotations have 1")
        return self


class FlatSurface(Section):
    """A plane surface; the body is on the side (x − point)·normal ≥ 0."""

    point: Vector = Field((0.0, 0.0, 0.0), description="m, any point of the plane")
    normal: Vector | None = Field(
        None, description="from the surface towards the body, of any length above 0; default: against gravity"
    )

    @model_validator(mode="after")
    def _lies_somewhere(self) -> "FlatSurface":
        if self.normal is not None:
            direction(self.normal)
        if math.hypot(*self.point) > FARTHEST:
            raise ValueError(f"the point is more than {FARTHEST:g} m from the origin: millimetres?")
        return self


class NamedSurface(FlatSurface):
    """One of several plane surfaces, with a name and an optional extent."""

    name: SurfaceName
    point: Vector = Field(description="m, any point of the plane")
    normal: Vector = Field(description="from the surface towards the body, of any length above 0")
    extent: Annotated[tuple[Vector, ...], Field(min_length=3, max_length=1000)] | None = Field(
        None, description="m, corners of a polygon in the plane, beyond which there is no surface; optional"
    )

    @model_validator(mode="after")
    def _extent_lies_in_the_plane(self) -> "NamedSurface":
        if self.extent is not None:
            corners = np.array(self.extent) - self.point
            size = float(np.ptp(corners, axis=0).max())
            if not np.abs(corners @ direction(self.normal)).max() <= OFF_SURFACE * size:
                raise ValueError("extent: its corners do not lie in the plane of point and normal")
        return self


class NoiseInSpace(Section):
    """One-sigma measurement noise."""

    position: PerAxis | None = Field(None, description="m, each x, y and z; one number, or one for each")
    rotation: Positive | None = Field(None, description="rad, each component of a small turn")
    velocity: Positive | None = Field(None, description="m/s, each component (impacts.csv only)")
    angular_velocity: Positive | None = Field(None, description="rad/s, each component (impacts.csv only)")
