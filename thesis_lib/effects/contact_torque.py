"""Contact torque: a patch of finite width resists rolling with an impulsive couple.

    τ = −clip(2 k² ω̄, ±m_r c_n),   ω̄ = ω + (r_x c_n − r_y c_t) / (2 k²)

ω̄ is the mean of the rates before and after the law's impulse; τ opposes it with the lever m_r and saturates before
it would turn it round, so the couple never gives energy.  c_n is left as it is.  The couple turns the contact point
by −r_y τ / k² along t, and friction answers as on the total impulse:

    c_t ← c_t + C(−r_y τ / k²) − C(0),   C(u) = clip(−(v_t + u + K_tn c_n) / K_tt, ±μ c_n)

so that a stuck contact stays stuck (it rolls) and a sliding one is not touched.

| on paper | in code | unit | shape |                                                              |
|----------|---------|------|-------|--------------------------------------------------------------|
| m_r      | `m_r`   | m    |       | lever of rolling resistance, at most the patch's half-width  |
| k²       | `k2`    | m²   | (n,)  | radius of gyration squared, as the contact space has it      |

Source: Brach 1989 (rigid body collisions: moment coefficient).
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Impulse, Parameter


class ContactTorque(Effect):
    """Couple against the mean rolling rate, proportional to the normal impulse."""

    name = "contact_torque"
    family = "contact_law"
    title = "contact torque"
    equation = "τ = −sign(ω̄) min(m_r c_n, 2 k² |ω̄|)"
    parameters = (Parameter("m_r", "m", null=0.0, low=0.0, high=0.02, scale=5e-4),)
    reference = "Brach 1989"

    def impulse(self, impulse, space, mu, epsilon, r, state, p, rig):
        c_t, c_n = impulse.c_t, impulse.c_n
        r_x, r_y = r
        # K_tt + K_nn − 2 = |r|² / k²: the k of this impact, whatever other effects made of it
        k2 = (r_x * r_x + r_y * r_y) / (space.K_tt + space.K_nn - 2.0)
        rate = state.omega + (r_x * c_n - r_y * c_t) / (2.0 * k2)
        lever = p["m_r"] * np.abs(c_n)
        tau = -np.clip(2.0 * k2 * rate, -lever, lever)

        def friction(turned):
            limit = mu * np.abs(c_n)
            return np.clip(-(space.v_t + turned + space.K_tn * c_n) / space.K_tt, -limit, limit)

        answer = friction(-r_y * tau / k2) - friction(0.0)
        return Impulse(c_t + answer, c_n, impulse.tau + tau)


EFFECT = ContactTorque()
