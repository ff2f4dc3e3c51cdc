"""Velocity-dependent contact time: a contact that stiffens with depth is shorter in faster impacts.

    τ ← τ (|v_n| / v_0)^−p K_nn^(p/2),   v_0 = 1 m/s

A force k δⁿ that stops the mass m / K_nn lasts T ~ (m / (K_nn k))^(1/(n+1)) |v_n|^(−p) with p = (n − 1) / (n + 1).
The model already contains the factor K_nn^(−1/2) of a linear spring.  Hertz: n = 3/2, p = 1/5.

| on paper | in code | unit | shape | meaning                                                   |
|----------|---------|------|-------|-----------------------------------------------------------|
| p        | `p`     | 1    |       | exponent; 0: linear spring, 1/5: Hertz, < 0: softens      |
| v_0      | `SPEED` | m/s  |       | fixed scale; τ holds for a central impact with v_0        |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter

SPEED = 1.0  # m/s
SLOWEST = 1e-2  # m/s, below every impact that a camera resolves; keeps the power finite at v_n = 0


class VelocityDependentContactTime(Effect):
    name = "velocity_dependent_contact_time"
    family = "contact_law"
    title = "contact time depends on speed"
    equation = "τ = τ₀ (|v_n| / 1 m/s)^−p K_nn^(p/2)"
    parameters = (Parameter("p", "1", null=0.0, low=-0.5, high=0.9, scale=0.15, starts=(0.0,)),)
    channels = ("touch",)
    needs_contact_time = True
    dimensions = IN_SPACE
    reference = "Hertz 1882; Johnson 1985, section 11.4, doi:10.1017/CBO9781139171731"

    def contact_time(self, tau, contact, state, p, rig):
        speed = np.maximum(np.abs(contact.v_n), SLOWEST) / SPEED
        return tau * (np.sqrt(contact.K_nn) / speed) ** p["p"]


EFFECT = VelocityDependentContactTime()
