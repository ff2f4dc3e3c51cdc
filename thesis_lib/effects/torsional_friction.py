"""Torsional friction: a contact patch resists spin about the normal, in one cone with the friction against slip.

    |(dc_t / μ, dτ_n / m_t)| ≤ dp,   opposite to (v_t, ω_n) throughout the impact

The couple is m_t dp if the body spins without slip, and vanishes for fast slip.  A disk of radius R under uniform
pressure has m_t = 2 μ R / 3 (Contensou).

| on paper | in code | unit | shape |                                                                  |
|----------|---------|------|-------|------------------------------------------------------------------|
| m_t      | `m_t`   | m    |       | largest couple about the normal over the normal impulse          |
| τ_n, ω_n |         |      | (n,)  | couple and spin about the normal                                 |
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter
from thesis_lib.effects.path_in_space import with_and_without


class TorsionalFriction(Effect):
    name = "torsional_friction"
    family = "contact_law"
    title = "torsional friction"
    equation = "|(dc_t / μ, dτ_n / m_t)| ≤ dp"
    parameters = (Parameter("m_t", "m", null=0.0, low=0.0, high=0.02, scale=1e-3),)
    needs_angle = True
    rank = 4
    dimensions = ONLY_SPACE
    reference = "Contensou 1963; Leine and Glocker 2003, doi:10.1016/S0997-7538(02)01256-9"

    def impulse(self, impulse, contact, state, p, rig):
        if not np.any(p["m_t"]):
            return impulse
        return with_and_without(impulse, contact, state.spin, m_t=p["m_t"])


EFFECT = TorsionalFriction()
