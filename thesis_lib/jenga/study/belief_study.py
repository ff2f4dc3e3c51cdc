"""What the thesis says of figure 5-8, as numbers over all held-out pushes: the order in which beliefs change, and why.

Thesis, section 5.5.4.  A stuck block: at first most probability mass is on "no block"; as the force climbs, "no move"
and "hard move" grow; "hard move" loses again in the next few steps.  A block that moves easily: "no block" first, then
"easy move", with very low probabilities for the others.  Forces drive the inference at first, configurations further
along.

The evidence of readings D (forces, or displacements) of one sample for
stuck (S) against the other abstractions (F), counted towards the truth, is the growth of the log odds

    ± [ log Σ_{k∈S} w_k p_k(z_D) / Σ_{k∈F} w_k p_k(z_D)  −  log Σ_{k∈S} w_k / Σ_{k∈F} w_k ]

with w the weights before the sample.  Values are means over pushes, with their standard error over pushes and, where
several training sets have a learner, the variance between those over their number added.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.jenga.learners.abstractions import stuck_group
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import F_N, F_T, TOWER, YAW, X, Y, log_likelihood, push_groups
from thesis_lib.jenga.robot.samples import FREE, STUCK, PushSamples
from thesis_lib.jenga.study.model_study import filtered
from thesis_lib.statistics.intervals import Z95

FORCES, POSES = (F_N, F_T), (X, Y, YAW, TOWER)
EARLY = 3  # samples of the initial phase
LATE = 5  # samples after which configurations count as informative; pushes without a later one tell nothing of it
QUANTITIES = (
    "stuck_no_block_first",
    "stuck_resists",
    "stuck_hard_move_falls",
    "easy_no_block_first",
    "easy_settles",
    "force_leads_early",
    "poses_gain_later",
)


def belief_table(learners: Sequence[Hma], samples: PushSamples) -> pd.DataFrame:
    """Rows of quantity (`QUANTITIES`), value, std, low, high (95 %), n (pushes) for learners of one size.

    stuck_no_block_first, easy_no_block_first: p(no block) after the first sample, pushes of stuck and of free blocks.
    stuck_resists: growth of 1 − p(no block) − p(easy move) from before contact to the last sample, stuck blocks.
    stuck_hard_move_falls: growth of p(hard move) from the `EARLY`-th to the last sample, stuck blocks.  easy_settles:
    p(easy move) at the last sample, free blocks.  force_leads_early: evidence (nats) of forces less that of
    displacements in the first `EARLY` samples.  poses_gain_later: evidence a sample of displacements after `LATE`
    samples less that in the first `EARLY`.
    """
    of_learners = [_of_one(learner, samples) for learner in learners]
    rows = []
    for name in QUANTITIES:
        values = np.array([found[name] for found in of_learners])
        values = values[np.isfinite(values).any(axis=1)]  # without a stuck abstraction there is no evidence
        values = values[:, np.isfinite(values).all(axis=0)]
        n = values.shape[1]
        if not values.size:
            rows.append((name, *[np.nan] * 4, 0))
            continue
        pushes = values.mean(axis=0)
        variance = pushes.var(ddof=1) / n if n > 1 else np.nan
        variance += values.mean(axis=1).var(ddof=1) / len(values) if len(values) > 1 else 0.0
        mean, std = float(pushes.mean()), float(np.sqrt(variance))
        rows.append((name, mean, std, mean - Z95 * std, mean + Z95 * std, n))
    return pd.DataFrame(rows, columns=["quantity", "value", "std", "low", "high", "n"])


def _of_one(learner: Hma, samples: PushSamples) -> dict[str, np.ndarray]:
    """Each quantity for each push, NaN where the push does not tell it."""
    belief = filtered(learner, samples)
    named = {
        name: belief[:, [each.startswith(name) for each in learner.names]].sum(axis=1)
        for name in ("no block", "easy move", "hard move")
    }
    resists = 1.0 - named["no block"] - named["easy move"]
    forces, poses = (evidence(learner, samples, belief, seen) for seen in (FORCES, POSES))
    found: dict[str, list[float]] = {name: [] for name in QUANTITIES}
    for rows in push_groups(samples):
        first, last, truth = rows[0], rows[-1], samples.truth[rows[0]]
        stuck, free, long = truth == STUCK, truth == FREE, len(rows) > EARLY
        second = named["no block"][rows[1]] if len(rows) > 1 else np.nan
        found["stuck_no_block_first"].append(second if stuck else np.nan)
        found["easy_no_block_first"].append(second if free else np.nan)
        found["stuck_resists"].append(resists[last] - resists[first] if stuck and long else np.nan)
        falls = named["hard move"][last] - named["hard move"][rows[EARLY]] if stuck and long else np.nan
        found["stuck_hard_move_falls"].append(falls)
        found["easy_settles"].append(named["easy move"][last] if free and long else np.nan)
        early, late = rows[:EARLY], rows[LATE:]
        known = (stuck or free) and long
        found["force_leads_early"].append((forces - poses)[early].sum() if known else np.nan)
        later = poses[late].mean() - poses[early].mean() if known and len(late) else np.nan
        found["poses_gain_later"].append(later)
    return {name: np.array(values) for name, values in found.items()}


def evidence(learner: Hma, samples: PushSamples, belief: np.ndarray, seen: Sequence[int]) -> np.ndarray:
    """Growth (n,) of the log odds of stuck, towards the truth, by the readings `seen`; NaN without such abstractions.

    belief (n, K): before each sample.
    """
    stuck = stuck_group(learner)
    if stuck.all() or not stuck.any():
        return np.full(len(samples), np.nan)
    out = learner.predict(samples.state, samples.action, samples.context, belief)
    like = log_likelihood(out.mean, out.var, samples.next_state, learner.settings.belief, seen)
    like = like - like.max(axis=1, keepdims=True)

    def odds(weights: np.ndarray) -> np.ndarray:
        return np.log(np.maximum(weights[:, stuck].sum(axis=1), 1e-300)) - np.log(
            np.maximum(weights[:, ~stuck].sum(axis=1), 1e-300)
        )

    towards = np.where(samples.truth == STUCK, 1.0, -1.0)
    return towards * (odds(out.weight * np.exp(like)) - odds(out.weight))
