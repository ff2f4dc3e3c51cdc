"""Rounded corners: the corners of a polygon are arcs of radius ρ that touch its sides.

The body is the polygon shrunk by ρ and grown by a disk of radius ρ.  With u_i the corners of the shrunk polygon,

    u_i = v_i − ρ (n_i + n_i') / (1 + n_i · n_i'),   n_i, n_i' the outward normals of the two sides at v_i
    r  ← r + (lowest R(θ) u_i − (0, ρ)) − lowest R(θ) v_i
    φ_n ← φ_n + h_rounded − h_sharp < 0,   h the height of the origin above the lowest point

| on paper | in code | unit | shape |                                                               |
|----------|---------|------|-------|---------------------------------------------------------------|
| ρ        | `rho`   | m    |       | radius of the corners, at most the largest that fits           |
| v_i, u_i | `corners`, `inner` | m | (k, 2) | corners of the convex hull, in the body frame           |

Ellipses and disks have no corners.  In space the edges of box, cylinder and hull are rounded without a change of the
outer dimensions; ρ is added to the stated edge radius.
"""

from functools import lru_cache

import numpy as np

from thesis_lib.bodies.minkowski import SupportPoint
from thesis_lib.bodies.shapes import Corner, Polygon
from thesis_lib.bodies.solids import Edged, Recentred
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class RoundedCorners(Effect):
    name = "rounded_corners"
    family = "geometry"
    title = "rounded corners"
    equation = "r = lowest point of (polygon ⊖ ρ) ⊕ disk(ρ)"
    equation_in_space = "r = lowest point of (solid ⊖ ρ) ⊕ ball(ρ)"
    parameters = (Parameter("rho", "m", null=0.0, low=0.0, high=0.05, scale=2e-3),)
    channels = ("impact", "touch")
    dimensions = IN_SPACE
    reference = "Minkowski sums: de Berg et al. 2008, doi:10.1007/978-3-540-77974-2"

    def applies_to(self, rig):
        return isinstance(rig.shape, Polygon) or _edged(rig.shape) is not None

    def contact_point(self, r, state, p, rig):
        if (solid := _edged(rig.shape)) is not None:
            return r + _moved_in_space(rig.shape, solid, state, p["rho"])
        if not isinstance(rig.shape, Polygon | Corner):
            return r
        return r + np.array(_moved(rig.shape, state.theta, p["rho"]))

    def gap(self, gap, state, p, rig):
        if (solid := _edged(rig.shape)) is not None:
            return gap - _moved_in_space(rig.shape, solid, state, p["rho"])[-1]
        if not isinstance(rig.shape, Polygon | Corner):
            return gap
        return gap - _moved(rig.shape, state.theta, p["rho"])[1]


def _edged(shape) -> Edged | None:
    """Solid whose edges could be rounded further; None if there is none."""
    solid = shape.solid if isinstance(shape, SupportPoint) else shape
    solid = solid.solid if isinstance(solid, Recentred) else solid
    return solid if isinstance(solid, Edged) else None


def _moved_in_space(shape, solid, state, rho):
    """Shift (3, n) of the contact point, in the axes of the surface, if the edges of the solid are rounded further.

    If the shape is one contact point for each body, the shift of the nearest corner.
    """
    is_point = isinstance(shape, SupportPoint)
    whole, own = (shape.solid, shape) if is_point else (solid, solid)
    radius = np.broadcast_to(np.minimum(solid.edge_radius + rho, solid.inradius), len(state))
    moved, believed = np.zeros((3, len(state))), own.lowest(state.attitude)
    for one in np.unique(radius):  # a fit tries only a few at once
        rows = np.flatnonzero(radius == one)
        rounded = _rounded(whole, float(one))
        there = shape.nearest(rounded, rows) if is_point else rounded
        moved[:, rows] = there.lowest(state.attitude[:, rows]) - believed[:, rows]
    return moved


@lru_cache(maxsize=64)
def _rounded(solid, radius):
    """Solid with edges of that radius; cached, because the search for hits repeats a few radii many times."""
    return solid.rounded(radius)


def _moved(shape, theta, rho):
    """Shift of the contact point by rounding of the polygon, or of one corner of it: two arrays (n,)."""
    if isinstance(shape, Corner):
        _, inward, largest = _corners(shape.polygon.vertices)
        rho, (x, y) = np.minimum(rho, largest), shape.turned(inward, theta)
        return rho * x, rho * (y - 1.0)
    corners, inward, largest = _corners(shape.vertices)
    rho = np.minimum(rho, largest)
    sin, cos = np.sin(theta), np.cos(theta)

    def lowest(rho):
        x, y = (corners[:, i, None] + rho * inward[:, i, None] for i in (0, 1))
        heights = sin * x + cos * y  # (corners, n)
        index = np.argmin(heights, axis=0)
        x, y = (corners[index, i] + rho * inward[index, i] for i in (0, 1))
        return cos * x - sin * y, sin * x + cos * y

    round_x, round_y = lowest(rho)
    sharp_x, sharp_y = lowest(0.0)
    return round_x - sharp_x, round_y - rho - sharp_y


@lru_cache(maxsize=32)
def _corners(vertices):
    """Corners of the convex hull (k, 2), their inward shift per metre of ρ (k, 2), and the largest ρ that fits."""
    corners = Polygon(vertices=vertices).corners
    along = np.roll(corners, -1, axis=0) - corners
    length = np.hypot(along[:, 0], along[:, 1])
    # normal of the side that follows
    after = np.stack([along[:, 1], -along[:, 0]], axis=-1) / length[:, None]
    before = np.roll(after, 1, axis=0)
    share = 1.0 + np.sum(before * after, axis=1)
    inward = -(before + after) / share[:, None]
    # an arc takes ρ tan(turn / 2) from each of its two sides
    taken = np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / share
    return corners, inward, float(np.min(length / (taken + np.roll(taken, -1))))


EFFECT = RoundedCorners()
