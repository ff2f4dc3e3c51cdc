"""Position-dependent restitution: the surface is harder at one end.

    ε ← clip(ε (1 + g_ε x_c), 0, 1)

x_c is the place of the contact point, counted from the reference; ε is the value at the reference.

| on paper | in code   | unit | shape |                                    |
|----------|-----------|------|-------|------------------------------------|
| g_ε      | `g_eps`   | 1/m  |       | relative slope along +t            |
|          | `g_eps_x`, `g_eps_y` | 1/m | | in space: along both axes of the surface |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.contact_place import along_gradient
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components

_SLOPE = Parameter("g_eps", "1/m", null=0.0, low=-10.0, high=10.0, scale=0.5)


class PositionDependentRestitution(Effect):
    name = "position_dependent_restitution"
    family = "surface"
    title = "restitution depends on place"
    equation = "ε = ε₀ (1 + g_ε x_c)"
    equation_in_space = "ε = ε₀ (1 + g_ε·x_c)"
    parameters = (_SLOPE,)
    own_in_space = components(_SLOPE, ("g_eps_x", "g_eps_y"))
    level = (("g_eps_x", "g_eps_y", 1),)
    embedded = (("g_eps_x", "g_eps", 1.0),)
    needs_one_surface = True
    reference = "first order of a smooth dependence on place"
    breaks_mirror = True
    along = ("x",)
    dimensions = IN_SPACE

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + along_gradient(state, p, "g_eps", rig)), 0.0, 1.0)


EFFECT = PositionDependentRestitution()
