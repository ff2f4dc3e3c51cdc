"""Rotations that leave a solid body unchanged: its shape, centre of mass and inertia."""

import itertools
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from thesis_lib.bodies.solids import Solid

SAME = 1e-3  # tolerance, as a share of the extent, and of the inertia
TILT = 0.02  # rad, by which a standing body is tilted to check that its centre of mass rises
LEVEL = 1e-9  # m
SOME = np.random.default_rng(0).standard_normal((3, 60))  # directions in which solids are compared


@dataclass(frozen=True, eq=False)
class Symmetry:
    """Rotations about axes of the shape, by right angles and by any angle, that leave a body unchanged.

    Attributes:
        solid: with its origin at the centre of mass.
        G: (3, 3) inertia per mass in m², axes of the shape.
    """

    solid: Solid
    G: np.ndarray

    def keeps(self, Q: np.ndarray) -> bool:
        """Whether the body is the same after the rotation Q (3, 3)."""
        off = np.abs(Q @ self.solid.support(Q.T @ SOME) - self.solid.support(SOME)).max()
        return bool(
            off < SAME * self.solid.extent and np.abs(Q @ self.G @ Q.T - self.G).max() < SAME * np.trace(self.G)
        )

    @cached_property
    def turns(self) -> list[np.ndarray]:
        """Rotations (3, 3) by right angles that keep the body, the identity first."""
        signed = (
            np.eye(3)[list(order)] * np.array(signs)[:, None]
            for order in itertools.permutations(range(3))
            for signs in itertools.product((1.0, -1.0), repeat=3)
        )
        return [Q for Q in signed if np.linalg.det(Q) > 0.0 and self.keeps(Q)]

    @cached_property
    def axes(self) -> list[int]:
        """Axes 0, 1, 2 of the shape about which every rotation keeps the body; all three for a ball."""
        return [axis for axis in range(3) if self.keeps(turn_about(axis, 1.0))]

    @cached_property
    def stands(self) -> np.ndarray:
        """Upward directions (k, 3), in axes of the body, in its stable poses: least heights of its centre of mass.

        For a body with an axis of symmetry, one direction represents all about that axis.
        """

        def height(up: np.ndarray) -> np.ndarray:
            return -np.einsum("in,in->n", up, self.solid.support(-up))

        directions = (
            np.eye(3)[i] * np.cos(a) + np.eye(3)[i - 1] * np.sin(a) for i in range(3) for a in (0.0, 0.8, 1.6, 2.4)
        )
        around, least = np.array(list(directions)), []
        for up in -self.solid.faces:
            tilted = up[:, None] + TILT * np.cross(np.concatenate([around, -around]), up).T
            near = tilted / np.linalg.norm(tilted, axis=0)
            least.append(bool((height(near) >= height(up[:, None]) - LEVEL).all()))
        return -self.solid.faces[least]

    def leaning(self, up: np.ndarray) -> np.ndarray:
        """Rotation vectors (m, 3) in rad, axes of the body, from unit vectors `up` (m, 3) to the nearest of `stands`.

        Zero for a ball.
        """
        if len(self.axes) == 3:
            return np.zeros_like(up)
        nearest = self.nearest_stand(up)[1]
        across, cosine = np.cross(up, nearest), np.einsum("mi,mi->m", up, nearest)
        sine = np.linalg.norm(across, axis=1)
        return across * (np.arctan2(sine, cosine) / np.maximum(sine, 1e-12))[:, None]

    def nearest_stand(self, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Index (m,) into `stands`, and direction (m, 3), of the stable pose nearest to unit vectors `up` (m, 3)."""
        stands = np.broadcast_to(self.stands, (len(up), *self.stands.shape))
        for axis in self.axes:
            w = np.eye(3)[axis]
            level = up - np.outer(up @ w, w)
            level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
            along = self.stands @ w
            stands = along[:, None] * w + np.sqrt(np.maximum(1.0 - along**2, 0.0))[:, None] * level[:, None, :]
        number = np.einsum("mi,mki->mk", up, stands).argmax(axis=1)
        return number, stands[np.arange(len(up)), number]

    def nearest(self, R: np.ndarray, to: np.ndarray) -> np.ndarray:
        """Of all attitudes Q R (3, 3) that are equivalent for this body, the one nearest to the attitude `to`."""
        if len(self.axes) == 3:
            return to
        equal = [Q @ R for Q in self.turns]
        for axis in self.axes:
            i, j = (axis + 1) % 3, (axis + 2) % 3
            M = [one @ to.T for one in equal]
            angles = [np.arctan2(m[i, j] - m[j, i], m[i, i] + m[j, j]) for m in M]
            equal = [turn_about(axis, angle) @ one for angle, one in zip(angles, equal)]
        return max(equal, key=lambda one: float(np.trace(one @ to.T)))


def turn_about(axis: int, angle: float) -> np.ndarray:
    """Rotation matrix (3, 3) for `angle` in rad about an axis 0, 1 or 2."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    Q = np.eye(3)
    Q[[i, i, j, j], [i, j, i, j]] = np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)
    return Q
