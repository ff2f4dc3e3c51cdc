"""Which measured impacts were hits of two corners, by the law's own account of them.

A square that lands nearly flat hits with one corner and, milliseconds later, with its neighbour.  Between two frames
that is one impact, and what it does is not done at one point: the neighbour takes back the spin that the first corner
gave.  A learner of impulses at one point takes this for a large residual.  Where a throw is simulated the neighbour
hits by itself, so that its impulse is counted twice, and since a body that rocks on its corner has the features X1 of
one that lands flat (the same velocity of the same contact point), such residuals also reach states in which they would
multiply the energy.

    hit again  ⇔  after the law's v⁺, in free flight from the touch, another corner touches within the time T_c

Nothing measured after the impact enters.

| on paper | in code  | unit | shape | meaning                                                                |
|----------|----------|------|-------|------------------------------------------------------------------------|
| T_c      | `within` | s    |       | time up to which hits are one contact (`DiceDataSettings.longest_contact`) |

Source: own choice; the thesis (section 4.4, figure 4-9) names double hits as what makes throws hard to predict.
"""

import numpy as np

from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.residual.throwing.flight import ThrownBody, first_touch
from thesis_lib.residual.throwing.throw import LawImpact


def hit_again(body: ThrownBody, law: LawImpact, impacts: Impacts, within: float) -> np.ndarray:
    """Mask (n,) of the impacts after which the law says that another corner hits within a time.

    Args:
        body, law: as believed; `law` with the parameters fitted to training impacts.
        impacts: poses and velocities before impact are used; the corner that hits is the lowest one.
        within: s.
    """
    q = impacts.q.copy()
    # a measured height is a millimetre off: the corner that hits touches
    q[:, 1] -= body.gap(q)
    r, corner = body.lowest(q[:, 2])
    _, after, _ = law(q, impacts.v_pre, r, np.zeros(len(q), bool), np.random.default_rng(0))
    known = np.isfinite(after).all(axis=1)
    again = np.zeros(len(q), bool)
    t, other = first_touch(body, q[known], after[known])
    again[known] = (t < within) & (other != corner[known])
    return again
