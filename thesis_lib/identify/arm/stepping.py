"""Time stepping of a batch of arm-and-disk copies, each with its own base parameters and start.

The step is that of `simulate.stepping.stepping` for contact pairs ("arm", "ground"), with the closed-form dynamics of
`parameters`.  In each step each contact of a copy has one mode,

    off     c_n = 0,  c_t = 0                 needs v_n⁺ >= b, or no contact
    stick   v_n⁺ = b, v_t⁺ = 0                needs c_n >= 0, |c_t| <= μ c_n
    slip s  v_n⁺ = b, c_t = -s μ c_n          needs c_n >= 0, s v_t⁺ >= 0,       s = ±1,

so that four linear equations give the impulse.  The previous step's modes are tried first, then all sixteen pairs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from thesis_lib.simulate.stepping.arm_disk import MIN_DISTANCE, ArmDisk
from thesis_lib.simulate.stepping.contact_modes import TOUCH
from thesis_lib.simulate.stepping.stepping import V_REBOUND, V_RECOVER

# extra(q (n, 5), v (n, 5), c_n (n, 2) of the step before) -> generalised force (n, 5) beside gravity and f_ext
ExtraForce = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]

OFF, STICK, SLIP_UP, SLIP_DOWN = range(4)  # v_t⁺ > 0 and v_t⁺ < 0 in the last two
_SIGN = np.array([0.0, 0.0, 1.0, -1.0])
# sticking pairs first: of several solutions, the most dissipative is taken
_ALL_MODES = np.array(list(product((STICK, SLIP_UP, SLIP_DOWN, OFF), repeat=2)))
MODE_TOL = 1e-11  # of velocities and impulses at a mode's border; rounding of the 4 x 4 systems is near 1e-14


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
    extra: ExtraForce | None = None,
) -> Copies:
    """Simulate n copies over the m steps of `f_ext`.

    Only the lengths, base, radius and gravity of `arm` are used.  `theta` (n, 6) has a positive definite mass matrix;
    `q0`, `v0` (n, 5); `f_ext` (m, 5) or (n, m, 5) in N and N m; `h` in s; `mu`, `epsilon` are those of both pairs.
    `extra` is evaluated at the start of each step.
    """
    f_ext = np.asarray(f_ext, dtype=float)
    f_ext = f_ext[None] if f_ext.ndim == 2 else f_ext
    n, m = len(theta), f_ext.shape[1]
    out = Copies(
        q=np.full((n, m + 1, 5), np.nan),
        v=np.full((n, m + 1, 5), np.nan),
        c_n=np.zeros((n, m, 2)),
        c_t=np.zeros((n, m, 2)),
        mode=np.zeros((n, m, 2), dtype=np.int8),
    )
    theta = np.asarray(theta, dtype=float)
    q, v = np.array(q0, dtype=float), np.array(v0, dtype=float)
    out.q[:, 0], out.v[:, 0] = q, v
    mode, c_n = np.zeros((n, 2), dtype=np.int8), np.zeros((n, 2))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        for k in range(m):
            f = f_ext[:, k] if extra is None else f_ext[:, k] + extra(q, v, c_n)
            v_free, M_inv, J, phi = _free_step(arm, theta, q, v, f, h)
            phi_free = _gaps(arm, q + h * v_free)
            any_active = (phi_free <= 0.0).any(axis=1)
            active = (phi_free <= 0.0) | (phi <= TOUCH)
            if any_active.any():
                at = np.flatnonzero(any_active)
                v_n = np.matmul(J[at, 2:], v[at, :, None])[:, :, 0]
                rebound = -epsilon * v_n
                v_n_free = np.matmul(J[at, 2:], v_free[at, :, None])[:, :, 0]
                closing = v_n_free - phi_free[at] / h
                b = np.where((rebound > V_REBOUND) & (phi_free[at] <= 0.0), rebound, np.minimum(closing, V_RECOVER))
                MJ = np.matmul(M_inv[at], J[at].transpose(0, 2, 1))
                K = np.matmul(J[at], MJ)
                v_c = np.matmul(J[at], v_free[at, :, None])[:, :, 0]
                guess = np.where(active[at] & (mode[at] == OFF), STICK, mode[at])
                c, new_mode = _impulses(K, v_c, b, mu, active[at], guess)
                v_free[at] += np.matmul(MJ, c[:, :, None])[:, :, 0]
                mode = np.zeros_like(mode)
                mode[at] = new_mode
                c_n = np.zeros((n, 2))
                c_n[at] = c[:, 2:] / h
                out.c_n[:, k], out.mode[:, k] = c_n, mode
                out.c_t[at, k] = c[:, :2] / h
            else:
                mode, c_n = np.zeros_like(mode), np.zeros((n, 2))
            v = v_free
            q = q + h * v
            out.q[:, k + 1], out.v[:, k + 1] = q, v
    return out


def _free_step(
    arm: ArmDisk, theta: np.ndarray, q: np.ndarray, v: np.ndarray, f: np.ndarray, h: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """v_free (n, 5), M⁻¹ (n, 5, 5), contact rows (n, 4, 5) in the order of K, and gaps (n, 2) in m."""
    n, (l1, l2), (bx, by), R, g = len(q), arm.link_lengths, arm.base, arm.disk_radius, arm.g
    q1, q12, x, y = q[:, 0], q[:, 0] + q[:, 1], q[:, 2], q[:, 3]
    c1, s1, ux, uy = np.cos(q1), np.sin(q1), np.cos(q12), np.sin(q12)
    cos2, sin2 = c1 * ux + s1 * uy, c1 * uy - s1 * ux  # of q_2
    b1, b2, b3, b4, md, inertia = theta.T
    # M⁻¹ of the arm, two by two
    coupling = l1 * b3 * cos2
    M12, M22 = b4 + coupling, b4
    M11 = b2 + b4 + 2.0 * coupling
    det = M11 * M22 - M12 * M12
    i11, i12, i22 = M22 / det, -M12 / det, M11 / det
    # g - C v + f
    w1, w2, sb = v[:, 0], v[:, 1], l1 * b3 * sin2
    g2 = -g * b3 * ux
    r1 = f[:, 0] - g * b1 * c1 + g2 + sb * w2 * (2.0 * w1 + w2)
    r2 = f[:, 1] + g2 - sb * w1 * w1
    v_free = np.empty((n, 5))
    v_free[:, 0] = w1 + h * (i11 * r1 + i12 * r2)
    v_free[:, 1] = w2 + h * (i12 * r1 + i22 * r2)
    v_free[:, 2] = v[:, 2] + h * f[:, 2] / md
    v_free[:, 3] = v[:, 3] + h * (f[:, 3] / md - g)
    v_free[:, 4] = v[:, 4] + h * f[:, 4] / inertia
    M_inv = np.zeros((n, 5, 5))
    M_inv[:, 0, 0], M_inv[:, 1, 1] = i11, i22
    M_inv[:, 0, 1] = M_inv[:, 1, 0] = i12
    M_inv[:, 2, 2] = M_inv[:, 3, 3] = 1.0 / md
    M_inv[:, 4, 4] = 1.0 / inertia
    # nearest point of link 2, as in ArmDisk.contacts
    ex, ey = bx + l1 * c1, by + l1 * s1
    reach = np.clip((x - ex) * ux + (y - ey) * uy, 0.0, l2)
    cx, cy = ex + reach * ux, ey + reach * uy
    dx, dy = x - cx, y - cy
    distance = np.hypot(dx, dy)
    distance[distance < MIN_DISTANCE] = np.nan
    nx, ny = dx / distance, dy / distance
    J = np.zeros((n, 4, 5))
    px, py, ox, oy = cx - bx, cy - by, cx - ex, cy - ey
    J[:, 0, 0], J[:, 0, 1] = ny * py + nx * px, ny * oy + nx * ox
    J[:, 0, 2], J[:, 0, 3], J[:, 0, 4] = ny, -nx, R
    J[:, 1, 2], J[:, 1, 4] = 1.0, R
    J[:, 2, 0], J[:, 2, 1], J[:, 2, 2], J[:, 2, 3] = nx * py - ny * px, nx * oy - ny * ox, nx, ny
    J[:, 3, 3] = 1.0
    return v_free, M_inv, J, np.stack([distance, y], axis=1) - R


def _gaps(arm: ArmDisk, q: np.ndarray) -> np.ndarray:
    """Gaps (n, 2) in m at configurations (n, 5)."""
    (l1, l2), (bx, by) = arm.link_lengths, arm.base
    q1, q12 = q[:, 0], q[:, 0] + q[:, 1]
    ux, uy = np.cos(q12), np.sin(q12)
    ox, oy = q[:, 2] - bx - l1 * np.cos(q1), q[:, 3] - by - l1 * np.sin(q1)
    reach = np.clip(ox * ux + oy * uy, 0.0, l2)
    return np.stack([np.hypot(ox - reach * ux, oy - reach * uy), q[:, 3]], axis=1) - arm.disk_radius


def _impulses(
    K: np.ndarray, v_c: np.ndarray, b: np.ndarray, mu: float, active: np.ndarray, guess: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Impulses c (n, 4) = (c_t, c_n of both pairs) in N s and modes (n, 2); NaN where no modes are consistent.

    K (n, 4, 4) in 1/kg is J M⁻¹ J', rows J_t of both pairs, then J_n.
    """
    c, holds = _try_modes(K, v_c, b, mu, active, guess)
    mode = guess.copy()
    rest = np.flatnonzero(~holds)
    if len(rest):
        r, s = len(rest), len(_ALL_MODES)
        each = np.repeat(rest, s)
        modes = np.where(active[each], np.tile(_ALL_MODES, (r, 1)), OFF)
        trial, good = _try_modes(K[each], v_c[each], b[each], mu, active[each], modes)
        good = good.reshape(r, s)
        pick = np.arange(r) * s + good.argmax(axis=1)
        c[rest] = np.where(good.any(axis=1)[:, None], trial[pick], np.nan)
        mode[rest] = modes[pick]
    return c, mode


def _try_modes(
    K: np.ndarray, v_c: np.ndarray, b: np.ndarray, mu: float, active: np.ndarray, mode: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Impulses (n, 4) in N s for the modes (n, 2), and whether the modes' conditions hold (n,)."""
    n = len(K)
    A, rhs = K.copy(), -v_c
    rhs[:, 2:] += b
    for i in (0, 1):
        m = mode[:, i]
        not_stick = m != STICK
        # friction: c_t + s μ c_n = 0 where slipping, c_t = 0 where off
        row = A[:, i]
        row[not_stick] = 0.0
        row[not_stick, i] = 1.0
        row[not_stick, 2 + i] = _SIGN[m[not_stick]] * mu
        rhs[not_stick, i] = 0.0
        off = m == OFF
        row = A[:, 2 + i]
        row[off] = 0.0
        row[off, 2 + i] = 1.0
        rhs[off, 2 + i] = 0.0
    try:
        c = np.linalg.solve(A, rhs[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        # one exactly singular system would stop the batch; with a shift at rounding level it fails its conditions
        c = np.linalg.solve(A + 1e-15 * np.eye(4), rhs[:, :, None])[:, :, 0]
    v = v_c + np.matmul(K, c[:, :, None])[:, :, 0]
    scale = np.maximum(np.abs(v_c).max(axis=1), np.abs(b).max(axis=1)) + 1e-12
    v_tol = MODE_TOL * scale
    c_tol = v_tol / K[:, [0, 1], [0, 1]].max(axis=1)
    holds = np.isfinite(c).all(axis=1)
    for i in (0, 1):
        m, c_t, c_n = mode[:, i], c[:, i], c[:, 2 + i]
        fine = np.where(
            m == OFF,
            ~active[:, i] | (v[:, 2 + i] >= b[:, i] - v_tol),
            (c_n >= -c_tol) & np.where(m == STICK, np.abs(c_t) <= mu * c_n + c_tol, _SIGN[m] * v[:, i] >= -v_tol),
        )
        holds &= fine & (active[:, i] | (m == OFF))
    return c.reshape(n, 4), holds
