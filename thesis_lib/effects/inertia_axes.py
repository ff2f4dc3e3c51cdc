"""Inertia axes: the principal axes of the inertia are rotated in the body relative to the assumed axes.

    G → Q G Qᵀ,   Q = exp(b),   α = G⁻¹ (G ω × ω) in flight

The moments do not change.  If two moments are equal, a rotation about the third axis has no effect and is not fitted.

| on paper | in code             | unit | shape        |                                          |
|----------|---------------------|------|--------------|------------------------------------------|
| b        | `b_x`, `b_y`, `b_z` | rad  |              | rotation vector, axes of the body        |
| Q        |                     | 1    | (3, 3, n)    | rotation of the assumed into true axes   |
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter, along_axes, components
from thesis_lib.mechanics.inertia import principal_axes
from thesis_lib.mechanics.space import SPACE, of_rotation_vector, rotation_matrix

EQUAL = 1e-6  # relative to the largest moment: if moments differ by less, their axes are undefined


class InertiaAxes(Effect):
    name = "inertia_axes"
    family = "inertia"
    title = "turned axes of inertia"
    equation = "I = exp(b) I₀ exp(b)ᵀ"
    parameters = components(Parameter("b", "rad", null=0.0, low=-0.8, high=0.8, scale=0.05), ("b_x", "b_y", "b_z"))
    channels = ("impact", "flight")
    denies = "inertia"
    needs_angle = True
    rank = 1
    turns = True
    dimensions = ONLY_SPACE
    reference = "Goldstein, Classical Mechanics, chapter 5"

    def applies_to(self, rig):
        return not rig.space.is_plane and len(self.unseen(rig)) < 3

    def unseen(self, rig):
        G = np.asarray(rig.G)[:, :, 0]
        axes = principal_axes(G)
        moments = np.diag(axes.T @ G @ axes)
        apart = np.abs(np.roll(moments, -1) - np.roll(moments, 1))  # difference of the other two moments, for each axis
        return axes.T[apart < EQUAL * moments.max()]

    def inertia(self, G, p):
        Q = rotation_matrix(of_rotation_vector(along_axes(p, "b", SPACE)))
        return np.einsum("ijn,jkn,lkn->iln", Q, np.asarray(G), Q)


EFFECT = InertiaAxes()
