"""Compiled torque-free rotation of n bodies; see `free_motion.py` for the equations.

In body axes, with M = Rᵀ L, Ω = G⁻¹ M, N = Rᵀ dL and η = Rᵀ φ,

    q̇ = ½ q Ω,    Ṁ = M × Ω,    Ṅ = N × Ω,    η̇ = G⁻¹ (N + M × η) − Ω × η,

so that each coefficient of their power series follows from the preceding ones.  One series covers all times near its
start: many times of a flight cost little more than one.

numba compiles this file at the first call, in a few seconds, and caches the result next to it.  All compiled functions
must be in this file, because numba does not detect changes to functions in other files.
"""

import numpy as np
from numba import njit, types

ORDER = 12  # order of the series

compiled = njit(cache=True, error_model="numpy")
# any memory layout: each function is compiled once
_given = [types.Array(types.float64, k, "A", readonly=True) for k in range(4)]
_new = [types.Array(types.float64, k, "C") for k in range(5)]


@compiled
def _rows(A):
    """Rows of a matrix (3, 3) as three tuples."""
    return (A[0, 0], A[0, 1], A[0, 2]), (A[1, 0], A[1, 1], A[1, 2]), (A[2, 0], A[2, 1], A[2, 2])


@compiled
def _axes(w, x, y, z):
    """Rows of the rotation matrix of a unit quaternion; its columns are the body axes in the world."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@compiled
def _times(A, u):
    a, b, c = A
    x, y, z = u
    return a[0] * x + a[1] * y + a[2] * z, b[0] * x + b[1] * y + b[2] * z, c[0] * x + c[1] * y + c[2] * z


@compiled
def _back(A, u):
    """Product Aᵀ u."""
    a, b, c = A
    x, y, z = u
    return a[0] * x + b[0] * y + c[0] * z, a[1] * x + b[1] * y + c[1] * z, a[2] * x + b[2] * y + c[2] * z


@compiled
def _cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@njit([types.void(_given[2], _given[2], _given[3], _given[3], _new[2])], cache=True, error_model="numpy")
def spins_up(attitude, spin, G, inverse, into):
    """Write ω' = W (L × ω), L = R G Rᵀ ω, of n bodies to `into` (3, n); G and inverse are (n or 1, 3, 3)."""
    for i in range(spin.shape[1]):
        own, R = min(i, len(G) - 1), _axes(attitude[0, i], attitude[1, i], attitude[2, i], attitude[3, i])
        omega = _back(R, (spin[0, i], spin[1, i], spin[2, i]))
        rate = _times(_rows(inverse[own]), _cross(_times(_rows(G[own]), omega), omega))
        into[0, i], into[1, i], into[2, i] = _times(R, rate)


@compiled
def _series(q, L, inverse, D, Q, M, N, E):
    """Write the coefficients (`ORDER` + 1, ...) of q, (M, Ω) and, by column, N and η to the last four arguments.

    `E` contains the initial η; D (3, c) is dL.
    """
    R = _axes(q[0], q[1], q[2], q[3])
    Q[0, 0], Q[0, 1], Q[0, 2], Q[0, 3] = q
    M[0, 0], M[0, 1], M[0, 2] = m = _back(R, L)
    M[0, 3], M[0, 4], M[0, 5] = _times(inverse, m)
    for j in range(D.shape[1]):
        N[0, 0, j], N[0, 1, j], N[0, 2, j] = _back(R, (D[0, j], D[1, j], D[2, j]))
    for k in range(ORDER):
        share = 1.0 / (k + 1)
        s = a = b = c = x = y = z = 0.0
        for i in range(k + 1):
            d, e, f = M[k - i, 3], M[k - i, 4], M[k - i, 5]
            w, t, u, v = Q[i, 0], Q[i, 1], Q[i, 2], Q[i, 3]
            s -= t * d + u * e + v * f
            a += w * d + u * f - v * e
            b += w * e + v * d - t * f
            c += w * f + t * e - u * d
            t, u, v = M[i, 0], M[i, 1], M[i, 2]
            x += u * f - v * e
            y += v * d - t * f
            z += t * e - u * d
        Q[k + 1, 0], Q[k + 1, 1] = 0.5 * share * s, 0.5 * share * a
        Q[k + 1, 2], Q[k + 1, 3] = 0.5 * share * b, 0.5 * share * c
        M[k + 1, 0], M[k + 1, 1], M[k + 1, 2] = m = share * x, share * y, share * z
        M[k + 1, 3], M[k + 1, 4], M[k + 1, 5] = _times(inverse, m)
        for j in range(D.shape[1]):
            a, b, c = N[k, 0, j], N[k, 1, j], N[k, 2, j]
            s = t = u = x = y = z = 0.0
            for i in range(k + 1):
                m, omega = (M[i, 0], M[i, 1], M[i, 2]), (M[i, 3], M[i, 4], M[i, 5])
                eta = E[k - i, 0, j], E[k - i, 1, j], E[k - i, 2, j]
                d, e, f = _cross(m, eta)
                a, b, c = a + d, b + e, c + f
                d, e, f = _cross(eta, omega)
                s, t, u = s + d, t + e, u + f
                d, e, f = _cross((N[k - i, 0, j], N[k - i, 1, j], N[k - i, 2, j]), omega)
                x, y, z = x + d, y + e, z + f
            a, b, c = _times(inverse, (a, b, c))
            E[k + 1, 0, j], E[k + 1, 1, j], E[k + 1, 2, j] = share * (a + s), share * (b + t), share * (c + u)
            N[k + 1, 0, j], N[k + 1, 1, j], N[k + 1, 2, j] = share * x, share * y, share * z


@compiled
def _attitude(Q, t):
    """Unit quaternion at time t of the series."""
    w, x, y, z = Q[ORDER, 0], Q[ORDER, 1], Q[ORDER, 2], Q[ORDER, 3]
    for k in range(ORDER - 1, -1, -1):
        w, x, y, z = w * t + Q[k, 0], x * t + Q[k, 1], y * t + Q[k, 2], z * t + Q[k, 3]
    length = np.sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


@compiled
def _turn(E, R, t, j):
    """Column j of φ at time t of the series, at which the rotation matrix is R."""
    x, y, z = E[ORDER, 0, j], E[ORDER, 1, j], E[ORDER, 2, j]
    for k in range(ORDER - 1, -1, -1):
        x, y, z = x * t + E[k, 0, j], y * t + E[k, 1, j], z * t + E[k, 2, j]
    return _times(R, (x, y, z))


@njit(
    [
        types.float64(
            *(_given[2], _given[2], _given[3], _given[3], _given[1], _given[2], types.float64, types.float64),
            *(_new[3], _new[3], _new[4]),
        )
    ],
    cache=True,
    error_model="numpy",
)
def follow(attitude, spin, G, inverse, largest, tau, step, most, attitudes, spins, columns):
    """Write attitudes (4, k, n), spins (3, k, n) and Φ (3, c, k, n) at times tau (k, n) to the last three arguments.

    attitude (4, n) and spin (3, n) are at time 0, G and its inverse (n or 1, 3, 3) with its largest eigenvalue
    (n or 1,), `step` in rad; c = 0 gives no Φ.  Returns the largest turn in rad; beyond `most` nothing is integrated.
    """
    k, n = tau.shape
    c = columns.shape[1]
    reach, momenta, farthest = np.empty(n), np.empty((n, 3)), 0.0
    Q, M = np.empty((ORDER + 1, 4)), np.empty((ORDER + 1, 6))
    D, N, E = np.empty((3, c)), np.empty((ORDER + 1, 3, c)), np.empty((ORDER + 1, 3, c))
    for i in range(n):
        own, omega = min(i, len(inverse) - 1), (spin[0, i], spin[1, i], spin[2, i])
        R = _axes(attitude[0, i], attitude[1, i], attitude[2, i], attitude[3, i])
        L = _times(R, _times(_rows(G[own]), _back(R, omega)))
        momenta[i, 0], momenta[i, 1], momenta[i, 2] = L
        # least principal moment g: g |ω|² ≤ ω·G ω, which is constant
        twice = L[0] * omega[0] + L[1] * omega[1] + L[2] * omega[2]
        rate = np.sqrt((0.0 if twice < 0.0 else twice) * largest[own])
        reach[i] = step / rate if 0.0 < rate < np.inf else np.inf  # time covered by one series
        for row in range(k):
            turn = rate * abs(tau[row, i])
            if np.isfinite(turn):
                farthest = max(farthest, turn)
            if not np.isfinite(tau[row, i]):
                attitudes[:, row, i], spins[:, row, i], columns[:, :, row, i] = np.nan, np.nan, np.nan
    if farthest > most:
        return farthest
    for i in range(n):
        own, L = min(i, len(inverse) - 1), (momenta[i, 0], momenta[i, 1], momenta[i, 2])
        back = _rows(inverse[own])
        first = (attitude[0, i], attitude[1, i], attitude[2, i], attitude[3, i])
        if c:
            R, moment = _axes(first[0], first[1], first[2], first[3]), _rows(G[own])
            for j in range(3):  # the columns of R G Rᵀ
                D[0, j], D[1, j], D[2, j] = _times(R, _times(moment, R[j]))
        for sign in (1.0, -1.0):  # forwards from time 0, then backwards
            q, begun, P, last = first, 0.0, np.zeros((3, c)), -1.0
            for row in range(k):
                if np.isfinite(tau[row, i]) and (tau[row, i] != 0.0 or sign > 0.0):
                    last = max(last, sign * tau[row, i])
            while begun <= last:
                R = _axes(q[0], q[1], q[2], q[3])
                for j in range(c):
                    E[0, 0, j], E[0, 1, j], E[0, 2, j] = _back(R, (P[0, j], P[1, j], P[2, j]))
                _series(q, L, back, D, Q, M, N, E)
                for row in range(k):
                    t = sign * tau[row, i] - begun
                    if not 0.0 <= t < reach[i] or (sign < 0.0 and tau[row, i] == 0.0):
                        continue
                    q = _attitude(Q, sign * t)
                    R = _axes(q[0], q[1], q[2], q[3])
                    omega = _times(R, _times(back, _back(R, L)))
                    attitudes[0, row, i], attitudes[1, row, i], attitudes[2, row, i], attitudes[3, row, i] = q
                    spins[0, row, i], spins[1, row, i], spins[2, row, i] = omega
                    for j in range(c):
                        columns[0, j, row, i], columns[1, j, row, i], columns[2, j, row, i] = _turn(E, R, sign * t, j)
                begun += reach[i]
                if begun <= last:
                    q = _attitude(Q, sign * reach[i])
                    R = _axes(q[0], q[1], q[2], q[3])
                    for j in range(c):
                        P[0, j], P[1, j], P[2, j] = _turn(E, R, sign * reach[i], j)
    return farthest
