"""Position-dependent restitution: the surface is harder at one end.

    ε ← clip(ε (1 + g_ε x_c), 0, 1)

x_c is the place of the contact point, counted from the reference; ε is the value there.

| on paper | in code   | unit | shape |                                    |
|----------|-----------|------|-------|------------------------------------|
| g_ε      | `g_eps`   | 1/m  |       | relative slope along +t            |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.contact_place import along_surface
from thesis_lib.effects.effect import Effect, Parameter


class PositionDependentRestitution(Effect):
    name = "position_dependent_restitution"
    family = "surface"
    title = "restitution depends on place"
    equation = "ε = ε₀ (1 + g_ε x_c)"
    parameters = (Parameter("g_eps", "1/m", null=0.0, low=-10.0, high=10.0, scale=0.5),)
    needs_one_surface = True
    reference = "first order of a smooth dependence on place"
    breaks_mirror = True
    along = ("x",)

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu, np.clip(epsilon * (1.0 + p["g_eps"] * along_surface(state, rig)), 0.0, 1.0)


EFFECT = PositionDependentRestitution()
