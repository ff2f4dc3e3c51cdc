"""Velocities that an impact can produce without penetration or energy gain: projection and unbounded coordinates.

With z = (v_x, v_y, k ω) the kinetic energy is m |z|²/2, so the feasible set is a half ball in the kinetic metric:

    |z⁺| ≤ |z| = R        the energy ellipse (or, with a couple, the ellipsoid) of equations 4.4 and 4.5
    n̂ · z⁺ ≥ 0            no penetration, v_n⁺ = J_n v⁺ ≥ 0,  n̂ ∝ (0, 1, r_x/k)

In the orthonormal frame (n̂, t̂, b̂), t̂ ∝ (1, 0, −r_y/k) less its part along n̂, b̂ = n̂ × t̂, an impulse through the
contact point does not change z_b.  The rigid set is the half disc z_n² + z_t² ≤ R² − z_b², the set of a wrench the half
ball.  The plane passes through the centre, so projection onto the plane and then into the ball gives the nearest
feasible point.

With Φ the normal distribution function, every (s_n, s_t, s_b) ∈ ℝ³ is a feasible velocity,

    z_n = R Φ(s_n),   z_t = √(R² − z_n²) (2 Φ(s_t) − 1),   z_b = √(R² − z_n² − z_t²) (2 Φ(s_b) − 1)

Source of the energy ellipse: Chatterjee and Ruina 1998, doi:10.1115/1.2791929; ellipsoid: thesis, figure 4-2.
"""

import numpy as np
from scipy.special import ndtr, ndtri

from thesis_lib.contact.space import velocity_error

TOLERANCE = 1e-9  # of the speed before impact: rounding
MARGIN = 1e-3  # least distance of targets from the boundary, where s is infinite, as a share of the radius


def feasible(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray, k_g: float) -> np.ndarray:
    """Mask (n,) of velocities after impact (n, 3) that neither penetrate nor gain energy; NaN is not feasible."""
    before = velocity_error(v_pre, k_g)
    penetrates = v_post[:, 1] + r[:, 0] * v_post[:, 2] < -TOLERANCE * before
    gains_energy = velocity_error(v_post, k_g) > (1.0 + TOLERANCE) * before
    return ~(penetrates | gains_energy) & np.isfinite(v_post).all(axis=1)


def project(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray, k_g: float, *, wrench: bool) -> np.ndarray:
    """Nearest feasible velocity after impact in the kinetic metric, (n, 3); feasible ones are unchanged.

    `v_pre`, `v_post` are (n, 3) in m/s and rad/s, `r` (n, 2) and `k_g` in m.  Without `wrench` no couple acts, and an
    impulse through the contact point must reach `v_post`.
    """
    frame = _frame(r, k_g)
    before, z = coordinates(v_pre, frame, k_g), coordinates(v_post, frame, k_g)
    axes = 3 if wrench else 2
    radius = np.linalg.norm(before[:, :axes], axis=1)
    near = z.copy()
    near[:, 0] = np.maximum(near[:, 0], 0.0)
    length = np.linalg.norm(near[:, :axes], axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        near[:, :axes] *= np.where(length > radius, radius / length, 1.0)[:, None]
    inside = feasible(v_pre, v_post, r, k_g)
    return np.where(inside[:, None], v_post, _velocity(near, frame, k_g))


def to_latent(v_pre: np.ndarray, v_post: np.ndarray, r: np.ndarray, k_g: float, *, wrench: bool) -> np.ndarray:
    """Coordinates s (n, 2 or 3) of a velocity after impact, projected first if it is not feasible."""
    frame = _frame(r, k_g)
    remaining = _radius_squared(v_pre, frame, k_g, wrench)
    z = coordinates(project(v_pre, v_post, r, k_g, wrench=wrench), frame, k_g)
    s = np.empty((len(z), 3 if wrench else 2))
    for i in range(s.shape[1]):
        share = z[:, i] / np.sqrt(np.maximum(remaining, 1e-300))
        share = share if i == 0 else 0.5 * (1.0 + share)
        s[:, i] = ndtri(np.clip(share, MARGIN, 1.0 - MARGIN))
        remaining = remaining - z[:, i] ** 2
    return s


def from_latent(v_pre: np.ndarray, latent: np.ndarray, r: np.ndarray, k_g: float) -> np.ndarray:
    """Velocity after impact (n, 3) at coordinates s (n, 2 or 3): always feasible."""
    frame = _frame(r, k_g)
    wrench = latent.shape[1] == 3
    remaining = _radius_squared(v_pre, frame, k_g, wrench)
    z = coordinates(v_pre, frame, k_g)
    for i in range(latent.shape[1]):
        share = ndtr(latent[:, i])
        z[:, i] = np.sqrt(np.maximum(remaining, 0.0)) * (share if i == 0 else 2.0 * share - 1.0)
        remaining = remaining - z[:, i] ** 2
    return _velocity(z, frame, k_g)


def coordinates(v: np.ndarray, frame: np.ndarray, k_g: float) -> np.ndarray:
    """(z_n, z_t, z_b) of velocities (n, 3), m/s; `frame` (n, 3, 3) has n̂, t̂, b̂ as rows."""
    return np.einsum("nij,nj->ni", frame, v * [1.0, 1.0, k_g])


def _velocity(z: np.ndarray, frame: np.ndarray, k_g: float) -> np.ndarray:
    return np.einsum("nij,ni->nj", frame, z) / [1.0, 1.0, k_g]


def _frame(r: np.ndarray, k_g: float) -> np.ndarray:
    ones, zeros = np.ones(len(r)), np.zeros(len(r))
    n = np.stack([zeros, ones, r[:, 0] / k_g], axis=1)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    t = np.stack([ones, zeros, -r[:, 1] / k_g], axis=1)
    t -= np.sum(t * n, axis=1, keepdims=True) * n
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    return np.stack([n, t, np.cross(n, t)], axis=1)


def _radius_squared(v_pre: np.ndarray, frame: np.ndarray, k_g: float, wrench: bool) -> np.ndarray:
    return np.sum(coordinates(v_pre, frame, k_g)[:, : 3 if wrench else 2] ** 2, axis=1)
