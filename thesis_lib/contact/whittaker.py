"""Whittaker: Newton's restitution and friction that opposes the initial slip but may not reverse it.

As defined: c_n = −(1 + ε) v_n / (K_nn − s μ K_tn), c_t = −s μ c_n with s the sign of the initial slip, if this
keeps s v_t⁺ ≥ 0; otherwise the contact sticks, c = M_C (−v_t, −(1 + ε) v_n), even if this impulse is outside the cone.
Without initial slip the contact sticks.  In space friction is directed against the initial slip, and the contact sticks
if the remaining slip would be reversed, v_t·v_t⁺ < 0.

As published (the authors' code): the stick impulse; if it is outside the cone, c_t = ±μ c_n against the resulting
slip, *without* solving for c_n again.  The normal impulse then does not depend on μ, and the contact may penetrate.
The code tries c_t = +μ c_n first and otherwise takes −μ c_n unchecked; if the impulse pulls (c_n < 0), both may be
directed along the slip, and the result is not mirror symmetric (0.2 % of the reference draw).

Sources: Whittaker, Analytical Dynamics, 1904; reviewed by Chatterjee and Ruina 1998, doi:10.1115/1.2791929;
thesis section 3.3.2.
"""

import numpy as np

from thesis_lib.contact.law import Law, Promise
from thesis_lib.mechanics.contact import Contact


def impulse(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n) or (c_t1, c_t2, c_n), each (n,) in N s, of a contact that slides as initially or sticks."""
    dv_n = (-1.0 - epsilon) * space.v_n
    if space.dimension == 3:
        return _in_space(space, mu, dv_n)
    slope = -np.copysign(mu, space.v_t)
    reach = space.K_nn + slope * space.K_tn
    slide_n = dv_n / reach
    slide_t = slope * slide_n
    v_t = space.v_t + space.K_tt * slide_t + space.K_tn * slide_n
    slides = (v_t * space.v_t >= 0.0) & (reach > 0.0) & (space.v_t != 0.0)
    stick_t = -(space.K_nn * space.v_t + space.K_tn * dv_n) / space.det
    stick_n = (space.K_tt * dv_n + space.K_tn * space.v_t) / space.det
    return np.where(slides, slide_t, stick_t), np.where(slides, slide_n, stick_n)


def _in_space(space: Contact, mu: np.ndarray, dv_n: np.ndarray) -> tuple[np.ndarray, ...]:
    v_1, v_2, v_n = space.v
    speed = np.hypot(v_1, v_2)
    share = -mu / np.where(speed > 0.0, speed, 1.0)
    reach = space.K_nn + share * (space.K[0][2] * v_1 + space.K[1][2] * v_2)
    slide_n = dv_n / reach
    slide = share * v_1 * slide_n, share * v_2 * slide_n, slide_n
    after = space.velocity_after(*slide)
    slides = (after[0] * v_1 + after[1] * v_2 >= 0.0) & (reach > 0.0) & (speed > 0.0)
    stick = space.impulse_to(0.0, 0.0, v_n + dv_n)
    return tuple(np.where(slides, *both) for both in zip(slide, stick))


def impulse_as_published(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n), each (n,) in N s, of the authors' code."""
    c_t, c_n = space.impulse_to(0.0, -epsilon * space.v_n)
    limit = mu * c_n
    v_t = space.v_t + space.K_tt * limit + space.K_tn * c_n  # slip if friction were +μ c_n
    edge = np.where(v_t * limit > 0.0, -limit, limit)
    return np.where(np.abs(c_t) > limit, edge, c_t), c_n


LAW = Law(
    name="whittaker",
    title="Whittaker",
    impulse=impulse,
    promises=frozenset(Promise) - {Promise.FRICTION_CONE, Promise.NO_ENERGY_GAIN, Promise.FRICTIONLESS},
    breaks={Promise.FRICTION_CONE: 0.0384, Promise.NO_ENERGY_GAIN: 0.0248, Promise.FRICTIONLESS: 0.163},
    dimensions=frozenset({2, 3}),
    breaks_in_space={
        Promise.FRICTION_CONE: 0.0807,
        Promise.NO_ENERGY_GAIN: 0.0163,
        Promise.FRICTIONLESS: 0.053,
        Promise.STICKS: 0.00436,
    },
    reference="Whittaker 1904; Chatterjee and Ruina 1998, doi:10.1115/1.2791929",
)

LAW_AS_PUBLISHED = Law(
    name="whittaker_as_published",
    title="Whittaker (as published)",
    impulse=impulse_as_published,
    promises=frozenset({Promise.HOMOGENEOUS, Promise.STICKS, Promise.CENTRAL}),
    breaks={
        Promise.NON_PENETRATION: 0.140,
        Promise.FRICTION_CONE: 0.0891,  # each time because it pulls: c_n < 0
        Promise.NO_ENERGY_GAIN: 0.124,
        Promise.FRICTIONLESS: 1.0,
        Promise.PLASTIC: 0.634,
    },
    reference="authors' code, github.com/mcubelab/planar-impact-dataset",
)
