"""Where bodies touch in space, as their hits show it: for finding hits where the believed surface is off.

A bent table, a camera that is not square to it, a body of another size or a marker at another place move the gap at
hits by millimetres, and another corner seems to touch.  A regression of the gap φ on place and attitude,

    φ̂ = h(x, y) + s z_c + u·n + w·|n|,    h of the second order

with z_c the height of the centre above the contact point and n the normal in axes of the body, holds all of these to
first order, whatever the cause.  It only says where another hit may be; models are fitted to what was measured.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.optimize import least_squares

from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

FEWEST = 39  # hits, three for each column
OFF = 1e-3  # m by which gaps at hits scatter, below which no other corner is taken for the one that touches
EXPLAINED = 0.5  # of that scatter is left at most
PLACES = 6  # columns of h


@dataclass(frozen=True)
class Ground:
    """`coefficients` (13,) of φ̂, in m and 1/m; `middle` (2,) in m, from where places count."""

    coefficients: np.ndarray
    middle: np.ndarray

    @classmethod
    def seen(cls, rig: Rig, state: State) -> Self | None:
        """The ground by bodies (n) as they hit it, None where too few do or what is believed serves."""
        gap, r = rig.gap(state), rig.lowest(state)
        spread = float(robust_std(gap - np.median(gap))) if len(gap) >= FEWEST else 0.0
        if spread < OFF:
            return None
        place = state.position[:2] + r[:2]
        middle = np.median(place, axis=1)
        X = np.concatenate([_of_place(place - middle[:, None]), of_shape(rig.shape, state)[:, 1:]], axis=1)
        size = np.maximum(np.abs(X).max(axis=0), 1e-9)
        start = np.linalg.lstsq(X / size, gap, rcond=1e-6)[0]
        scale = max(float(robust_std(gap - X @ (start / size))), 1e-6)

        def sigmas(b: np.ndarray) -> np.ndarray:
            # a weak pull to zero decides what a body of few attitudes leaves open
            return np.concatenate([(X @ (b / size) - gap) / scale, 1e-3 * b / spread])

        found = least_squares(sigmas, start, loss="soft_l1").x / size
        left = gap - X @ found
        return cls(found, middle) if robust_std(left - np.median(left)) < EXPLAINED * spread else None

    def under(self, shape: Any, state: State) -> State:
        """The bodies as they lie above the believed surface: turned by the slope of h, and moved by φ̂."""
        r, c = shape.lowest(state.attitude)[:2], self.coefficients
        x, y = at = state.position[:2] - self.middle[:, None]
        slope = np.stack([c[1] + 2.0 * c[3] * x + c[4] * y, c[2] + c[4] * x + 2.0 * c[5] * y])
        turn = np.stack([-slope[1], slope[0], np.zeros(len(state))])
        lift = _of_place(at + r) @ c[:PLACES] + of_shape(shape, state)[:, 1:] @ c[PLACES:] - (slope * r).sum(axis=0)
        return state.changed(
            position=state.position - np.array([[0.0], [0.0], [1.0]]) * lift,
            attitude=SPACE.attitude_after(state.attitude, turn),
        )


@dataclass(frozen=True)
class SeenRig(Rig):
    """The believed rig with the ground on which hits were found, if it is another one."""

    ground: Ground | None = None

    def above(self, state: State) -> State:
        """The bodies as they lie above the believed surface."""
        return state if self.ground is None else self.ground.under(self.shape, state)

    def lowest(self, state: State) -> np.ndarray:
        """Contact point (3, n) in m of the believed shape, from the body origin."""
        above = self.above(state)
        return self.shape.lowest(above.attitude) + (above.position - state.position)

    def heights(self, state: State) -> np.ndarray:
        """Heights (p, n) in m of the points of the believed hull above the ground."""
        solid: Any = self.shape
        above = self.above(state)
        return solid.minkowski.heights(above.attitude) + (above.height - self.height)


def of_shape(shape: Any, state: State) -> np.ndarray:
    """Columns (n, 8) by which a wrong shape sinks bodies: 1, height of the centre, the surface's normal in axes of the
    body, and the sizes of its components."""
    normal = rotation_matrix(state.attitude)[2]
    return np.concatenate([np.ones((1, len(state))), -shape.lowest(state.attitude)[2:], normal, np.abs(normal)]).T


def _of_place(place: np.ndarray) -> np.ndarray:
    """1, x, y, x², x y, y² (n, 6)."""
    x, y = place
    return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y], axis=1)
