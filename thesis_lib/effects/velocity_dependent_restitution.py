"""Velocity-dependent restitution: faster impacts lose a larger share of their normal velocity.

    ε ← clip(ε (|v_n| / v_0)^−p, 0, 1),   v_0 = 1 m/s

Plastic contact above yield has p = 1/4, hard plastics less; ε is then the restitution at v_0.

| on paper | in code   | unit | shape |                                     |
|----------|-----------|------|-------|-------------------------------------|
| p        | `p`       | 1    |       | exponent; 0 is constant restitution |
| v_0      | `SPEED`   | m/s  |       | fixed scale                         |

Source: Johnson, Contact Mechanics, 1985, section 11.5, doi:10.1017/CBO9781139171731.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter

SPEED = 1.0  # m/s
SLOWEST = 1e-3  # m/s, below every impact that a camera sees; keeps the power finite at v_n = 0


class VelocityDependentRestitution(Effect):
    """ε falls with a power of the normal contact speed."""

    name = "velocity_dependent_restitution"
    family = "contact_law"
    title = "restitution depends on speed"
    equation = "ε = ε₀ (|v_n| / 1 m/s)^−p"
    parameters = (Parameter("p", "1", null=0.0, low=-1.0, high=1.0, scale=0.15),)
    reference = "Johnson 1985, doi:10.1017/CBO9781139171731"

    def coefficients(self, mu, epsilon, space, state, p, rig):
        speed = np.maximum(np.abs(space.v_n), SLOWEST) / SPEED
        return mu, np.clip(epsilon * speed ** -p["p"], 0.0, 1.0)


EFFECT = VelocityDependentRestitution()
