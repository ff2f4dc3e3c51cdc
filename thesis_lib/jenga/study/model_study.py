"""Evaluation of a learned model: abstractions against hidden truth, forces against friction cone and height.

Held-out pushes come from towers not used in training.  The belief is filtered along each push as in a game; an
abstraction is described by predictions for the samples in which it is the most likely one.  The forces f_n and f_t
(figure 5-7A, N) are predictions of the next reading.

A prediction lies inside the cone if |f_t| ≤ μ f_n + n σ, with μ = 0.42 for finger on wood, σ the noise of a force
reading and n = `SLACK`, because readings and the predictions learned from them are noisy.
Source: thesis, section 5.5.4 and figure 5-7.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from thesis_lib.jenga.learners.abstractions import FIRST, abstraction_table, agreement, stuck_group
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import Learner, along_pushes, push_groups
from thesis_lib.jenga.robot.samples import F_N, F_T, MM, STUCK, PushSamples
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower_model import PER_LAYER
from thesis_lib.statistics.bootstrap import resampled

SLACK = 2.0
BOOTSTRAP = 500


def filtered(learner: Learner, samples: PushSamples) -> np.ndarray:
    """Belief (n, K) before each sample, filtered along its push."""
    belief = np.empty((len(samples), learner.n_abstractions))
    for now, _, before, _ in along_pushes(learner, samples):
        belief[now] = before
    return belief


def predictions(learner: Learner, samples: PushSamples) -> tuple[np.ndarray, np.ndarray]:
    """Predicted mean of the next reading (n, 7), mm and N, and weights (n, K) of abstractions, with filtered belief."""
    predicted = learner.predict(samples.state, samples.action, samples.context, filtered(learner, samples))
    return predicted.moments()[0], predicted.weight


def cone_table(learner: Hma, samples: PushSamples, setup: Setup) -> pd.DataFrame:
    """Table of predicted forces (figure 5-7A): push, step, f_n, f_t (N), abstraction (name), inside (0 or 1)."""
    mean, weight = predictions(learner, samples)
    f_n, f_t = mean[:, F_N], mean[:, F_T]
    limit = setup.robot.tip_friction * np.maximum(f_n, 0.0) + SLACK * setup.sensing.force
    table = pd.DataFrame({"push": samples.push, "step": samples.step, "f_n": f_n, "f_t": f_t})
    names = np.array(learner.names)[weight.argmax(axis=1)]
    return table.assign(abstraction=names, inside=(np.abs(f_t) <= limit).astype(int))


def height_table(learner: Hma, samples: PushSamples, setup: Setup) -> pd.DataFrame:
    """Table with a row per held-out push (figure 5-7B): push, block, height_mm, f_n, f_n_pred, abstraction, truth.

    Both forces, measured and predicted (N), are means over the second half of a push, when the finger bends no further.
    """
    mean, weight = predictions(learner, samples)
    rows = []
    for group in push_groups(samples):
        first, late = group[0], group[len(group) // 2 :]
        block, truth = samples.block[first], int(samples.truth[first])
        height = MM * setup.tower.block[2] * (block // PER_LAYER + 0.5)
        forces = float(samples.next_state[late, F_N].mean()), float(mean[late, F_N].mean())
        name = learner.names[int(weight[late].mean(axis=0).argmax())]
        rows.append((samples.push[first], block, height, *forces, name, truth))
    names = ["push", "block", "height_mm", "f_n", "f_n_pred", "abstraction", "truth"]
    return pd.DataFrame(rows, columns=names)


def looks(learners: Mapping[tuple[int, int], Hma], samples: PushSamples) -> pd.DataFrame:
    """Table of the abstractions of `learners` by (size, set): size, set, columns of `abstraction_table`, stuck_share.

    stuck_share: share of stuck blocks among the held-out pushes that end in the abstraction (NaN without any).
    """
    parts = []
    for (size, number), learner in learners.items():
        ends = [rows[-1] for rows in push_groups(samples)]
        last = filtered(learner, samples)[ends].argmax(axis=1)
        truth = samples.truth[ends]
        of = [truth[last == k] == STUCK for k in range(learner.n_abstractions)]
        share = [float(stuck.mean()) if len(stuck) else np.nan for stuck in of]
        parts.append(abstraction_table(learner).assign(size=size, set=number, stuck_share=share))
    return pd.concat(parts, ignore_index=True).set_index(["size", "set"]).reset_index()


def summary(cone: pd.DataFrame, height: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Summary of figure 5-7: quantity, value, std, low, high (bootstrap over pushes), n (pushes).

    inside_cone: share of predictions inside the friction cone.  height_correlation: rank correlation of a push's force
    with the height of the block; height_correlation_predicted: the same for the predicted force.
    """
    from scipy.stats import spearmanr

    def rank_correlation(rows: np.ndarray) -> float:
        return float(spearmanr(*rows.T)[0])

    quantities = {
        "inside_cone": (cone.groupby("push")["inside"].mean().to_numpy()[:, None], np.mean),
        "height_correlation": (height[["height_mm", "f_n"]].to_numpy(), rank_correlation),
        "height_correlation_predicted": (height[["height_mm", "f_n_pred"]].to_numpy(), rank_correlation),
    }
    rows = []
    for name, (values, statistic) in quantities.items():
        drawn = resampled(values, statistic, BOOTSTRAP, rng)
        low, high = np.nanpercentile(drawn, [2.5, 97.5])
        rows.append((name, statistic(values), float(np.nanstd(drawn)), low, high, len(values)))
    return pd.DataFrame(rows, columns=["quantity", "value", "std", "low", "high", "n"])


def of_one(looks: pd.DataFrame) -> pd.DataFrame:
    """Rows of the first set at the largest size, for the figure."""
    return looks[(looks["size"] == looks["size"].max()) & (looks["set"] == looks["set"].min())]


def agreements(
    learners: Mapping[tuple[int, int], Hma], samples: PushSamples, setup: Setup, rng: np.random.Generator
) -> pd.DataFrame:
    """Agreement of pushes called stuck or free after the first steps with the true label, not used in training.

    There is a row per (size, set), and one with the mean for each size.
    Columns: size, set (-1 for the mean), balanced_accuracy, low, high (bootstrap over pushes; for the mean: lowest and
    highest set), rand_index, n_stuck, n_free, n_abstractions, n_stuck_abstractions.
    """
    rows, robot = [], setup.robot
    steps = FIRST + int(np.ceil(robot.start_off[1] / robot.step))
    for (size, number), learner in learners.items():
        counts = {"n_abstractions": learner.n_abstractions, "n_stuck_abstractions": int(stuck_group(learner).sum())}
        rows.append({"size": size, "set": number} | agreement(learner, samples, rng, steps) | counts)
    table = pd.DataFrame(rows)
    means = table.groupby("size", as_index=False).mean(numeric_only=True).assign(set=-1)
    ends = table.groupby("size")["balanced_accuracy"]
    means["low"], means["high"] = ends.min().to_numpy(), ends.max().to_numpy()
    return pd.concat([table, means[table.columns]], ignore_index=True)
