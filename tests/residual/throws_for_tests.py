"""A square and random starts, for the tests of flights, throws and beliefs."""

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.effects.effect import Rig
from thesis_lib.thesis.residual.throwing.flight import ThrownBody

HALF = 0.03
SQUARE = Polygon(vertices=((HALF, HALF), (-HALF, HALF), (-HALF, -HALF), (HALF, -HALF)))
RIG = Rig(SQUARE, 0.0245, 9.81, 0.0)


def thrown_square(rho: float = 0.0, c_v: float = 0.0, c_w: float = 0.0) -> ThrownBody:
    """The square of the rig, with corners rounded by `rho` (m) and linear drag (1/s)."""
    corners = np.array(SQUARE.vertices) * (1.0 - rho / HALF)
    return ThrownBody(tuple(map(tuple, corners.tolist())), rho, RIG.k_g, RIG.gravity, RIG.height, c_v, c_w)


BODY = thrown_square()


def starts(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Any poses above the surface and velocities, (n, 3) each."""
    q = np.column_stack([rng.normal(size=n), rng.uniform(0.05, 0.2, n), rng.uniform(-3.0, 3.0, n)])
    v = np.column_stack([rng.normal(size=n), rng.uniform(-2.5, 2.0, n), rng.uniform(-25.0, 25.0, n)])
    return q, v


def throws(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Starts like those of the measured throws."""
    rng = np.random.default_rng(seed)
    q = np.column_stack([np.zeros(n), np.full(n, 0.155), rng.uniform(-3.0, 3.0, n)])
    v = np.column_stack([rng.uniform(-0.9, -0.3, n), rng.uniform(-2.5, -1.8, n), rng.uniform(-10, 10, n)])
    return q, v
