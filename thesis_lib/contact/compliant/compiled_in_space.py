"""Compiled compliant contacts of finite duration in space: the motion of a body on all its contact points.

Units, forces and steps are those of the motion in the plane in `compiled.py`.  In space the spin follows from the
angular momentum L, which is constant without torque,

    ω = W L,    W = T W_0 Tᵀ,    T the turn since first contact, W_0 the inverse inertia then, in world axes.

Friction has two components.  It ends the slip within the step if |c_t| ≤ μ c_n; else it is μ c_n against the slip in
the middle of the step, (½ A + λ) c_t = −s, with A the compliance along the surface.  If the slip reverses within the
step, friction first opposes the slip before and then the slip after.  With torsional friction, a couple τ about the
normal shares the limit, |(c_t / μ, τ / m_t)| ≤ c_n.  The force of a convex contact minimises its convex program in the
circular cone |f_t| ≤ μ f_n.  On a pyramid it is a sum of forces g ≥ 0 along four edges, n ± μ t_1 and n ± μ t_2, each
with its part of R.  Torsional friction lies in the circular cone, too, or on two more edges of the pyramid, with the R
of a slip of ω_n m_t / μ.
μ is the value for fast slip times Stribeck's factor 1 + s exp(−(|s_t| / v_s)²) at the slip s_t in the middle of the
step; for a convex contact, at its start.  If an ellipse limits friction, with M = 1 + [[a_c, a_s], [a_s, −a_c]] and
c_t = M d, the friction of springs is solved for d with slip M s and compliance M A M.  A point that touches within a
step presses from that instant on, except in convex contacts, whose engine does not resolve this instant either.

A contact point belongs to a body that is a Minkowski sum (`bodies/minkowski.py`): a point that turns with the body,
plus the lowest point of an ellipsoid that turns with it, minus a radius along the normal.

numba compiles this file at the first call and caches the result next to it.  A change in `compiled.py` is not
detected: after changing forces there, also modify (touch) this file.
"""

import numpy as np

from thesis_lib.contact.compliant.compiled import CONVEX, PYRAMID, SETTLED, SPEED, SWEEPS, _push, compiled, kernel

CLOSE = 1e-9  # relative tolerance of friction at its limit
MOST = 40  # steps to the limit; about 4 Newton steps are needed
LEAST = 1e-9  # least μ, for a cone of non-zero size
AT_LIMIT = 0.999  # of the square of friction's limit, from which on the next step probably slides
TURNS, TURNED, WIDE = 8, 1e-6, 0.5  # steps along the side of a cone: most of them, the last and the widest in rad
ON_BALL = 1e-13  # relative tolerance of the length that `in_ball` limits


@kernel
def _limited(a, b, c, x, y, limit):
    """d with |d| ≤ limit and (A + λ) d = −(x, y) for the least possible λ ≥ 0; A = [[a, b], [b, c]]."""
    added = 0.0
    for _ in range(MOST):
        a_1, c_1 = a + added, c + added
        det = a_1 * c_1 - b * b
        d_1, d_2 = (b * y - c_1 * x) / det, (b * x - a_1 * y) / det
        length = np.sqrt(d_1 * d_1 + d_2 * d_2)
        if length <= limit * (1.0 + CLOSE):
            break
        if limit <= 0.0:
            return 0.0, 0.0
        # Newton's step for 1/|d|, which is nearly linear in λ (Moré and Sorensen 1983)
        square = (c_1 * d_1 * d_1 - 2.0 * b * d_1 * d_2 + a_1 * d_2 * d_2) / det
        added += length * length / square * (length - limit) / limit
    return d_1, d_2


@kernel
def _friction(a, b, c, x, y, s_1, s_2, limit, sharing):
    """Friction impulse, at most `limit`, in a step that changes the slip from (x, y) to (s_1, s_2) without friction.

    [[a, b], [b, c]] is the compliance along the surface; the impulse ending the slip is shared by `sharing` contacts.
    """
    a, b, c = sharing * a, sharing * b, sharing * c
    pull_1, pull_2, speed = s_1 - x, s_2 - y, np.sqrt(x * x + y * y)
    if x * pull_1 + y * pull_2 < 0.0 and limit > 0.0:
        # friction first opposes the initial slip, then, if too weak to stop it, the slip in another direction
        d_1, d_2 = _limited(a, b, c, pull_1, pull_2, np.inf)
        if d_1 * d_1 + d_2 * d_2 > limit * limit:
            d_1, d_2 = _limited(a, b, c, pull_1, pull_2, limit)
            u_1, u_2 = x / speed, y / speed
            w_1, w_2 = pull_1 - limit * (a * u_1 + b * u_2), pull_2 - limit * (b * u_1 + c * u_2)
            part = -(x * w_1 + y * w_2) / (w_1 * w_1 + w_2 * w_2)
            if part < 1.0 and u_1 * d_1 + u_2 * d_2 > 0.0:
                return (1.0 - part) * d_1 - part * limit * u_1, (1.0 - part) * d_2 - part * limit * u_2
    d_1, d_2 = _limited(a, b, c, s_1, s_2, np.inf)
    if d_1 * d_1 + d_2 * d_2 <= limit * limit:
        return d_1, d_2
    return _limited(0.5 * a, 0.5 * b, 0.5 * c, 0.5 * (s_1 + x), 0.5 * (s_2 + y), limit)


@kernel
def _inverted(a, b, c, d, e, f, x, y, z):
    """Solution of the symmetric system ((a, b, c), (b, d, e), (c, e, f)) · = (x, y, z)."""
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    D, E, F = a * f - c * c, b * c - a * e, a * d - b * b
    det = a * A + b * B + c * C
    return (A * x + B * y + C * z) / det, (B * x + D * y + E * z) / det, (C * x + E * y + F * z) / det


@kernel
def in_ball(a, b, c, d, e, f, x, y, z, radius):
    """y with |y| ≤ radius and (B + λ) y = −(x, y, z) for the least possible λ ≥ 0; B is the matrix of `_inverted`."""
    added = 0.0
    for _ in range(MOST):
        p, q, r = _inverted(a + added, b, c, d + added, e, f + added, -x, -y, -z)
        size = np.sqrt(p * p + q * q + r * r)
        if added == 0.0 and size <= radius:
            break
        if not abs(size - radius) > ON_BALL * radius:
            break
        i, j, k = _inverted(a + added, b, c, d + added, e, f + added, p, q, r)
        added += (size / radius - 1.0) * size * size / (p * i + q * j + r * k)
    return p, q, r


@kernel
def _twisted(A, x, y, turning, s_1, s_2, omega_n, mu, lever, push, sharing):
    """As `_friction`, with a couple about the normal; without it the step changes the spin from `turning` to `omega_n`.

    A (4, 4) is the matrix of `_compliance`; |(f / μ, τ / lever)| is at most `push`.
    """
    m, t = max(mu, LEAST), lever
    a, b, c = sharing * m * m * A[0, 0], sharing * m * m * A[0, 1], sharing * m * t * A[0, 3]
    d, e, f = sharing * m * m * A[1, 1], sharing * m * t * A[1, 3], sharing * t * t * A[3, 3]
    p, q, r = _inverted(a, b, c, d, e, f, -m * s_1, -m * s_2, -t * omega_n)
    if p * p + q * q + r * r > push * push:
        x, y, z = 0.5 * m * (x + s_1), 0.5 * m * (y + s_2), 0.5 * t * (turning + omega_n)
        p, q, r = in_ball(0.5 * a, 0.5 * b, 0.5 * c, 0.5 * d, 0.5 * e, 0.5 * f, x, y, z, push)
    return m * p, m * q, t * r


@kernel
def _in_cone(Q, c, mu, lever, start):
    """f (f_1, f_2, f_n, τ) that minimises ½ fᵀ Q f − fᵀ c in |(f_t / μ, τ / lever)| ≤ f_n; τ is 0 without a lever.

    The minimum at a given f_n is a convex function of f_n: its slope increases, and Newton's steps from `start` find
    the root of the slope, bracketed by values that are too low and too high.
    """
    m, t = max(mu, LEAST), lever
    A, B, C, D, E, F = m * m * Q[0, 0], m * m * Q[0, 1], m * t * Q[0, 3], m * m * Q[1, 1], m * t * Q[1, 3], 1.0
    if t > 0.0:
        F = t * t * Q[3, 3]
    b_1, b_2, b_t, c_1, c_2, c_t = m * Q[0, 2], m * Q[1, 2], t * Q[2, 3], m * c[0], m * c[1], t * c[3]
    first = -c[2] - np.sqrt(c_1 * c_1 + c_2 * c_2 + c_t * c_t)
    if first >= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    low, high, f_n = 0.0, np.inf, start if start > 0.0 else -first / Q[2, 2]
    for _ in range(MOST):
        x, y, z = b_1 * f_n - c_1, b_2 * f_n - c_2, b_t * f_n - c_t
        p, q, r = in_ball(A, B, C, D, E, F, x, y, z, f_n)
        slope, bend = Q[2, 2] * f_n + b_1 * p + b_2 * q + b_t * r - c[2], Q[2, 2]
        pull = p * (x + A * p + B * q + C * r) + q * (y + B * p + D * q + E * r) + r * (z + C * p + E * q + F * r)
        added = max(-pull, 0.0) / (f_n * f_n)  # λ of `in_ball`; 0 inside
        i, j, k = _inverted(A + added, B, C, D + added, E, F + added, b_1, b_2, b_t)
        bend -= b_1 * i + b_2 * j + b_t * k
        if added > 0.0:
            slope -= added * f_n
            u, v, w = _inverted(A + added, B, C, D + added, E, F + added, p, q, r)
            bend += (f_n + p * i + q * j + r * k) ** 2 / (p * u + q * v + r * w) - added
        if abs(slope) <= CLOSE * -first:
            break
        if slope < 0.0:
            low = f_n
        else:
            high = f_n
        f_n -= slope / bend
        if not low < f_n < high:
            f_n = 0.5 * (low + high) if high < np.inf else 2.0 * low
    return m * p, m * q, f_n, t * r


@kernel
def _on_side(Q, c, mu, x, y):
    """f (f_1, f_2, f_n) that minimises ½ fᵀ Q f − fᵀ c on the side |f_t| = μ f_n of the cone, and whether it is the
    minimum in the cone.

    Newton's steps turn the direction of f_t from (x, y).  With e = (μ x, μ y, 1), the best f along e has the value
    −½ (cᵀe)²/(eᵀQe).  The minimum is that in the cone if a weaker friction would not lower it.
    """
    m, length = max(mu, LEAST), np.sqrt(x * x + y * y)
    if length <= 0.0:
        x, y = c[0], c[1]
        length = np.sqrt(x * x + y * y)
        if length <= 0.0:
            return 0.0, 0.0, 0.0, False
    x, y = x / length, y / length
    for _ in range(TURNS):
        f_1, f_2 = m * x, m * y
        u, w = Q[0, 0] * f_1 + Q[0, 1] * f_2 + Q[0, 2], Q[0, 1] * f_1 + Q[1, 1] * f_2 + Q[1, 2]
        own, by = f_1 * u + f_2 * w, f_1 * w - f_2 * u  # e and its derivative, each with Q e along the surface
        square = own + Q[0, 2] * f_1 + Q[1, 2] * f_2 + Q[2, 2]
        pull, aside, outward = c[0] * f_1 + c[1] * f_2 + c[2], c[1] * f_1 - c[0] * f_2, c[0] * f_1 + c[1] * f_2
        bend = Q[0, 0] * f_2 * f_2 - 2.0 * Q[0, 1] * f_1 * f_2 + Q[1, 1] * f_1 * f_1 - own
        slope, change = aside * square - pull * by, -outward * square + aside * by - pull * bend
        if pull <= 0.0 or change >= 0.0:
            break
        turn = -slope / change
        if abs(turn) > WIDE:
            break
        shorter = 1.0 / np.sqrt(1.0 + turn * turn)
        x, y = shorter * (x - turn * y), shorter * (y + turn * x)
        if abs(turn) <= TURNED:
            f_1, f_2 = m * x, m * y
            u, w = Q[0, 0] * f_1 + Q[0, 1] * f_2 + Q[0, 2], Q[0, 1] * f_1 + Q[1, 1] * f_2 + Q[1, 2]
            square = f_1 * (u + Q[0, 2]) + f_2 * (w + Q[1, 2]) + Q[2, 2]
            f_n = (c[0] * f_1 + c[1] * f_2 + c[2]) / square
            return f_n * f_1, f_n * f_2, f_n, f_n > 0.0 and f_1 * (f_n * u - c[0]) + f_2 * (f_n * w - c[1]) <= 0.0
    return 0.0, 0.0, 0.0, False


@kernel
def _on_edges(P, c, free, g, M, x):
    """Set g to the solution of P g = c where `free`, else 0; P (n, n) is positive definite, M and x are work arrays."""
    n, m = len(P), 0
    for i in range(n):
        g[i] = 0.0
        if free[i]:
            x[m], k = c[i], 0
            for j in range(i + 1):
                if free[j]:
                    M[m, k] = P[i, j]
                    k += 1
            m += 1
    # the lower triangle becomes the factor in P = L D Lᵀ
    for i in range(m):
        for j in range(i + 1, m):
            share = M[j, i] / M[i, i]
            for k in range(j, m):
                M[k, j] -= share * M[k, i]
            x[j] -= share * x[i]
    for i in range(m - 1, -1, -1):
        for j in range(i + 1, m):
            x[i] -= M[j, i] * x[j]
        x[i] /= M[i, i]
    k = 0
    for i in range(n):
        if free[i]:
            g[i] = x[k]
            k += 1


@kernel
def _of_edges(Q, mu, lever, regular, P):
    """Set P (n, n) to the matrix in g of ½ fᵀ Q f + ½ `regular` Σ g_i², f = Σ g_i e_i; return the number n of edges."""
    n = 6 if lever > 0.0 else 4
    for i in range(n):
        a, x = _edge(i, mu, lever)
        row = Q[2, 2] + x * Q[a, 2]
        for j in range(i + 1):
            b, y = _edge(j, mu, lever)
            P[i, j] = P[j, i] = row + y * (Q[2, b] + x * Q[a, b])
        P[i, i] += regular
    return n


@kernel
def _pyramid(P, c, mu, lever, free, g, d, M, x):
    """f (f_1, f_2, f_n, τ) = Σ g_i e_i with g ≥ 0 that minimises ½ gᵀ P g − fᵀ c, with P (n, n) of `_of_edges`.

    Starting from the edges that are `free`, each step corrects the first wrong sign of g or of its slopes (Murty 1974).
    g, d, x (n,) and M (n, n) are work arrays.
    """
    n = len(P)
    for i in range(n):
        a, y = _edge(i, mu, lever)
        d[i] = c[2] + y * c[a]
    for _ in range(MOST):
        _on_edges(P, d, free, g, M, x)
        wrong = -1
        for i in range(n - 1, -1, -1):
            if free[i]:
                if g[i] < 0.0:
                    wrong = i
                continue
            slope = d[i]
            for j in range(n):
                slope -= P[i, j] * g[j]
            if slope > CLOSE * abs(d[i]):
                wrong = i
        if wrong < 0:
            break
        free[wrong] = not free[wrong]
    f_n = 0.0
    for i in range(n):
        g[i] = max(g[i], 0.0)
        f_n += g[i]
    twist = lever * (g[4] - g[5]) if n > 4 else 0.0
    return mu * (g[0] - g[1]), mu * (g[2] - g[3]), f_n, twist


@kernel
def _edge(i, mu, lever):
    """Index and size of the component that edge i has besides the normal one."""
    a, x = (3, lever) if i > 3 else (i // 2, mu)
    return a, x if i % 2 == 0 else -x


@kernel
def _compliance(W, r, A):
    """Set the first rows of A (4, 4) to K = 1 − [r]ₓ W [r]ₓ, with W (3, 3) and r (3,); the last one to the effect of a
    couple about the normal: W n × r on the velocity of the point, W_nn on the spin."""
    x, y, z = r[0], r[1], r[2]
    # rows of −[r]ₓ W
    for j in range(3):
        A[0, j], A[1, j], A[2, j] = z * W[1, j] - y * W[2, j], x * W[2, j] - z * W[0, j], y * W[0, j] - x * W[1, j]
    for i in range(3):
        a, b, c = A[i, 0], A[i, 1], A[i, 2]
        A[i, 0], A[i, 1], A[i, 2] = b * z - c * y, c * x - a * z, a * y - b * x
        A[i, i] += 1.0
        A[i, 3] = A[3, i] = c
    A[3, 3] = W[2, 2]


@kernel
def _convex(kind, h, rho, ratio, v, omega, a, alpha, W, rs, depths, mus, levers, Bs, Ks, forces, room):
    """Replace in `forces` (p, 4) the forces and normal couples per mass of convex contacts in the previous step by the
    new ones.

    As in the plane, they belong to velocities in the middle of a step h from `v`, `omega`; a and alpha (3,) are the
    accelerations of the body without contact, and are modified.  `room` holds the work arrays of `_room`.
    """
    (As, Qs, Ps, cs, free), (c, u, d, M), (g, x, y, N) = room
    p = len(depths)
    pressing = 0
    for k in range(p):
        if depths[k] <= 0.0:
            forces[k] = 0.0
            continue
        pressing += 1
        r, f, B, mu, lever, A, Q = rs[k], forces[k], Bs[k], mus[k], levers[k], As[k], Qs[k]
        _accelerate(f[0], f[1], f[2], f[3], r, W, a, alpha)
        _compliance(W, r, A)
        half = 1.0 + 0.5 * B * h
        for i in range(4):
            for j in range(4):
                Q[i, j] = half * A[i, j]
        cs[k, 0] = -B * (v[0] + omega[1] * r[2] - omega[2] * r[1])
        cs[k, 1] = -B * (v[1] + omega[2] * r[0] - omega[0] * r[2])
        cs[k, 2] = Ks[k] * depths[k] - B * (v[2] + omega[0] * r[1] - omega[1] * r[0])
        cs[k, 3] = -B * omega[2]
        if kind == PYRAMID:
            _of_edges(Q, mu, lever, 2.0 * mu * mu * rho, Ps[k])
            free[k] = True
        else:
            along = rho / ratio
            about = along * mu * mu / (lever * lever) if lever > 0.0 else np.inf
            Q[0, 0], Q[1, 1], Q[2, 2], Q[3, 3] = Q[0, 0] + along, Q[1, 1] + along, Q[2, 2] + rho, Q[3, 3] + about
    for _ in range(SWEEPS if pressing > 1 else 1):
        moved, total = 0.0, 0.0
        for k in range(p):
            if depths[k] <= 0.0:
                continue
            r, f, B, mu, lever, A, Q = rs[k], forces[k], Bs[k], mus[k], levers[k], As[k], Qs[k]
            u[0], u[1] = a[0] + alpha[1] * r[2] - alpha[2] * r[1], a[1] + alpha[2] * r[0] - alpha[0] * r[2]
            u[2], u[3] = a[2] + alpha[0] * r[1] - alpha[1] * r[0], alpha[2]
            half, c[3] = 1.0 + 0.5 * B * h, 0.0
            for i in range(4 if lever > 0.0 else 3):
                u[i] -= A[i, 0] * f[0] + A[i, 1] * f[1] + A[i, 2] * f[2] + A[i, 3] * f[3]
                c[i] = cs[k, i] - half * u[i]
            if kind == PYRAMID:
                n = 6 if lever > 0.0 else 4
                if mu > 0.0:
                    f_1, f_2, f_n, twist = _pyramid(Ps[k, :n, :n], c, mu, lever, free[k], g, x, N, y)
                else:  # all edges coincide with the normal
                    f_1, f_2, f_n, twist = 0.0, 0.0, max(c[2], 0.0) / Q[2, 2], 0.0
            else:
                # sticking: evaluated in the middle of a step that resolves it, else at the end against oscillation
                largest = max(A[0, 0], A[1, 1])
                later = 0.0 if B * h * largest < half * largest + rho / ratio else 0.5 * B * h
                slid = lever <= 0.0 and f[0] * f[0] + f[1] * f[1] > AT_LIMIT * (mu * f[2]) ** 2
                found, twist = False, 0.0
                if slid and later == 0.0:  # a minimum on the side excludes sticking
                    f_1, f_2, f_n, found = _on_side(Q, c, mu, f[0], f[1])
                if not found:
                    f_1, f_2, f_n, twist = _sticking(Q, A, c, u, later, lever, M, d)
                    slip = (f_1 * f_1 + f_2 * f_2) / max(mu, LEAST) ** 2
                    if f_n < 0.0 or slip + (twist / lever if lever > 0.0 else 0.0) ** 2 > f_n * f_n:
                        if lever <= 0.0 and not (slid and later == 0.0):
                            f_1, f_2, f_n, found = _on_side(Q, c, mu, f_1, f_2)
                        if not found:
                            f_1, f_2, f_n, twist = _in_cone(Q, c, mu, lever, f[2])
            d_1, d_2, d_n, d_t = f_1 - f[0], f_2 - f[1], f_n - f[2], twist - f[3]
            _accelerate(d_1, d_2, d_n, d_t, r, W, a, alpha)
            f[0], f[1], f[2], f[3] = f_1, f_2, f_n, twist
            moved = max(moved, abs(d_1) + abs(d_2) + abs(d_n))
            total += f_n
        if moved <= SETTLED * (total + 1e-12):
            break


@compiled
def _room(p):
    """Work arrays of `_convex` for p contacts, for one of them, and for the edges of a pyramid."""
    matrices = (
        np.empty((p, 4, 4)),
        np.empty((p, 4, 4)),
        np.empty((p, 6, 6)),
        np.empty((p, 4)),
        np.ones((p, 6), np.bool_),
    )
    return (
        matrices,
        (np.empty(4), np.empty(4), np.empty(3), np.empty((3, 3))),
        (np.empty(6), np.empty(6), np.empty(6), np.empty((6, 6))),
    )


@kernel
def _sticking(Q, A, c, u, later, lever, M, d):
    """f (f_1, f_2, f_n, τ) with Q f = c, friction and couple evaluated `later` in the step; τ is 0 without a lever.

    M (3, 3) and d (3,) are work arrays.
    """
    for i in range(3):
        share = 0.0 if i == 2 else later
        d[i] = c[i] - share * u[i]
        for j in range(3):
            M[i, j] = Q[i, j] + share * A[i, j]
    if lever <= 0.0:
        f_1, f_2, f_n = _solved(M, d)
        return f_1, f_2, f_n, 0.0
    twist, pivot = c[3] - later * u[3], Q[3, 3] + later * A[3, 3]
    for i in range(3):
        column = (Q[i, 3] + (0.0 if i == 2 else later) * A[i, 3]) / pivot
        d[i] -= column * twist
        for j in range(3):
            M[i, j] -= column * (Q[3, j] + later * A[3, j])
    f_1, f_2, f_n = _solved(M, d)
    for i, f in enumerate((f_1, f_2, f_n)):
        twist -= (Q[3, i] + later * A[3, i]) * f
    return f_1, f_2, f_n, twist / pivot


@kernel
def _accelerate(f_1, f_2, f_n, twist, r, W, a, alpha):
    """Add the effect of a force at r and of a couple about the normal to the accelerations a and alpha (3,)."""
    a[0], a[1], a[2] = a[0] + f_1, a[1] + f_2, a[2] + f_n
    x, y, z = r[1] * f_n - r[2] * f_2, r[2] * f_1 - r[0] * f_n, r[0] * f_2 - r[1] * f_1 + twist
    for i in range(3):
        alpha[i] += W[i, 0] * x + W[i, 1] * y + W[i, 2] * z


@kernel
def _solved(Q, c):
    """Q⁻¹ c of a matrix (3, 3)."""
    m_0, m_1, m_2 = (
        Q[1, 1] * Q[2, 2] - Q[1, 2] * Q[2, 1],
        Q[1, 2] * Q[2, 0] - Q[1, 0] * Q[2, 2],
        Q[1, 0] * Q[2, 1] - Q[1, 1] * Q[2, 0],
    )
    det = Q[0, 0] * m_0 + Q[0, 1] * m_1 + Q[0, 2] * m_2
    x = c[0] * m_0 + Q[0, 1] * (Q[1, 2] * c[2] - c[1] * Q[2, 2]) + Q[0, 2] * (c[1] * Q[2, 1] - Q[1, 1] * c[2])
    y = Q[0, 0] * (c[1] * Q[2, 2] - Q[1, 2] * c[2]) + c[0] * m_1 + Q[0, 2] * (Q[1, 0] * c[2] - c[1] * Q[2, 0])
    z = Q[0, 0] * (Q[1, 1] * c[2] - c[1] * Q[2, 1]) + Q[0, 1] * (c[1] * Q[2, 0] - Q[1, 0] * c[2]) + c[0] * m_2
    return x / det, y / det, z / det


@kernel
def _turn(q, x, y, z):
    """Turn the quaternion q (4,) by the rotation vector (x, y, z) about world axes, using a power series.

    Steps of a contact turn the body by about 1e-3 rad.
    """
    half = 0.25 * (x * x + y * y + z * z)
    share, c = 0.5 - half / 12.0, 1.0 - 0.5 * half + half * half / 24.0
    x, y, z = share * x, share * y, share * z
    w, a, b, d = q[0], q[1], q[2], q[3]
    q[0] = c * w - x * a - y * b - z * d
    q[1] = c * a + x * w + y * d - z * b
    q[2] = c * b + y * w + z * a - x * d
    q[3] = c * d + z * w + x * b - y * a


@kernel
def _matrix(q, T):
    """Set T (3, 3) to the rotation matrix of the quaternion q."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    T[0, 0], T[0, 1], T[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    T[1, 0], T[1, 1], T[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    T[2, 0], T[2, 1], T[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@kernel
def _turned_inertia(T, W_0, W):
    """Set W (3, 3) to T W_0 Tᵀ."""
    for i in range(3):
        x = T[i, 0] * W_0[0, 0] + T[i, 1] * W_0[1, 0] + T[i, 2] * W_0[2, 0]
        y = T[i, 0] * W_0[0, 1] + T[i, 1] * W_0[1, 1] + T[i, 2] * W_0[2, 1]
        z = T[i, 0] * W_0[0, 2] + T[i, 1] * W_0[1, 2] + T[i, 2] * W_0[2, 2]
        for j in range(3):
            W[i, j] = x * T[j, 0] + y * T[j, 1] + z * T[j, 2]


@kernel
def _times(W, L, omega):
    """Set omega (3,) to W L."""
    for i in range(3):
        omega[i] = W[i, 0] * L[0] + W[i, 1] * L[1] + W[i, 2] * L[2]


@kernel
def _rolled(T, squares, axes, radius, at):
    """Set `at` (3,) to the lowest point, from its centre, of an ellipsoid with squared semi-axes (3,) along the
    columns of T `axes`, minus the radius along the normal."""
    at[0], at[1], at[2] = 0.0, 0.0, -radius
    if squares[0] + squares[1] + squares[2] == 0.0:
        return
    length = 0.0
    for j in range(3):
        down = T[2, 0] * axes[0, j] + T[2, 1] * axes[1, j] + T[2, 2] * axes[2, j]
        length += squares[j] * down * down
    if length <= 0.0:
        return
    length = np.sqrt(length)
    for j in range(3):
        down = T[2, 0] * axes[0, j] + T[2, 1] * axes[1, j] + T[2, 2] * axes[2, j]
        for i in range(3):
            turned = T[i, 0] * axes[0, j] + T[i, 1] * axes[1, j] + T[i, 2] * axes[2, j]
            at[i] -= turned * squares[j] * down / length


@kernel
def _stribeck(mu, x, y, s, v_s):
    """Coefficient of friction at the slip (x, y) in m/s, with Stribeck's factor."""
    return mu * (1.0 + s * np.exp(-(x * x + y * y) / v_s**2))


@kernel
def _stretched(a_c, a_s, x, y):
    """Product M (x, y) with the matrix M of a friction ellipse."""
    return (1.0 + a_c) * x + a_s * y, a_s * x + (1.0 - a_c) * y


@kernel
def _roll(share, couples, L):
    """Add `share` times the couples (p, 2) about horizontal axes to the angular momentum L (3,)."""
    for k in range(len(couples)):
        L[0] += share * couples[k, 0]
        L[1] += share * couples[k, 1]


@kernel
def _each_body(force, r_0, points, friction, body, outline, velocity, spin, step, most, out, one, each, room):
    """The motion of `integrate`, written to `out`; `one`, `each` and `room` are work arrays of one body, of each of its
    contact points, and of `_convex`."""
    kind, exponent, ratios, rhos, shares = force
    is_convex = kind in (CONVEX, PYRAMID)
    gaps, mus, losses, lengths = points
    W_0s, momenta, accelerations, couples = body
    squares, axes, radius = outline
    p, n = gaps.shape
    shift, turned, after, spun, elapsed, impulses = out
    (x, v, L, omega, a, alpha, beside, under), (T, W, W_0, own), A, q = one
    (push, depths, deepest, parts, mu, levers, Bs, Ks), r, forces, (slid, carried, rolled) = each
    d_1, d_2 = 0.0, 0.0
    for i in range(n):
        h, t = step[i], 0.0
        q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
        for j in range(3):
            x[j], v[j], L[j], omega[j] = 0.0, velocity[j, i], momenta[j, i], spin[j, i]
            for k in range(3):
                W_0[j, k], own[j, k] = W_0s[j, k, i], axes[j, k, i]
        forces[:], carried[:], rolled[:] = 0.0, 0.0, 0.0
        for k in range(p):
            depths[k], deepest[k], mu[k], levers[k] = -gaps[k, i], 0.0, mus[k, i], friction[2, i]
        _matrix(q, T)
        _rolled(T, squares, own, radius, beside)
        for _ in range(most[i]):
            for j in range(3):
                x[j] += 0.5 * h * v[j]
            _turn(q, 0.5 * h * omega[0], 0.5 * h * omega[1], 0.5 * h * omega[2])
            _matrix(q, T)
            _rolled(T, squares, own, radius, under)
            near = False
            for k in range(p):
                c_1, c_2, c_3 = (r_0[0, k, i] - beside[0], r_0[1, k, i] - beside[1], r_0[2, k, i] - beside[2])
                r[k, 2] = under[2] + T[2, 0] * c_1 + T[2, 1] * c_2 + T[2, 2] * c_3
                depth, sunk = depths[k], -(gaps[k, i] + x[2] + r[k, 2] - r_0[2, k, i])
                depths[k], push[k], parts[k] = sunk, 0.0, 1.0
                touches = not is_convex and deepest[k] == 0.0 and sunk + 0.5 * (sunk - depth) > 0.0
                if sunk < 0.0 and not touches:  # contacts above the surface do not push
                    forces[k] = 0.0
                    continue
                r[k, 0] = under[0] + T[0, 0] * c_1 + T[0, 1] * c_2 + T[0, 2] * c_3
                r[k, 1] = under[1] + T[1, 0] * c_1 + T[1, 1] * c_2 + T[1, 2] * c_3
                if touches:  # it presses from the instant within the step at which it touches
                    path = -h * (v[2] + omega[0] * r[k, 1] - omega[1] * r[k, 0])
                    parts[k] = min(0.5 + sunk / path, 1.0) if path > 0.0 else 0.0
                    if parts[k] <= 0.0:
                        parts[k] = 1.0
                        if sunk < 0.0:
                            continue
                    elif parts[k] < 1.0:
                        depths[k] = 0.5 * parts[k] * path
                near = True
                r[k, 2] += shares[i] * depths[k]
                deepest[k] = max(deepest[k], depths[k])
                if friction[0, i] != 0.0:
                    s_1 = v[0] + omega[1] * r[k, 2] - omega[2] * r[k, 1]
                    s_2 = v[1] + omega[2] * r[k, 0] - omega[0] * r[k, 2]
                    mu[k] = _stribeck(mus[k, i], s_1, s_2, friction[0, i], friction[1, i])
            _turned_inertia(T, W_0, W)
            _times(W, L, omega)
            turning, pressing = omega[2], 0
            if near and is_convex:
                for k in range(p):
                    if depths[k] > 0.0:
                        share, rate = 0.5 * mu[k] * mu[k] if kind == PYRAMID else 1.0, SPEED / lengths[k, i]
                        more = 1.0 + share * rhos[i]
                        Bs[k], Ks[k] = losses[k, i] * rate * more, rate * rate * more
                for j in range(3):
                    a[j] = accelerations[j, i]
                _times(W, couples[:, i], alpha)
                _convex(kind, h, rhos[i], ratios[i], v, omega, a, alpha, W, r, depths, mu, levers, Bs, Ks, forces, room)
                for k in range(p):
                    push[k] = h * forces[k, 2]
                    pressing += push[k] > 0.0
            elif near:
                for k in range(p):
                    if depths[k] < 0.0:
                        continue
                    _compliance(W, r[k], A)
                    slid[k, 0] = v[0] + omega[1] * r[k, 2] - omega[2] * r[k, 1]
                    slid[k, 1] = v[1] + omega[2] * r[k, 0] - omega[0] * r[k, 2]
                    fast = -(v[2] + omega[0] * r[k, 1] - omega[1] * r[k, 0]) / SPEED
                    length = lengths[k, i]
                    f, slope = _push(kind, exponent, depths[k] / length, fast, deepest[k] / length, losses[k, i])
                    # effect of the force at its point until the middle of the step, with the previous friction
                    mobility = A[2, 2] + carried[k, 0] * A[2, 0] + carried[k, 1] * A[2, 1]
                    kick = h * SPEED**2 / length
                    push[k] = parts[k] * kick * f / (1.0 + 0.5 * kick * slope * mobility)
                    pressing += push[k] > 0.0
            for j in range(3):
                v[j] += h * accelerations[j, i]
                L[j] += h * couples[j, i]
            for k in range(p):
                if push[k] != 0.0:
                    v[2] += push[k]
                    L[0] += r[k, 1] * push[k]
                    L[1] -= r[k, 0] * push[k]
            if friction[3, i] > 0.0:  # friction uses the rolling couples of the previous step
                _roll(1.0, rolled, L)
            _times(W, L, omega)
            along_1 = along_2 = 0.0
            for k in range(p):
                if is_convex:
                    if depths[k] <= 0.0:
                        continue
                    d_1, d_2 = h * forces[k, 0], h * forces[k, 1]
                    L[2] += h * forces[k, 3]
                elif push[k] == 0.0:
                    carried[k] = 0.0
                    continue
                else:
                    _compliance(W, r[k], A)
                    s_1 = v[0] + omega[1] * r[k, 2] - omega[2] * r[k, 1]
                    s_2 = v[1] + omega[2] * r[k, 0] - omega[0] * r[k, 2]
                    x_1, x_2, twist, lever = slid[k, 0], slid[k, 1], 0.0, friction[2, i]
                    a_c, a_s = friction[4, i], friction[5, i]
                    is_round = a_c == 0.0 and a_s == 0.0
                    if not is_round:
                        x_1, x_2 = _stretched(a_c, a_s, x_1, x_2)
                        s_1, s_2 = _stretched(a_c, a_s, s_1, s_2)
                        for j in range(2):
                            A[j, 0], A[j, 1] = _stretched(a_c, a_s, A[j, 0], A[j, 1])
                        for j in (0, 1, 3):
                            A[0, j], A[1, j] = _stretched(a_c, a_s, A[0, j], A[1, j])
                    for corrected in range(2 if friction[0, i] != 0.0 else 1):
                        if corrected:  # μ at the slip in the middle of the step
                            mid_1 = 0.5 * (x_1 + s_1 + A[0, 0] * d_1 + A[0, 1] * d_2 + A[0, 3] * twist)
                            mid_2 = 0.5 * (x_2 + s_2 + A[0, 1] * d_1 + A[1, 1] * d_2 + A[1, 3] * twist)
                            if not is_round:
                                mid_1, mid_2 = _stretched(-a_c, -a_s, mid_1, mid_2)
                                det = 1.0 - a_c * a_c - a_s * a_s
                                mid_1, mid_2 = mid_1 / det, mid_2 / det
                            mu[k] = _stribeck(mus[k, i], mid_1, mid_2, friction[0, i], friction[1, i])
                        if lever > 0.0:
                            d_1, d_2, twist = _twisted(
                                A, x_1, x_2, turning, s_1, s_2, omega[2], mu[k], lever, push[k], pressing
                            )
                        else:
                            d_1, d_2 = _friction(
                                A[0, 0], A[0, 1], A[1, 1], x_1, x_2, s_1, s_2, mu[k] * push[k], pressing
                            )
                    if not is_round:
                        d_1, d_2 = _stretched(a_c, a_s, d_1, d_2)
                    L[2] += twist
                    carried[k, 0], carried[k, 1] = d_1 / push[k], d_2 / push[k]
                along_1, along_2 = along_1 + d_1, along_2 + d_2
                L[0] -= r[k, 2] * d_2
                L[1] += r[k, 2] * d_1
                L[2] += r[k, 0] * d_2 - r[k, 1] * d_1
                impulses[0, k, i] += d_1
                impulses[1, k, i] += d_2
                impulses[2, k, i] += push[k]
            v[0], v[1] = v[0] + along_1, v[1] + along_2
            if friction[3, i] > 0.0:
                _roll(-1.0, rolled, L)
                _times(W, L, omega)
                for k in range(p):
                    x_1, x_2, x_3 = pressing * W[0, 0], pressing * W[0, 1], pressing * W[1, 1]
                    rolled[k] = 0.0
                    if push[k] > 0.0:
                        most_k = friction[3, i] * push[k]
                        rolled[k, 0], rolled[k, 1], _ = in_ball(
                            x_1, x_2, 0.0, x_3, 0.0, 1.0, omega[0], omega[1], 0.0, most_k
                        )
                _roll(1.0, rolled, L)
            _times(W, L, omega)
            for j in range(3):
                x[j] += 0.5 * h * v[j]
            _turn(q, 0.5 * h * omega[0], 0.5 * h * omega[1], 0.5 * h * omega[2])
            t += h
            deep = False
            for k in range(p):
                deep |= depths[k] > 0.0
                if depths[k] <= 0.0:  # a corner that has left the surface may press again
                    deepest[k] = 0.0
            if not pressing and not deep:
                break
        _matrix(q, T)
        _turned_inertia(T, W_0, W)
        _times(W, L, omega)
        for j in range(3):
            shift[j, i], after[j, i], spun[j, i] = x[j], v[j], omega[j]
        for j in range(4):
            turned[j, i] = q[j]
        elapsed[i] = t


@compiled
def integrate(force, r_0, points, friction, body, outline, velocity, spin, step, most):
    """Integrate the motion of n bodies from first contact until none of their p contact points penetrates the surface.

    Args:
        force: kind; exponent; ratio (n,) of tangential to normal damping and R m (n,) of a convex contact, on a pyramid
            along the surface; height (n,) of the force above the point, as a fraction of the depth.
        r_0: points (3, p, n) in m from the centre of mass, at first contact.
        points: gap in m, μ, D and L in m of each point, (4, p, n).
        friction: s and v_s in m/s of Stribeck's factor, m_t and m_r in m, a_c and a_s of an ellipse, (6, n).
        body: W_0 (3, 3, n) in 1/m² and L (3, n) in m²/s at first contact; acceleration in m/s² and couple in m²/s² in
            flight, (3, n).
        outline: squared semi-axes (3,) in m² of an ellipsoid that rolls, axes of the body (3, 3, n) as columns at first
            contact, and radius in m, subtracted along the normal.
        velocity, spin: (3, n) in m/s and rad/s.
        step: (n,) in s.
        most: greatest number of steps (n,).

    Returns:
        Shift (3, n) in m, turn (4, n) as a quaternion, velocity and spin (3, n), time (n,) in s, and for each point the
        impulses per mass (3, p, n) in m/s.
    """
    p, n = points.shape[1:]
    out = np.zeros((3, n)), np.zeros((4, n)), np.zeros((3, n)), np.zeros((3, n)), np.zeros(n), np.zeros((3, p, n))
    vectors = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    matrices = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    scalars = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
    pairs = np.zeros((p, 2)), np.zeros((p, 2)), np.zeros((p, 2))
    one, each = (vectors, matrices, np.zeros((4, 4)), np.zeros(4)), (scalars, np.zeros((p, 3)), np.zeros((p, 4)), pairs)
    _each_body(force, r_0, points, friction, body, outline, velocity, spin, step, most, out, one, each, _room(p))
    return out
