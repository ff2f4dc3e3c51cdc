"""Inertia per unit mass: k² in the plane, a 3 × 3 tensor in space.

| on paper | in code    | unit | shape                                                   |
|----------|------------|------|---------------------------------------------------------|
| G        | `G`        | m²   | plane: k², a number or (n,); space: (3, 3), (3, 3, 1) or (3, 3, n), axes of the body |
| G⁻¹      | `mobility` | 1/m² | as for G, in world axes                                 |

Impacts and flights depend only on the inertia per mass.
"""

import numpy as np

from thesis_lib.mechanics.space import Space, by_column


def mobility(space: Space, G: np.ndarray | float, attitude: np.ndarray) -> np.ndarray:
    """Inverse inertia G⁻¹ in 1/m²: shape of G in the plane; (3, 3, n) in world axes in space, at attitudes (4, n)."""
    if space.is_plane:
        return 1.0 / G
    return by_column("in_world", by_column("inverse", np.reshape(G, (9, -1))), attitude)


def in_world(G: np.ndarray, attitude: np.ndarray) -> np.ndarray:
    """Inertia (3, 3, n) in m² in world axes, from `G` in the axes of bodies with the attitudes (4, n)."""
    return by_column("in_world", np.reshape(G, (9, -1)), attitude)


def principal_axes(G: np.ndarray) -> np.ndarray:
    """Principal axes (3, 3) of a tensor (3, 3) in its axes, as columns in the order of the nearest of x, y and z."""
    if np.count_nonzero(G - np.diag(np.diag(G))) == 0:
        return np.eye(3)
    axes, order = np.linalg.eigh(G)[1], []
    for axis in range(3):
        order.append(max((i for i in range(3) if i not in order), key=lambda i: abs(axes[axis, i])))
    axes = axes[:, order]
    return axes * np.sign(np.diag(axes))
