"""Magnus effect: the air pushes a spinning body perpendicular to its velocity.

    a ← a + k_m ω × v = a + k_m ω (−v_y, v_x)

| on paper | in code | unit | shape |                                                           |
|----------|---------|------|-------|-----------------------------------------------------------|
| k_m      | `k_m`   | 1    |       | mass of the co-rotating air over the mass of the body     |

The force is perpendicular to the velocity and does no work.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class Magnus(Effect):
    name = "magnus"
    family = "flight"
    title = "Magnus effect"
    equation = "a = g + k_m ω × v"
    parameters = (Parameter("k_m", "1", null=0.0, low=-1.0, high=1.0, scale=0.01),)
    channels = ("flight",)
    needs_angle = True
    dimensions = IN_SPACE
    reference = "Rubinow and Keller 1961, doi:10.1017/S0022112061000640"

    def acceleration(self, a, state, p, rig):
        d = state.space.dimension
        lifted = a.copy()
        lifted[:d] += p["k_m"] * state.space.velocity_at(np.zeros_like(state.velocity), state.spin, state.velocity)
        return lifted


EFFECT = Magnus()
