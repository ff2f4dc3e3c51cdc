"""Empirical surface on which bodies touch in space, estimated from hits if the believed one is wrong.

A bent table, a camera that is not perpendicular to it, a wrong size of the body or a displaced marker change the gap at
hits by millimetres, and a wrong corner appears to touch.  A regression of the gap φ on position and attitude,

    φ̂ = h(x, y) + s z_c + u·n + w·|n|,    h of second order

with z_c the height of the centre above the contact point and n the normal in body axes, represents all of these causes
to first order.  It serves only to find further hits; models are fitted to the measured data.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.optimize import least_squares

from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

FEWEST = 39  # least number of hits, three for each column
OFF = 1e-3  # m, scatter of the gaps at hits below which the touching corner is not in doubt
EXPLAINED = 0.5  # greatest fraction of that scatter that may remain
PLACES = 6  # number of columns of h


@dataclass(frozen=True)
class Ground:
    """Regression φ̂: `coefficients` (13,), in m and 1/m; `middle` (2,) in m, the origin of positions."""

    coefficients: np.ndarray
    middle: np.ndarray

    @classmethod
    def seen(cls, rig: Rig, state: State) -> Self | None:
        """Ground estimated from states (n,) at hits; None for too few hits or if the believed surface is adequate."""
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
            # a weak prior towards zero determines what few attitudes leave undetermined
            return np.concatenate([(X @ (b / size) - gap) / scale, 1e-3 * b / spread])

        found = least_squares(sigmas, start, loss="soft_l1").x / size
        left = gap - X @ found
        return cls(found, middle) if robust_std(left - np.median(left)) < EXPLAINED * spread else None

    def under(self, shape: Any, state: State) -> State:
        """States relative to the believed surface: turned by the slope of h, and shifted by φ̂."""
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
    """The believed rig with the ground estimated from hits, if it differs from the believed surface."""

    ground: Ground | None = None

    def above(self, state: State) -> State:
        """States relative to the believed surface; unchanged without a ground."""
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
    """Regressors (n, 8) for the depth due to a wrong shape: 1, height of the centre, the surface's normal in body axes,
    and the absolute values of its components."""
    normal = rotation_matrix(state.attitude)[2]
    return np.concatenate([np.ones((1, len(state))), -shape.lowest(state.attitude)[2:], normal, np.abs(normal)]).T


def _of_place(place: np.ndarray) -> np.ndarray:
    """Columns 1, x, y, x², x y, y² (n, 6) of h."""
    x, y = place
    return np.stack([np.ones(len(x)), x, y, x * x, x * y, y * y], axis=1)
