"""Angles at which a body lies still on a level surface: a polygon on a side, an ellipse on its flat end.

A polygon lies on a side of its convex hull if the origin, taken as the centre of mass, is above that side.
"""

from functools import lru_cache

import numpy as np

from thesis_lib.bodies.shapes import Ellipse, Polygon, Shape


def lying_angle(shape: Shape, theta: np.ndarray) -> np.ndarray:
    """The nearest angle (n,) in rad to `theta` (n,) at which the body lies; `theta` itself of a disk."""
    if isinstance(shape, Polygon):
        angles, turn = _on_sides(shape.vertices), 2.0 * np.pi
    elif isinstance(shape, Ellipse):
        a, b = shape.semi_axes
        angles, turn = np.array([0.0 if b <= a else 0.5 * np.pi]), np.pi
    else:
        return theta
    off = np.remainder(np.subtract.outer(theta, angles) + 0.5 * turn, turn) - 0.5 * turn
    return theta - off[np.arange(len(theta)), np.abs(off).argmin(axis=1)]


@lru_cache(maxsize=32)
def _on_sides(vertices: tuple[tuple[float, float], ...]) -> np.ndarray:
    """Angles (k,) in rad at which the polygon lies on each side that it can lie on."""
    corners = Polygon(vertices=vertices).corners
    along = np.roll(corners, -1, axis=0) - corners
    share = -np.sum(corners * along, axis=1) / np.sum(along**2, axis=1)  # of the side, where the origin is above it
    return -np.arctan2(along[:, 1], along[:, 0])[(share > 0.0) & (share < 1.0)]
