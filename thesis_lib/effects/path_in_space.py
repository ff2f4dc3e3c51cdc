"""Path of an impact in space in steps of the normal impulse, the counterpart of `impulse_path` in the plane; compiled.

Shared by effects; not an effect itself.  Per unit mass, with the normal impulse p as "time",

    dv = K (dc_t, dp) + (G⁻¹ dτ) × r,   dω = G⁻¹ (r × (dc_t, dp) + dτ)

Two resistances act on a contact; each takes the value that would end its motion, limited to a ball:

    slip and spin about the normal   (dc_1 / μ f, dc_2 / μ f, dτ_n / m_t)   of at most dp      Coulomb, in one cone
    rolling                          (dτ_1, dτ_2)                           of at most m_r dp

f = 1 + s exp(−(|v_t| / v_s)²) is Stribeck's factor; anisotropic friction has the matrix M in place of μ, and
(M f)⁻¹ dc_t in the cone.  A step y within a ball of radius R solves (B + λ) y = −u with the least λ ≥ 0 for which
|y| ≤ R, and thus opposes the velocity at its end.  Restitution ends by Stronge's energetic coefficient.  An effect
adds the difference between the path with the effect and the path without it.

| on paper      | in code    | unit | shape     |                                                     |
|---------------|------------|------|-----------|-----------------------------------------------------|
| v, ω          | `v`, `w`   | m/s, rad/s | (3, n) | of the contact point, of the body                |
| K, G⁻¹        | `K`, `mobility` | 1/kg, 1/(kg m²) | (3, 3, n) | as in `mechanics.contact`               |
| m_t, m_r      | `m_t`, `m_r` | m  | (n,)      | levers of torsional and of rolling friction         |
| s, v_s        | `s`, `v_s` | 1, m/s | (n,)    | parameters of Stribeck's factor                     |
| a_c, a_s      | `a_c`, `a_s` | 1  | (n,)      | anisotropy, M = μ (1 + [[a_c, a_s], [a_s, −a_c]])   |

Sources: as for `impulse_path`; for the common cone Contensou 1963, and Leine and Glocker 2003,
doi:10.1016/S0997-7538(02)01256-9.
"""

import numpy as np

from thesis_lib.contact.compliant.compiled import compiled
from thesis_lib.contact.compliant.compiled_in_space import in_ball
from thesis_lib.effects.effect import Impulse
from thesis_lib.effects.impulse_path import STEPS, whole_impulse
from thesis_lib.mechanics.contact import Contact

_TINY = 1e-30  # m/s; a step without any rise of v_n lies wholly in compression or in restitution
_FLATTEST = 1e-6  # lower limit of dv_n/dp over K_nn, for the last step
_SMOOTH = 1e-9  # lower limit of μ, so that the ball has a nonzero radius


def with_and_without(impulse: Impulse, contact: Contact, spin: np.ndarray, **parameters) -> Impulse:
    """Impulse of the law plus the difference between the paths with and without (s, v_s, m_t, m_r, a_c, a_s).

    c_n stays non-negative; friction stays within the cone of the largest μ along the path, or within the friction of
    the law if this is larger, and couples stay within their levers times c_n.
    """
    n = len(contact.v_n)
    s, v_s, m_t, m_r, a_c, a_s = (
        np.array(np.broadcast_to(parameters.get(name, value), n), dtype=float)
        for name, value in (("s", 0.0), ("v_s", 1.0), ("m_t", 0.0), ("m_r", 0.0), ("a_c", 0.0), ("a_s", 0.0))
    )
    mu, epsilon = (np.array(np.broadcast_to(part, n), dtype=float) for part in (contact.mu, contact.epsilon))
    dp, none = whole_impulse(contact) / STEPS, np.zeros(n)
    v, w, r, K, mobility = (
        np.array(part, dtype=float) for part in (contact.v, spin, contact.r, contact.K, contact.mobility)
    )
    with_it, without = np.zeros((6, n)), np.zeros((6, n))
    _follow(v, w, r, K, mobility, mu, epsilon, dp, s, v_s, m_t, m_r, a_c, a_s, STEPS, with_it)
    _follow(v, w, r, K, mobility, mu, epsilon, dp, none, v_s, none, none, none, none, STEPS, without)
    made = added_in_space(impulse, with_it - without, mu * (1.0 + np.maximum(s, 0.0)) * (1.0 + np.hypot(a_c, a_s)))
    more, c_n = _finite((with_it - without)[3:]), made.c[2]
    couple = np.concatenate([_within(more[:2], m_r * c_n), np.clip(more[2:], -m_t * c_n, m_t * c_n)])
    return Impulse(made.c, impulse.couple + couple)


def added_in_space(impulse: Impulse, more: np.ndarray, mu: np.ndarray) -> Impulse:
    """Impulse of the law plus `more` (3, n), within the same limits as in `impulse_path.added`."""
    c, more = np.array(impulse.c), _finite(more)
    c_n = np.maximum(c[2] + more[2], 0.0)
    c_t = _within(c[:2] + more[:2], np.maximum(mu * c_n, np.hypot(c[0], c[1])))
    return Impulse(np.concatenate([c_t, c_n[None]]), impulse.couple)


def _finite(more: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(more), more, 0.0)


def _within(u: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Vectors (2, n) shortened to at most `most` (n,)."""
    return u * np.minimum(1.0, most / np.maximum(np.hypot(u[0], u[1]), _TINY))


@compiled
def _column(A, j):
    return A[0, j], A[1, j], A[2, j]


@compiled
def _moved(u, A, a, B, b, C, c):
    """Vector u + (A a + B b + C c); tuples avoid the allocation of arrays in every step."""
    return (
        u[0] + (A[0] * a + B[0] * b + C[0] * c),
        u[1] + (A[1] * a + B[1] * b + C[1] * c),
        u[2] + (A[2] * a + B[2] * b + C[2] * c),
    )


@compiled
def _changed(u, A, a, B, b):
    """Vector u + (A a + B b)."""
    return u[0] + (A[0] * a + B[0] * b), u[1] + (A[1] * a + B[1] * b), u[2] + (A[2] * a + B[2] * b)


@compiled
def _follow(v0, w0, r0, K0, mobility, mu0, epsilon, dp0, s, v_s, m_t, m_r, a_c, a_s, steps, found):
    """Write impulses and couples (6, n) at the ends of the paths into `found`."""
    turn, lift, total, last = np.empty((3, 3)), np.empty((3, 3)), np.empty(6), np.empty(6)
    for i in range(len(mu0)):
        dp, r, H, K = dp0[i], r0[:, i].copy(), mobility[:, :, i].copy(), K0[:, :, i].copy()
        # rotation due to an impulse along each axis, and motion of the contact point due to a couple about each axis
        for j in range(3):
            e = np.zeros(3)
            e[j] = 1.0
            turn[:, j] = H @ np.cross(r, e)
            lift[:, j] = np.cross(H[:, j].copy(), r)
        K_1, K_2, K_n = _column(K, 0), _column(K, 1), _column(K, 2)
        turn_1, turn_2, turn_n = _column(turn, 0), _column(turn, 1), _column(turn, 2)
        lift_1, lift_2, lift_n = _column(lift, 0), _column(lift, 1), _column(lift, 2)
        H_1, H_2, H_n = _column(H, 0), _column(H, 1), _column(H, 2)
        v, w = (v0[0, i], v0[1, i], v0[2, i]), (w0[0, i], w0[1, i], w0[2, i])
        before, rolled_1, rolled_2 = v, 0.0, 0.0
        total[:], last[:] = 0.0, 0.0
        low, compression, work, rise = v[2], 0.0, 0.0, 0.0
        t = m_t[i]
        for _ in range(steps):
            old = v[2]
            x, y = 1.5 * v[0] - 0.5 * before[0], 1.5 * v[1] - 0.5 * before[1]
            before = v
            f = max(mu0[i], _SMOOTH) * (1.0 + s[i] * np.exp(-(x * x + y * y) / (v_s[i] * v_s[i])))
            # friction assumes the couple of the last step: a sticking contact continues to stick while it rolls
            v = _moved(v, K_n, dp, lift_1, rolled_1, lift_2, rolled_2)
            w = _moved(w, turn_n, dp, H_1, rolled_1, H_2, rolled_2)
            # M and M K M
            a, b, c = f * (1.0 + a_c[i]), f * a_s[i], f * (1.0 - a_c[i])
            B_11 = a * a * K_1[0] + b * (2.0 * a * K_2[0] + b * K_2[1])
            B_12 = a * c * K_2[0] + b * (a * K_1[0] + b * K_2[0] + c * K_2[1])
            B_22 = c * c * K_2[1] + b * (2.0 * c * K_2[0] + b * K_1[0])
            u_1, u_2 = a * v[0] + b * v[1], c * v[1] + b * v[0]
            if t > 0.0:
                l_1, l_2 = a * t * lift_n[0] + b * t * lift_n[1], c * t * lift_n[1] + b * t * lift_n[0]
                p, q, z = in_ball(B_11, B_12, l_1, B_22, l_2, t * t * H_n[2], u_1, u_2, t * w[2], dp)
            else:
                p, q, z = in_ball(B_11, B_12, 0.0, B_22, 0.0, 1.0, u_1, u_2, 0.0, dp)
            last[0], last[1], last[2], last[5] = a * p + b * q, c * q + b * p, dp, t * z
            v = _moved(v, K_1, last[0], K_2, last[1], lift_n, last[5])
            w = _moved(w, turn_1, last[0], turn_2, last[1], H_n, last[5])
            if m_r[i] > 0.0:
                w = _changed(w, H_1, -rolled_1, H_2, -rolled_2)
                v = _changed(v, lift_1, -rolled_1, lift_2, -rolled_2)
                rolled_1, rolled_2, _z = in_ball(H_1[0], H_2[0], 0.0, H_2[1], 0.0, 1.0, w[0], w[1], 0.0, m_r[i] * dp)
                w = _changed(w, H_1, rolled_1, H_2, rolled_2)
                v = _changed(v, lift_1, rolled_1, lift_2, rolled_2)
            last[3], last[4] = rolled_1, rolled_2
            rise = v[2] - old
            below = min(v[2], 0.0)
            share = (below - low + _TINY) / (rise + _TINY)
            compression += share * (below + low) * dp
            work += (v[2] + old) * dp
            low = below
            for j in range(6):
                total[j] += last[j]
        b = max(rise / dp, _FLATTEST * K[2, 2])
        compression -= low * low / b
        square = v[2] * v[2] + b * ((1.0 - epsilon[i] * epsilon[i]) * compression - work)
        share = (np.sqrt(max(square, 0.0)) - v[2]) / (b * dp)
        for j in range(6):
            found[j, i] = total[j] + share * last[j]
