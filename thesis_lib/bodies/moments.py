"""Volume, centre of mass and inertia of homogeneous solids, from the triangles of their surfaces.

Source: Tonon, J. Math. Stat. 1 (2005), doi:10.3844/jmssp.2005.8.11.
"""

from typing import NamedTuple

import numpy as np


class Moments(NamedTuple):
    """Volume (m³), centre of mass (3,) in m, and inertia per mass (3, 3) in m² about it, of a homogeneous solid."""

    volume: float
    centre: np.ndarray
    inertia_per_mass: np.ndarray


def moments_within(triangles: np.ndarray) -> Moments:
    """Moments of the solid in a closed surface of triangles (f, 3, 3) in m, each counter-clockwise seen from outside.

    Each triangle and the origin span a tetrahedron of signed volume V = a·(b × c)/6, with the centre of mass
    (a + b + c)/4 and the second moments ∫ r rᵀ dV = V/20 (a aᵀ + b bᵀ + c cᵀ + s sᵀ), s = a + b + c.

    Raises:
        ValueError: the enclosed volume is not positive.
    """
    origin = triangles.reshape(-1, 3).mean(axis=0)  # near, so that no digits cancel
    corners = triangles - origin
    V = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = float(V.sum())
    if not volume > 0.0:
        raise ValueError("the triangles enclose no volume: is the surface closed, and do its normals point out?")
    s = corners.sum(axis=1)
    centre = V @ s / (4.0 * volume)
    second = (np.einsum("f,fci,fcj->ij", V, corners, corners) + np.einsum("f,fi,fj->ij", V, s, s)) / (20.0 * volume)
    second -= np.outer(centre, centre)
    return Moments(volume, centre + origin, np.trace(second) * np.eye(3) - second)
