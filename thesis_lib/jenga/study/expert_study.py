"""Number of experts that a mixture of regressions needs, by cross-validation and on pushes of other towers.

For each training set and each number of experts K, there are two scores, in nats per sample beyond one expert:

    gain(K) = mean over samples of log p(Δ | x, K experts) − log p(Δ | x, 1 expert)

one by 5-fold cross-validation over the pushes of the training set (as `mor` chooses K), one for experts fitted to all
of it on held-out pushes.  Standard errors are clustered by push: with S_j the sum over push j of n_j samples, N = Σ n_j
and m = Σ S_j / N, their square is Σ_j (S_j − m n_j)² / N².  For a mean over training sets, which share the held-out
pushes, the variance between sets divided by their number is added.

Source: thesis, section 5.7: "the number of mixtures ranges from 2 to 11 (determined using 5-fold cross-validation)";
a large number "increases the parameter space, requiring more data to learn".
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.jenga.learners.learner import push_groups
from thesis_lib.jenga.learners.mor import Mor, cross_validated, em, with_one
from thesis_lib.jenga.learners.settings import LearnerSettings
from thesis_lib.jenga.play.settings import ExpertChoice
from thesis_lib.jenga.robot.samples import PushSamples
from thesis_lib.statistics.wording import ends

FEW, MANY = 2, 11  # thesis


def expert_tables(
    sets: Sequence[PushSamples],
    held_out: PushSamples,
    sizes: Sequence[int],
    choice: ExpertChoice,
    settings: LearnerSettings,
    rng: np.random.Generator,
) -> dict[str, pd.DataFrame]:
    """Tables for each number of samples in `sizes`, taken from the start of each of `sets`.

    experts: size, set, experts, cv, cv_std, held_out, held_out_std (gains and their standard errors), chosen (0 or 1,
    by cross-validation).  experts_summary: quantity, size (0: all), value, std, low, high (95 %, normal), n (fits):
    fewest and most, the smallest and largest number chosen; chosen_gain, held-out gain of the chosen number;
    many_minus_few, held-out gain of 11 experts minus that of 2.
    """
    tables, rows = [], []
    for size in sizes:
        gains: dict[str, list[np.ndarray]] = {"chosen_gain": [], "many_minus_few": []}
        for number, samples in enumerate(sets):
            table, held = _of_one(samples.first(size), held_out, choice, settings, rng)
            tables.append(table.assign(size=size, set=number))
            chosen = table.loc[table["chosen"] == 1, "experts"].item()
            gains["chosen_gain"].append(held[chosen] - held[min(held)])
            gains["many_minus_few"].append(held[MANY] - held[FEW])
        rows += [(name, size, *_over_sets(np.array(each), held_out), len(each)) for name, each in gains.items()]
    curves = pd.concat(tables, ignore_index=True)
    for size in (0, *sizes):
        chosen = curves.loc[(curves["chosen"] == 1) & (curves["size"].eq(size) | (size == 0)), "experts"]
        ends = {"fewest": chosen.min(), "most": chosen.max()}
        rows += [(name, size, float(value), np.nan, np.nan, np.nan, len(chosen)) for name, value in ends.items()]
    columns = ["size", "set", "experts", "cv", "cv_std", "held_out", "held_out_std", "chosen"]
    summary = pd.DataFrame(rows, columns=["quantity", "size", "value", "std", "low", "high", "n"])
    return {"experts": curves[columns], "experts_summary": summary}


def _of_one(
    samples: PushSamples,
    held_out: PushSamples,
    choice: ExpertChoice,
    settings: LearnerSettings,
    rng: np.random.Generator,
) -> tuple[pd.DataFrame, dict[int, np.ndarray]]:
    """Table of one training set, and the held-out log density (n,) for each number of experts."""
    learner = Mor(settings)
    inputs, y = learner.scale(samples)
    x, numbers = with_one(inputs), sorted({*range(choice.fewest, choice.most + 1), FEW, MANY})
    scores = cross_validated(x, y, samples.push, numbers, settings.experts, rng)
    other = with_one(learner.scaling.inputs(held_out.state, held_out.action, held_out.context))
    changes = learner.scaling.outputs(held_out.state, held_out.next_state)
    # one start, as in cross-validation: the mean over training sets also averages over starts
    once = settings.experts.model_copy(update={"restarts": 1})
    held = {k: em(x, y, k, once, rng).log_density(other, changes) for k in numbers}
    chosen = max(scores, key=lambda k: scores[k].sum())
    rows = []
    for k in numbers:
        cv, seen = (gain[k] - gain[numbers[0]] for gain in (scores, held))
        found = (*clustered(cv, samples), *clustered(seen, held_out))
        rows.append((k, *found, int(k == chosen)))
    return pd.DataFrame(rows, columns=["experts", "cv", "cv_std", "held_out", "held_out_std", "chosen"]), held


def clustered(values: np.ndarray, samples: PushSamples) -> tuple[float, float]:
    """Mean of values (n,) of samples, and its standard error clustered by push."""
    groups = push_groups(samples)
    sums, counts = np.array([values[rows].sum() for rows in groups]), np.array([len(rows) for rows in groups])
    mean = sums.sum() / counts.sum()
    return float(mean), float(np.sqrt(((sums - mean * counts) ** 2).sum()) / counts.sum())


def _over_sets(gains: np.ndarray, held_out: PushSamples) -> tuple[float, float, float, float]:
    """Mean, standard error and 95 % interval of gains (sets, n) on the same held-out samples."""
    mean, between_pushes = clustered(gains.mean(axis=0), held_out)
    between_sets = gains.mean(axis=1).var(ddof=1) / len(gains) if len(gains) > 1 else 0.0
    std = float(np.hypot(between_pushes, np.sqrt(between_sets)))
    return mean, std, *ends(mean, std)
