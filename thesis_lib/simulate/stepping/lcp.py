"""Small linear complementarity problems, and the problem that gives the impulse of a planar contact.

The solution of a linear complementarity problem (LCP) is a vector z with

    w = M z + q >= 0,   z >= 0,   z'w = 0.

k unknowns have 2^k complementary bases: choose the unknowns S that may be positive, set w_S = 0 and all other z to
zero, and solve M_SS z_S = -q_S.  All sixteen bases of a planar contact are tried, in batches.

The contact impulse follows Anitescu and Potra, with Newton's restitution: unknowns z = (c_n, b_1, b_2, λ), friction
directions D = (-J_t, J_t), and inverse contact-space inertia K = J M⁻¹ J',

    M = [[ K_nn, -K_tn,  K_tn, 0],        q = ( v_n + ε v_n,
         [-K_tn,  K_tt, -K_tt, 1],             -v_t,
         [ K_tn, -K_tt,  K_tt, 1],              v_t,
         [ μ,    -1,    -1,    0]]              0 ),          c_t = b_2 - b_1.

By the first row a closed contact separates at -ε v_n; the last row is Coulomb's cone |c_t| <= μ c_n, and λ is the
sliding speed.  Energy is not always lost: with ε > 0 and friction it can grow (Kane's paradox).

Sources: M. Anitescu, F. A. Potra, Nonlinear Dynamics 14 (1997), doi 10.1023/A:1008292328909; R. W. Cottle, J.-S. Pang,
R. E. Stone, The Linear Complementarity Problem, SIAM 2009, doi 10.1137/1.9780898719000 (complementary bases).
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

# largest accepted violation by a basis, on data scaled to about 1: well above the rounding errors of a 4x4 system
# (~1e-14) and negligible for any caller
FEASIBILITY_TOL = 1e-10
SINGULAR_TOL = 1e-12  # largest |det| of a basis, on scaled data, that counts as singular


class LcpStatus(IntEnum):
    """Outcome of one problem in a batch."""

    SOLVED = 0
    NO_SOLUTION = 1  # no complementary basis is feasible
    INVALID_INPUT = 2  # NaN or infinity in the data


@dataclass(frozen=True)
class ContactImpulse:
    """Impulses of n single contacts; c and residual are NaN where no solution was found."""

    c: np.ndarray  # (n, 2) impulse (c_t, c_n) in N s
    residual: np.ndarray  # (n,) complementarity residual max(-z, -w, |z w|) of the dimensionless problem
    status: np.ndarray  # (n,) `LcpStatus` codes


def solve_lcp_enumeration(M: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solve n LCPs w = M z + q ⟂ z, M (n, k, k), q (n, k), by trying every complementary basis.

    If there are several solutions, the first in a fixed order is returned.  Bases without z_0 come before bases with
    it: with c_n as z_0, a contact then gets an impulse only if it needs one.  The feasibility tolerance is absolute:
    scale the data to about 1 first.

    Returns:
        z (n, k), NaN where there is no solution, and status (n,) of `LcpStatus` codes.
    """
    n, k = q.shape
    z = np.full((n, k), np.nan)
    status = np.full(n, LcpStatus.NO_SOLUTION, dtype=int)
    finite = np.isfinite(M).all(axis=(1, 2)) & np.isfinite(q).all(axis=1)
    status[~finite] = LcpStatus.INVALID_INPUT
    todo = np.flatnonzero(finite)
    for basis in range(2**k):
        if not len(todo):
            break
        positive = [i for i in range(k) if basis >> (k - 1 - i) & 1]
        trial = _basic_solution(M[todo], q[todo], positive)
        w = _slack(M[todo], q[todo], trial)
        w[:, positive] = 0.0
        # the NaN of a singular basis fails the comparison, as intended
        solved = (trial.min(axis=1) >= -FEASIBILITY_TOL) & (w.min(axis=1) >= -FEASIBILITY_TOL)
        z[todo[solved]] = np.maximum(trial[solved], 0.0)
        status[todo[solved]] = LcpStatus.SOLVED
        todo = todo[~solved]
    return z, status


def complementarity_residual(M: np.ndarray, q: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Largest of -z, -w and |z w| over the rows of each of n LCPs, (n,); NaN where z is NaN."""
    w = _slack(M, q, z)
    return np.maximum(np.maximum(-z, -w), np.abs(z * w)).max(axis=1)


def impact(
    mass: np.ndarray, J: np.ndarray, v: np.ndarray, mu: np.ndarray | float, epsilon: np.ndarray | float
) -> tuple[ContactImpulse, np.ndarray]:
    """Impulse of one contact on each of n mechanisms, and velocity v⁺ (n, nv) after it; NaN without a solution.

    `mass` is (nv, nv) or (n, nv, nv), `J` (n, 2, nv) holds the contact rows (J_t, J_n), `v` (n, nv) is the velocity
    before the impact; `mu`, `epsilon` are scalars or (n,).
    """
    M_inv_Jt = np.linalg.solve(mass, np.swapaxes(J, 1, 2))
    # K = J M⁻¹ J',  v_C = J v,  v⁺ = v + M⁻¹ J' c
    out = contact_lcp(J @ M_inv_Jt, (J @ v[:, :, None])[:, :, 0], mu, epsilon)
    return out, v + (M_inv_Jt @ out.c[:, :, None])[:, :, 0]


def contact_lcp(K: np.ndarray, v_c: np.ndarray, mu: np.ndarray | float, epsilon: np.ndarray | float) -> ContactImpulse:
    """Impulse of n independent planar contacts from the Anitescu-Potra LCP with Newton restitution.

    `K` (n, 2, 2) in 1/kg, order (t, n), is positive definite; `v_c` (n, 2) is (v_t, v_n) in m/s before the impact;
    `mu`, `epsilon` are scalars or (n,).
    """
    K, v_c = np.asarray(K, dtype=float), np.asarray(v_c, dtype=float)
    n = len(v_c)
    mu, epsilon = np.broadcast_to(mu, n), np.broadcast_to(epsilon, n)

    # dimensionless data (K / k_scale, v / v_scale): the same tolerance then suits grams and tonnes
    k_scale = np.trace(K, axis1=1, axis2=2) / 2.0
    v_scale = np.abs(v_c).max(axis=1)
    v_scale = np.where(v_scale == 0.0, 1.0, v_scale)
    b = -epsilon * (v_c[:, 1] / v_scale)
    M, q = lcp_matrices(K / k_scale[:, None, None], v_c / v_scale[:, None], b[:, None], mu[:, None])
    z, status = solve_lcp_enumeration(M, q)
    c = np.stack([z[:, 2] - z[:, 1], z[:, 0]], axis=1) * (v_scale / k_scale)[:, None]
    return ContactImpulse(c, complementarity_residual(M, q, z), status)


def lcp_matrices(K: np.ndarray, v_c: np.ndarray, b: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """LCP data M (4k, 4k), q (4k,) of the k contacts of a mechanism, for z = (c_n, b_1, b_2, λ) with k entries each.

    `K` (2k, 2k) and the velocities `v_c` (2k,) have tangential rows first; closed contacts separate at `b` (k,); `mu`
    is (k,).  For n mechanisms, all arrays have n as first axis.
    """
    k = b.shape[-1]
    K = K.transpose(-2, -1, *range(b.ndim - 1))
    K_tt, K_tn, K_nn = K[:k, :k], K[:k, k:], K[k:, k:]
    K_nt, one = np.swapaxes(K_tn, 0, 1), np.eye(k).reshape(k, k, *[1] * (b.ndim - 1))
    blocks = (
        (K_nn, -K_nt, K_nt, 0.0),
        (-K_tn, K_tt, -K_tt, one),
        (K_tn, -K_tt, K_tt, one),
        (one * mu.T, -one, -one, 0.0),
    )
    M = np.empty((4, k, 4, k, *b.shape[:-1]))  # np.block is several times slower
    for i, row in enumerate(blocks):
        for j, block in enumerate(row):
            M[i, :, j] = block
    M = M.reshape(4 * k, 4 * k, *b.shape[:-1]).transpose(*range(2, b.ndim + 1), 0, 1)
    v_t, v_n = v_c[..., :k], v_c[..., k:]
    return M, np.concatenate([v_n - b, -v_t, v_t, np.zeros_like(b)], axis=-1)


def _slack(M: np.ndarray, q: np.ndarray, z: np.ndarray) -> np.ndarray:
    return (M @ z[:, :, None])[:, :, 0] + q


def _basic_solution(M: np.ndarray, q: np.ndarray, positive: list[int]) -> np.ndarray:
    """z (n, k) with w = 0 on `positive` and z = 0 elsewhere; NaN where this basis is singular."""
    z = np.zeros_like(q)
    if positive:
        A = M[:, positive][:, :, positive]
        regular = np.abs(np.linalg.det(A)) > SINGULAR_TOL
        z[~regular] = np.nan
        z[np.ix_(regular, positive)] = -np.linalg.solve(A[regular], q[regular][:, positive, None])[:, :, 0]
    return z
