"""Position-dependent contact time: the surface is softer at one end.

    τ ← τ (k(x_c) / k_0)^(−1/2),   k(x_c) / k_0 = max(1 − 2 g_τ x_c, 1/10)

The stiffness k of a linear contact changes linearly along the surface, and τ ~ k^(−1/2).  x_c is the place of the
contact point, counted from the reference; τ and k_0 are the values at the reference.

| on paper | in code | unit | shape | meaning                                             |
|----------|---------|------|-------|-----------------------------------------------------|
| g_τ      | `g_tau` | 1/m  |       | relative slope of τ along +t, at the reference      |
|          | `g_tau_x`, `g_tau_y` | 1/m | | in space: along both axes of the surface       |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.contact_place import along_gradient
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components

SOFTEST = 0.1  # lower limit, relative to the stiffness at the reference
_SLOPE = Parameter("g_tau", "1/m", null=0.0, low=-10.0, high=10.0, scale=1.0, starts=(0.0,))


class PositionDependentContactTime(Effect):
    name = "position_dependent_contact_time"
    family = "surface"
    title = "contact time depends on place"
    equation = "τ = τ₀ (1 − 2 g_τ x_c)^(−1/2)"
    equation_in_space = "τ = τ₀ (1 − 2 g_τ·x_c)^(−1/2)"
    parameters = (_SLOPE,)
    own_in_space = components(_SLOPE, ("g_tau_x", "g_tau_y"))
    level = (("g_tau_x", "g_tau_y", 1),)
    embedded = (("g_tau_x", "g_tau", 1.0),)
    channels = ("touch",)
    needs_contact_time = True
    needs_one_surface = True
    reference = "stiffness that is linear in place, of a linear spring; Goldsmith 1960, chapter 4"
    breaks_mirror = True
    along = ("x",)
    dimensions = IN_SPACE

    def contact_time(self, tau, contact, state, p, rig):
        return tau / np.sqrt(np.maximum(1.0 - 2.0 * along_gradient(state, p, "g_tau", rig), SOFTEST))


EFFECT = PositionDependentContactTime()
