"""Quadratic drag: air resistance opposite to the velocity, proportional to its square.

    a ← a − c_q |v| (v_x, v_y),   c_q = ρ C_d A / (2 m)

| on paper | in code | unit | shape |                                         |
|----------|---------|------|-------|-----------------------------------------|
| c_q      | `c_q`   | 1/m  |       | over a path 1 / c_q, v falls to 1/e     |

The spin does not change.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class QuadraticDrag(Effect):
    name = "quadratic_drag"
    family = "flight"
    title = "air drag"
    equation = "a = g − c_q |v| v"
    parameters = (Parameter("c_q", "1/m", null=0.0, low=0.0, high=10.0, scale=0.1),)
    channels = ("flight",)
    dimensions = IN_SPACE
    reference = "Newton, Principia, book II; Batchelor 1967"

    def acceleration(self, a, state, p, rig):
        slowed = a.copy()
        slowed[: state.space.dimension] -= p["c_q"] * np.sqrt((state.velocity**2).sum(axis=0)) * state.velocity
        return slowed


EFFECT = QuadraticDrag()
