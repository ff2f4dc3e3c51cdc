"""Interface between a physics engine and a critique in space: maps states at first touch to states off the surface.

An engine simulates bodies whose contact points touch the plane z = 0, from the first touch until the body is off.  This
module holds the parts common to all engines, as `thesis_lib/engines/engine.py` does for planar motion.  A body leaves
within a step; its flight is then traced back to the instant at which it left.

| on paper | in code        | unit       | shape     |                                                             |
|----------|----------------|------------|-----------|-------------------------------------------------------------|
| q        | `pose`         | m, 1       | (7, n)    | centre of mass; attitude, axes of the body into the surface's |
| v, ω     | `motion`       | m/s, rad/s | (6, n)    | axes of the surface                                         |
| u        | `centres`      | m          | (3, p, n) | centres of the points from the centre of mass, axes of the body |
| G        | `inertia`      | m²         | (3, 3)    | inertia per mass, axes of the body                          |
| a, M     | `push`         | m/s², m²/s² | (6, n)   | force and couple per mass besides contact                   |
| μ, ε, T  | `coefficients` | 1, 1, s    | (3, n)    | of a central contact                                        |
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

SUNK = 1e-7  # m below the touch, so that dampers act from the first stage on: MuJoCo detects a touch to 0.1 µm
LEAST = 1e-6  # m, radius of the ball at a sharp corner
BACK = 2  # Newton steps to find the instant at which a body left
TINY = 1e-12  # m or m/s
UP = np.array([[0.0], [0.0], [1.0]])


@dataclass(frozen=True)
class TouchPoints:
    """Points of n bodies that may touch: balls of one radius in m about `centres`, or one ellipsoid with the squared
    semi-axes `squares` (3,) in m²."""

    centres: np.ndarray
    squares: np.ndarray
    radius: float

    def gap(self, pose: np.ndarray, rows: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Return the height (n,) in m of the lowest point of each of the bodies `rows`."""
        up = SPACE.turned_back(pose[3:], UP)
        height = np.einsum("ipn,in->pn", self.centres[..., rows], up).min(axis=0)
        return pose[2] + height - np.sqrt(self.squares @ (up * up)) - self.radius

    def rise(self, pose: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Return the vertical velocity (n,) in m/s of the lowest point of each body, upwards positive."""
        up = SPACE.turned_back(pose[3:], UP)
        lowest = np.einsum("ipn,in->pn", self.centres, up).argmin(axis=0)
        r = self.centres[:, lowest, np.arange(len(lowest))]
        r = r - self.squares[:, None] * up / np.maximum(np.sqrt(self.squares @ (up * up)), TINY)
        return SPACE.velocity_at(motion[:3], motion[3:], SPACE.turned(pose[3:], r))[2]


class PressInSpace(Protocol):
    """Interface of an engine with n bodies on its plane."""

    name: str
    points: TouchPoints
    h: float  # s, between two states of a path

    def path(self, rows: np.ndarray, pose: np.ndarray, motion: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (7, m, steps) and motions (6, m, steps) of the bodies `rows` (m,) after each of several steps;
        once a body is off, later steps may repeat its state."""
        ...


def pressed(engine: PressInSpace, start: State, longest: np.ndarray) -> tuple[State, np.ndarray]:
    """Return the states (n,) at which bodies leave the surface, from states at first touch, and the time (n,) in s.

    The bodies are first moved vertically to touch the plane.  A contact that lasts `longest` (n,) in s is cut off.

    Raises:
        UserError: the engine returns a state that is not finite.
    """
    points, pose, motion = engine.points, start.pose.copy(), start.motion.copy()
    lower = points.gap(pose) + SUNK
    pose[2] -= lower
    elapsed, rows = np.zeros(len(start)), np.arange(len(start))
    while len(rows):
        q, v = engine.path(rows, pose[:, rows], motion[:, rows])
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            raise UserError(f"{engine.name} returned a state that is not finite in a contact.")
        steps = q.shape[2]
        off = np.stack([points.gap(q[..., k], rows) >= 0.0 for k in range(steps)], axis=1)
        last, each = np.where(off.any(axis=1), off.argmax(axis=1), steps - 1), np.arange(len(rows))
        pose[:, rows], motion[:, rows] = q[:, each, last], v[:, each, last]
        elapsed[rows] += (last + 1) * engine.h
        rows = rows[~off.any(axis=1) & (elapsed[rows] < longest[rows])]
    for _ in range(BACK):
        back = np.clip(points.gap(pose) / np.maximum(points.rise(pose, motion), TINY), 0.0, engine.h)
        pose, elapsed = SPACE.shift(pose, -back * motion), elapsed - back
    pose[2] += lower
    return State(pose, motion, start.trial, start.t + elapsed, start.surface, SPACE), elapsed
