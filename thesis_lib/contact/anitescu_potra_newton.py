"""Anitescu-Potra with Newton's restitution: Coulomb's law on the total impulse and the final slip.

The law is a linear complementarity problem in (c_n, β₁, β₂, λ).  For one planar contact the linearised cone is
exact and the solution has closed form: with the target v_n⁺ = −ε v_n,

    stick   c = M_C (−v_t, −(1 + ε) v_n)                          if |c_t| ≤ μ c_n
    slide   c_n = −(1 + ε) v_n / (K_nn − s μ K_tn),  c_t = −s μ c_n   otherwise, s the sign of the final slip.

In space the cone is circular, and the solution requires one root of a scalar equation (circular_cone.py).

On the line v_n⁺ = −ε v_n, which crosses the cone's axis, v_t⁺ grows with c_t; a stick impulse outside the cone
therefore lies beyond the edge on its own side, and s = −sign(c_t of the stick impulse).

Source: Anitescu and Potra, Nonlinear Dynamics 14 (1997), doi:10.1023/A:1008292328909; thesis section 3.3.2.
"""

import numpy as np

from thesis_lib.contact import circular_cone
from thesis_lib.contact.law import Law, Promise
from thesis_lib.mechanics.contact import Contact


def impulse(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t, c_n) or (c_t1, c_t2, c_n), each (n,) in N s, for the target normal velocity −ε v_n."""
    target = (-1.0 - epsilon) * space.v_n
    return impulse_to_normal_velocity(space, mu, target)


def impulse_to_normal_velocity(space: Contact, mu: np.ndarray, dv_n: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (n,) in N s that changes v_n by `dv_n` ≥ 0 (n,) in m/s, with Coulomb's law on the final slip."""
    if space.dimension == 3:
        return circular_cone.impulse_to_normal_velocity(space, mu, dv_n)
    c_t = -(space.K_nn * space.v_t + space.K_tn * dv_n) / space.det
    c_n = (space.K_tt * dv_n + space.K_tn * space.v_t) / space.det
    slope = np.copysign(mu, c_t)  # c_t / c_n on the cone's edge, −s μ
    slides = np.abs(c_t) > mu * c_n
    c_n = np.where(slides, dv_n / (space.K_nn + slope * space.K_tn), c_n)
    return np.where(slides, slope * c_n, c_t), c_n


LAW = Law(
    name="anitescu_potra_newton",
    title="AP Newton",
    impulse=impulse,
    promises=frozenset(Promise) - {Promise.NO_ENERGY_GAIN},
    breaks={Promise.NO_ENERGY_GAIN: 0.0184},
    dimensions=frozenset({2, 3}),
    breaks_in_space={Promise.NO_ENERGY_GAIN: 0.0119},
    reference="Anitescu and Potra 1997, doi:10.1023/A:1008292328909",
)
