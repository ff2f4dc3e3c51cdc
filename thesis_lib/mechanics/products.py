"""Compiled products of n vectors and quaternions in space; `space.py` explains them.

numba compiles this file at the first call, in a few seconds, and caches the result next to it.  Arrays are (c, n); an
array with a single column is used with all n columns of the other one.
"""

import numpy as np
from numba import njit, types

SMALL = 1e-4  # rad: smaller half angles use a power series, exact to rounding

_of = types.Array(types.float64, 2, "A", readonly=True)  # any memory layout: each function is compiled once
_two, _three = types.Array(types.float64, 2, "C"), types.Array(types.float64, 3, "C")


def _compiled(result, arguments: int):
    return njit([result(*[_of] * arguments)], cache=True, error_model="numpy")


@_compiled(_two, 2)
def cross(a, b):
    """Vector product a × b (3, n)."""
    n, one_a, one_b = a.shape[1] if b.shape[1] == 1 else b.shape[1], a.shape[1] == 1, b.shape[1] == 1
    product = np.empty((3, n))
    for i in range(n):
        j, k = 0 if one_a else i, 0 if one_b else i
        x, y, z, u, v, w = a[0, j], a[1, j], a[2, j], b[0, k], b[1, k], b[2, k]
        product[0, i], product[1, i], product[2, i] = y * w - z * v, z * u - x * w, x * v - y * u
    return product


@_compiled(_two, 2)
def multiplied(p, q):
    """Product p q (4, n) of quaternions."""
    n, one_p, one_q = p.shape[1] if q.shape[1] == 1 else q.shape[1], p.shape[1] == 1, q.shape[1] == 1
    product = np.empty((4, n))
    for i in range(n):
        j, k = 0 if one_p else i, 0 if one_q else i
        s, x, y, z, t, u, v, w = p[0, j], p[1, j], p[2, j], p[3, j], q[0, k], q[1, k], q[2, k], q[3, k]
        product[0, i] = s * t - x * u - y * v - z * w
        product[1, i] = s * u + t * x + (y * w - z * v)
        product[2, i] = s * v + t * y + (z * u - x * w)
        product[3, i] = s * w + t * z + (x * v - y * u)
    return product


@_compiled(_two, 2)
def rotated(q, u):
    """Vectors u (3, n) turned by quaternions q (4, n)."""
    n, one_q, one_u = q.shape[1] if u.shape[1] == 1 else u.shape[1], q.shape[1] == 1, u.shape[1] == 1
    turned = np.empty((3, n))
    for i in range(n):
        j, k = 0 if one_q else i, 0 if one_u else i
        s, x, y, z, a, b, c = q[0, j], q[1, j], q[2, j], q[3, j], u[0, k], u[1, k], u[2, k]
        d, e, f = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
        turned[0, i] = a + s * d + (y * f - z * e)
        turned[1, i] = b + s * e + (z * d - x * f)
        turned[2, i] = c + s * f + (x * e - y * d)
    return turned


@_compiled(_three, 1)
def rotation_matrix(q):
    """Rotation matrices R (3, 3, n) of quaternions (4, n)."""
    n = q.shape[1]
    R = np.empty((3, 3, n))
    for i in range(n):
        w, x, y, z = q[0, i], q[1, i], q[2, i], q[3, i]
        X, Y, Z = 2.0 * x, 2.0 * y, 2.0 * z
        R[0, 0, i], R[0, 1, i], R[0, 2, i] = 1.0 - (y * Y + z * Z), y * X - w * Z, w * Y + z * X
        R[1, 0, i], R[1, 1, i], R[1, 2, i] = w * Z + x * Y, 1.0 - (z * Z + x * X), z * Y - w * X
        R[2, 0, i], R[2, 1, i], R[2, 2, i] = x * Z - w * Y, w * X + y * Z, 1.0 - (x * X + y * Y)
    return R


@_compiled(_two, 1)
def of_rotation_vector(turn):
    """Quaternions (4, n) of rotation vectors (3, n) in rad."""
    n = turn.shape[1]
    q = np.empty((4, n))
    for i in range(n):
        x, y, z = turn[0, i], turn[1, i], turn[2, i]
        half = 0.5 * np.sqrt(x * x + y * y + z * z)
        share = 0.5 - half * half / 12.0 if half < SMALL else 0.5 * np.sin(half) / half
        q[0, i], q[1, i], q[2, i], q[3, i] = np.cos(half), share * x, share * y, share * z
    return q


@_compiled(_two, 1)
def rotation_vector(q):
    """Shortest rotation vectors (3, n) in rad of quaternions (4, n)."""
    n = q.shape[1]
    turn = np.empty((3, n))
    for i in range(n):
        sign = -1.0 if q[0, i] < 0.0 else 1.0
        w, x, y, z = sign * q[0, i], sign * q[1, i], sign * q[2, i], sign * q[3, i]
        sine = np.sqrt(x * x + y * y + z * z)
        share = 2.0 + sine * sine / 3.0 if sine < SMALL else 2.0 * np.arctan2(sine, w) / sine
        turn[0, i], turn[1, i], turn[2, i] = share * x, share * y, share * z
    return turn


@_compiled(_two, 2)
def turned_by(turn, attitude):
    """Attitudes (4, n) after turns (3, n) in rad about world axes."""
    return multiplied(of_rotation_vector(turn), attitude)


@_compiled(_two, 2)
def turn_between(first, second):
    """Turns (3, n) in rad from the first attitudes to the second."""
    back = np.empty(first.shape)
    for i in range(first.shape[1]):
        back[0, i], back[1, i], back[2, i], back[3, i] = first[0, i], -first[1, i], -first[2, i], -first[3, i]
    return rotation_vector(multiplied(second, back))


@_compiled(_three, 2)
def in_world(G, q):
    """R G Rᵀ (3, 3, n) of matrices G (9, n), stored row by row."""
    n, one = q.shape[1], G.shape[1] == 1
    R, turned = rotation_matrix(q), np.empty((3, 3, n))
    for i in range(n):
        k = 0 if one else i
        for j in range(3):
            x, y, z = R[j, 0, i], R[j, 1, i], R[j, 2, i]
            a = x * G[0, k] + y * G[3, k] + z * G[6, k]
            b = x * G[1, k] + y * G[4, k] + z * G[7, k]
            c = x * G[2, k] + y * G[5, k] + z * G[8, k]
            for l in range(3):
                turned[j, l, i] = a * R[l, 0, i] + b * R[l, 1, i] + c * R[l, 2, i]
    return turned


@_compiled(_two, 1)
def inverse(G):
    """Inverses (9, n) of symmetric matrices (9, n), stored row by row."""
    found = np.empty(G.shape)
    for i in range(G.shape[1]):
        a, b, c, d, e, f = G[0, i], G[1, i], G[2, i], G[4, i], G[5, i], G[8, i]
        A, B, C, D, E, F = d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b
        det = a * A + b * B + c * C
        found[0, i], found[4, i], found[8, i] = A / det, D / det, F / det
        found[1, i] = found[3, i] = B / det
        found[2, i] = found[6, i] = C / det
        found[5, i] = found[7, i] = E / det
    return found


@_compiled(_two, 2)
def product(A, b):
    """Products A b (3, n) of vectors b and matrices A (9, n), stored row by row."""
    n, one_A, one_b = A.shape[1] if b.shape[1] == 1 else b.shape[1], A.shape[1] == 1, b.shape[1] == 1
    found = np.empty((3, n))
    for i in range(n):
        j, k = 0 if one_A else i, 0 if one_b else i
        x, y, z = b[0, k], b[1, k], b[2, k]
        found[0, i] = A[0, j] * x + A[1, j] * y + A[2, j] * z
        found[1, i] = A[3, j] * x + A[4, j] * y + A[5, j] * z
        found[2, i] = A[6, j] * x + A[7, j] * y + A[8, j] * z
    return found


@_compiled(_three, 2)
def compliance(r, mobility):
    """S G⁻¹ Sᵀ (3, 3, n) with S = −[r]ₓ, of G⁻¹ (9, n), stored row by row."""
    n, one = r.shape[1], mobility.shape[1] == 1
    K = np.empty((3, 3, n))
    for i in range(n):
        j = 0 if one else i
        x, y, z = r[0, i], r[1, i], r[2, i]
        a, b, c = mobility[0, j], mobility[1, j], mobility[2, j]
        d, e, f = mobility[3, j], mobility[4, j], mobility[5, j]
        g, h, k = mobility[6, j], mobility[7, j], mobility[8, j]
        # rows of S G⁻¹
        p, q, s = z * d - y * g, z * e - y * h, z * f - y * k
        t, u, v = x * g - z * a, x * h - z * b, x * k - z * c
        l, m, o = y * a - x * d, y * b - x * e, y * c - x * f
        K[0, 0, i], K[0, 1, i], K[0, 2, i] = q * z - s * y, s * x - p * z, p * y - q * x
        K[1, 0, i], K[1, 1, i], K[1, 2, i] = u * z - v * y, v * x - t * z, t * y - u * x
        K[2, 0, i], K[2, 1, i], K[2, 2, i] = m * z - o * y, o * x - l * z, l * y - m * x
    return K
