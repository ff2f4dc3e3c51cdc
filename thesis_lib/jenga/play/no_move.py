"""The probability that the pushed block does not move, as far as a learner can express it.

A learner with abstractions (HMA, MOR) says the belief in those that count as stuck (`abstractions.stuck_group`).  A
single network has none; it says what it predicts of the next straight push, by the same rule on the same features,

    p = 1 − (1 − P(m < m₀) P(f ≥ f₀)) (1 − P(d > d₀)),   m, f, d: advance of the block, force, advance of the tower

with independent normal m, f and d.  Both are 0 to 1, and the controller charges their growth alike.
"""

import numpy as np
from scipy.special import ndtr

from thesis_lib.jenga.learners.abstractions import stuck_group
from thesis_lib.jenga.learners.learner import Learner
from thesis_lib.jenga.learners.mixture import DRAG, NO_FORCE, NO_MOVE
from thesis_lib.jenga.robot.samples import F_N, TOWER, X


def no_move(
    learner: Learner, belief: np.ndarray, state: np.ndarray, context: np.ndarray, contact: float = 0.0
) -> float:
    """Probability of no move; belief (K,), state (7,) in mm and N, context (2,), contact in mm off the centre."""
    if hasattr(learner, "look"):
        return float(belief[stuck_group(learner)].sum())
    mean, var = learner.predict(state[None], np.array([[contact, 0.0]]), context[None], belief[None]).moments()
    std = np.sqrt(var[0])
    still = ndtr((NO_MOVE - mean[0, X] + state[X]) / std[X])
    forced = ndtr((mean[0, F_N] - NO_FORCE) / std[F_N])
    drags = ndtr((mean[0, TOWER] - state[TOWER] - DRAG) / std[TOWER])
    return float(1.0 - (1.0 - still * forced) * (1.0 - drags))
