"""Judging the abstractions: their looks, and their agreement with the hidden label.

Stuck or free is decided from the first steps, without truth.  An abstraction counts as stuck if its block moves less
than half of the advance or drags the tower along (`stuck_group`: `mixture.NO_MOVE`, `mixture.DRAG`; without any force
there is no block).  A push is stuck if those abstractions hold more than half of the belief.  Only the comparison,

    balanced accuracy = ½ (share of stuck pushes called stuck + share of free pushes called free),

and the adjusted Rand index of abstractions against truth (Hubert and Arabie 1985, doi 10.1007/BF01908075) use `truth`.
Intervals resample pushes, stuck and free ones separately.

The probability of no move (`no_move`) is, of a learner with abstractions (HMA, MOR), the belief in those that count as
stuck.  A single network has none; it says what it predicts of the next straight push, by the same rule on the same
features,

    p = 1 − (1 − P(m < m₀) P(f ≥ f₀)) (1 − P(d > d₀)),   m, f, d: advance of the block, force, advance of the tower

with independent normal m, f and d.  Both are 0 to 1, and the controller charges their growth alike.

All of these are own choices: the thesis judges abstractions by eye (figure 5-8).
"""

import numpy as np
import pandas as pd
from scipy.special import ndtr

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import Learner, along_pushes, push_groups
from thesis_lib.jenga.learners.mixture import DRAG, NO_FORCE, NO_MOVE
from thesis_lib.jenga.robot.samples import F_N, FREE, STUCK, TOWER, UNKNOWN, PushSamples, X

RESAMPLES = 1000


def stuck_group(learner: Hma) -> np.ndarray:
    """Which abstractions count as stuck by the module's rule, (K,) bool."""
    look = learner.look
    still = (look["move"] < NO_MOVE) & (look["force"] >= NO_FORCE)
    return still | (look["drag"] > DRAG)


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


def infer_first_steps(learner: Learner, samples: PushSamples, steps: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """First row (m,) of each push with `steps` samples or more, and the belief (m, K) after them; UserError if none."""
    rows = np.array([rows[:steps] for rows in push_groups(samples) if len(rows) >= steps])
    if not len(rows):
        raise UserError(f"no push has {steps} samples; give fewer steps or longer pushes.")
    *_, (*_, belief) = along_pushes(learner, samples.select(rows.ravel()))
    return rows[:, 0], belief


def agreement(learner: Hma, samples: PushSamples, rng: np.random.Generator, steps: int = 5) -> dict[str, float | int]:
    """How well the first `steps` samples of a push tell stuck from free.

    balanced_accuracy with low and high (95 %), rand_index, n_stuck, n_free (pushes).  UserError if no push of known
    truth is long enough, or all have the same truth.
    """
    from sklearn.metrics import adjusted_rand_score

    known = samples.select(samples.truth != UNKNOWN)
    rows, belief = infer_first_steps(learner, known, steps)
    truth = known.truth[rows]
    called = belief[:, stuck_group(learner)].sum(axis=1) > 0.5
    right = {kind: (called == (kind == STUCK))[truth == kind].astype(float) for kind in (FREE, STUCK)}
    if min(map(len, right.values())) == 0:
        raise UserError("agreement with truth needs stuck and free pushes; these samples have one kind only.")
    draws = [rng.choice(part, (RESAMPLES, len(part))).mean(axis=1) for part in right.values()]
    low, high = np.quantile(np.mean(draws, axis=0), [0.5 - 0.95 / 2, 0.5 + 0.95 / 2])
    return {
        "balanced_accuracy": float(np.mean([part.mean() for part in right.values()])),
        "low": float(low),
        "high": float(high),
        "rand_index": float(adjusted_rand_score(truth, belief.argmax(axis=1))),
        "n_stuck": len(right[STUCK]),
        "n_free": len(right[FREE]),
    }


def abstraction_table(learner: Hma) -> pd.DataFrame:
    """A row per abstraction: name, share, force (N), rise (N/mm), move, lag, drag (1), stuck (0 or 1)."""
    return pd.DataFrame(
        {"abstraction": learner.names, "share": learner.shares}
        | {name: np.asarray(value) for name, value in learner.look.items()}
        | {"stuck": stuck_group(learner).astype(int)}
    )
