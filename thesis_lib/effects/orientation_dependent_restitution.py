"""Orientation-dependent restitution: the body rebounds differently where it is hit (slender, layered, hollow).

    ε ← clip(ε (1 + a_c cos 2β + a_s sin 2β), 0, 1)

Second harmonic of the place β on the body: opposite places are the same.  What a body cannot show (a_c at the corners
of a square) stays 0.

| on paper | in code | unit | shape |                                                           |
|----------|---------|------|-------|-----------------------------------------------------------|
| a_c      | `a_c`   | 1    |       | ends against sides                                        |
| a_s      | `a_s`   | 1    |       | one diagonal against the other; breaks the mirror         |
| β        |         | rad  | (n,)  | polar angle of the contact point in the axes of the body  |
"""

import numpy as np

from thesis_lib.effects.contact_place import around_body
from thesis_lib.effects.effect import Effect, Parameter


class OrientationDependentRestitution(Effect):
    name = "orientation_dependent_restitution"
    family = "contact_law"
    title = "restitution depends on the place on the body"
    equation = "ε = ε₀ (1 + a_c cos 2β + a_s sin 2β)"
    parameters = (
        Parameter("a_c", "1", null=0.0, low=-0.9, high=0.9, scale=0.1, starts=(0.0,)),
        Parameter("a_s", "1", null=0.0, low=-0.9, high=0.9, scale=0.1, starts=(0.0,)),
    )
    needs_angle = True
    reference = "Stoianovici and Hurmuzlu 1996 (rebound of slender bars at different angles)"
    breaks_mirror = True

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        angle = 2.0 * around_body(state, rig)
        factor = 1.0 + p["a_c"] * np.cos(angle) + p["a_s"] * np.sin(angle)
        return mu, np.clip(epsilon * factor, 0.0, 1.0)


EFFECT = OrientationDependentRestitution()
