"""Inertia per unit mass: k² in the plane, a 3 × 3 tensor in space.

| on paper | in code    | unit | shape                                                   |
|----------|------------|------|---------------------------------------------------------|
| G        | `G`        | m²   | plane: k², a number or (n,); space: (3, 3), (3, 3, 1) or (3, 3, n), axes of the body |
| G⁻¹      | `mobility` | 1/m² | the same, in axes of the world                          |

Impacts and flights depend on the inertia per mass only.
"""

import numpy as np

from thesis_lib.mechanics.space import SPACE, Space, rotation_matrix

TOLERANCE = 1e-9  # relative, of what makes a tensor symmetric, positive and that of a body


def mobility(space: Space, G: np.ndarray | float, attitude: np.ndarray) -> np.ndarray:
    """G⁻¹ in 1/m²: in the plane as G is, in space (3, 3, n) in the axes of the world at attitudes (4, n)."""
    if space.is_plane:
        return 1.0 / G
    inverse = np.linalg.inv(np.moveaxis(np.asarray(G), (0, 1), (-2, -1)))
    return in_world(np.moveaxis(inverse, (-2, -1), (0, 1)), attitude)


def in_world(G: np.ndarray, attitude: np.ndarray) -> np.ndarray:
    """G (3, 3, n) in m² in the axes of the world, of tensors as `G` in those of bodies at (4, n)."""
    R, each = rotation_matrix(attitude), G if G.ndim == 3 else G[:, :, None]
    if each.shape[2] == 1:
        return np.einsum("ijn,jk,lkn->iln", R, each[:, :, 0], R)
    return np.einsum("ijn,jkn,lkn->iln", R, each, R)


def require_inertia(space: Space, G: np.ndarray | float) -> np.ndarray:
    """G as an array, if a body can have it: positive, and no principal moment above the sum of the others.

    Raises:
        ValueError: it cannot; with what is wrong.
    """
    G = np.asarray(G, dtype=float)
    if space.is_plane:
        if not np.all(G > 0.0) or not np.all(np.isfinite(G)):
            raise ValueError(f"the inertia per mass must be positive, got {G}")
        return G
    if G.shape != (SPACE.turns, SPACE.turns) or not np.isfinite(G).all():
        raise ValueError(f"the inertia per mass must be a 3 × 3 matrix of finite numbers, got shape {G.shape}")
    size = np.abs(G).max()
    if not np.allclose(G, G.T, rtol=0.0, atol=TOLERANCE * size):
        raise ValueError("the inertia per mass is not symmetric")
    low, middle, high = np.linalg.eigvalsh(G)
    if low <= 0.0:
        raise ValueError(f"a principal moment of inertia is not positive: {low:g} m²")
    if high > (low + middle) * (1.0 + TOLERANCE):
        raise ValueError(f"the principal moment {high:g} m² is above the sum of the others, {low + middle:g} m²")
    return G
