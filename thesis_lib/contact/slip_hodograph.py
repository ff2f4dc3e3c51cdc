"""Coulomb's law along the path of an impact in space, where the direction of slip turns (Routh, Darboux, Keller).

With the normal impulse p as "time" the slip x and the normal velocity of the contact point move by

    dx/dp = k − μ K_tt x/|x|,    v_n = v_n0 + α·(x − x_0) + S p,    α = K_tt⁻¹ k,  S = K_nn − k·α,

until the impact ends, or slip does.  Slip that has ended sticks, dc/dp = −α, if |α| ≤ μ, else it goes on in the one
direction in which it grows (`circular_cone`); from there on all is straight, and in closed form.

While it slips with g = dV/dp, V = |x|, and turns with dθ/dp = f/V, a Runge-Kutta step of order 4 is as long as x
allows: a turn by 0.1 rad, or a quarter of the slip.  Slip is straight once its direction keeps itself (f = 0) and, if
it does so only nearly, is drawn to it; the plane is the case in which it is straight from the beginning.  So no slip
has to be regularised: sticking is exact, and the impulse is homogeneous in the velocity.  In random impacts the impulse
is off by 1e-7 of the contact speed in the median, 1.4e-4 at most; 28 steps are made on average, 240 at most.

The impact ends at p_f, with p_c at the end of compression, v_n = 0:

| restitution | ends where                               |
|-------------|------------------------------------------|
| Newton's    | v_n = −ε v_n0                            |
| Poisson's   | p = (1 + ε) p_c                          |
| Stronge's   | ∫ v_n dp from p_c = ε² times that before |

Sources: Routh, Dynamics of a System of Rigid Bodies, 1860; Keller, J. Appl. Mech. 53 (1986), doi:10.1115/1.3171712;
Bhatt and Koechling, J. Appl. Mech. 62 (1995), p. 893; Stronge, Proc. R. Soc. A 431 (1990),
doi:10.1098/rspa.1990.0125.
"""

import enum

import numpy as np

from thesis_lib.contact.circular_cone import cone_point, principal
from thesis_lib.mechanics.contact import Contact

STEPS = 240
TURN = 0.1  # rad a step: what the errors above belong to; they fall with its fourth power


class Restitution(enum.StrEnum):
    """Condition that ends an impact."""

    NEWTON = "v_n = −ε v_n0"
    POISSON = "p = (1 + ε) p_c"
    STRONGE = "W = (1 − ε²) W_c"


@np.errstate(all="ignore")  # what has no finite end is not finite
def impulse(
    contact: Contact, mu: np.ndarray, epsilon: np.ndarray, rule: Restitution, mu_after: np.ndarray | None = None
) -> tuple[np.ndarray, ...]:
    """Impulse (c_t1, c_t2, c_n), each (n,) in N s, at the end of restitution.

    `mu_after` (n,) is the coefficient once the first slip has ended, `mu` (n,) if not given.
    """
    from thesis_lib.contact.sliding.compiled import impulses

    K, v = contact.K, contact.v
    mu_after = mu if mu_after is None else mu_after
    parts = (mu, epsilon, mu_after, *v, K[0][0], K[0][1], K[1][1], K[0][2], K[1][2], K[2][2])
    shape = np.broadcast(*parts).shape
    filled = np.empty((len(parts), *shape))
    for i, part in enumerate(parts):
        filled[i] = part
    μ, ε, μ_after, v_1, v_2, v_n, K_11, K_12, K_22, k_1, k_2, K_nn = filled.reshape(len(parts), -1)
    axes = principal(K_11, K_12, K_22)
    κ = np.stack([axes.first, axes.second])
    k, x = np.stack(axes.into((k_1, k_2))), np.stack(axes.into((v_1, v_2)))
    α, c = k / κ, np.empty((3, len(v_n)))
    C, S = v_n - (α * x).sum(axis=0), K_nn - (k * α).sum(axis=0)
    constants = np.concatenate([k, μ * κ, α, [S, C]])
    stuck = cone_point((κ[0], κ[1]), (k[0], k[1]), μ_after)  # dc/dp once slip has ended
    impulses(list(Restitution).index(rule), TURN, STEPS, constants, x, ε, v_n, np.concatenate([κ, stuck]), c)
    return tuple(part.reshape(shape) for part in (*axes.back((c[0], c[1])), c[2]))
