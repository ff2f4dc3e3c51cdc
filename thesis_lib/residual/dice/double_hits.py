"""Impacts that a law predicts to be hits of two corners.

A square that lands nearly flat hits with one corner and, milliseconds later, with its neighbour.  The camera sees one
impact between two frames, but no impulse at one point explains it: the second hit takes back the spin that the first
one gave.  A learner of impulses at one point sees a large residual.  A simulated throw makes the second hit anyway, so
its impulse would count twice.  A body rocking on its corner has the same features X1 as one landing flat, so such
residuals also reach states in which they would multiply the energy.

    hit again  ⇔  after the law's v⁺, in free flight from the touch, another corner touches within the time T_c

Nothing measured after the impact is used.

| on paper | in code  | unit | shape | meaning                                                                |
|----------|----------|------|-------|------------------------------------------------------------------------|
| T_c      | `within` | s    |       | time up to which hits are one contact (`DiceDataSettings.longest_contact`) |

The thesis (section 4.4, figure 4-9) names double hits as what makes throws hard to predict.
"""

import numpy as np

from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.residual.throwing.flight import ThrownBody, first_touch
from thesis_lib.residual.throwing.throw import LawImpact


def hit_again(body: ThrownBody, law: LawImpact, impacts: Impacts, within: float) -> np.ndarray:
    """Mask (n,) of n impacts after which, by the law, another corner hits within the time `within` in s.

    Poses and velocities before impact are used, with the believed `body` and a `law` fitted to training impacts.
    """
    q = impacts.q.copy()
    # measured heights are a millimetre off: move the lowest corner onto the surface
    q[:, 1] -= body.gap(q)
    r, corner = body.lowest(q[:, 2])
    _, after, _ = law(q, impacts.v_pre, r, np.zeros(len(q), bool), np.random.default_rng(0))
    known = np.isfinite(after).all(axis=1)
    again = np.zeros(len(q), bool)
    t, other = first_touch(body, q[known], after[known])
    again[known] = (t < within) & (other != corner[known])
    return again
