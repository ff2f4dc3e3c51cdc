"""Tangential restitution: a stuck contact gives back part of its tangential velocity (back-spin).

    c_t ← clip((1 + e_t) c_t, ±μ c_n)   where the contact sticks

so that v_t⁺ = −e_t v_t as long as the impulse stays inside the cone; c_n is left as it is.

| on paper | in code | unit | shape |                                                       |
|----------|---------|------|-------|-------------------------------------------------------|
| e_t      | `e_t`   | 1    |       | tangential restitution; 0 absent, 1 reverses the slip |
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Impulse, Parameter

TOLERANCE = 1e-9  # relative: above the rounding of laws that search for a root, far below any slip that matters


class TangentialRestitution(Effect):
    name = "tangential_restitution"
    family = "contact_law"
    title = "tangential restitution"
    equation = "c_t = clip((1 + e_t) c_t,stick, ±μ c_n)"
    parameters = (Parameter("e_t", "1", null=0.0, low=-1.0, high=1.0, scale=0.2),)
    needs_angle = True
    rank = -1
    reference = "Walton 1993; Chatterjee and Ruina 1998, doi:10.1115/1.2791929"

    def impulse(self, impulse, contact, state, p, rig):
        # where the law itself leaves the cone, it is not cut back
        limit = np.maximum(contact.mu * np.abs(impulse.c_n), np.abs(impulse.c_t))
        wanted = np.clip((1.0 + p["e_t"]) * impulse.c_t, -limit, limit)
        c_t = np.where(_sticks(impulse, contact), wanted, impulse.c_t)
        return Impulse.planar(c_t, impulse.c_n, impulse.couple)


def _sticks(impulse, contact):
    # some laws stick to the end, others (Drumwright-Shell, published Poisson) up to maximum compression only
    def at_rest(c_n):
        driven = contact.v_t + contact.K_tn * c_n
        return np.abs(driven + contact.K_tt * impulse.c_t) <= TOLERANCE * np.abs(driven)

    return at_rest(impulse.c_n) | at_rest(impulse.c_n / (1.0 + contact.epsilon))


EFFECT = TangentialRestitution()
