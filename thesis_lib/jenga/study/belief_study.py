"""Statements of the thesis on figure 5-8, tested on all held-out pushes: the order in which beliefs change.

Thesis, section 5.5.4.  A stuck block: at first most probability mass is on "no block"; as the force rises, "no move"
and "hard move" grow; "hard move" falls again in the next few steps.  A block that moves easily: "no block" first, then
"easy move", with very low probabilities for the others.  Forces drive the inference at first, configurations later.

The evidence that readings D (forces, or displacements) of one sample give for the stuck abstractions (S) against the
others (F), positive if it favours the truth, is the growth of the log odds

    ± [ log Σ_{k∈S} w_k p_k(z_D) / Σ_{k∈F} w_k p_k(z_D)  −  log Σ_{k∈S} w_k / Σ_{k∈F} w_k ]

with w the weights before the sample.  Values are means over pushes, with standard errors over pushes; for learners of
several training sets, the variance between the sets divided by their number is added.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.jenga.learners.abstractions import stuck_group
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import log_likelihood, push_groups
from thesis_lib.jenga.robot.samples import F_N, F_T, KINDS, STUCK, TOWER, YAW, PushSamples, X, Y
from thesis_lib.jenga.study.model_study import filtered
from thesis_lib.statistics.wording import ends

FORCES, POSES = (F_N, F_T), (X, Y, YAW, TOWER)
EARLY = 3  # samples of the initial phase
LATE = 5  # samples after which configurations count as informative; pushes without later samples do not show this
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
    """Table of quantity (`QUANTITIES`), value, std, low, high (95 %), n (pushes) for learners of one training size.

    stuck_no_block_first, easy_no_block_first: p(no block) after the first sample, pushes of stuck and of free blocks.
    stuck_resists: growth of 1 − p(no block) − p(easy move) from before contact to the last sample, stuck blocks.
    stuck_hard_move_falls: growth of p(hard move) from the `EARLY`-th to the last sample, stuck blocks.  easy_settles:
    p(easy move) at the last sample, free blocks.  force_leads_early: evidence (nats) from forces minus that from
    displacements in the first `EARLY` samples.  poses_gain_later: evidence per sample from displacements after `LATE`
    samples minus that in the first `EARLY`.
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
        rows.append((name, mean, std, *ends(mean, std), n))
    return pd.DataFrame(rows, columns=["quantity", "value", "std", "low", "high", "n"])


def _of_one(learner: Hma, samples: PushSamples) -> pd.DataFrame:
    """Value of each quantity in each push, NaN where the push does not have it."""
    belief = filtered(learner, samples)
    named = {
        name: belief[:, [each.startswith(name) for each in learner.names]].sum(axis=1)
        for name in ("no block", "easy move", "hard move")
    }
    resists = 1.0 - named["no block"] - named["easy move"]
    forces, poses = (evidence(learner, samples, belief, seen) for seen in (FORCES, POSES))
    found = []
    for rows in push_groups(samples):
        first, last, kind = rows[0], rows[-1], KINDS.get(int(samples.truth[rows[0]]))
        early, late, of = rows[:EARLY], rows[LATE:], {}
        if kind and len(rows) > 1:
            of[f"{kind}_no_block_first"] = named["no block"][rows[1]]
        if kind and len(rows) > EARLY:
            of["force_leads_early"] = (forces - poses)[early].sum()
            of["stuck_resists"] = resists[last] - resists[first]
            of["stuck_hard_move_falls"] = named["hard move"][last] - named["hard move"][rows[EARLY]]
            of["easy_settles"] = named["easy move"][last]
            of["poses_gain_later"] = poses[late].mean() - poses[early].mean() if len(late) else np.nan
        found.append({name: value for name, value in of.items() if name.split("_")[0] in (kind, "force", "poses")})
    return pd.DataFrame(found, columns=list(QUANTITIES))


def evidence(learner: Hma, samples: PushSamples, belief: np.ndarray, seen: Sequence[int]) -> np.ndarray:
    """Growth (n,) of the log odds of the truth (stuck or free) by the readings `seen`; NaN without stuck abstractions.

    belief: (n, K), before each sample.
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
