"""Orientation-dependent friction: the faces of the body have different friction (a coated face, a glued pad).

    μ ← max(μ (1 + a·u), 0)

| on paper | in code             | unit | shape  |                                                                 |
|----------|---------------------|------|--------|-----------------------------------------------------------------|
| a        | `a_x`, `a_y`, `a_z` | 1    |        | difference of opposite faces, axes of the body                  |
| u        |                     | 1    | (3, n) | direction of the body that faces the surface, axes of the body  |
"""

import numpy as np

from thesis_lib.effects.contact_place import down_in_body
from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter, along_axes, components


class OrientationDependentFriction(Effect):
    name = "orientation_dependent_friction"
    family = "contact_law"
    title = "friction depends on the face"
    equation = "μ = μ₀ (1 + a·u)"
    parameters = components(
        Parameter("a", "1", null=0.0, low=-0.9, high=0.9, scale=0.1, starts=(0.0,)), ("a_x", "a_y", "a_z")
    )
    needs_angle = True
    dimensions = ONLY_SPACE
    breaks_mirror = True
    reference = "first order of a smooth dependence on the face"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        factor = 1.0 + (along_axes(p, "a", state.space) * down_in_body(state)).sum(axis=0)
        return np.maximum(mu * factor, 0.0), epsilon


EFFECT = OrientationDependentFriction()
