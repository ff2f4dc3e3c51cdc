"""Torque-free turning of n bodies, compiled; its equations stand in `free_motion.py`.

numba compiles this file at the first call, in some seconds, and keeps the result beside it.  What is compiled must
stand here, since numba does not see changes of functions in other files.
"""

import numpy as np
from numba import njit, types

SMALL = 1e-4  # rad: half angles below it are by their series, exact to rounding

compiled = njit(cache=True, error_model="numpy")
# of any layout, so that each is compiled once
_given = [types.Array(types.float64, k, "A", readonly=True) for k in range(4)]
_new = [types.Array(types.float64, k, "C") for k in range(5)]


@compiled
def _slowness(q, inverse):
    """W = R G⁻¹ Rᵀ, symmetric, as (xx, xy, xz, yy, yz, zz); G⁻¹ (3, 3) in axes of the body."""
    w, x, y, z = q
    a, b, c = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    d, e, f = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    g, h, i = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    xx, xy, xz, yy, yz, zz = inverse[0, 0], inverse[0, 1], inverse[0, 2], inverse[1, 1], inverse[1, 2], inverse[2, 2]
    ax, ay, az = a * xx + b * xy + c * xz, a * xy + b * yy + c * yz, a * xz + b * yz + c * zz
    dx, dy, dz = d * xx + e * xy + f * xz, d * xy + e * yy + f * yz, d * xz + e * yz + f * zz
    gx, gy, gz = g * xx + h * xy + i * xz, g * xy + h * yy + i * yz, g * xz + h * yz + i * zz
    return (
        ax * a + ay * b + az * c,
        ax * d + ay * e + az * f,
        ax * g + ay * h + az * i,
        dx * d + dy * e + dz * f,
        dx * g + dy * h + dz * i,
        gx * g + gy * h + gz * i,
    )


@compiled
def _times(W, x, y, z):
    return W[0] * x + W[1] * y + W[2] * z, W[1] * x + W[3] * y + W[4] * z, W[2] * x + W[4] * y + W[5] * z


@compiled
def _turned(q, x, y, z):
    """Quaternion after a turn by the rotation vector (x, y, z) about axes of the world."""
    half = 0.5 * np.sqrt(x * x + y * y + z * z)
    share = 0.5 - half * half / 12.0 if half < SMALL else 0.5 * np.sin(half) / half
    c, x, y, z = np.cos(half), share * x, share * y, share * z
    return (
        c * q[0] - x * q[1] - y * q[2] - z * q[3],
        c * q[1] + x * q[0] + y * q[3] - z * q[2],
        c * q[2] + y * q[0] + z * q[1] - x * q[3],
        c * q[3] + z * q[0] + x * q[2] - y * q[1],
    )


@compiled
def _step(q, h, L, inverse):
    """Attitude after h, and W at the four stages of the step."""
    W1 = _slowness(q, inverse)
    x1, y1, z1 = _times(W1, L[0], L[1], L[2])
    half = 0.5 * h
    q2 = _turned(q, half * x1, half * y1, half * z1)
    W2 = _slowness(q2, inverse)
    x2, y2, z2 = _times(W2, L[0], L[1], L[2])
    W3 = _slowness(_turned(q, half * x2, half * y2, half * z2), inverse)
    x3, y3, z3 = _times(W3, L[0], L[1], L[2])
    W4 = _slowness(_turned(q2, h * x3 - half * x1, h * y3 - half * y1, h * z3 - half * z1), inverse)
    x4, y4, z4 = _times(W4, L[0], L[1], L[2])
    part, x, y, z = h / 12.0, 2.0 * (x2 + x3), 2.0 * (y2 + y3), 2.0 * (z2 + z3)
    q = _turned(q, part * (3.0 * x1 + x - x4), part * (3.0 * y1 + y - y4), part * (3.0 * z1 + z - z4))
    q = _turned(q, part * (3.0 * x4 + x - x1), part * (3.0 * y4 + y - y1), part * (3.0 * z4 + z - z1))
    return q, W1, W2, W3, W4


@njit([types.void(_given[2], _given[2], _given[3], _given[3], _new[2])], cache=True, error_model="numpy")
def spins_up(attitude, spin, G, inverse, into):
    """ω' = W (L × ω), L = R G Rᵀ ω, of n bodies (3, n), written into the last; G and inverse are (n or 1, 3, 3)."""
    for i in range(spin.shape[1]):
        q, own = (attitude[0, i], attitude[1, i], attitude[2, i], attitude[3, i]), min(i, len(G) - 1)
        x, y, z = spin[0, i], spin[1, i], spin[2, i]
        a, b, c = _times(_slowness(q, G[own]), x, y, z)
        into[0, i], into[1, i], into[2, i] = _times(
            _slowness(q, inverse[own]), b * z - c * y, c * x - a * z, a * y - b * x
        )


@compiled
def _rate(W, D, L, x, y, z, j):
    """Φ̇ = W (D + L × Φ), of the column j of D that belongs to the column (x, y, z) of Φ."""
    return _times(W, D[0, j] + L[1] * z - L[2] * y, D[1, j] + L[2] * x - L[0] * z, D[2, j] + L[0] * y - L[1] * x)


@compiled
def _step_columns(P, h, D, L, W1, W2, W3, W4):
    """Φ after h, in its place, by the Runge-Kutta method whose stages `_step` has."""
    half = 0.5 * h
    for j in range(P.shape[1]):
        x, y, z = P[0, j], P[1, j], P[2, j]
        a1, b1, c1 = _rate(W1, D, L, x, y, z, j)
        a2, b2, c2 = _rate(W2, D, L, x + half * a1, y + half * b1, z + half * c1, j)
        a3, b3, c3 = _rate(W3, D, L, x + half * a2, y + half * b2, z + half * c2, j)
        a4, b4, c4 = _rate(W4, D, L, x + h * a3, y + h * b3, z + h * c3, j)
        P[0, j] = x + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
        P[1, j] = y + h / 6.0 * (b1 + 2.0 * (b2 + b3) + b4)
        P[2, j] = z + h / 6.0 * (c1 + 2.0 * (c2 + c3) + c4)


@compiled
def _order(tau, order):
    """Numbers of the times (k,) as they rise, into `order`."""
    order[:] = np.arange(len(tau))
    for row in range(1, len(tau)):
        if not tau[row] >= tau[row - 1]:
            order[:] = np.argsort(tau)
            return


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
    """Attitudes (4, k, n), spins (3, k, n) and Φ (3, c, k, n) at times tau (k, n), written into the last three.

    attitude (4, n) and spin (3, n) at time 0, G and its inverse (n or 1, 3, 3) with its largest eigenvalue (n or 1,),
    `step` in rad; c = 0 for no columns.  Returns the farthest turn in rad; nothing is followed if it is beyond `most`.
    """
    k, n = tau.shape
    rate, momenta, farthest = np.empty(n), np.empty((n, 3)), 0.0
    P, D, order = np.zeros((3, columns.shape[1])), np.empty((3, 3)), np.empty(k, np.int64)
    for i in range(n):
        own = min(i, len(inverse) - 1)
        q = (attitude[0, i], attitude[1, i], attitude[2, i], attitude[3, i])
        x, y, z = spin[0, i], spin[1, i], spin[2, i]
        momenta[i, 0], momenta[i, 1], momenta[i, 2] = a, b, c = _times(_slowness(q, G[own]), x, y, z)
        # least principal moment g: g |ω|² ≤ ω·G ω, which is constant
        twice = a * x + b * y + c * z
        rate[i] = np.sqrt((0.0 if twice < 0.0 else twice) * largest[own])
        for row in range(k):
            turn = abs(rate[i] * tau[row, i])
            if np.isfinite(turn):
                farthest = max(farthest, turn)
    if farthest > most:
        return farthest
    for i in range(n):
        own, momentum = inverse[min(i, len(inverse) - 1)], momenta[i]
        first = (attitude[0, i], attitude[1, i], attitude[2, i], attitude[3, i])
        _order(tau[:, i], order)
        if columns.shape[1]:
            W = _slowness(first, G[min(i, len(G) - 1)])
            D[0, 0], D[0, 1], D[0, 2], D[1, 1], D[1, 2], D[2, 2] = W
            D[1, 0], D[2, 0], D[2, 1] = W[1], W[2], W[4]
        for sign in (1.0, -1.0):  # onwards from time 0, then backwards
            q, now, P[:] = first, 0.0, 0.0
            for position in range(k):
                row = order[position if sign > 0.0 else k - 1 - position]
                t = tau[row, i]
                if not np.isfinite(t):
                    attitudes[:, row, i], spins[:, row, i], columns[:, :, row, i] = np.nan, np.nan, np.nan
                    continue
                if sign * t < 0.0 or (sign < 0.0 and t == 0.0):
                    continue
                turn = rate[i] * abs(t - now)
                # one for a body that does not turn, whose columns grow
                steps = max(int(np.ceil(turn / step)), 1) if np.isfinite(turn) else 1
                for _ in range(steps):
                    h = (t - now) / steps
                    q, W1, W2, W3, W4 = _step(q, h, momentum, own)
                    _step_columns(P, h, D, momentum, W1, W2, W3, W4)
                now = t
                W = _slowness(q, own)
                x, y, z = _times(W, momentum[0], momentum[1], momentum[2])
                attitudes[0, row, i], attitudes[1, row, i], attitudes[2, row, i], attitudes[3, row, i] = q
                spins[0, row, i], spins[1, row, i], spins[2, row, i] = x, y, z
                columns[:, :, row, i] = P
    return farthest
