"""Impulse path with a couple, a tangential force or a modified friction that depends on the current slip and spin.

Shared by user-defined effects; not an effect itself.  With the normal impulse p as "time", as in `impulse_path`,

    dτ = l dp,   dc_t = s dp + friction,   |friction| ≤ f μ dp

with l, s and f functions of the slip v_t and the angular velocity ω at that moment.  Friction therefore resists the
tangential force, and restitution depends on the remaining work.  The difference between this path and the path without
the additional terms is added to the impulse of the law in use.

| on paper | in code    | unit | shape | meaning                                                   |
|----------|------------|------|-------|-----------------------------------------------------------|
| l        | `couple`   | m    | (n,)  | couple over the normal impulse, counter-clockwise         |
| s        | `sideways` | 1    | (n,)  | tangential over normal impulse, in addition to friction   |
| f        | `factor`   | 1    | (n,)  | factor on μ; values below 0 count as 0                    |

l is limited to the radius of gyration k, s to 1 and f to 20, so that positive feedback cannot diverge.
"""

from collections.abc import Callable

import numpy as np

from thesis_lib.effects.effect import Impulse
from thesis_lib.effects.impulse_path import STEPS, NormalPath, added, friction, whole_impulse
from thesis_lib.mechanics.contact import Contact

LARGEST = 1.0  # limit of |l|/k and |s|: a term larger than the normal force is no longer a correction
HIGHEST = 20.0  # limit of f
Moment = Callable[[np.ndarray, np.ndarray], np.ndarray]  # of v_t (n,) in m/s and ω (n,) in rad/s


def driven(
    impulse: Impulse,
    contact: Contact,
    omega: np.ndarray,
    *,
    couple: Moment | None = None,
    sideways: Moment | None = None,
    factor: Moment | None = None,
) -> Impulse:
    """Impulse (n,) of the law plus the difference between the driven path and the plain path."""
    (r_x, r_y), mu, k2 = contact.r, contact.mu, 1.0 / contact.mobility
    with np.errstate(all="ignore"):
        dp = whole_impulse(contact) / STEPS
        turn_t, turn_n, path = r_y / k2, r_x / k2, NormalPath(contact, r_x / k2)
        v_t, turning = np.stack([contact.v_t, contact.v_t]), np.stack([omega, omega])
        was_t, was_turning = v_t[0], turning[0]
        none = np.zeros_like(v_t)
        levers, pushes, factors = none[0], none[0], none[0] + 1.0  # largest values along the path
        for _ in range(STEPS):
            # slip and spin in the middle of the step, extrapolated from the last step
            moment = 1.5 * v_t[0] - 0.5 * was_t, 1.5 * turning[0] - 0.5 * was_turning
            d_tau, push, limit = none.copy(), none.copy(), np.stack([mu * dp, mu * dp])
            if couple is not None:
                lever = np.clip(couple(*moment), -LARGEST * np.sqrt(k2), LARGEST * np.sqrt(k2))
                d_tau[0], levers = lever * dp, np.maximum(levers, np.abs(lever))
            if sideways is not None:
                share = np.clip(sideways(*moment), -LARGEST, LARGEST)
                push[0], pushes = share * dp, np.maximum(pushes, np.abs(share))
            if factor is not None:
                times = np.clip(factor(*moment), 0.0, HIGHEST)
                limit[0], factors = times * limit[1], np.maximum(factors, times)
            kicked = v_t + contact.K_tn * dp + contact.K_tt * push - turn_t * d_tau
            rubbed = friction(kicked, limit, contact.K_tt)
            was_t, was_turning = v_t[0], turning[0]
            v_t = kicked + contact.K_tt * rubbed
            turning = turning + turn_n * dp - turn_t * (rubbed + push) + d_tau / k2
            path.step(dp, rubbed + push, d_tau)
        return added(impulse, path.end(contact.epsilon), mu * factors + pushes, levers)
