"""Orientation-dependent restitution: ε depends on the place that touches (slender, layered or hollow bodies).

    ε ← clip(ε (1 + a_c cos 2β + a_s sin 2β), 0, 1);   in space ε ← clip(ε (1 + a·u), 0, 1)

In the plane this is the second harmonic of the place β on the body: opposite places are equal.  Parameters that a body
cannot reveal (a_c at the corners of a square) stay 0.  In space u is the direction of the body that faces the surface:
opposite faces differ.

| on paper | in code | unit | shape |                                                           |
|----------|---------|------|-------|-----------------------------------------------------------|
| a_c      | `a_c`   | 1    |       | difference of ends and sides                              |
| a_s      | `a_s`   | 1    |       | difference of the diagonals; breaks mirror symmetry       |
| a, u     | `a_x`, `a_y`, `a_z` | 1 | | in space, axes of the body                                 |
| β        |         | rad  | (n,)  | polar angle of the contact point in the axes of the body  |
"""

import numpy as np

from thesis_lib.effects.contact_place import around_body, down_in_body
from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, along_axes, components

_SIZE = Parameter("a", "1", null=0.0, low=-0.9, high=0.9, scale=0.1, starts=(0.0,))


class OrientationDependentRestitution(Effect):
    name = "orientation_dependent_restitution"
    family = "contact_law"
    title = "restitution depends on the place on the body"
    equation = "ε = ε₀ (1 + a_c cos 2β + a_s sin 2β)"
    equation_in_space = "ε = ε₀ (1 + a·u), u the direction of the body that faces the surface"
    parameters = components(_SIZE, ("a_c", "a_s"))
    own_in_space = components(_SIZE, ("a_x", "a_y", "a_z"))
    needs_angle = True
    dimensions = IN_SPACE
    reference = "Stoianovici and Hurmuzlu 1996 (rebound of slender bars at different angles)"
    breaks_mirror = True

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        if not state.space.is_plane:
            factor = 1.0 + (along_axes(p, "a", state.space) * down_in_body(state)).sum(axis=0)
            return mu, np.clip(epsilon * factor, 0.0, 1.0)
        angle = 2.0 * around_body(state, rig)
        factor = 1.0 + p["a_c"] * np.cos(angle) + p["a_s"] * np.sin(angle)
        return mu, np.clip(epsilon * factor, 0.0, 1.0)


EFFECT = OrientationDependentRestitution()
