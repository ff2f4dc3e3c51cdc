"""Position-dependent contact time: the surface is softer at one end.

    τ ← max(τ (1 + g_τ x_c), 0)

x_c is the place of the contact point, counted from the reference; τ is the value there.  τ ~ k^(−1/2) for the stiffness
k of a linear contact.

| on paper | in code | unit | shape | meaning                            |
|----------|---------|------|-------|------------------------------------|
| g_τ      | `g_tau` | 1/m  |       | relative slope along +t            |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.contact_place import along_surface
from thesis_lib.effects.effect import Effect, Parameter


class PositionDependentContactTime(Effect):
    name = "position_dependent_contact_time"
    family = "surface"
    title = "contact time depends on place"
    equation = "τ = τ₀ (1 + g_τ x_c)"
    parameters = (Parameter("g_tau", "1/m", null=0.0, low=-10.0, high=10.0, scale=1.0, starts=(0.0,)),)
    channels = ("touch",)
    needs_trajectories = True
    needs_contact_time = True
    needs_one_surface = True
    reference = "first order of a smooth dependence on place; stiffness of a spring, Goldsmith 1960, chapter 4"
    breaks_mirror = True
    along = ("x",)

    def contact_time(self, tau, space, state, p, rig):
        return np.maximum(tau * (1.0 + p["g_tau"] * along_surface(state, rig)), 0.0)


EFFECT = PositionDependentContactTime()
