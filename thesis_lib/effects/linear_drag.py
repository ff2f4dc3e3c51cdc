"""Linear drag: a force and a couple that oppose and are proportional to the motion (lubricated guide plate, slow air).

    a ← a − c_v (v_x, v_y),   α ← α − c_w ω

| on paper | in code | unit | shape |                              |
|----------|---------|------|-------|------------------------------|
| c_v      | `c_v`   | 1/s  |       | decay rate of the velocity   |
| c_w      | `c_w`   | 1/s  |       | decay rate of the spin       |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components


class LinearDrag(Effect):
    name = "linear_drag"
    family = "flight"
    title = "linear drag"
    equation = "a = g − c_v v, α = −c_w ω"
    parameters = components(Parameter("c", "1/s", null=0.0, low=0.0, high=20.0, scale=0.1), ("c_v", "c_w"))
    channels = ("flight",)
    dimensions = IN_SPACE
    includes = ("spin_damping",)
    reference = "Stokes 1851"

    def acceleration(self, a, state, p, rig):
        return a - np.concatenate([p["c_v"] * state.velocity, p["c_w"] * state.spin])


EFFECT = LinearDrag()
