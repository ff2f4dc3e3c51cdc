"""Bodies and states of which the tests of the effects know by hand what happens to them."""

import numpy as np

from thesis_lib.bodies.shapes import Disk, Polygon
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.state import State

N = 400
EXACT = 1e-12  # rounding of quantities of order 1 to 10
RADIUS = 0.03
DISK = Rig(Disk(radius=RADIUS), RADIUS / np.sqrt(2.0), 9.81, 0.0)
HALF = 0.03  # half the side of the square
SQUARE = Rig(Polygon(vertices=((HALF, HALF), (-HALF, HALF), (-HALF, -HALF), (HALF, -HALF))), 0.0245, 9.81, 0.0)


def at_rest(**given: float | np.ndarray) -> State:
    """A body at rest at the origin, or one for each of the given values, but for these."""
    values = dict.fromkeys(("x", "y", "theta", "vx", "vy", "omega", "trial", "t"), 0.0) | given
    return State.planar(*np.broadcast_arrays(*map(np.atleast_1d, values.values())))


def on(name: str, **p: float):
    """An effect with these parameters, the others at null."""
    effect = EFFECTS[name]
    return [(effect, {q.name: q.null for q in effect.parameters} | p)]


def coefficients(name: str, v_t: float = 0.0, v_n: float = -1.0, **given: float) -> tuple[float, float]:
    """μ and ε that an effect makes of 0.2 and 0.5."""
    state = {key: given.pop(key) for key in ("x", "theta", "trial") if key in given}
    space = Contact.planar(*(np.array([a]) for a in (v_t, v_n, 3.0, 1.0, 0.0)))
    effect, p = on(name, **given)[0]
    mu, epsilon = effect.coefficients(np.array([0.2]), np.array([0.5]), space, at_rest(**state), p, DISK)
    return float(mu[0]), float(epsilon[0])
