"""Velocity-dependent restitution: faster impacts lose a larger share of their normal velocity.

    ε ← clip(ε (|v_n| / v_0)^−p exp(−c |v_n|), 0, 1),   v_0 = 1 m/s

Two mechanisms lower ε: yield, with a power law (p = 1/4 far above yield, less for hard plastics; Johnson), and viscous
dissipation, where the force k δⁿ (1 + d δ̇) gives 1 − ε ~ |v_n| to first order (Hunt and Crossley).  The exponential
agrees to first order and stays positive; c ≈ (1 + ε) d / 3.

| on paper | in code   | unit | shape |                                                 |
|----------|-----------|------|-------|-------------------------------------------------|
| p        | `p`       | 1    |       | exponent of yield; 0: none                      |
| c        | `c`       | s/m  |       | slope of viscous dissipation; 0: none           |
| v_0      | `SPEED`   | m/s  |       | fixed scale                                     |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter

SPEED = 1.0  # m/s
SLOWEST = 1e-3  # m/s, below every impact that a camera resolves; keeps the power finite at v_n = 0


class VelocityDependentRestitution(Effect):
    name = "velocity_dependent_restitution"
    family = "contact_law"
    title = "restitution depends on speed"
    equation = "ε = ε₀ (|v_n| / 1 m/s)^−p exp(−c |v_n|)"
    parameters = (
        Parameter("p", "1", null=0.0, low=-1.0, high=1.0, scale=0.15, starts=(0.05,)),
        Parameter("c", "s/m", null=0.0, low=-0.5, high=0.5, scale=0.05, starts=(0.02,)),
    )
    dimensions = IN_SPACE
    reference = (
        "Johnson 1985, section 11.5, doi:10.1017/CBO9781139171731; Hunt and Crossley 1975, doi:10.1115/1.3423596"
    )

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        speed = np.maximum(np.abs(contact.v_n), SLOWEST) / SPEED
        return mu, np.clip(epsilon * speed ** -p["p"] * np.exp(-p["c"] * speed), 0.0, 1.0)


EFFECT = VelocityDependentRestitution()
