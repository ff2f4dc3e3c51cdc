"""Contact torque: a contact patch of finite width resists rolling with a couple throughout the impact.

    dτ = −m_r sign(ω) dp while the body turns;  once it has stopped, |dτ| ≤ m_r dp as needed to keep ω = 0

This is Coulomb's law for rolling: the normal force can act off the nominal contact point by at most m_r.  During an
impact ω changes, often its sign, and the couple with it; the couple never adds energy.  Through dv_t = −r_y dτ / k² and
dv_n = r_x dτ / k² it also changes the slip and the end of restitution, which follow their own laws on the same path.

In space the couple opposes the rotation about the axes along the surface, whatever its direction.

| on paper | in code | unit | shape |                                                              |
|----------|---------|------|-------|--------------------------------------------------------------|
| m_r      | `m_r`   | m    |       | lever of rolling resistance, at most the patch's half-width  |
| k²       | `k2`    | m²   | (n,)  | radius of gyration squared, as in the contact space          |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Impulse, Parameter
from thesis_lib.effects.impulse_path import STEPS, NormalPath, added, friction, whole_impulse
from thesis_lib.effects.path_in_space import with_and_without


class ContactTorque(Effect):
    name = "contact_torque"
    family = "contact_law"
    title = "contact torque"
    equation = "dτ = −m_r sign(ω) dp, |dτ| ≤ m_r dp where ω = 0"
    equation_in_space = "dτ_t = −m_r ω_t/|ω_t| dp, |dτ_t| ≤ m_r dp where ω_t = 0"
    parameters = (Parameter("m_r", "m", null=0.0, low=0.0, high=0.02, scale=5e-4),)
    needs_angle = True
    rank = 4
    dimensions = IN_SPACE
    reference = "Brach 1989 (rigid body collisions: moment coefficient); Johnson 1985, chapter 8 (rolling resistance)"

    def impulse(self, impulse, contact, state, p, rig):
        if not np.any(p["m_r"]):
            return impulse
        if contact.dimension == 3:
            return with_and_without(impulse, contact, state.spin, m_r=p["m_r"])
        with np.errstate(all="ignore"):
            paths = _paths(contact, state.omega, p["m_r"])
        return added(impulse, paths, contact.mu, lever=p["m_r"])


def _paths(contact, omega, m_r) -> Impulse:
    """Impulses and couples (2, n) at the ends of the paths with rolling resistance and without."""
    (r_x, r_y), inverse = contact.r, contact.mobility
    turn_t, turn_n = r_y * inverse, r_x * inverse
    dp = whole_impulse(contact) / STEPS
    kick, limit, spin = contact.K_tn * dp, contact.mu * dp, turn_n * dp
    most = np.stack([m_r * dp, 0.0 * dp])
    v_t, couple, path = contact.v_t, np.zeros_like(most), NormalPath(contact, turn_n)
    for _ in range(STEPS):
        # friction assumes the couple of the last step, so that a sticking contact continues to stick while it rolls
        kicked = v_t + kick - turn_t * couple
        d_t = friction(kicked, limit, contact.K_tt)
        omega = omega + spin - turn_t * d_t
        d_tau = friction(omega, most, inverse)
        omega = omega + inverse * d_tau
        v_t = kicked + contact.K_tt * d_t - turn_t * (d_tau - couple)
        couple = d_tau
        path.step(dp, d_t, d_tau)
    return path.end(contact.epsilon)


EFFECT = ContactTorque()
