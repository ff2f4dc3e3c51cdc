"""The three-dimensional body that corresponds to a planar model.

The plane of the drops is the x-z plane of the body: planar (x, y) is (x, z), θ turns about −y, and the body is `depth`
deep along y.  Drops determine one moment of inertia, m k² about y.  The whole tensor is that of a uniform solid of this
shape and depth, scaled by one factor to give the right moment about y; it is therefore always physically possible.

The surface is inclined by the tilt φ: its normal is (sin φ, 0, cos φ).
"""

from dataclasses import replace

import numpy as np

from thesis_lib.bodies.shapes import Disk, Ellipse, Polygon, Shape
from thesis_lib.bodies.solids import Box, Cylinder, Ellipsoid, Hull, Solid, Sphere
from thesis_lib.critique.export.solid import NO_MASS, UPRIGHT, ExportedBody, contact_of, mass_said, require_size
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.engines.parameters import PLANAR
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.frame import Frame
from thesis_lib.mechanics.space import of_rotation_vector

MOST_DEPTH = 100.0  # m
ALIGNED = 1e-9  # m, largest distance of corners from the corners of a box


def planar_body(model: SavedModel, target: str, mass: float | None = None, depth: float | None = None) -> ExportedBody:
    """Return the body of a planar model for the format `target`.

    Args:
        mass: kg; None: `NO_MASS`, because a model contains only the radius of gyration.
        depth: m along y; None: the longest extent in the plane.

    Raises:
        UserError: mass or depth is not positive, or round corners do not fit into the depth.
    """
    require_size("mass", mass)
    require_size("depth", depth, MOST_DEPTH)
    values, m = model.values, mass or NO_MASS

    def of(name: str) -> float:
        return values.get(name, 0.0)

    shape, size = model.rig.shape, 1.0 + of("wrong_size.s")
    depth = depth or 2.0 * size * _half_width(shape)
    uniform, at = _deep(shape, depth / size)
    uniform, at = uniform.scaled(size), replace(at, origin=size * at.origin)
    G = at.vectors_out(at.vectors_out(uniform.moments.inertia_per_mass).T)
    k = model.rig.radius_of_gyration * float(np.sqrt(1.0 + of("wrong_inertia.d_I")))
    solid, seen = uniform, None
    if isinstance(shape, Disk) and target == "urdf":  # Drake's iteration for a cylinder on a box stalls
        solid, seen = Sphere(radius=size * shape.radius), uniform
    if isinstance(solid, Box | Hull) and (rho := of("rounded_corners.rho")):
        if rho >= 0.5 * depth:
            raise UserError(f"--depth {depth:g} is too thin for corners of {rho:g} m radius; give a larger depth.")
        solid = solid.rounded(min(rho, solid.inradius))
    leans = "its normal leans by {:.6g} rad towards the x of the drops"
    tilt, height = of("surface_tilt.phi"), model.rig.height + of("surface_height.h")
    normal, gravity = np.array([np.sin(tilt), 0.0, np.cos(tilt)]), model.rig.gravity + of("wrong_gravity.dg")
    touches_once = isinstance(shape, Ellipse) or (isinstance(shape, Disk) and target != "mjcf")
    return ExportedBody(
        **contact_of(model, target),
        shape=solid,
        at=at,
        seen=seen,
        mass=m,
        mass_known=mass is not None,
        inertia=m * k**2 / G[1, 1] * G,
        centre=np.array([of("com_offset.c_x"), 0.0, of("com_offset.c_y")]),
        points=1 if touches_once else 2,
        estimate=PLANAR,
        gravity=np.array([0.0, 0.0, -gravity]),
        surface=replace(Frame.of_surface(np.zeros(3), normal), origin=height * normal),
        said=(
            "axes: the plane of the drops is x-z; theta turns about -y; units m, kg, s, rad",
            "origin of the body: the believed centre of mass, as in the dataset",
            f"shape: as in dataset.yaml{' times 1 + wrong_size.s' if 'wrong_size' in model.effects else ''}",
            f"depth along y: {depth:g} m, assumed, not measured",
            mass_said(mass),
            f"inertia: about y m k^2 with k = {k:.6g} m"
            + (" (fitted)" if "wrong_inertia" in model.effects else " (as in dataset.yaml)")
            + "; the other moments as for a uniform solid, scaled by the same factor",
        ),
        not_patched={
            "wrong_size": f"geometry is not patched: scale it by {size:.6g}",
            "rounded_corners": f"geometry is not patched: round the corners with {of('rounded_corners.rho'):.6g} m",
            "surface_height": f"the surface is not patched: its height is {height:.6g} m",
            "surface_tilt": f"the surface is not patched: {leans.format(tilt)}",
            "wrong_gravity": f"gravity is not patched: it is {gravity:.6g} m/s^2",
        },
    )


def _deep(shape: Shape, depth: float) -> tuple[Solid, Frame]:
    """Return the uniform solid of a shape with `depth` in m along y, and its pose in the body."""
    half, here = 0.5 * depth, Frame(np.zeros(3), UPRIGHT)
    if isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        return Ellipsoid(semi_axes=(a, half, b)), here
    if isinstance(shape, Disk):
        quarter = of_rotation_vector(np.array([-0.5 * np.pi, 0.0, 0.0]))  # the cylinder's z is the body's y
        return Cylinder(radius=shape.radius, half_length=half), Frame(np.zeros(3), quarter)
    if box := _box(shape):
        (x, z), (a, b) = box
        return Box(half_extents=(float(a), half, float(b))), Frame(np.array([x, 0.0, z]), UPRIGHT)
    return Hull(vertices=tuple((float(x), y, float(z)) for y in (-half, half) for x, z in shape.corners)), here


def _box(shape: Polygon) -> tuple[np.ndarray, np.ndarray] | None:
    """Return centre and half sides (2,) in m of a rectangle along the axes of the body; None for other shapes."""
    corners = shape.corners
    low, high = corners.min(axis=0), corners.max(axis=0)
    off = np.minimum(np.abs(corners - low), np.abs(corners - high)).max()
    return (0.5 * (low + high), 0.5 * (high - low)) if len(corners) == 4 and off < ALIGNED else None


def _half_width(shape: Shape) -> float:
    if isinstance(shape, Ellipse):
        return max(shape.semi_axes)
    return shape.radius if isinstance(shape, Disk) else 0.5 * float(np.ptp(shape.corners, axis=0).max())
