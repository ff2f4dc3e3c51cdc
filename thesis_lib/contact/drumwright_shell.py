"""Drumwright-Shell: the impulse of maximum dissipation, with restitution on the normal impulse.

Plastic stage: minimise the kinetic energy ½ cᵀ M_C⁻¹ c + v_Cᵀ c over the friction cone with v_n⁺ ≥ 0; the total
impulse is (c_t, (1 + ε) c_n): restitution leaves the friction impulse unchanged.

As defined, the normal impulse is at most that of the frictionless plastic impact, c_n ≤ κ = −v_n / K_nn.
The feasible set is then a triangle, bounded by the line of maximum compression (through (0, κ)), the line c_n = κ
and the edge of the cone on the side on which friction lifts the contact, c_t K_tn ≥ 0.  The optimum is the stick
impulse, which lies on the line of maximum compression, if this impulse is feasible; otherwise the optimum lies on
the side of the triangle that the stick impulse violates.

As published (the authors' code), this bound is absent: the optimum is the stick impulse if it lies in the cone,
else c = t (−s μ, 1) on an edge, with t = max(t_E, t_0), where t_E minimises the energy on the edge and v_n⁺ = 0 at
t_0; of the two edges the code takes the one with less energy.

Source: Drumwright and Shell, WAFR 2010, doi:10.1007/978-3-642-17452-0_15; thesis section 3.3.2.
"""

import numpy as np

from thesis_lib.contact.law import Law, Promise
from thesis_lib.mechanics.contact import Contact


def impulse(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Impulse (c_t, c_n), each (n,) in N s, with the bound on the normal impulse."""
    stick_t, stick_n = space.impulse_to(0.0, 0.0)
    kappa = -space.v_n / space.K_nn
    limit = mu * kappa
    # side c_n = κ: least energy at c_t = −(v_t + K_tn κ) / K_tt, clipped to where friction lifts (all if K_tn = 0)
    c_t = (space.v_t + space.K_tn * kappa) / -space.K_tt
    lower = np.where(space.K_tn > 0.0, 0.0, -limit)
    upper = np.where(space.K_tn < 0.0, 0.0, limit)
    c_t = np.minimum(np.maximum(c_t, lower), upper)
    c_n = kappa
    # the lifting edge c = t (σ μ, 1), σ = sign K_tn, from v_n⁺ = 0 up to κ
    lifts = stick_t * space.K_tn > 0.0
    slope = np.copysign(mu, space.K_tn)
    t_E, t_0 = _edge_optima(space, slope)
    t = np.minimum(np.maximum(t_E, t_0), kappa)
    sticks = np.abs(stick_t) <= mu * stick_n
    c_t = np.where(lifts, np.where(sticks, stick_t, slope * t), c_t)
    c_n = np.where(lifts, np.where(sticks, stick_n, t), c_n)
    return c_t, (1.0 + epsilon) * c_n


def impulse_as_published(space: Contact, mu: np.ndarray, epsilon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Impulse (c_t, c_n), each (n,) in N s, by the authors' code, without the bound."""
    stick_t, stick_n = space.impulse_to(0.0, 0.0)
    energies, ts = [], []
    for slope in (mu, -mu):
        t_E, t_0 = _edge_optima(space, slope)
        t = np.maximum(t_E, t_0)
        stiffness = space.K_nn + slope * (2.0 * space.K_tn + slope * space.K_tt)
        energy = t * (0.5 * stiffness * t + space.v_n + slope * space.v_t)
        # if K_nn + slope K_tn ≤ 0, no point on this edge reaches v_n⁺ ≥ 0
        energies.append(np.where(space.K_nn + slope * space.K_tn > 0.0, energy, np.inf))
        ts.append(t)
    right = energies[0] < energies[1]
    sticks = np.abs(stick_t) <= mu * stick_n
    t = np.where(right, ts[0], ts[1])
    c_t = np.where(sticks, stick_t, np.where(right, mu, -mu) * t)
    return c_t, (1.0 + epsilon) * np.where(sticks, stick_n, t)


def _edge_optima(space: Contact, slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parameters t on the edge c = t (slope, 1) at which the energy is least and at which v_n⁺ = 0."""
    reach = space.K_nn + slope * space.K_tn
    stiffness = reach + slope * (space.K_tn + slope * space.K_tt)
    return -(space.v_n + slope * space.v_t) / stiffness, -space.v_n / reach


LAW = Law(
    name="drumwright_shell",
    title="Drumwright-Shell",
    impulse=impulse,
    promises=frozenset(Promise) - {Promise.PLASTIC, Promise.CENTRAL, Promise.STICKS},
    breaks={Promise.PLASTIC: 0.277, Promise.CENTRAL: 0.431, Promise.STICKS: 0.709},
    reference="Drumwright and Shell 2010, doi:10.1007/978-3-642-17452-0_15",
)

LAW_AS_PUBLISHED = Law(
    name="drumwright_shell_as_published",
    title="Drumwright-Shell (as published)",
    impulse=impulse_as_published,
    promises=frozenset(Promise) - {Promise.NO_ENERGY_GAIN, Promise.PLASTIC, Promise.CENTRAL},
    breaks={Promise.NO_ENERGY_GAIN: 0.154, Promise.PLASTIC: 0.634, Promise.CENTRAL: 0.431},
    reference="authors' code, github.com/mcubelab/planar-impact-dataset",
)
