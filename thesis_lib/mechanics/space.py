"""The plane and space: components of poses, velocities and turns, and operations on them.

All other code uses a `Space`, so that one equation covers both.  The first axis of an array is the component: n vectors
are (d, n), n poses (d + attitude, n), n motions (d + turns, n).

| on paper      | in code    | plane             | space                          | axes   |
|---------------|------------|-------------------|--------------------------------|--------|
| d             | `dimension`| 2: x, y           | 3: x, y, z                     | world  |
| attitude      | `attitude` | 1: θ, rad         | 4: quaternion, scalar first    | body into world |
| ω             | `turns`    | 1: rad/s          | 3: rad/s                       | world  |
| small turn φ  |            | 1: rad            | 3: rotation vector, rad        | world  |
| normal        |            | +y                | +z                             | world  |

A contact has the components (t, n) in the plane, (t_1, t_2, n) in space, along world axes.  Quaternions are Hamilton's;
(w, x, y, z) and its negative represent the same attitude.
Source: Solà 2017, Quaternion kinematics for the error-state Kalman filter, arXiv:1711.02508.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np


@dataclass(frozen=True)
class Space:
    """The plane or space: numbers of components, and operations on poses, motions and vectors.

    Attributes:
        dimension: number d of components of a position.
        attitude: number of components of an attitude.
        turns: number of components of a spin and of a small turn.
    """

    dimension: int
    attitude: int
    turns: int

    @property
    def poses(self) -> int:
        """Number of components of a pose."""
        return self.dimension + self.attitude

    @property
    def motions(self) -> int:
        """Number of components of a motion and of a small change of a pose."""
        return self.dimension + self.turns

    @property
    def is_plane(self) -> bool:
        return self.dimension == 2

    # vectors ----------------------------------------------------------------------------------------------------
    def velocity_at(self, velocity: np.ndarray, spin: np.ndarray, r: np.ndarray) -> np.ndarray:
        """Velocity v + ω × r (d, n) in m/s of a point at r (d, n) in m from the point that moves with v (d, n)."""
        if self.is_plane:
            return np.array((velocity[0] - spin[0] * r[1], velocity[1] + spin[0] * r[0]))
        return velocity + cross(spin, r)

    def moment(self, r: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Moment r × f (turns, n) of a force or impulse f that acts at r (d, n)."""
        if self.is_plane:
            return (r[0] * f[1] - r[1] * f[0])[None]
        return cross(r, f)

    def turned(self, attitude: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Components in world axes of vectors u (d, n) or (d, 1) given in body axes."""
        if self.is_plane:
            sin, cos = np.sin(attitude[0]), np.cos(attitude[0])
            return np.stack([cos * u[0] - sin * u[1], sin * u[0] + cos * u[1]])
        return rotated(attitude, u)

    def turned_back(self, attitude: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Components in body axes of vectors u (d, n) or (d, 1) given in world axes."""
        return self.turned(-attitude if self.is_plane else conjugate(attitude), u)

    # attitudes --------------------------------------------------------------------------------------------------
    def attitude_after(self, attitude: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """Attitude after a turn by the rotation vectors `turn` (turns, n) in rad about world axes."""
        if self.is_plane:
            return attitude + turn
        return by_column("turned_by", turn, attitude)

    def turn_between(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Rotation vector (turns, n) in rad about world axes from the first attitude to the second.

        In space it is the shortest one; in the plane, full turns count.
        """
        if self.is_plane:
            return second - first
        return by_column("turn_between", first, second)

    def shift(self, pose: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Poses after small changes (d + turns, n) in m, rad."""
        if self.is_plane:
            return pose + change
        d = self.dimension
        return np.concatenate([pose[:d] + change[:d], self.attitude_after(pose[d:], change[d:])])

    def difference(self, second: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Change (d + turns, n) in m, rad from the first poses to the second; the inverse of `shift`."""
        if self.is_plane:
            return second - first
        d = self.dimension
        return np.concatenate([second[:d] - first[:d], self.turn_between(first[d:], second[d:])])


PLANE = Space(2, 1, 1)
SPACE = Space(3, 4, 3)


def by_column(name: str, *arrays: np.ndarray) -> np.ndarray:
    """Result of the function `name` of `products` for arrays (c, ...), which broadcast beyond their first axis."""
    kernel = _compiled(name)
    for array in arrays:
        if array.ndim != 2:
            break
    else:
        return kernel(*arrays)
    shape = np.broadcast_shapes(*(array.shape[1:] for array in arrays))
    ones = ((len(array), *(1,) * (len(shape) + 1 - array.ndim), *array.shape[1:]) for array in arrays)
    full = (np.broadcast_to(array.reshape(one), (len(array), *shape)) for array, one in zip(arrays, ones))
    found = kernel(*(array.reshape(len(array), -1) for array in full))
    return found.reshape(*found.shape[:-1], *shape)


@cache
def _compiled(name: str) -> Callable[..., np.ndarray]:
    """The function `name` of `products`, a module that imports numba."""
    from thesis_lib.mechanics import products

    return getattr(products, name)


def by_row(A: np.ndarray) -> np.ndarray:
    """Matrices (3, 3, ...) reshaped to (9, ...), row by row."""
    return np.reshape(A, (9, *np.shape(A)[2:]))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Vector product a × b (3, ...) of vectors (3, ...)."""
    return by_column("cross", a, b)


def multiplied(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Product p q (4, ...) of quaternions: the turn q followed by the turn p."""
    return by_column("multiplied", p, q)


def conjugate(q: np.ndarray) -> np.ndarray:
    """Conjugates (4, ...) of unit quaternions: the inverse turns."""
    opposite = -q
    opposite[0] = q[0]
    return opposite


def rotated(q: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Vectors u (3, ...) turned by unit quaternions q (4, ...): u + 2 s (a × u) + 2 a × (a × u) for q = (s, a)."""
    return by_column("rotated", q, u)


def about_normal(angle: np.ndarray | float, u: np.ndarray) -> np.ndarray:
    """Vectors u (2 or 3, ..., n) turned by `angle` (n,) in rad about the third axis."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * u[0] - sin * u[1], sin * u[0] + cos * u[1], *u[2:]])


def rotation_matrix(q: np.ndarray) -> np.ndarray:
    """Rotation matrices (3, 3, ...) of unit quaternions q (4, ...); their columns are the body axes in the world."""
    return by_column("rotation_matrix", q)


def of_rotation_vector(turn: np.ndarray) -> np.ndarray:
    """Unit quaternions (4, ...) of rotation vectors (3, ...) in rad."""
    return by_column("of_rotation_vector", turn)


def rotation_vector(q: np.ndarray) -> np.ndarray:
    """Shortest rotation vectors (3, ...) in rad of unit quaternions (4, ...)."""
    return by_column("rotation_vector", q)


def of_rotation_matrix(R: np.ndarray) -> np.ndarray:
    """Unit quaternion (4,) of a rotation matrix (3, 3), computed from its largest component (Shepperd 1978)."""
    trace = np.trace(R)
    squares = 0.25 * (1.0 + np.append(trace, 2.0 * np.diag(R) - trace))  # of w, x, y, z
    w, x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 0.0
    xy, xz, yz = R[1, 0] + R[0, 1], R[0, 2] + R[2, 0], R[2, 1] + R[1, 2]
    products = 0.25 * np.array([[z, w, x, y], [w, z, xy, xz], [x, xy, z, yz], [y, xz, yz, z]])  # of pairs of w, x, y, z
    i = int(squares.argmax())
    largest = np.sqrt(squares[i])
    q = products[i] / largest
    q[i] = largest
    return q
