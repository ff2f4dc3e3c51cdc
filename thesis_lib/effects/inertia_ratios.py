"""Inertia ratios: the principal moments of inertia have other ratios than assumed.

    G → A diag(G_xx, G_yy (1 + a_y), G_zz (1 + a_z)) Aᵀ,   A the assumed principal axes,   α = G⁻¹ (G ω × ω) in flight

Hits depend on the moments, flights only on their ratios: a common factor of all moments does not change free rotation.

| on paper | in code      | unit | shape  |                                                                  |
|----------|--------------|------|--------|------------------------------------------------------------------|
| a_y, a_z | `a_y`, `a_z` | 1    |        | relative errors of two principal moments; x is unchanged         |
| A        | `axes`       | 1    | (3, 3) | columns: the principal axes nearest to x, y, z of the body       |
| ω, α     |              | rad/s, rad/s² | (3, n) | spin and its change, axes of the body                   |
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter, components, vector
from thesis_lib.mechanics.inertia import principal_axes

_NAMES = ("a_y", "a_z")


class InertiaRatios(Effect):
    name = "inertia_ratios"
    family = "inertia"
    title = "wrong ratios of inertia"
    equation = "I_yy = I_yy,0 (1 + a_y), I_zz = I_zz,0 (1 + a_z)"
    parameters = components(Parameter("a", "1", null=0.0, low=-0.6, high=1.5, scale=0.1), _NAMES)
    channels = ("impact", "flight")
    denies = "inertia"
    needs_angle = True
    turns = True
    dimensions = ONLY_SPACE
    reference = "Goldstein, Classical Mechanics, chapter 5"

    def inertia(self, G, p):
        G, a = np.asarray(G), vector(p, _NAMES)
        axes = principal_axes(G[:, :, 0])
        moments = np.einsum("ji,jkn,ki->in", axes, G, axes)
        more = np.concatenate([np.zeros((1, a.shape[1])), a]) * moments
        return G + np.einsum("ij,jn,kj->ikn", axes, more, axes)


EFFECT = InertiaRatios()
