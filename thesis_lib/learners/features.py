"""Inputs and targets of learned contact models (thesis section 4.3.2, equations 4.7 and 4.9 to 4.11).

    X1 = (M_c,tt, M_c,tn, M_c,nn, v_t, v_n)                 inertia and velocity of the contact point, eq. 4.9
    X2 = ((M_c v_c)_t, (M_c v_c)_n)                         momentum of the contact point, eq. 4.10
    X2 polar = (atan2(p_n, p_t), |p|), p = M_c v_c          as in the authors' repository
    X1 + ω                                                  an extension: ω is not a function of X1
    full = (q, v, r, m, m k²)                               ten numbers, the input of the contact map as it is, eq. 4.7

    rigid   (c_t, c_n)        c_irb = M_C J Δv, the impulse through the contact point that is nearest to Δv, eq. 4.11
    wrench  (c_t, c_n, τ)     c = m (Δv_x, Δv_y),  τ = m (k² Δω − r_x Δv_y + r_y Δv_x) about the contact point

A wrench is a change of coordinates of Δv and loses nothing; a rigid impulse drops the couple.

The undefined X5 of the thesis's class 2 is read as X1.  Without a mass, impulses are per kilogram.

Source: Fazeli, Zapolsky, Drumwright, Rodriguez, "Learning data-efficient rigid-body contact models", CoRL 2017.
"""

from typing import Literal

import numpy as np

from thesis_lib.contact.space import contact_space, measured_impulse, residual_couple
from thesis_lib.datasets.format.impacts import Impacts

FeatureSet = Literal["X1", "X2", "X2_polar", "X1_omega", "full"]


def features(impacts: Impacts, chosen: FeatureSet) -> np.ndarray:
    """Features of n impacts, (n, 5), (n, 2), (n, 2), (n, 6) or (n, 10) in SI units, from before impact only."""
    if chosen == "full":
        body = np.tile([impacts.mass, impacts.mass * impacts.k_g**2], (len(impacts), 1))
        return np.column_stack([impacts.q, impacts.v_pre, impacts.r, body])
    space = contact_space(impacts.v_pre, impacts.r, mass=impacts.mass, k_g=impacts.k_g)
    if chosen in ("X1", "X1_omega"):
        M_c = space.M_c
        x1 = np.stack([M_c[:, 0, 0], M_c[:, 0, 1], M_c[:, 1, 1], space.v_t, space.v_n], axis=1)
        return x1 if chosen == "X1" else np.column_stack([x1, impacts.v_pre[:, 2]])
    momentum = -np.stack(space.impulse_to(0.0, 0.0), axis=1)
    if chosen == "X2":
        return momentum
    # an approaching contact has mostly downward momentum, so the angle does not jump
    p_t, p_n = momentum.T
    return np.stack([np.arctan2(p_n, p_t), np.hypot(p_t, p_n)], axis=1)


def impulse_of(dv: np.ndarray, impacts: Impacts, *, wrench: bool) -> np.ndarray:
    """Impulse (c_t, c_n) in N s or wrench (c_t, c_n, τ in N m s) of the velocity change dv (n, 3); linear in dv."""
    body = {"mass": impacts.mass, "k_g": impacts.k_g}
    if wrench:
        return np.column_stack([impacts.mass * dv[:, :2], residual_couple(dv, impacts.r, **body)])
    return np.stack(measured_impulse(dv, impacts.r, **body), axis=1)


def velocity_map(impacts: Impacts, *, wrench: bool) -> np.ndarray:
    """A = M⁻¹ Jᵀ, (n, 3, 2) or (n, 3, 3) in 1/kg, 1/(kg m), 1/(kg m²); columns are Δv by c_t, c_n and τ."""
    A = wrench_map(impacts.r, impacts.k_g) / impacts.mass
    return A if wrench else A[:, :, :2]


def wrench_map(r: np.ndarray, k_g: float) -> np.ndarray:
    """A = M⁻¹ Jᵀ (n, 3, 3) per unit mass: velocity change per component of (c_t, c_n, τ) at r (n, 2) in m."""
    A, inverse = np.tile(np.eye(3), (len(r), 1, 1)), 1.0 / k_g**2
    A[:, 2] = np.column_stack([-inverse * r[:, 1], inverse * r[:, 0], np.full(len(r), inverse)])
    return A


def velocity_after(impulse: np.ndarray, impacts: Impacts) -> np.ndarray:
    """v⁺ = v + M⁻¹ Jᵀ c, (n, 3), from impulses (n, 2) or wrenches (n, 3) (thesis, equation 4.8)."""
    A = velocity_map(impacts, wrench=impulse.shape[1] == 3)
    return impacts.v_pre + np.einsum("nij,nj->ni", A, impulse)
