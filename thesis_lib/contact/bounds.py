"""Post-hoc bounds: the best that any rigid point impulse could do, and the best of a set of laws (thesis 3.3.2).

IRB Bound: of all admissible impulses (pushing, not penetrating, not gaining energy: thesis, figure 3-2) the one
with the least velocity error √(δv_x² + δv_y² + (k δω)²).  In that metric the error is, up to the part that no
impulse through the contact point can reach, the distance (c − c_irb)ᵀ M_C⁻¹ (c − c_irb), the same quadratic form
that bounds the energy.  With M_C⁻¹ = L Lᵀ and z = Lᵀ c the energy ellipse is a disc about z_0 = −Lᵀ M_C v_C, and

    v_n⁺ ≥ 0   is a half-plane through the centre of the disc,
    c_n ≥ 0    is a half-plane through z = 0, which lies on its circle,

so the bound is the Euclidean projection of a point onto the part of a disc cut off by two lines: exact and batched.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.contact.space import contact_space, measured_impulse, velocity_change, velocity_error

TOLERANCE = 1e-10  # of the disc's radius: candidates lie on the boundaries only up to rounding


@dataclass(frozen=True)
class BestImpulse:
    """Post-hoc best of n impacts: impulse (n, 2) in N s, v_post (n, 3) in m/s and rad/s, kinetic error (n,) in m/s."""

    impulse: np.ndarray
    v_post: np.ndarray
    error: np.ndarray


def irb_bound(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray, *, mass: float, k_g: float) -> BestImpulse:
    """Ideal Rigid-Body Bound: best admissible impulse for each measured impact.

    Args:
        v_pre, v_post: (n, 3) measured velocities, m/s and rad/s; impacts must approach (v_n < 0).
        r: (n, 2) contact points, m.
        mass, k_g: kg, m.
    """
    dv = v_post - v_pre
    space = contact_space(v_pre, r, mass=mass, k_g=k_g)
    # M_C⁻¹ = L Lᵀ, L lower triangular; z = Lᵀ c
    l_tt = np.sqrt(space.K_tt)
    l_nt = space.K_tn / l_tt
    l_nn = np.sqrt(space.det) / l_tt

    def whiten(c: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        return np.stack([l_tt * c[0] + l_nt * c[1], l_nn * c[1]], axis=-1)

    target = whiten(measured_impulse(dv, r, mass=mass, k_g=k_g))
    centre = whiten(space.impulse_to(0.0, 0.0))
    radius = np.linalg.norm(centre, axis=1)
    # v_n⁺ = (l_nt, l_nn)·(z − z_0) ≥ 0
    normal = np.stack([l_nt, l_nn], axis=-1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    z = project_on_cut_disc(target, centre, radius, normal)
    c_n = z[:, 1] / l_nn
    c_t = (z[:, 0] - l_nt * c_n) / l_tt
    change = velocity_change(c_t, c_n, r, mass=mass, k_g=k_g)
    return BestImpulse(np.stack([c_t, c_n], axis=-1), v_pre + change, velocity_error(dv - change, k_g))


def project_on_cut_disc(target: np.ndarray, centre: np.ndarray, radius: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Nearest point to `target` in {|z − centre| ≤ radius, normal·(z − centre) ≥ 0, z_2 ≥ 0}; all (n, 2) or (n,).

    The nearest point is the target itself, its projection on one of the three boundaries, or a corner; of these
    candidates the feasible one that is nearest.  The set is never empty: it holds the impulse of a frictionless
    plastic impact.
    """
    away = target - centre
    length = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
    on_circle = centre + radius[:, None] * away / length
    on_normal = target - np.sum(normal * away, axis=1, keepdims=True) * normal
    on_up = target * [1.0, 0.0]
    candidates = [target, on_circle, on_normal, on_up]
    # corners: circle with v_n⁺ = 0 (its diameter), circle with z_2 = 0, and the crossing of the two lines
    along = np.stack([normal[:, 1], -normal[:, 0]], axis=-1)
    candidates += [centre + radius[:, None] * along, centre - radius[:, None] * along]
    half = np.sqrt(np.maximum(radius**2 - centre[:, 1] ** 2, 0.0))
    zero = np.zeros_like(half)
    candidates += [np.stack([centre[:, 0] + half, zero], -1), np.stack([centre[:, 0] - half, zero], -1)]
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        crossing = np.sum(normal * centre, axis=1) / normal[:, 0]
    # parallel lines cross nowhere, or too far to matter
    near = np.abs(crossing - centre[:, 0]) <= 2.0 * radius
    candidates.append(np.stack([np.where(near, crossing, 0.0), zero], axis=-1))

    z = np.stack(candidates)  # (9, n, 2)
    offset = z - centre
    slack = TOLERANCE * radius
    feasible = (
        (np.linalg.norm(offset, axis=-1) <= radius + slack)
        & (np.sum(normal * offset, axis=-1) >= -slack)
        & (z[..., 1] >= -slack)
    )
    distance = np.where(feasible, np.linalg.norm(z - target, axis=-1), np.inf)
    nearest = np.take_along_axis(z, np.argmin(distance, axis=0)[None, :, None], axis=0)[0]
    # without a target there is no nearest point, though the corners are still feasible
    return np.where(np.isfinite(target).all(axis=1, keepdims=True), nearest, np.nan)


def best_post_hoc(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best Post Hoc: index and error (n,) of the best law for each impact, from errors (n, laws) in m/s.

    Raises:
        ValueError: an impact has no finite error at all.
    """
    usable = np.where(np.isfinite(errors), errors, np.inf)
    best = np.argmin(usable, axis=1)
    error = usable[np.arange(len(errors)), best]
    if not np.all(np.isfinite(error)):
        raise ValueError(f"{np.sum(~np.isfinite(error))} impacts have no finite error from any law")
    return best, error
