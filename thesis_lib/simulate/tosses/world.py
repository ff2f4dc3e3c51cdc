"""The true body over a flat surface, its releases, and the interface of engines that simulate its tosses.

All quantities are in the frame of the surface: axes (t_1, t_2, n) at `surface.point`, with the believed surface at 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from thesis_lib.bodies.solid_body import FlatSurface
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE, of_rotation_vector
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.causes_in_space import Hidden, true_rig

STRAIGHT = np.array([1.0, 0.0, 0.0, 0.0])  # attitude of a body along the axes of the surface
SPINS = (2.0, 15.0)  # rad/s, range of spins at release
HEIGHTS = (0.12, 0.35)  # m, height above the surface of the lowest point that the body has in any attitude
ASIDE, ACROSS, UPWARDS = 0.15, 0.7, (-1.0, 0.5)  # m, m/s, m/s; limits of x and y, and of velocity along and up


@dataclass(frozen=True, eq=False)
class TossedWorld:
    """A body as its owner believes it, its hidden causes, and its contact with the surface.

    Attributes:
        header: rig as its owner believes it.
        mu, epsilon: Coulomb friction, and restitution of a central hit.
        contact_time: duration of a central hit, s.
        hidden: sizes of hidden causes by effect and parameter.
    """

    header: SpaceHeader
    mu: float = 0.25
    epsilon: float = 0.5
    contact_time: float = 1e-3
    hidden: Hidden = field(default_factory=dict)

    def of(self, name: str) -> float:
        """The value of a hidden parameter; 0 if it is absent."""
        return float(self.hidden.get(name, 0.0))

    def vector(self, stem: str, axes: Sequence[str] = "xyz") -> np.ndarray:
        """The values (k,) of a hidden vector."""
        return np.array([self.of(f"{stem}{axis}") for axis in axes])

    def has(self, names: Sequence[str]) -> bool:
        """Return whether one of these causes is hidden."""
        return bool(set(names) & {name.split(".")[0] for name in self.hidden})

    @cached_property
    def rig(self) -> SpaceHeader:
        """True body, tracked frame, table and gravity, in the frame of the believed surface."""
        g = float(np.linalg.norm(self.header.gravity))
        level = self.header.model_copy(update={"gravity": (0.0, 0.0, -g), "surface": FlatSurface()})
        return true_rig(level, self.hidden)

    @property
    def mass(self) -> float:
        return self.rig.body.mass or 1.0

    @property
    def height(self) -> float:
        """Height of the true surface, m."""
        return self.rig.surface.point[2]

    @property
    def balls(self) -> tuple[np.ndarray, float]:
        """Centres (k, 3) in m, in axes of the shape, of the balls that can touch, and their radius.

        Raises:
            UserError: the body is an ellipsoid or a cylinder.
        """
        points = self.rig.body.solid.minkowski
        if points.squares.any():
            raise UserError("our own contact simulates a sphere, box, capsule or hull: no ellipsoid or cylinder.")
        return points.centres.T.copy(), points.radius


class TossEngine(Protocol):
    """Simulator that moves a tossed body."""

    def moves(self, world: TossedWorld, release: State, times: np.ndarray) -> State:
        """Simulate n releases; poses of the shape's frame at rising times (n, k) in s, one toss after the other.

        `release` has the poses of the shape's frame and the motion of its origin; the returned motions may be NaN.
        """
        ...


def released(world: TossedWorld, n: int, rng: np.random.Generator) -> State:
    """Draw n releases over the surface, with any attitude and spins in the range `SPINS` about any axis."""
    along, spin = rng.standard_normal((3, n)), rng.uniform(*SPINS, n)
    reach = world.rig.body.solid.extent + max(world.height, 0.0)
    place = np.concatenate([rng.uniform(-ASIDE, ASIDE, (2, n)), reach + rng.uniform(*HEIGHTS, (1, n))])
    velocity = np.concatenate([rng.uniform(-ACROSS, ACROSS, (2, n)), rng.uniform(*UPWARDS, (1, n))])
    attitude = of_rotation_vector(3.0 * rng.standard_normal((3, n)))
    motion = np.concatenate([velocity, spin * along / np.linalg.norm(along, axis=0)])
    return State(np.concatenate([place, attitude]), motion, np.arange(n), np.zeros(n), None, SPACE)
