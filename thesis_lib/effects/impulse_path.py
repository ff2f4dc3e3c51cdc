"""Path of an impact in steps of the normal impulse, for effects that change Coulomb's law during the impact.

Shared by effects; not an effect itself.  With the normal impulse p as "time" (Routh), and per unit mass,

    dv_t = K_tt dc_t + K_tn dp − (r_y / k²) dτ,   dv_n = K_nn dp + K_tn dc_t + (r_x / k²) dτ

Within a step, friction is the impulse that would end the slip, limited to μ dp; the path for a constant μ is therefore
exact, except in the one step in which the slip reverses.  Restitution ends by Stronge's energetic coefficient: the work
W = ∫ v_n dp has its least value W_c at maximum compression, and the impact ends at W = (1 − ε²) W_c.  v_n is linear in
p within a step, so both have closed forms; the last step is lengthened or shortened to the end of the impact.

An effect adds the *difference* of two such paths, with and without the effect (rows 0 and 1 of arrays (2, n)), to the
impulse of the law in use (`added`): step errors cancel, a null effect changes nothing, and all else follows the law.

| on paper | in code   | unit      | shape  |                                                       |
|----------|-----------|-----------|--------|-------------------------------------------------------|
| dp       | `dp`      | N s/kg    | (n,)   | normal impulse of a step, the same on both paths      |
| v_n      | `v_n`     | m/s       | (2, n) | normal contact velocity at the end of a step          |
| dc_t, dτ | `d_t`, `d_tau`  | N s/kg, N m s/kg | (2, n) | friction impulse and couple of a step      |
| p_end    | `whole_impulse` | N s/kg | (n,)   | normal impulse of the whole path with constant μ      |

Sources: Routh 1860; Stronge 1990, doi:10.1098/rspa.1990.0125; Mirtich 1996.
"""

from collections.abc import Callable

import numpy as np
from numba import njit

from thesis_lib.contact.mirtich import impulse as exact_impulse
from thesis_lib.effects.effect import Impulse
from thesis_lib.mechanics.contact import Contact

STEPS = 12  # steps of one path; the mean error of velocities after impact is then about 1 mm/s, at 1 to 3 m/s
_TINY = 1e-30  # m/s; a step without any rise of v_n lies wholly in compression or in restitution
_FLATTEST = 1e-6  # lower limit of dv_n/dp over K_nn, for the last step


def whole_impulse(contact: Contact) -> np.ndarray:
    """Normal impulse (n,) in N s/kg of the whole path with constant μ, which is divided into steps."""
    with np.errstate(all="ignore"):
        return exact_impulse(contact, contact.mu, contact.epsilon)[-1]


def friction(kicked: np.ndarray, limit: np.ndarray, K_tt: np.ndarray) -> np.ndarray:
    """Friction impulse (n,) or (2, n) of a step in N s/kg that ends the slip `kicked` (m/s), limited to ±`limit`."""
    return np.maximum(np.minimum(kicked / -K_tt, limit), -limit)


def walk(contact: Contact, factor: Callable[[np.ndarray], np.ndarray], steps: int = STEPS) -> Impulse:
    """Impulses (2, n) at the ends of two paths: the first with friction μ `factor`(v_t), the second with μ."""
    dp = whole_impulse(contact) / steps
    kick, path = contact.K_tn * dp, NormalPath(contact)
    limit = np.stack([contact.mu * dp, contact.mu * dp])
    v_t = before = np.stack([contact.v_t, contact.v_t])
    with np.errstate(all="ignore"):
        for _ in range(steps):
            # slip in the middle of the step, extrapolated from the last step
            limit[0] = limit[1] * factor(1.5 * v_t[0] - 0.5 * before[0])
            before, kicked = v_t, v_t + kick
            d_t = friction(kicked, limit, contact.K_tt)
            v_t = kicked + contact.K_tt * d_t
            path.step(dp, d_t)
        return path.end(contact.epsilon)


class NormalPath:
    """Normal velocity, its work and the impulses along two paths; `end` returns the impulses at the end of restitution.

    Attributes:
        v_n: (2, n) normal velocity in m/s at the end of the last step.
        lift: (n,) r_x / k² in rad/m, the change of v_n per couple.
    """

    def __init__(self, contact: Contact, lift: np.ndarray | float = 0.0) -> None:
        n = len(contact.v_n)
        v_n, self._K_nn, self._K_tn, self.lift = (
            np.array(np.broadcast_to(values, n)) for values in (contact.v_n, contact.K_nn, contact.K_tn, lift)
        )
        self.v_n = np.stack([v_n, v_n])
        self._low = self.v_n.copy()  # v_n during compression, then 0
        # sums over the steps: twice the work of compression and of the whole path, impulses and couple; the last rise
        self._compression, self._work, self._c_t, self._tau, self._rise = (np.zeros((2, n)) for _ in range(5))
        self._c_n = np.zeros(n)
        self._none = np.zeros((2, n))
        self._last = self._c_n, self._none, self._none

    def step(self, dp: np.ndarray, d_t: np.ndarray, d_tau: np.ndarray | None = None) -> None:
        """Advance by the normal impulse `dp` (n,) > 0, with friction impulse and couple (2, n) of the step."""
        self._last = dp, d_t, self._none if d_tau is None else d_tau
        _advance(
            *(self._K_nn, self._K_tn, self.lift, *self._last),
            *(self.v_n, self._low, self._compression, self._work, self._c_t, self._c_n, self._tau, self._rise),
        )

    def end(self, epsilon: np.ndarray) -> Impulse:
        """Impulses (2, n) at the end of restitution, which returns the share ε² of the work of compression.

        The last step is lengthened or shortened to this end.
        """
        dp, d_t, d_tau = self._last
        b = np.maximum(self._rise / dp, _FLATTEST * self._K_nn)
        # compression may last beyond the last step
        compression = self._compression - self._low * self._low / b
        # 2 W + 2 v_n x + b x² = (1 − ε²) 2 W_c
        square = self.v_n * self.v_n + b * ((1.0 - epsilon * epsilon) * compression - self._work)
        more = (np.sqrt(np.maximum(square, 0.0)) - self.v_n) / b
        share = more / dp
        return Impulse.planar(self._c_t + share * d_t, self._c_n + more, self._tau + share * d_tau)


@njit(cache=True, error_model="numpy")
def _advance(K_nn, K_tn, lift, dp, d_t, d_tau, v_n, low, compression, work, c_t, c_n, tau, rise):
    """Advance both paths by one step, in place; K, dp, `lift` and c_n are (n,), all others (2, n)."""
    for i in range(len(dp)):
        c_n[i] += dp[i]
    for k in range(2):
        for i in range(len(dp)):
            up = K_nn[i] * dp[i] + K_tn[i] * d_t[k, i] + lift[i] * d_tau[k, i]
            then = v_n[k, i] + up
            below = 0.0 if then > 0.0 else then
            # v_n is linear in p: share of the step that belongs to compression
            share = (below - low[k, i] + _TINY) / (up + _TINY)
            compression[k, i] += share * (below + low[k, i]) * dp[i]
            work[k, i] += (then + v_n[k, i]) * dp[i]
            c_t[k, i] += d_t[k, i]
            tau[k, i] += d_tau[k, i]
            v_n[k, i], low[k, i], rise[k, i] = then, below, up


def added(impulse: Impulse, paths: Impulse, mu: np.ndarray, lever: np.ndarray | float = 0.0) -> Impulse:
    """Impulse (n,) of the law plus the difference of two `paths` (2, n), the first minus the second.

    c_n stays non-negative, friction stays in the cone of the largest `mu` (n,) along the path, and the couple within
    `lever` (m) times c_n.  If the impulse of the law is outside the cone, the sum may be as far outside.
    """
    d_t, d_n, d_tau = (
        np.where(np.isfinite(pair[0] - pair[1]), pair[0] - pair[1], 0.0)
        for pair in (paths.c_t, paths.c_n, paths.couple)
    )
    c_n = np.maximum(impulse.c_n + d_n, 0.0)
    limit = np.maximum(mu * c_n, np.abs(impulse.c_t))
    c_t = np.maximum(np.minimum(impulse.c_t + d_t, limit), -limit)
    return Impulse.planar(c_t, c_n, impulse.couple + np.clip(d_tau, -lever * c_n, lever * c_n))
