"""Adhesion: separation requires a fixed energy, so slow impacts rebound less.

    ε² ← max(ε² − (v_s / v_n)², 0)

Below the speed v_s / ε the body stays on the surface.  The first derivative with respect to v_s is zero at v_s = 0.

| on paper | in code | unit | shape |                                                         |
|----------|---------|------|-------|---------------------------------------------------------|
| v_s      | `v_s`   | m/s  |       | normal speed whose energy adhesion absorbs; 0: absent   |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter

SLOWEST = 1e-3  # m/s, below every impact that a camera resolves; keeps the quotient finite at v_n = 0


class Adhesion(Effect):
    name = "adhesion"
    family = "contact_law"
    title = "adhesion"
    equation = "ε² = max(ε₀² − (v_s / v_n)², 0)"
    parameters = (Parameter("v_s", "m/s", null=0.0, low=0.0, high=3.0, scale=0.3, starts=(0.1, 0.8)),)
    rank = 5
    dimensions = IN_SPACE
    reference = "Thornton and Ning 1998, doi:10.1016/S0032-5910(98)00099-0"

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        lost = p["v_s"] / np.maximum(np.abs(contact.v_n), SLOWEST)
        return mu, np.sqrt(np.maximum(epsilon * epsilon - lost * lost, 0.0))


EFFECT = Adhesion()
