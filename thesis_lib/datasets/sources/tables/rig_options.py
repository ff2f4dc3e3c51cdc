"""Body and rig, as given by the options of `datasets init`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from thesis_lib.bodies.mesh import Mesh
from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.bodies.solids import Box, Capsule, Cylinder, Ellipsoid, Solid, Sphere
from thesis_lib.bodies.walls import Wall
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.mistakes import message

GRAVITY = 9.81  # m/s²


@dataclass(frozen=True)
class RigOptions:
    """Assumed properties of body and rig, as given by the options of `datasets init`.

    Mass in kg; k_g in m (default: of a uniform lamina); surface_height in m (default: 0, in space that of the table);
    gravity in m/s² (default: `GRAVITY`, or 0 between walls, which are seen from above); rate in Hz (default: from the
    times).
    `size_uncertainty` (relative, one sigma) declares the body homogeneous and gives the uncertainty of its size.  With
    a shape in space (box, sphere, …, mesh) the motion stays in space; such a body is homogeneous unless its
    `radii_of_gyration` about its axes and `center_of_mass` in m are given.
    """

    shape: Shape | Any
    mass: float | None = None
    k_g: float | None = None
    size_uncertainty: float | None = None
    rate: float | None = None
    gravity: float | None = None
    surface_height: float | None = None
    walls: tuple[Wall, ...] = ()
    radii_of_gyration: tuple[float, ...] | None = None
    center_of_mass: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.walls and self.surface_height:
            raise UserError("--surface-height: between walls (--wall) there is no surface; leave one of the two out.")
        if self.rate is not None and not (np.isfinite(self.rate) and self.rate > 0):
            raise UserError(f"--rate: {self.rate} Hz is impossible; give a number above 0.")
        for name in ("radii_of_gyration", "center_of_mass"):
            if getattr(self, name) is not None and not self.in_space:
                raise UserError(f"--{name.replace('_', '-')} is for shapes in space; for a planar shape give --k-g.")
        if isinstance(self.shape, Mesh) and self.radii_of_gyration is None:
            try:
                _ = self.shape.moments
            except ValueError as error:
                raise UserError(
                    f"--shape: {error}. Repair the mesh, or give measured or assumed values: --center-of-mass X,Y,Z "
                    "and --radii-of-gyration X,Y,Z, in m along the axes of the mesh."
                ) from error

    @property
    def in_space(self) -> bool:
        """Whether the shape is three-dimensional."""
        return not isinstance(self.shape, Ellipse | Disk | Polygon)

    @property
    def radius(self) -> float:
        """Radius of gyration in m."""
        return self.shape.radius_of_gyration if self.k_g is None else self.k_g

    @property
    def g(self) -> float:
        """Gravity in m/s²."""
        return (0.0 if self.walls else GRAVITY) if self.gravity is None else self.gravity


def parse_shape(text: str) -> Shape | Solid | Mesh:
    """The shape of 'ellipse:A,B' | 'disk:R' | 'square:SIDE' | 'rect:W,H' | 'polygon:x1,y1;…' in m, or a shape in space.

    Shapes in space: 'box:X,Y,Z' (edges) | 'sphere:R' | 'ellipsoid:A,B,C' | 'cylinder:R,HEIGHT' | 'capsule:R,HEIGHT'
    (without its caps) | 'mesh:FILE,SCALE'.  UserError for anything else.
    """
    kind, _, rest = text.partition(":")
    try:
        if kind == "mesh":
            name, comma, scale = rest.rpartition(",")
            path, factor = Path(name if comma else scale), float(scale) if comma else 1.0
            return Mesh.model_validate({"file": path.name, "scale": factor}, context={"folder": path.parent})
        points = [tuple(float(value) for value in point.split(",")) for point in rest.split(";")]
        if kind == "ellipse":
            return Ellipse(semi_axes=points[0])  # pyright: ignore[reportArgumentType]
        if kind == "disk":
            return Disk(radius=points[0][0])
        if kind in ("square", "rect"):
            width, height = points[0] * 2 if kind == "square" else points[0]
            w, h = width / 2.0, height / 2.0
            return Polygon(vertices=((w, h), (-w, h), (-w, -h), (w, -h)))
        if kind == "box":
            return Box(half_extents=tuple(0.5 * edge for edge in points[0]))  # pyright: ignore[reportArgumentType]
        if kind == "sphere":
            return Sphere(radius=points[0][0])
        if kind == "ellipsoid":
            return Ellipsoid(semi_axes=points[0])  # pyright: ignore[reportArgumentType]
        if kind in ("cylinder", "capsule"):
            radius, length = points[0]
            return (Cylinder if kind == "cylinder" else Capsule)(radius=radius, half_length=0.5 * length)
        if kind == "polygon":
            return Polygon(vertices=tuple(points))  # pyright: ignore[reportArgumentType]
    except (ValueError, ValidationError) as error:
        reason = message(error.errors()[0]) if isinstance(error, ValidationError) else str(error)
        raise UserError(f"--shape: '{text}' is not a shape ({reason}).") from error
    known = "ellipse:A,B (semi-axes), disk:R, square:SIDE, rect:WIDTH,HEIGHT, polygon:x1,y1;x2,y2;… or, in space, "
    known += "box:X,Y,Z, sphere:R, ellipsoid:A,B,C, cylinder:R,HEIGHT, capsule:R,HEIGHT, mesh:FILE,SCALE"
    raise UserError(f"--shape: '{kind}' is unknown; give {known} in m.")


def parse_wall(text: str) -> Wall:
    """'NAME:X,Y,NX,NY' -> the wall through X, Y (m) with the normal NX, NY; UserError for anything else."""
    name, _, rest = text.partition(":")
    try:
        x, y, nx, ny = (float(value) for value in rest.split(","))
        return Wall(name=name.strip(), point=(x, y), normal=(nx, ny))
    except (ValueError, ValidationError) as error:
        reason = message(error.errors()[0]) if isinstance(error, ValidationError) else str(error)
        raise UserError(
            f"--wall: '{text}' is not NAME:X,Y,NX,NY, a lower-case name, a point of the wall in m, and its "
            f"normal towards the body ({reason}); for example east:0.6,0,-1,0."
        ) from error


def needs_no_angle(shape: Shape | Any, where: str) -> None:
    """UserError if a recording without an angle is of a shape that needs one."""
    if not isinstance(shape, Disk | Sphere):
        raise UserError(
            f"{where}: it has no angle of the body (no theta, no orientation), and only a round body can do without: "
            "give --shape disk:RADIUS (or sphere:RADIUS), or name the columns of the angle (--columns theta=NAME, "
            "--quaternion)."
        )
