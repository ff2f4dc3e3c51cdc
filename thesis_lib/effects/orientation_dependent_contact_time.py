"""Orientation-dependent contact time: a corner or a side of the body is softer than the others.

    τ ← τ exp(a_c cos β + a_s sin β + b_c cos 2β + b_s sin 2β)

These are the first two harmonics of the place β on the body.  They can represent any four values of τ at the corners of
a rectangle; the exponential keeps τ positive.  Parameters that a body cannot reveal (b_c for a square) stay 0.

In space τ ← τ exp(a·u), u the direction of the body that faces the surface: opposite faces differ.

| on paper | in code | unit | shape | meaning                                                             |
|----------|---------|------|-------|---------------------------------------------------------------------|
| a_c, a_s | `a_c`, `a_s` | 1 |     | difference of opposite sides, along the axes of the body            |
| b_c, b_s | `b_c`, `b_s` | 1 |     | difference of ends and sides, and of the two diagonals              |
| a, u     | `a_x`, `a_y`, `a_z` | 1 | (3, n) | in space, axes of the body                                 |
| β        |         | rad  | (n,)  | polar angle of the contact point in the axes of the body            |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.contact_place import around_body, down_in_body
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, along_axes, components

_SIZE = Parameter("a", "1", null=0.0, low=-2.0, high=2.0, scale=0.1, starts=(0.0,))


class OrientationDependentContactTime(Effect):
    name = "orientation_dependent_contact_time"
    family = "contact_law"
    title = "contact time depends on the place on the body"
    equation = "τ = τ₀ exp(a_c cos β + a_s sin β + b_c cos 2β + b_s sin 2β)"
    equation_in_space = "τ = τ₀ exp(a·u), u the direction of the body that faces the surface"
    parameters = components(_SIZE, ("a_c", "a_s", "b_c", "b_s"))
    own_in_space = components(_SIZE, ("a_x", "a_y", "a_z"))
    channels = ("touch",)
    needs_contact_time = True
    needs_angle = True
    dimensions = IN_SPACE
    reference = "first harmonics of a smooth dependence on the place"
    breaks_mirror = True

    def contact_time(self, tau, contact, state, p, rig):
        if not state.space.is_plane:
            return tau * np.exp((along_axes(p, "a", state.space) * down_in_body(state)).sum(axis=0))
        beta = around_body(state, rig)
        first = p["a_c"] * np.cos(beta) + p["a_s"] * np.sin(beta)
        return tau * np.exp(first + p["b_c"] * np.cos(2.0 * beta) + p["b_s"] * np.sin(2.0 * beta))


EFFECT = OrientationDependentContactTime()
