"""Soft body: the body, not the surface, deforms, so that the contact force acts nearer to its centre.

    r ← r_shape + d (l, 1),   d = λ |v_n|

If a hard body sinks into a soft surface, the force acts at its lowest point.  If a soft body is flattened, the force
acts in the middle of the chord along which the surface cuts the body.  For an ellipse this middle lies on the line from
the lowest point to the centre, l = r_x/r_y, because the midpoints of all parallel chords lie on one diameter.  At a
corner it lies between the two adjacent sides, l = (cot β + cot β')/2 with their angles β, β' from the surface.  In
space l is a vector, at a corner the mean over the edges that rise from it.

The depth d is the mean over the contact, weighted with the force.  For a linear spring it is half the penetration of
the ballistic path when the impulse acts: λ = τ/2 if only the body deforms, 0 if only the surface does.

| on paper | in code | unit | shape |                                                       |
|----------|---------|------|-------|-------------------------------------------------------|
| λ        | `lam`   | s    |       | mean depth in the body divided by the impact speed    |
| d        | `depth` | m    | (n,)  | mean depth in the body                                |
| l        | `lean`  | 1    | (n,), (2, n) | shift of the chord's middle along the surface over its height |
"""

from functools import lru_cache
from typing import Any

import numpy as np

from thesis_lib.bodies.minkowski import SupportPoint
from thesis_lib.bodies.shapes import Corner, Polygon, Shape
from thesis_lib.bodies.solids import Solid
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter
from thesis_lib.mechanics.space import SPACE

LEVEL = 1e-9  # relative to the edge length: an edge that rises by less lies on the surface
STEEPEST = 4.0  # largest cot β, of a side 14° from the surface


class SoftBody(Effect):
    name = "soft_body"
    family = "geometry"
    title = "the body gives way"
    equation = "r = r_shape(θ) + λ |v_n| (l, 1)"
    equation_in_space = "r = r_shape(R) + λ |v_n| (l_1, l_2, 1)"
    parameters = (Parameter("lam", "s", null=0.0, low=0.0, high=3e-3, scale=1e-4),)
    needs_contact_time = True
    needs_angle = True
    dimensions = IN_SPACE
    reference = "Johnson 1985, chapter 4 (both bodies give way in the ratio of their compliances)"

    def applies_to(self, rig):
        if rig.space.is_plane:
            return True
        parts = _solid(rig.shape).minkowski
        return parts.centres.shape[1] == 1 or not parts.squares.any()  # not at the rim of a cylinder

    def contact_point(self, r, state, p, rig):
        depth = p["lam"] * np.maximum(-state.space.velocity_at(state.velocity, state.spin, rig.lowest(state))[-1], 0.0)
        if state.space.is_plane:
            return r + np.array((depth * lean(rig.shape, state.theta), depth))
        return r + depth * np.concatenate([lean_in_space(rig.shape, state.attitude), np.ones((1, len(state)))])


def _solid(shape: Any) -> Solid:
    return shape.solid if isinstance(shape, SupportPoint) else shape


def lean(shape: Shape | Corner, theta: np.ndarray) -> np.ndarray:
    """Slope l (n,) of bodies at angles θ (n,) in rad, at most `STEEPEST`: beyond this the whole side touches."""
    polygon = shape.polygon if isinstance(shape, Corner) else shape
    r = shape.contact_point(theta)
    if not isinstance(polygon, Polygon):
        return r[:, 0] / r[:, 1]
    corners, sin, cos = polygon.corners, np.sin(theta), np.cos(theta)
    index = (
        shape.index
        if isinstance(shape, Corner)
        else (np.outer(sin, corners[:, 0]) + np.outer(cos, corners[:, 1])).argmin(axis=1)
    )
    slopes = []
    for step in (1, -1):
        x, y = (corners[(index + step) % len(corners)] - corners[index]).T
        across, up = cos * x - sin * y, sin * x + cos * y
        slopes.append(np.clip(np.divide(across, up, out=np.zeros_like(up), where=up > 0.0), -STEEPEST, STEEPEST))
    return 0.5 * (slopes[0] + slopes[1])


def lean_in_space(shape: Any, attitude: np.ndarray) -> np.ndarray:
    """Slope l (2, n) of bodies at attitudes (4, n), at most `STEEPEST`; `shape` is a solid or one point per body."""
    solid: Any = _solid(shape)
    parts = solid.minkowski
    index = shape.index if isinstance(shape, SupportPoint) else parts.heights(attitude).argmin(axis=0)
    if not solid.corners.size:
        across = SPACE.turned(attitude, parts.centres[:, index]) - shape.lowest(attitude)
        return across[:2] / across[2]
    found = np.zeros((2, attitude.shape[1]))
    for corner in np.unique(index):
        rows = np.flatnonzero(index == corner)
        edges = parts.centres[:, _neighbours(solid)[corner]] - parts.centres[:, corner, None]
        edges = np.stack([SPACE.turned(attitude[:, rows], edge[:, None]) for edge in edges.T])  # (edges, 3, n)
        rises = edges[:, 2] > LEVEL * np.abs(edges).max()
        slopes = np.divide(edges[:, :2], edges[:, 2:], out=np.zeros_like(edges[:, :2]), where=rises[:, None])
        steep = np.hypot(slopes[:, 0], slopes[:, 1])[:, None]
        slopes = slopes * np.minimum(1.0, STEEPEST / np.maximum(steep, STEEPEST))
        found[:, rows] = slopes.sum(axis=0) / np.maximum(rises.sum(axis=0), 1)
    return found


@lru_cache(maxsize=16)
def _neighbours(solid: Any) -> list[np.ndarray]:
    """Neighbours of each corner: the corners with which it shares an edge, that is two faces."""
    centres = solid.minkowski.centres
    off = solid.faces @ centres
    on = (off > off.max(axis=1, keepdims=True) - LEVEL * solid.extent).astype(int)
    return [np.flatnonzero((row >= 2) & (np.arange(len(row)) != i)) for i, row in enumerate(on.T @ on)]


EFFECT = SoftBody()
