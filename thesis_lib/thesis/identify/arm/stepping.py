"""Compiled time stepping of a batch of arm-and-disk copies, each with its own base parameters and start.

The scheme is that of `simulate.stepping.stepping` for contact pairs ("arm", "ground"), with the closed-form dynamics of
`parameters`.  In each step each contact of a copy has one mode,

    off     c_n = 0,  c_t = 0                 needs v_n⁺ >= b, or no contact
    stick   v_n⁺ = b, v_t⁺ = 0                needs c_n >= 0, |c_t| <= μ c_n
    slip s  v_n⁺ = b, c_t = -s μ c_n          needs c_n >= 0, s v_t⁺ >= 0,       s = ±1,

and four linear equations give the impulse.  The previous step's modes are tried first, then all sixteen pairs.

numba compiles this file at the first call, in a few seconds, and caches the result beside it.  All compiled code must
be in this file, and constants of other files are passed as arguments: numba does not detect changes of other files.
Rows are copied element by element: if shapes could differ, numba would compile an error message, doubling the time.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numba import njit

from thesis_lib.simulate.stepping.arm_disk import MIN_DISTANCE, ArmDisk
from thesis_lib.simulate.stepping.contact_modes import TOUCH, V_REBOUND, V_RECOVER

OFF, STICK, SLIP_UP, SLIP_DOWN = range(4)  # v_t⁺ > 0 and v_t⁺ < 0 in the last two
_SIGN = np.array([0.0, 0.0, 1.0, -1.0])
# sticking pairs first: of several solutions, the most dissipative is taken
_ALL_MODES = np.array(list(product((STICK, SLIP_UP, SLIP_DOWN, OFF), repeat=2)), dtype=np.int8)
MODE_TOL = 1e-11  # tolerance of velocities and impulses at a mode's limit; rounding of the 4 x 4 systems is near 1e-14
SHIFT = 1e-15  # added to the diagonal of an exactly singular system, which then fails its conditions

compiled = njit(cache=True, error_model="numpy")


@dataclass(frozen=True)
class Copies:
    """Motions of n copies over m steps; NaN from the first step without a solution."""

    q: np.ndarray  # q, v: (n, m+1, 5) states
    v: np.ndarray
    c_n: np.ndarray  # c_n, c_t: (n, m, 2) contact forces over each step in N, order ("arm", "ground")
    c_t: np.ndarray
    mode: np.ndarray  # (n, m, 2) modes of both contacts


def simulate_copies(
    arm: ArmDisk,
    theta: np.ndarray,
    q0: np.ndarray,
    v0: np.ndarray,
    f_ext: np.ndarray,
    h: float,
    mu: float,
    epsilon: float,
) -> Copies:
    """Simulate n copies over the m steps of `f_ext`.

    Only the lengths, base, radius and gravity of `arm` are used.  `theta` (n, 6) has a positive definite mass matrix;
    `q0`, `v0` (n, 5); `f_ext` (m, 5) or (n, m, 5) in N and N m; `h` in s; `mu`, `epsilon` are those of both pairs.
    """
    f_ext = np.asarray(f_ext, dtype=float)
    f_ext = np.array(np.broadcast_to(f_ext, (len(theta), *f_ext.shape[-2:])), order="C")  # compiled for this
    n, m = f_ext.shape[:2]
    out = Copies(
        q=np.full((n, m + 1, 5), np.nan),
        v=np.full((n, m + 1, 5), np.nan),
        c_n=np.zeros((n, m, 2)),
        c_t=np.zeros((n, m, 2)),
        mode=np.zeros((n, m, 2), dtype=np.int8),
    )
    out.q[:, 0], out.v[:, 0] = q0, v0
    numbers = (*arm.link_lengths, *arm.base, arm.disk_radius, arm.g, h, mu, epsilon)
    constants = tuple(map(float, (*numbers, TOUCH, V_REBOUND, V_RECOVER, MIN_DISTANCE)))
    theta = np.ascontiguousarray(theta, dtype=float)
    _steps(theta, out.q, out.v, out.c_n, out.c_t, out.mode, f_ext, constants)
    return out


@compiled
def _steps(theta, q, v, c_n, c_t, mode, f_ext, constants):
    """Do all steps of every copy, writing to q, v (n, m+1, 5), c_n, c_t and mode (n, m, 2)."""
    h, mu, epsilon, touch, v_rebound, v_recover = constants[6:12]
    J, MJ, K, A = np.zeros((4, 5)), np.zeros((5, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    v_free, phi, phi_free, q_free = np.zeros(5), np.zeros(2), np.zeros(2), np.zeros(5)
    v_c, b, c = np.zeros(4), np.zeros(2), np.zeros(4)
    active, guess = np.zeros(2, dtype=np.bool_), np.zeros(2, dtype=np.int8)
    for i in range(len(q)):
        for k in range(f_ext.shape[1]):
            v_before = v[i, k]
            _free_step(theta[i], q[i, k], v_before, f_ext[i, k], constants, v_free, J, MJ, phi)
            for a in range(5):
                q_free[a] = q[i, k, a] + h * v_free[a]
            _gaps(q_free, constants, phi_free)
            if phi_free[0] <= 0.0 or phi_free[1] <= 0.0:
                for r in range(4):
                    v_c[r] = 0.0
                    for a in range(5):
                        v_c[r] += J[r, a] * v_free[a]
                    for s in range(4):
                        K[r, s] = 0.0
                        for a in range(5):
                            K[r, s] += J[r, a] * MJ[a, s]
                for j in range(2):
                    v_n = 0.0
                    for a in range(5):
                        v_n += J[2 + j, a] * v_before[a]
                    closing = v_c[2 + j] - phi_free[j] / h
                    rebounds = -epsilon * v_n > v_rebound and phi_free[j] <= 0.0
                    b[j] = -epsilon * v_n if rebounds else min(closing, v_recover)
                    active[j] = phi_free[j] <= 0.0 or phi[j] <= touch
                    last = mode[i, k - 1, j] if k > 0 else OFF
                    guess[j] = STICK if active[j] and last == OFF else last
                _impulses(K, A, v_c, b, mu, active, guess, c)
                for a in range(5):
                    for r in range(4):
                        v_free[a] += MJ[a, r] * c[r]
                for j in range(2):
                    mode[i, k, j] = guess[j]
                    c_t[i, k, j], c_n[i, k, j] = c[j] / h, c[2 + j] / h
            for a in range(5):
                v[i, k + 1, a] = v_free[a]
                q[i, k + 1, a] = q[i, k, a] + h * v_free[a]


@compiled
def _free_step(theta, q, v, f, constants, v_free, J, MJ, phi):
    """Compute for one copy the velocity without contact forces (5,), contact rows J (4, 5) in the order of K,
    M⁻¹ J' (5, 4) and gaps (2,) in m."""
    l1, l2, bx, by, R, g, h = constants[:7]
    c1, s1 = np.cos(q[0]), np.sin(q[0])
    ux, uy = np.cos(q[0] + q[1]), np.sin(q[0] + q[1])
    cos2, sin2 = c1 * ux + s1 * uy, c1 * uy - s1 * ux  # of q_2
    b1, b2, b3, b4, md, inertia = theta
    # M⁻¹ of the arm, two by two
    coupling = l1 * b3 * cos2
    M11, M12, M22 = b2 + b4 + 2.0 * coupling, b4 + coupling, b4
    det = M11 * M22 - M12 * M12
    i11, i12, i22 = M22 / det, -M12 / det, M11 / det
    # g - C v + f
    w1, w2, sb = v[0], v[1], l1 * b3 * sin2
    g2 = -g * b3 * ux
    r1 = f[0] - g * b1 * c1 + g2 + sb * w2 * (2.0 * w1 + w2)
    r2 = f[1] + g2 - sb * w1 * w1
    v_free[0] = w1 + h * (i11 * r1 + i12 * r2)
    v_free[1] = w2 + h * (i12 * r1 + i22 * r2)
    v_free[2] = v[2] + h * f[2] / md
    v_free[3] = v[3] + h * (f[3] / md - g)
    v_free[4] = v[4] + h * f[4] / inertia
    # nearest point of link 2, as in ArmDisk.contacts
    ex, ey = bx + l1 * c1, by + l1 * s1
    reach = min(max((q[2] - ex) * ux + (q[3] - ey) * uy, 0.0), l2)
    px, py = ex + reach * ux - bx, ey + reach * uy - by
    ox, oy = px + bx - ex, py + by - ey
    dx, dy = q[2] - bx - px, q[3] - by - py
    distance = np.hypot(dx, dy)
    if distance < constants[12]:
        distance = np.nan
    phi[0], phi[1] = distance - R, q[3] - R
    nx, ny = dx / distance, dy / distance
    J[0, 0], J[0, 1] = ny * py + nx * px, ny * oy + nx * ox
    J[0, 2], J[0, 3], J[0, 4] = ny, -nx, R
    J[1, 2], J[1, 4] = 1.0, R
    J[2, 0], J[2, 1], J[2, 2], J[2, 3] = nx * py - ny * px, nx * oy - ny * ox, nx, ny
    J[3, 3] = 1.0
    for r in range(4):
        MJ[0, r], MJ[1, r] = i11 * J[r, 0] + i12 * J[r, 1], i12 * J[r, 0] + i22 * J[r, 1]
        MJ[2, r], MJ[3, r], MJ[4, r] = J[r, 2] / md, J[r, 3] / md, J[r, 4] / inertia


@compiled
def _gaps(q, constants, phi):
    """Compute the gaps (2,) in m at a configuration (5,)."""
    l1, l2, bx, by, R = constants[:5]
    ux, uy = np.cos(q[0] + q[1]), np.sin(q[0] + q[1])
    ox, oy = q[2] - bx - l1 * np.cos(q[0]), q[3] - by - l1 * np.sin(q[0])
    reach = min(max(ox * ux + oy * uy, 0.0), l2)
    phi[0], phi[1] = np.hypot(ox - reach * ux, oy - reach * uy) - R, q[3] - R


@compiled
def _impulses(K, A, v_c, b, mu, active, mode, c):
    """Find impulses c (4,) = (c_t, c_n of both pairs) in N s and modes (2,), from a guess of modes; NaN if none hold.

    K (4, 4) in 1/kg is J M⁻¹ J', rows J_t of both pairs, then J_n.
    """
    if _modes_hold(K, A, v_c, b, mu, active, mode, c):
        return
    for trial in _ALL_MODES:
        for j in range(2):
            mode[j] = trial[j] if active[j] else OFF
        if _modes_hold(K, A, v_c, b, mu, active, mode, c):
            return
    for r in range(4):
        c[r] = np.nan


@compiled
def _modes_hold(K, A, v_c, b, mu, active, mode, c):
    """Compute impulses c (4,) in N s for the modes (2,), and return whether the modes' conditions hold."""
    for shift in (0.0, SHIFT):
        for r in range(4):
            replaced = mode[r % 2] != STICK if r < 2 else mode[r % 2] == OFF
            for s in range(4):
                A[r, s] = 0.0 if replaced else K[r, s]
        for j in range(2):
            c[j], c[2 + j] = -v_c[j], b[j] - v_c[2 + j]
            if mode[j] != STICK:  # c_t + s μ c_n = 0 where slipping, c_t = 0 where off
                A[j, j], A[j, 2 + j], c[j] = 1.0, _SIGN[mode[j]] * mu, 0.0
            if mode[j] == OFF:
                A[2 + j, 2 + j], c[2 + j] = 1.0, 0.0
        for j in range(4):
            A[j, j] += shift
        if _solve(A, c):
            break
    scale = 1e-12
    for r in range(4):
        if not np.isfinite(c[r]):
            return False
        scale = max(scale, abs(v_c[r]) + 1e-12, abs(b[r % 2]) + 1e-12)
    v_tol = MODE_TOL * scale
    c_tol = v_tol / max(K[0, 0], K[1, 1])
    for j in range(2):
        if mode[j] == OFF:
            v_n = v_c[2 + j]
            for s in range(4):
                v_n += K[2 + j, s] * c[s]
            if active[j] and not v_n >= b[j] - v_tol:
                return False
            continue
        if not (active[j] and c[2 + j] >= -c_tol):
            return False
        if mode[j] == STICK:
            if not abs(c[j]) <= mu * c[2 + j] + c_tol:
                return False
            continue
        v_t = v_c[j]
        for s in range(4):
            v_t += K[j, s] * c[s]
        if not _SIGN[mode[j]] * v_t >= -v_tol:
            return False
    return True


@compiled
def _solve(A, x):
    """Solve A x = b in place of b (4,), by elimination with row pivots; False for an exactly singular matrix."""
    for j in range(4):
        pivot = j
        for r in range(j + 1, 4):
            if abs(A[r, j]) > abs(A[pivot, j]):
                pivot = r
        if A[pivot, j] == 0.0:
            return False
        for s in range(4):
            A[j, s], A[pivot, s] = A[pivot, s], A[j, s]
        x[j], x[pivot] = x[pivot], x[j]
        for r in range(j + 1, 4):
            factor = A[r, j] / A[j, j]
            for s in range(j, 4):
                A[r, s] -= factor * A[j, s]
            x[r] -= factor * x[j]
    for j in range(3, -1, -1):
        for s in range(j + 1, 4):
            x[j] -= A[j, s] * x[s]
        x[j] /= A[j, j]
    return True
