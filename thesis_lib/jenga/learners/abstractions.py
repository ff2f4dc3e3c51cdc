"""Evaluation of the abstractions: their mean features, their agreement with the hidden label, the need for a new one.

A push is called stuck or free after its first steps, without the true label.  An abstraction counts as stuck if its
block moves by less than half of the advance or drags the tower along (`stuck_group`: `mixture.NO_MOVE`, `mixture.DRAG`;
without any force there is no block).  A push is called stuck if these abstractions hold more than half of the belief.
The true label (`truth`) is used only to compute the

    balanced accuracy = ½ (share of stuck pushes called stuck + share of free pushes called free)

and the adjusted Rand index of abstractions against truth (Hubert and Arabie 1985, doi 10.1007/BF01908075).  Intervals
resample pushes, stuck and free pushes separately.

Predictive check (Box): residuals of each sample under the nearest abstraction among those with belief above `PLAUSIBLE`
from the push so far,

    r_id = (z_id − μ_id)/√var_id,   d²_i = mean_d r²_id,   v_j = mean over push j of (r_i1 … r_i6, log d²_i)
    D²_j = Σ_d (v_jd − m_d)² / (τ_d² + σ_d²/n_j);   p_j = (1 + reference pushes with D ≥ D_j) / (1 + reference pushes)

with r (n, 6) in the dimensions `learner.SEEN`, and mean m, variance τ² between and σ² within reference pushes of the
known tower that were not used in training.  A push fails if p_j ≤ `LEVEL`; D is ranked because slips leave its
distribution unknown.  Whether all pushes together deviate is tested by permuting both sets, with the mean of D² (which
is sensitive to the tail: an effect changes only some blocks).

A new abstraction gets a normal component for the windows of the failing pushes, and a network that is initialised with
the nearest existing network and shares the prior of all.  Earlier abstractions stay unchanged.

For a learner with abstractions (HMA, MOR), the probability of no move (`no_move`) is the belief in the stuck ones.  A
single network has no abstractions; the same rule is then applied to the features predicted for the next straight push:

    p = 1 − (1 − P(m < m₀) P(f ≥ f₀)) (1 − P(d > d₀)),   m, f, d: advance of the block, force, advance of the tower

with independent normal m, f and d.  Both lie in 0 to 1, and the controller penalises their growth in the same way.

All these criteria are own choices: the thesis judges abstractions by eye (figure 5-8).
"""

from copy import copy
from dataclasses import replace

import numpy as np
import pandas as pd
import torch
from scipy.special import ndtr

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import MIN_SAMPLES, SEEN, Learner, along_pushes, push_groups, windows
from thesis_lib.jenga.learners.mixture import DRAG, NO_FORCE, NO_MOVE, describe, names_of
from thesis_lib.jenga.learners.networks import BayesianNetworks, train
from thesis_lib.jenga.robot.samples import F_N, FREE, STATE, STUCK, TOWER, UNKNOWN, PushSamples, X

PLAUSIBLE = 0.05  # belief below which an abstraction cannot explain a sample
LEVEL = 0.05  # significance level of the predictive check, for one push and for all together
PERMUTATIONS, RESAMPLES = 2000, 1000
FIRST = 5  # samples of a push after which it is called stuck or free
ENOUGH = 20  # reference pushes: with fewer, no p-value of a push can reach the level


def stuck_group(learner: Hma) -> np.ndarray:
    """Mask (K,) of the abstractions that count as stuck by the module's rule."""
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


def infer_first_steps(learner: Learner, samples: PushSamples, steps: int = FIRST) -> tuple[np.ndarray, np.ndarray]:
    """First row (m,) of each push with `steps` samples or more, and the belief (m, K) after them; UserError if none."""
    rows = np.array([rows[:steps] for rows in push_groups(samples) if len(rows) >= steps])
    if not len(rows):
        raise UserError(f"no push has {steps} samples; use fewer steps or collect longer pushes.")
    *_, (*_, belief) = along_pushes(learner, samples.select(rows.ravel()))
    return rows[:, 0], belief


def agreement(
    learner: Hma, samples: PushSamples, rng: np.random.Generator, steps: int = FIRST
) -> dict[str, float | int]:
    """Agreement with the true label after the first `steps` samples of each push.

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
        raise UserError("agreement with truth needs stuck and free pushes, but these samples contain only one kind.")
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


def residuals(learner: Learner, samples: PushSamples) -> tuple[np.ndarray, np.ndarray]:
    """r (n, 6) of the module, and the index (n,) of the abstraction nearest to each sample."""
    residual = np.empty((len(samples), len(SEEN)))
    nearest = np.empty(len(samples), dtype=int)
    for now, step, belief, _ in along_pushes(learner, samples):
        out = learner.predict(*step, belief)
        each = ((samples.next_state[now][:, None] - out.mean) / np.sqrt(out.var))[..., list(SEEN)]
        square = np.where(out.weight > PLAUSIBLE, (each**2).mean(axis=2), np.inf)
        nearest[now] = square.argmin(axis=1)
        residual[now] = each[np.arange(len(now)), nearest[now]]
    return residual, nearest


def predictive_check(
    learner: Learner, samples: PushSamples, reference: PushSamples, rng: np.random.Generator
) -> tuple[pd.DataFrame, float]:
    """Table that marks the pushes that no learned abstraction explains, and the p-value of all pushes together.

    A row per push: push, tower, block, layer, side, steps, distance (D), p_value, fails, abstraction (most frequent),
    worst (the dimension of the state with the largest term of D²).  `reference` holds samples of the known tower that
    were not used in training.  A new abstraction is needed if all pushes together deviate (p-value below `LEVEL`).
    UserError for fewer than `ENOUGH` reference pushes.
    """
    known, reference_values, within = _per_push(learner, reference)
    if len(known) < ENOUGH:
        raise UserError(
            f"the predictive check needs at least {ENOUGH} reference pushes, got {len(known)}; hold out more pushes."
        )
    table, values, _ = _per_push(learner, samples)
    sizes = known["steps"].to_numpy()
    square = _square(values, table["steps"].to_numpy(), reference_values, sizes, within)
    # a reference push is compared with the others only: including itself would make its distance too small
    reference_square = np.vstack(
        [
            _square(reference_values[[j]], sizes[[j]], np.delete(reference_values, j, 0), np.delete(sizes, j), within)
            for j in range(len(known))
        ]
    )
    known["distance"] = np.sqrt(reference_square.sum(axis=1))
    table["distance"] = np.sqrt(square.sum(axis=1))
    table["worst"] = [STATE[SEEN[k]] for k in square[:, : len(SEEN)].argmax(axis=1)]
    rank = np.searchsorted(np.sort(known["distance"]), table["distance"].to_numpy())
    table["p_value"] = (1 + len(known) - rank) / (1 + len(known))
    table["fails"] = (table["p_value"] <= LEVEL).astype(int)
    both = np.concatenate([table["distance"], known["distance"]]) ** 2
    shuffled = rng.permuted(np.tile(both, (PERMUTATIONS, 1)), axis=1)[:, : len(table)].sum(axis=1)
    return table, float((1 + (shuffled >= (table["distance"] ** 2).sum()).sum()) / (1 + PERMUTATIONS))


def _square(
    values: np.ndarray, sizes: np.ndarray, reference: np.ndarray, reference_sizes: np.ndarray, within: np.ndarray
) -> np.ndarray:
    """Terms (pushes, 7) of D² for `values` v (pushes, 7), relative to the reference."""
    between = reference.var(axis=0, ddof=1) - (1.0 / reference_sizes).mean() * within
    return (values - reference.mean(axis=0)) ** 2 / (np.maximum(between, 0.0) + within / sizes[:, None])


def _per_push(learner: Learner, samples: PushSamples) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """A row per push, v (pushes, 7), and the variance (7,) within pushes."""
    residual, nearest = residuals(learner, samples)
    values = np.column_stack([residual, np.log((residual**2).mean(axis=1))])
    rows, means, spread, freedom = [], [], 0.0, 0
    for group in push_groups(samples):
        first = group[0]
        means.append(values[group].mean(axis=0))
        spread = spread + ((values[group] - means[-1]) ** 2).sum(axis=0)
        freedom += len(group) - 1
        where = (samples.push[first], samples.tower[first], samples.block[first], *samples.context[first])
        rows.append((*where, len(group), np.bincount(nearest[group]).argmax()))
    names = ["push", "tower", "block", "layer", "side", "steps", "abstraction"]
    return pd.DataFrame(rows, columns=names), np.array(means), spread / max(freedom, 1)


def with_new_abstraction(learner: Hma, samples: PushSamples, rng: np.random.Generator) -> Hma:
    """A copy of the learner with one more abstraction, learned from `samples` of failing pushes.

    Its share is 1/(K + 1), because the number of blocks to which it applies is unknown.  UserError for fewer than
    `MIN_SAMPLES` samples, or a learner without a window mixture (one-shot).
    """
    if learner.mixture is None:
        raise UserError("a new abstraction needs the two-step learner (one_shot: false).")
    if len(samples) < MIN_SAMPLES:
        raise UserError(f"a new abstraction needs {MIN_SAMPLES} samples of failing pushes, got {len(samples)}.")
    config, old, nets = learner.settings, learner.mixture, learner.networks
    k, c = learner.n_abstractions, len(old.weights)
    features = windows(samples, config.window)
    scaled = (features - old.centre) / old.spread
    cov = np.cov(scaled.T) + config.mixture.regularisation * np.eye(scaled.shape[1])
    topics = np.zeros((k + 1, c + 1))
    topics[:k, :c], topics[k, c] = old.topics, 1.0
    share = 1.0 / (k + 1)
    weights = np.append(old.weights * (1 - share), share)

    inputs = learner.scaling.inputs(samples.state, samples.action, samples.context)
    outputs = learner.scaling.outputs(samples.state, samples.next_state)
    nearest = np.bincount(residuals(learner, samples)[1], minlength=k).argmax()
    start = BayesianNetworks(
        nets.settings, [m[[nearest]] for m in nets.mean], [s[[nearest]] for s in nets.log_std], nets.shared
    )
    new = train(inputs, outputs, np.ones((len(inputs), 1)), config.network, int(rng.integers(2**31)), start)

    extended = copy(learner)
    extended.networks = BayesianNetworks(
        nets.settings,
        *([torch.cat(pair) for pair in zip(a, b)] for a, b in ((nets.mean, new.mean), (nets.log_std, new.log_std))),
        nets.shared,
        [torch.cat(pair, dim=1) for pair in zip(nets.draws, new.draws)],
    )
    extended.shares = np.append(learner.shares * (1 - share), share)
    extended.first = np.append(learner.first * (1 - share), share)
    extended.mixture = replace(
        old,
        weights=weights,
        means=np.vstack([old.means, scaled.mean(axis=0)]),
        covariances=np.concatenate([old.covariances, cov[None]]),
        topics=topics,
        shares=extended.shares,
    )
    look = describe(features, np.ones((len(features), 1)), config.window.force_scale)
    extended.look = {name: np.append(value, look[name]) for name, value in learner.look.items()}
    extended.names = [*learner.names, f"new: {names_of(look)[0]}"]
    return extended
