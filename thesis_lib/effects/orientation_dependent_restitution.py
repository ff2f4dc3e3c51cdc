"""Orientation-dependent restitution: the body rebounds differently along its two axes (slender, layered, hollow).

    ε ← clip(ε (1 + a_c cos 2θ + a_s sin 2θ), 0, 1)

Second harmonic of the body angle: a body turned by half a turn is the same.

| on paper | in code | unit | shape |                                                      |
|----------|---------|------|-------|------------------------------------------------------|
| a_c      | `a_c`   | 1    |       | ends against sides                                   |
| a_s      | `a_s`   | 1    |       | one diagonal against the other; breaks the mirror    |
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class OrientationDependentRestitution(Effect):
    name = "orientation_dependent_restitution"
    family = "contact_law"
    title = "restitution depends on body angle"
    equation = "ε = ε₀ (1 + a_c cos 2θ + a_s sin 2θ)"
    parameters = (
        Parameter("a_c", "1", null=0.0, low=-0.9, high=0.9, scale=0.1),
        Parameter("a_s", "1", null=0.0, low=-0.9, high=0.9, scale=0.1),
    )
    reference = "Stoianovici and Hurmuzlu 1996 (rebound of slender bars at different angles)"

    def coefficients(self, mu, epsilon, space, state, p, rig):
        angle = 2.0 * state.theta
        factor = 1.0 + p["a_c"] * np.cos(angle) + p["a_s"] * np.sin(angle)
        return mu, np.clip(epsilon * factor, 0.0, 1.0)


EFFECT = OrientationDependentRestitution()
