"""Position-dependent friction: the surface is rougher at one end.

    μ ← max(μ (1 + g_μ x_c), 0)

x_c is the place of the contact point, counted from the reference; μ is the value at the reference.

| on paper | in code   | unit | shape |                                    |
|----------|-----------|------|-------|------------------------------------|
| g_μ      | `g_mu`    | 1/m  |       | relative slope along +t            |
|          | `g_mu_x`, `g_mu_y` | 1/m | | in space: along both axes of the surface |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.contact_place import along_gradient
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components

_SLOPE = Parameter("g_mu", "1/m", null=0.0, low=-10.0, high=10.0, scale=0.5)


class PositionDependentFriction(Effect):
    name = "position_dependent_friction"
    family = "surface"
    title = "friction depends on place"
    equation = "μ = μ₀ (1 + g_μ x_c)"
    equation_in_space = "μ = μ₀ (1 + g_μ·x_c)"
    parameters = (_SLOPE,)
    own_in_space = components(_SLOPE, ("g_mu_x", "g_mu_y"))
    level = (("g_mu_x", "g_mu_y", 1),)
    embedded = (("g_mu_x", "g_mu", 1.0),)
    needs_one_surface = True
    reference = "first order of a smooth dependence on place"
    breaks_mirror = True
    along = ("x",)
    dimensions = IN_SPACE

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return np.maximum(mu * (1.0 + along_gradient(state, p, "g_mu", rig)), 0.0), epsilon


EFFECT = PositionDependentFriction()
