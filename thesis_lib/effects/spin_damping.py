"""Spin damping: a couple that opposes the spin in flight, without a force (air around a smooth ball).

    α ← α − c_w ω

| on paper | in code | unit | shape |                          |
|----------|---------|------|-------|--------------------------|
| c_w      | `c_w`   | 1/s  |       | decay rate of the spin   |

In the plane linear_drag contains it, together with a force.
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter


class SpinDamping(Effect):
    name = "spin_damping"
    family = "flight"
    title = "damped spin"
    equation = "α = −c_w ω"
    parameters = (Parameter("c_w", "1/s", null=0.0, low=0.0, high=20.0, scale=0.1),)
    channels = ("flight",)
    needs_angle = True
    dimensions = ONLY_SPACE
    reference = "Stokes 1851"

    def acceleration(self, a, state, p, rig):
        return a - np.concatenate([np.zeros_like(state.velocity), p["c_w"] * state.spin])


EFFECT = SpinDamping()
