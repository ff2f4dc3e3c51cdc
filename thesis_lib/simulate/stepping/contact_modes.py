"""Impulses of the active contacts of one step: one contact by its modes in closed form, several by Drake's Moby solver.

With the inverse contact-space inertia K = J M⁻¹ J', v_C = J v_free and w = v_n - b, a closed contact has three modes:

    stick:            K (c_t, c_n)' = -(v_t, w)'                          if c_n >= 0 and |c_t| <= μ c_n
    slip towards s:   c_n = -w / (K_nn - s μ K_tn),  c_t = -s μ c_n       if c_n >= 0 and s v_t⁺ >= 0

k contacts have the LCP of `lcp` (sources there) in blocks, z = (c_n, b_1, b_2, λ) of k unknowns each.  A pivoting
solver has its own tolerance; the equations of its basis, z_S = -M_SS⁻¹ q_S, are solved again to rounding accuracy.
Several contacts can have several solutions (two sticking feet share their friction in many ways): one is returned, and
only the sum is unique.

The residual is the largest of -z, -w and |z w|, with impulses divided by v_scale / k_scale and velocities by v_scale;
k_scale = tr K / (2 k), v_scale is the largest contact velocity in the data.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from thesis_lib.simulate.stepping.lcp import LcpStatus, lcp_matrices, solve_lcp_enumeration
from thesis_lib.simulate.stepping.multibody import ContactGeometry, Mechanism

MODE_TOL = 1e-12  # tolerance of velocities and impulses of one contact, for rounding at the border between two modes
# m: a pair with a smaller gap may be closed by another contact's impulse in the same step, even if free motion opens it
TOUCH = 1e-4
# v_reb, m/s; the velocity gained by gravity in a step of 5 ms: a slower rebound would end within the same step
V_REBOUND = 0.05
# v_rec, m/s; 0.5 mm in a step of 5 ms, the drift of a body of 1 m that rolls at a few rad/s
V_RECOVER = 0.1
MAX_UNKNOWNS = 8  # two planar contacts, 256 bases; for more, a pivoting method is better
POLISHED = 1e-13  # residual of a basis that is solved to rounding
ACCEPTED = 1e-9  # largest accepted residual of a solution, on dimensionless data


@dataclass(frozen=True, slots=True)
class StepSolution:
    """Contact impulses of one step; v, c_n, c_t and residual are NaN if the step has no solution."""

    v: np.ndarray  # (nv,) velocity after the step
    c_n: np.ndarray  # c_n, c_t: (p,) impulses in N s
    c_t: np.ndarray
    residual: float  # dimensionless
    status: int  # an `LcpStatus` code
    impulse: bool  # whether any contact was active, or the step failed


def solve_contacts(
    mechanism: Mechanism,
    q: np.ndarray,
    M_inv: np.ndarray,
    v: np.ndarray,
    v_free: np.ndarray,
    h: float,
    mu: np.ndarray,
    epsilon: np.ndarray,
    contacts: ContactGeometry | None = None,
) -> StepSolution:
    """Impulses of one step and the velocity after it, under the conditions given in `stepping`.

    `q` (nq,) and `M_inv` (nv, nv) are at the start of the step; `v` and `v_free` (nv,) are the velocities before it and
    after it without contact; `h` in s; `mu`, `epsilon` (p,).  `contacts` are the contacts at q, if already known.
    """
    phi_free = mechanism.contacts(q + h * v_free).phi
    contacts = contacts or mechanism.contacts(q)
    phi, J_n, J_t = contacts.phi, contacts.J_n, contacts.J_t
    c_n, c_t = np.zeros((2, len(phi)))
    active = np.flatnonzero((phi_free <= 0.0) | (phi <= TOUCH))
    if not (phi_free <= 0.0).any():
        if np.isfinite(v_free).all():
            return StepSolution(v_free, c_n, c_t, 0.0, LcpStatus.SOLVED, False)
        return _failed(v_free, len(phi), LcpStatus.INVALID_INPUT)

    if len(active) == 1:
        i = int(active[0])
        M_inv_t, M_inv_n = M_inv @ J_t[i], M_inv @ J_n[i]
        v_n_pre, v_n = float(J_n[i] @ v), float(J_n[i] @ v_free)
        rebound = -float(epsilon[i]) * v_n_pre
        b = rebound if rebound > V_REBOUND else min(v_n - float(phi_free[i]) / h, V_RECOVER)
        c_t[i], c_n[i], residual = solve_one(
            float(J_t[i] @ M_inv_t),
            float(J_t[i] @ M_inv_n),
            float(J_n[i] @ M_inv_n),
            float(J_t[i] @ v_free),
            v_n,
            b,
            float(mu[i]),
        )
        v_new = v_free + c_t[i] * M_inv_t + c_n[i] * M_inv_n
    else:
        k, J = len(active), np.concatenate([J_t[active], J_n[active]])
        v_n_pre = J_n[active] @ v
        rebound = -epsilon[active] * v_n_pre
        closing = np.minimum(J_n[active] @ v_free - phi_free[active] / h, V_RECOVER)
        hit = (rebound > V_REBOUND) & (phi_free[active] <= 0.0)
        b = np.where(hit, rebound, closing)
        M_inv_Jt = M_inv @ J.T
        c, residual = solve_several(J @ M_inv_Jt, J @ v_free, b, mu[active])
        c_t[active], c_n[active] = c[:k], c[k:]
        v_new = v_free + M_inv_Jt @ c
    if residual <= ACCEPTED:
        return StepSolution(v_new, c_n, c_t, residual, LcpStatus.SOLVED, True)
    finite = np.isfinite(v_free).all() and np.isfinite(phi).all() and np.isfinite(M_inv).all()
    return _failed(v_free, len(phi), LcpStatus.NO_SOLUTION if finite else LcpStatus.INVALID_INPUT)


def _failed(v: np.ndarray, p: int, status: LcpStatus) -> StepSolution:
    nothing = np.full(p, np.nan)
    return StepSolution(np.full_like(v, np.nan), nothing, nothing, np.nan, status, True)


def solve_one(
    K_tt: float, K_tn: float, K_nn: float, v_t: float, v_n: float, b: float, mu: float
) -> tuple[float, float, float]:
    """Impulse (c_t, c_n) in N s of one contact and its residual, which is infinite if no mode is consistent."""
    w = v_n - b
    k_scale, v_scale = 0.5 * (K_tt + K_nn), max(abs(v_t), abs(v_n), abs(b)) or 1.0
    unit = v_scale / k_scale

    def with_residual(c_t: float, c_n: float) -> tuple[float, float, float]:
        slip = (v_t + K_tt * c_t + K_tn * c_n) / v_scale
        gap = (w + K_tn * c_t + K_nn * c_n) / v_scale
        p_t, p_n = c_t / unit, c_n / unit
        cone = mu * p_n - abs(p_t)
        # the friction impulse must oppose the slip: residual b (λ ± v_t) with λ = |v_t|
        against = abs(p_t) * (abs(slip) + (slip if p_t > 0.0 else -slip))
        return c_t, c_n, max(-p_n, -gap, abs(p_n * gap), -cone, abs(slip * cone), against)

    if w >= 0.0:
        return 0.0, 0.0, 0.0
    # stick: K c = -(v_t, w)
    det = K_tt * K_nn - K_tn * K_tn
    if det > 0.0:
        c_t, c_n = (K_tn * w - K_nn * v_t) / det, (K_tn * v_t - K_tt * w) / det
        if c_n >= 0.0 and abs(c_t) <= mu * c_n + MODE_TOL * unit:
            return with_residual(c_t, c_n)
    # first try slip in the direction of the free motion; the other direction is rare
    first = 1.0 if v_t >= 0.0 else -1.0
    for s in (first, -first):
        reach = K_nn - s * mu * K_tn
        if reach <= 0.0:
            continue
        c_n = -w / reach
        c_t = -s * mu * c_n
        if s * (v_t + K_tt * c_t + K_tn * c_n) >= -MODE_TOL * v_scale:
            return with_residual(c_t, c_n)
    return np.nan, np.nan, np.inf


def solve_several(K: np.ndarray, v_c: np.ndarray, b: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, float]:
    """Impulses c (2k,) = (c_t, c_n) in N s of k >= 1 contacts of one mechanism, and the residual.

    K (2k, 2k) in 1/kg, which may be singular, and the velocities v_c (2k,) in m/s after the free step have the
    tangential rows first; b (k,) is in m/s, mu (k,).  If there is no solution, c is NaN and the residual infinite.
    """
    k = len(b)
    if not (np.isfinite(K).all() and np.isfinite(v_c).all() and np.isfinite(b).all()):
        return np.full(2 * k, np.nan), np.inf
    k_scale, v_scale = np.trace(K) / (2 * k), max(np.abs(v_c).max(), np.abs(b).max()) or 1.0
    M, q = lcp_matrices(K / k_scale, v_c / v_scale, b / v_scale, mu)
    best, residual = np.full(4 * k, np.nan), np.inf
    for solve in (partial(by_drake, "MobyLcpSolver"), _enumerate, partial(by_drake, "UnrevisedLemkeSolver")):
        z = solve(M, q)
        if z is not None:
            z, residual = _polished(M, q, z)
            best = z
        if residual <= ACCEPTED:
            break
    c_n, b_1, b_2 = best[:k], best[k : 2 * k], best[2 * k : 3 * k]
    return np.concatenate([b_2 - b_1, c_n]) * (v_scale / k_scale), residual


def _polished(M: np.ndarray, q: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, float]:
    """z with the equations of its basis solved to rounding accuracy, if that lowers the residual, and the residual."""
    basis = np.flatnonzero(z > M @ z + q)
    best, residual = z, _residual(M, q, z)
    # least squares for singular bases, in which several supports share one force
    for solve in (np.linalg.solve, lambda A, b: np.linalg.lstsq(A, b, rcond=None)[0]):
        exact = np.zeros_like(z)
        try:
            exact[basis] = solve(M[np.ix_(basis, basis)], -q[basis])
        except np.linalg.LinAlgError:
            continue
        after = _residual(M, q, exact)
        if after < residual:
            best, residual = exact, after
        if residual < POLISHED:
            break
    return best, residual


def _residual(M: np.ndarray, q: np.ndarray, z: np.ndarray) -> float:
    w = M @ z + q
    return float(max(0.0, -z.min(), -w.min(), np.abs(z * w).max()))


def by_drake(solver: str, M: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    """Solution z (4k,) from a solver of pydrake.solvers; None if it finds no solution."""
    from pydrake import solvers

    program = solvers.MathematicalProgram()
    z = program.NewContinuousVariables(len(q))
    program.AddLinearComplementarityConstraint(M, q, z)  # pyright: ignore[reportArgumentType]
    result = getattr(solvers, solver)().Solve(program, None, None)
    value = result.GetSolution(z) if result.is_success() else np.array([np.nan])
    return value if np.isfinite(value).all() else None


def _enumerate(M: np.ndarray, q: np.ndarray) -> np.ndarray | None:
    if len(q) > MAX_UNKNOWNS:
        return None
    z, status = solve_lcp_enumeration(M[None], q[None])
    return z[0] if status[0] == LcpStatus.SOLVED else None
