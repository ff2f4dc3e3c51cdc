"""Post-hoc bounds: the smallest error of any rigid point impulse, and of the best in a set of laws (thesis 3.3.2).

IRB Bound: the admissible impulse (it pushes, does not penetrate, does not gain energy: thesis, figure 3-2) with the
least velocity error √(|δv|² + δωᵀ G δω), where G = k² in the plane.  Apart from a residual that no impulse through
the contact point can reduce, the squared error times the mass is (c − c_irb)ᵀ M_C⁻¹ (c − c_irb), the quadratic form
that also bounds the energy.  With M_C⁻¹ = L Lᵀ and z = Lᵀ c the energy ellipse is a ball about z_0 = −L⁻¹ v_C, and

    v_n⁺ ≥ 0   is a half-space whose boundary passes through the centre of the ball,
    c_n ≥ 0    is a half-space whose boundary passes through z = 0, a point on the surface of the ball.

The bound is therefore the Euclidean projection of a point onto a ball cut by two planes, which is computed exactly
for all impacts at once.
"""

from dataclasses import dataclass
from itertools import compress, product

import numpy as np

from thesis_lib.contact.space import contact_space, velocity_change, velocity_error
from thesis_lib.mechanics.contact import Contact
from thesis_lib.mechanics.space import PLANE, SPACE

TOLERANCE = 1e-10  # relative to the ball's radius: candidates lie on the boundaries only up to rounding


@dataclass(frozen=True)
class BestImpulse:
    """Best post-hoc impulses (n, 2) in N s of n impacts, v_post (n, 3) in m/s and rad/s, kinetic error (n,) in m/s."""

    impulse: np.ndarray
    v_post: np.ndarray
    error: np.ndarray


def irb_bound(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray, *, mass: float, k_g: float) -> BestImpulse:
    """Ideal Rigid-Body Bound: the best admissible impulse for each measured impact in the plane.

    Args:
        v_pre, v_post: (n, 3) measured velocities, m/s and rad/s; impacts must approach (v_n < 0).
        r: (n, 2) contact points, m.
        mass, k_g: kg, m.
    """
    dv = v_post - v_pre
    c = best_impulse(contact_space(v_pre, r, mass=mass, k_g=k_g), dv.T)
    change = velocity_change(c[0], c[1], r, mass=mass, k_g=k_g)
    return BestImpulse(c.T, v_pre + change, velocity_error(dv - change, k_g))


def best_impulse(at: Contact, dv: np.ndarray) -> np.ndarray:
    """Admissible impulse (d, n) in N s that best explains measured changes `dv` (d + turns, n) in m/s, rad/s."""
    space = PLANE if at.dimension == 2 else SPACE
    d = space.dimension
    v, wanted = np.array([*at.v]).T[:, :, None], space.velocity_at(dv[:d], dv[d:], at.r).T[:, :, None]
    K: np.ndarray = np.moveaxis(np.array([[*row] for row in at.K]), -1, 0)
    known = np.asarray(np.isfinite(np.concatenate([K, v, wanted], axis=2)).all(axis=(1, 2)))
    L = np.linalg.cholesky(np.where(known[:, None, None], K, np.eye(d)))
    target, centre = np.linalg.solve(L, wanted)[:, :, 0], -np.linalg.solve(L, v)[:, :, 0]
    # v_n⁺ is the last row of L times z − z_0
    z = project_on_cut_ball(target, centre, L[:, -1] / np.linalg.norm(L[:, -1], axis=1, keepdims=True))
    c = np.linalg.solve(np.swapaxes(L, 1, 2), z[:, :, None])[:, :, 0]
    return np.where(known[:, None], c, np.nan).T


def project_on_cut_ball(target: np.ndarray, centre: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Nearest point to `target` in {|z − centre| ≤ |centre|, normal·(z − centre) ≥ 0, z_d ≥ 0}; all (n, d).

    For each choice of faces (none, one or both), the candidate is the nearest point of the ball within their
    intersection; the result is the nearest feasible candidate.  The set is never empty: it contains the impulse of a
    frictionless plastic impact.
    """
    n, d = target.shape
    radius, up = np.linalg.norm(centre, axis=1), np.zeros((n, d))
    up[:, -1] = 1.0
    faces = ((normal, np.zeros(n)), (up, -centre[:, -1]))  # a·(z − centre) ≥ b
    away, best, least = target - centre, np.full((n, d), np.nan), np.full(n, np.inf)
    for chosen in product((False, True), repeat=2):
        middle, nearest = np.zeros((n, d)), away
        if active := list(compress(faces, chosen)):
            A, b = np.stack([a for a, _ in active], 1), np.stack([b for _, b in active], 1)
            back = np.linalg.pinv(A)  # for parallel faces, the point midway between them
            middle = (back @ b[:, :, None])[:, :, 0]
            nearest = middle + away - (back @ (A @ away[:, :, None]))[:, :, 0]
        room = np.sqrt(np.maximum(radius**2 - (middle**2).sum(axis=1), 0.0))
        length = np.maximum(np.linalg.norm(nearest - middle, axis=1), 1e-300)
        z = middle + np.minimum(1.0, room / length)[:, None] * (nearest - middle)
        feasible = np.linalg.norm(z, axis=1) <= radius * (1.0 + TOLERANCE)
        for a, b in faces:
            feasible &= (a * z).sum(axis=1) >= b - TOLERANCE * radius
        distance = np.where(feasible, np.linalg.norm(z - away, axis=1), np.inf)
        best, least = np.where((distance < least)[:, None], z, best), np.minimum(distance, least)
    return centre + best


def best_post_hoc(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Best Post Hoc: index and error (n,) of the best law for each impact, given errors (n, laws) in m/s.

    Raises:
        ValueError: no law has a finite error at some impact.
    """
    usable = np.where(np.isfinite(errors), errors, np.inf)
    best = np.argmin(usable, axis=1)
    error = usable[np.arange(len(errors)), best]
    if not np.all(np.isfinite(error)):
        raise ValueError(f"{np.sum(~np.isfinite(error))} impacts have no finite error from any law")
    return best, error
