"""Velocity-dependent friction: μ falls, or rises, from a static value with the speed of slip (Stribeck).

    μ(v_t) = μ (1 + s exp(−(v_t / v_s)²)),   along the path of the impact: dc_t = −μ(v_t) sign(v_t) dp while it slips

μ on the right is the value for fast slip.  Slip, and with it friction, changes during the impact; a contact sticks as
long as the static friction μ (1 + s) suffices.  The same curve holds for a body that slides on the surface.  s > 0 is
the Stribeck curve of dry and lubricated metals, s < 0 is friction that rises with speed (polymers); if v_s is above all
speeds, both are parabolas in the speed.

| on paper | in code | unit | shape |                                                     |
|----------|---------|------|-------|-----------------------------------------------------|
| s        | `s`     | 1    |       | static over sliding friction, minus 1; 0 is Coulomb |
| v_s      | `v_s`   | m/s  |       | Stribeck velocity                                   |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter
from thesis_lib.effects.impulse_path import added, walk
from thesis_lib.effects.path_in_space import with_and_without


class VelocityDependentFriction(Effect):
    name = "velocity_dependent_friction"
    family = "contact_law"
    title = "friction depends on speed"
    equation = "μ = μ₀ (1 + s exp(−(v_t/v_s)²))"
    parameters = (
        Parameter("s", "1", null=0.0, low=-0.9, high=3.0, scale=0.2, starts=(0.2, -0.2)),
        Parameter("v_s", "m/s", null=0.5, low=0.05, high=3.0, scale=0.05, starts=(0.5, 1.2)),
    )
    needs_angle = True
    rank = 2
    dimensions = IN_SPACE
    reference = "Armstrong-Hélouvry, Dupont and Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7"

    def impulse(self, impulse, contact, state, p, rig):
        s, v_s = p["s"], p["v_s"]
        if not np.any(s):
            return impulse
        if contact.dimension == 3:
            return with_and_without(impulse, contact, state.spin, s=s, v_s=v_s)

        def factor(v_t: np.ndarray) -> np.ndarray:
            return 1.0 + s * np.exp(-((v_t / v_s) ** 2))

        return added(impulse, walk(contact, factor), contact.mu * (1.0 + np.maximum(s, 0.0)))

    def sliding(self, mu, contact, state, p, rig):
        slip = np.linalg.norm(contact.v[:-1], axis=0)
        return mu * (1.0 + p["s"] * np.exp(-((slip / p["v_s"]) ** 2)))


EFFECT = VelocityDependentFriction()
