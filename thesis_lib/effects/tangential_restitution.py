"""Tangential restitution: a sticking contact recovers part of its tangential velocity (back-spin).

    c_t ← clip((1 + e_t) c_t, ±μ c_n)   if the contact sticks

so that v_t⁺ = −e_t v_t as long as the impulse stays inside the cone; c_n does not change.

| on paper | in code | unit | shape |                                                       |
|----------|---------|------|-------|-------------------------------------------------------|
| e_t      | `e_t`   | 1    |       | tangential restitution; 0: absent, 1: reverses slip   |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Impulse, Parameter

TOLERANCE = 1e-9  # relative: above the rounding of laws that search for a root, far below any slip that matters
TINY = 1e-300  # N s/kg, avoids a division by zero


class TangentialRestitution(Effect):
    name = "tangential_restitution"
    family = "contact_law"
    title = "tangential restitution"
    equation = "c_t = clip((1 + e_t) c_t,stick, ±μ c_n)"
    equation_in_space = "c_t = (1 + e_t) c_t,stick, |c_t| ≤ μ c_n"
    parameters = (Parameter("e_t", "1", null=0.0, low=-1.0, high=1.0, scale=0.2),)
    needs_angle = True
    rank = -1
    dimensions = IN_SPACE
    reference = "Walton 1993; Chatterjee and Ruina 1998, doi:10.1115/1.2791929"

    def impulse(self, impulse, contact, state, p, rig):
        if contact.dimension == 3:
            c_t = np.array(impulse.c[:2])
            size = np.sqrt((c_t**2).sum(axis=0))
            # |1 + e_t| times the impulse, limited to the cone, or to the impulse of the law if this is outside it
            most = np.maximum(contact.mu * np.abs(impulse.c_n), size) / np.maximum(size, TINY)
            factor = np.where(_sticks(impulse, contact), np.clip(1.0 + p["e_t"], -most, most), 1.0)
            return Impulse((*(factor * c_t), impulse.c_n), impulse.couple)
        # an impulse of the law outside the cone is not reduced
        limit = np.maximum(contact.mu * np.abs(impulse.c_n), np.abs(impulse.c_t))
        wanted = np.clip((1.0 + p["e_t"]) * impulse.c_t, -limit, limit)
        c_t = np.where(_sticks(impulse, contact), wanted, impulse.c_t)
        return Impulse.planar(c_t, impulse.c_n, impulse.couple)


def _sticks(impulse, contact):
    # some laws stick to the end, others (Drumwright-Shell, published Poisson) up to maximum compression only
    def at_rest(c_n):
        if contact.dimension == 3:
            driven = contact.v[:2] + contact.K[:2, 2] * c_n
            c_t = np.array(impulse.c[:2])
            left = driven + (contact.K[:2, :2] * c_t).sum(axis=1)
            return np.sqrt((left**2).sum(axis=0)) <= TOLERANCE * np.sqrt((driven**2).sum(axis=0))
        driven = contact.v_t + contact.K_tn * c_n
        return np.abs(driven + contact.K_tt * impulse.c_t) <= TOLERANCE * np.abs(driven)

    return at_rest(impulse.c_n) | at_rest(impulse.c_n / (1.0 + contact.epsilon))


EFFECT = TangentialRestitution()
