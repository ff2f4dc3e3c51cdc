"""Anisotropic friction: slip to the right meets another friction than slip to the left (print direction, scratches).

    μ ← μ (1 + a_t sign(v_t)),   so that μ_± = μ (1 ± a_t)

The sign is that of the slip at each instant of the impact.  The law gets the μ of the first slip.  Where slip ends and
may go on the other way, the change by the other μ is added as the difference of two impulse paths (Stronge's), so that
all else is as the law has it:

    c ← c_law + c_path(μ of the first slip, then of the second) − c_path(μ of the first slip)

| on paper | in code | unit | shape |                                                 |
|----------|---------|------|-------|-------------------------------------------------|
| a_t      | `a_t`   | 1    |       | half the relative difference; 0 is isotropic    |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.contact.mirtich import impulse as path_impulse
from thesis_lib.effects.effect import Effect, Impulse, Parameter


class AnisotropicFriction(Effect):
    name = "anisotropic_friction"
    family = "contact_law"
    title = "friction depends on direction"
    equation = "μ = μ₀ (1 + a_t sign(v_t))"
    parameters = (Parameter("a_t", "1", null=0.0, low=-0.95, high=0.95, scale=0.1),)
    needs_angle = True
    rank = 1
    reference = "Zmitrowicz 1981 (constitutive equations of anisotropic friction)"
    breaks_mirror = True

    def coefficients(self, mu, epsilon, contact, state, p, rig):
        return mu * (1.0 + p["a_t"] * np.sign(contact.v_t)), epsilon

    def impulse(self, impulse, contact, state, p, rig):
        # a second slip goes the way of K_tn; `contact.mu` is that of the first
        mu, epsilon = contact.mu, contact.epsilon
        ratio = (1.0 + p["a_t"] * np.sign(contact.K_tn)) / (1.0 + p["a_t"] * np.sign(contact.v_t))
        with np.errstate(all="ignore"):
            changed, plain = path_impulse(contact, mu, epsilon, ratio * mu), path_impulse(contact, mu, epsilon)
        d_t, d_n = (np.where(np.isfinite(a - b), a - b, 0.0) for a, b in zip(changed, plain))
        return Impulse.planar(impulse.c_t + d_t, impulse.c_n + d_n, impulse.couple)


EFFECT = AnisotropicFriction()
