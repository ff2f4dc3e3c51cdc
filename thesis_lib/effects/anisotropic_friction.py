"""Anisotropic friction: friction differs between slip to the right and slip to the left (print direction, scratches).

    μ ← μ (1 + a_t sign(v_t)),   so that μ_± = μ (1 ± a_t)

The sign follows the slip at each instant of the impact.  The law receives the μ of the first slip.  If the slip
reverses, the change due to the other μ is added as the difference of two impulse paths (Stronge's law), and all else
follows the law in use:

    c ← c_law + c_path(μ of the first slip, then of the second) − c_path(μ of the first slip)

In space an ellipse, symmetric about its centre, limits friction, which dissipates the most energy possible within it
(maximum dissipation), throughout the impact:

    |M⁻¹ dc_t| ≤ dp,   dc_t = −M² v_t / |M v_t| dp while it slips,   M = μ (1 + [[a_c, a_s], [a_s, −a_c]])

For a sliding body, too, f_t = −M² v_t / |M v_t| f_n.  Friction is opposite to the slip only if the slip is along a
principal axis.  With a = |(a_c, a_s)| the semi-axes are μ (1 ± a), the longer one rotated by φ from t_1 to t_2:
(a_c, a_s) = a (cos 2φ, sin 2φ).

| on paper | in code | unit | shape |                                                 |
|----------|---------|------|-------|-------------------------------------------------|
| a_t      | `a_t`   | 1    |       | half the relative difference; 0 is isotropic    |
| a_c, a_s | `a_c`, `a_s` | 1 |     | in space: difference of t_1 and t_2, and of the two diagonals |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.contact.mirtich import impulse as path_impulse
from thesis_lib.effects.effect import IN_SPACE, Effect, Impulse, Parameter, components
from thesis_lib.effects.path_in_space import with_and_without


class AnisotropicFriction(Effect):
    name = "anisotropic_friction"
    family = "contact_law"
    title = "friction depends on direction"
    equation = "μ = μ₀ (1 + a_t sign(v_t))"
    equation_in_space = "|M⁻¹ dc_t| ≤ dp, M = μ₀ (1 + [[a_c, a_s], [a_s, −a_c]])"
    parameters = (Parameter("a_t", "1", null=0.0, low=-0.95, high=0.95, scale=0.1),)
    own_in_space = components(Parameter("a", "1", null=0.0, low=-0.65, high=0.65, scale=0.1), ("a_c", "a_s"))
    level = (("a_c", "a_s", 2),)
    needs_angle = True
    rank = 1
    dimensions = IN_SPACE
    reference = (
        "Zmitrowicz 1981 (constitutive equations of anisotropic friction); maximum dissipation: Goyal, Ruina and "
        "Papadopoulos 1991, doi:10.1016/0043-1648(91)90104-3"
    )
    breaks_mirror = True

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        if contact.dimension == 3:
            return mu, epsilon
        return mu * (1.0 + p["a_t"] * np.sign(contact.v_t)), epsilon

    def impulse(self, impulse, contact, state, p, rig):
        if contact.dimension == 3:
            is_round = not (np.any(p["a_c"]) or np.any(p["a_s"]))
            return impulse if is_round else with_and_without(impulse, contact, state.spin, **p)
        # a second slip has the direction of K_tn; `contact.mu` holds for the first slip
        mu, epsilon = contact.mu, contact.epsilon
        ratio = (1.0 + p["a_t"] * np.sign(contact.K_tn)) / (1.0 + p["a_t"] * np.sign(contact.v_t))
        with np.errstate(all="ignore"):
            changed, plain = path_impulse(contact, mu, epsilon, ratio * mu), path_impulse(contact, mu, epsilon)
        d_t, d_n = (np.where(np.isfinite(a - b), a - b, 0.0) for a, b in zip(changed, plain))
        return Impulse.planar(impulse.c_t + d_t, impulse.c_n + d_n, impulse.couple)

    def sliding(self, mu, contact, state, p, rig):
        if contact.dimension == 2 or not (np.any(p["a_c"]) or np.any(p["a_s"])):
            return mu
        a_c, a_s = (np.broadcast_to(p[name], np.shape(mu)) for name in ("a_c", "a_s"))
        return mu * np.array([[1.0 + a_c, a_s], [a_s, 1.0 - a_c]])


EFFECT = AnisotropicFriction()
