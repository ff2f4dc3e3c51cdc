"""Velocity-dependent friction: μ rises or falls with the slip speed.

    μ ← max(μ (1 + c_μ |v_t|), 0),   |v_t| the mean speed of the slip during the impact

The slip slows down along the path of the impact: its mean speed is (|v_t| + |v_t⁺|)/2 where it lasts to the end, and
|v_t|/2 where it ends before; a second slip, the other way, starts from zero.  The linear law is the first order of any
smooth dependence; a Stribeck curve has c_μ < 0, polymer creep c_μ > 0.

| on paper | in code | unit | shape |                                     |
|----------|---------|------|-------|-------------------------------------|
| c_μ      | `c_mu`  | s/m  |       | relative slope; 0 is Coulomb's law  |

Source: Armstrong-Hélouvry, Dupont and Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter
from thesis_lib.effects.path_friction import second_slip


class VelocityDependentFriction(Effect):
    """μ is linear in the mean tangential contact speed."""

    name = "velocity_dependent_friction"
    family = "contact_law"
    title = "friction depends on speed"
    equation = "μ = max(μ₀ (1 + c_μ |v_t|), 0)"
    parameters = (Parameter("c_mu", "s/m", null=0.0, low=-1.0, high=3.0, scale=0.2),)
    reference = "Armstrong-Hélouvry et al. 1994, doi:10.1016/0005-1098(94)90209-7"

    def coefficients(self, mu, epsilon, space, state, p, rig):
        return np.maximum(mu * (1.0 + p["c_mu"] * _mean_speed(space, mu, epsilon)), 0.0), epsilon

    def impulse(self, impulse, space, mu, epsilon, r, state, p, rig):
        factor = np.maximum(1.0 + p["c_mu"] * _mean_speed(space, mu, epsilon), 1e-9)
        before = mu / factor
        # a second slip gathers speed along K_tn − μ K_tt from where the first has ended
        rate = np.maximum(np.abs(space.K_tn) - before * space.K_tt, 0.0)
        whole = (1.0 + epsilon) * np.abs(space.v_n) / space.K_nn
        ended = np.minimum(_slip_end(space, before), whole)
        after = np.maximum(before * (1.0 + 0.5 * p["c_mu"] * rate * (whole - ended)), 0.0)
        return second_slip(impulse, space, mu, after, epsilon)


def _slip_end(space, mu):
    """Normal impulse at which the first slip ends, ∞ if it is not braked."""
    braking = mu * space.K_tt - np.sign(space.v_t) * space.K_tn
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(braking > 0.0, np.abs(space.v_t) / braking, np.inf)


def _mean_speed(space, mu, epsilon):
    """Mean |v_t| of the first slip, m/s."""
    whole = (1.0 + epsilon) * np.abs(space.v_n) / space.K_nn
    left = np.maximum(1.0 - whole / np.maximum(_slip_end(space, mu), 1e-300), 0.0)
    return 0.5 * np.abs(space.v_t) * (1.0 + left)


EFFECT = VelocityDependentFriction()
