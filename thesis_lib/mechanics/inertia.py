"""Inertia per unit mass: k² in the plane, a 3 × 3 tensor in space.

| on paper | in code    | unit | shape                                                   |
|----------|------------|------|---------------------------------------------------------|
| G        | `G`        | m²   | plane: k², a number or (n,); space: (3, 3), (3, 3, 1) or (3, 3, n), axes of the body |
| G⁻¹      | `mobility` | 1/m² | the same, in axes of the world                          |

Impacts and flights depend on the inertia per mass only.
"""

import numpy as np

from thesis_lib.mechanics.space import Space, by_column


def mobility(space: Space, G: np.ndarray | float, attitude: np.ndarray) -> np.ndarray:
    """G⁻¹ in 1/m²: in the plane as G is, in space (3, 3, n) in the axes of the world at attitudes (4, n)."""
    if space.is_plane:
        return 1.0 / G
    return by_column("in_world", by_column("inverse", np.reshape(G, (9, -1))), attitude)


def in_world(G: np.ndarray, attitude: np.ndarray) -> np.ndarray:
    """G (3, 3, n) in m² in the axes of the world, of tensors as `G` in those of bodies at (4, n)."""
    return by_column("in_world", np.reshape(G, (9, -1)), attitude)


def principal_axes(G: np.ndarray) -> np.ndarray:
    """Principal axes (3, 3) of a tensor (3, 3) in its own axes, by column: each the one nearest to x, y and z."""
    if np.count_nonzero(G - np.diag(np.diag(G))) == 0:
        return np.eye(3)
    axes, order = np.linalg.eigh(G)[1], []
    for axis in range(3):
        order.append(max((i for i in range(3) if i not in order), key=lambda i: abs(axes[axis, i])))
    axes = axes[:, order]
    return axes * np.sign(np.diag(axes))
