"""Coulomb's law on a total impulse in space: circular cone, and friction against the remaining slip.

With the normal impulse eliminated (Schur complement), the tangential impulse c, a vector in the surface, obeys

    slip after    u = b + A c,        A symmetric and positive, 2 × 2,
    either        u = 0 and |c| ≤ ℓ − s·c            (stick)
    or            u = −λ c, λ > 0, |c| = ℓ − s·c      (slide),

so that c = −(A + λ)⁻¹ b with the single unknown λ.  In the principal axes of A, with its principal values a_1 and a_2,
and multiplied by D = (a_1 + λ)(a_2 + λ), the edge of the cone is

    |N(λ)| = ℓ D(λ) − s·N(λ),    N = −((a_2 + λ) b_1, (a_1 + λ) b_2),    c = N / D,

which is solved by Newton's method (`sliding/cone.py`).  A stick impulse is taken if it exists; of 200 000 random
impacts, all others had exactly one root (if ℓ > 0 there is at least one).

| problem                                   | A                 | b               | ℓ          | s            |
|-------------------------------------------|-------------------|-----------------|------------|--------------|
| impulse that changes v_n by dv_n           | K_tt − k kᵀ/K_nn  | v_t + k dv_n/K_nn | μ dv_n/K_nn | μ k/K_nn  |
| friction at a given normal impulse N       | K_tt              | v_t + k N       | μ N        | 0            |
| dc_t/dp once slip has ended (`slip_hodograph`) | K_tt          | k               | μ          | 0            |

K_tt, k = K_tn and K_nn are blocks of the compliance K.  Sources: Anitescu and Potra, Nonlinear Dynamics 14 (1997),
doi:10.1023/A:1008292328909 (the law, with a polyhedral cone); Moré and Sorensen, SIAM J. Sci. Stat. Comput. 4 (1983),
doi:10.1137/0904038 (the equation in λ).
"""

from typing import NamedTuple

import numpy as np

from thesis_lib.mechanics.contact import Contact

Pair = tuple[np.ndarray, np.ndarray]


class Principal(NamedTuple):
    """Principal values (n,) of symmetric 2 × 2 matrices, and cosine and sine of the angle to the first axis."""

    first: np.ndarray
    second: np.ndarray
    cos: np.ndarray
    sin: np.ndarray

    def into(self, x: Pair) -> Pair:
        """Components along the principal axes of vectors given along the surface axes."""
        return self.cos * x[0] + self.sin * x[1], self.cos * x[1] - self.sin * x[0]

    def back(self, x: Pair) -> Pair:
        """Components along the surface axes of vectors given along the principal axes."""
        return self.cos * x[0] - self.sin * x[1], self.cos * x[1] + self.sin * x[0]


def principal(A_11: np.ndarray, A_12: np.ndarray, A_22: np.ndarray) -> Principal:
    """Principal values and axes of the matrices [[A_11, A_12], [A_12, A_22]]."""
    mean, half = 0.5 * (A_11 + A_22), 0.5 * (A_11 - A_22)
    radius = np.hypot(half, A_12)
    angle = 0.5 * np.arctan2(A_12, half)
    return Principal(mean + radius, mean - radius, np.cos(angle), np.sin(angle))


def cone_point(a: Pair, b: Pair, limit: np.ndarray, slope: Pair | None = None) -> Pair:
    """Tangential impulse c that solves the module's problem, in principal axes; arrays broadcast.

    `a` holds the principal values of A; ℓ is `limit` and s is `slope`.  ℓ = 0 and s = 0 mean no friction.
    """
    from thesis_lib.contact.sliding.cone import impulses

    parts = (*a, *b, limit, *(slope or (0.0, 0.0)))
    shape = np.broadcast(*parts).shape
    problems, c = np.empty((7, *shape)), np.empty((2, *shape))
    for i, part in enumerate(parts):
        problems[i] = part
    impulses(problems.reshape(7, -1), c.reshape(2, -1))
    return c[0], c[1]


def impulse_to_normal_velocity(contact: Contact, mu: np.ndarray, dv_n: np.ndarray) -> tuple[np.ndarray, ...]:
    """Impulse (c_t1, c_t2, c_n), each (n,) in N s, that changes v_n by `dv_n` ≥ 0 (n,) in m/s."""
    K, v, share = contact.K, contact.v, dv_n / contact.K_nn
    k, w = (K[0][2], K[1][2]), 1.0 / contact.K_nn
    axes = principal(K[0][0] - k[0] * k[0] * w, K[0][1] - k[0] * k[1] * w, K[1][1] - k[1] * k[1] * w)
    b, s = axes.into((v[0] + k[0] * share, v[1] + k[1] * share)), axes.into((mu * k[0] * w, mu * k[1] * w))
    c_1, c_2 = axes.back(cone_point((axes.first, axes.second), b, mu * share, s))
    return c_1, c_2, share - (k[0] * c_1 + k[1] * c_2) * w


def friction_at(contact: Contact, v_t: Pair, limit: np.ndarray) -> Pair:
    """Friction impulse (2 of (n,)) in N s, at most `limit` (n,), against what remains of the slip `v_t` in m/s."""
    K = contact.K
    axes = principal(K[0][0], K[0][1], K[1][1])
    return axes.back(cone_point((axes.first, axes.second), axes.into(v_t), limit))
