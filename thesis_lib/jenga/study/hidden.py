"""Effects absent from training: are they detected and located, and does relearning with few samples help?

On towers with the effect, the base policy pushes blocks that have it and as many others.  On the first half of the
towers, the predictive check determines which pushes the learned abstractions do not explain, which abstraction fails,
and whether a new one is needed, which is then learned from the failing pushes alone.  The error on the other half is

    e = mean over samples and readings of |z − ẑ|/σ_Δ,    σ_Δ the spread of training's changes, ẑ the mixture's mean

with the belief filtered along each push, and a 95 % interval over pushes.  The list of blocks with the effect only
selects the blocks to push and groups the results; neither half uses it otherwise.

Source: thesis, section 5.8, names models that detect what they do not explain as a goal.  The procedure is our own.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.abstractions import LEVEL, predictive_check, with_new_abstraction
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import MIN_SAMPLES, SEEN, push_groups
from thesis_lib.jenga.play.players import learner_of
from thesis_lib.jenga.play.settings import Chapter5, HiddenChoice
from thesis_lib.jenga.robot.samples import PushSamples, join
from thesis_lib.jenga.study.collect import APART, explore_tower
from thesis_lib.jenga.study.model_study import predictions
from thesis_lib.jenga.tower.settings import HiddenEffects, Setup
from thesis_lib.jenga.tower.tower import REACHABLE
from thesis_lib.jenga.tower.tower_model import PER_LAYER
from thesis_lib.statistics.intervals import student_mean


def hidden_of(effect: str, choice: HiddenChoice) -> tuple[HiddenEffects, tuple[int, ...]]:
    """Settings of an effect and the blocks that have it; UserError for an unknown effect."""
    layer = tuple(range(PER_LAYER * choice.layer, PER_LAYER * (choice.layer + 1)))
    known = {
        "glued": (HiddenEffects(glued=layer), layer),
        "slippery": (HiddenEffects(slippery_layer=choice.layer), layer),
        "heavy_tool": (HiddenEffects(pusher_mass=choice.pusher_mass), tuple(REACHABLE)),
    }
    if effect not in known:
        raise UserError(f"there is no hidden effect {effect}; choose one of {', '.join(known)}.")
    return known[effect]


def hidden_study(
    effect: str,
    learner: Hma,
    reference: PushSamples,
    setup: Setup,
    choice: HiddenChoice,
    first_seed: int,
    base_seed: int,
    rng: np.random.Generator,
) -> dict[str, pd.DataFrame]:
    """Carry out the procedure for one effect; `reference` holds held-out samples of towers without it.

    summary: one row: p_value, new_abstraction (0 or 1), numbers of pushes and of failing pushes with and without the
    effect, the abstraction that fails most, number of samples for relearning.  pushes: a row per push of the first half
    (`predictive_check`) with affected (0 or 1).  errors: stage (before, relearned), group (affected, others), error,
    low, high, n.  UserError if one half of the towers gave no samples.
    """
    hidden, affected_blocks = hidden_of(effect, choice)
    tower = setup.tower.model_copy(update={"hidden": hidden})
    with_effect = setup.model_copy(update={"tower": tower})
    halves: list[list[PushSamples]] = [[], []]
    for i in range(choice.towers):
        # some effects concern few blocks, others all
        affected = rng.permutation(affected_blocks)[: -(-choice.pushes // choice.towers)]
        rest = [block for block in REACHABLE if block not in affected_blocks]
        others = rng.permutation(rest)[: -(-choice.others // choice.towers)] if rest else []
        blocks = tuple(int(block) for block in (*affected, *others))
        samples, _ = explore_tower(first_seed + i, base_seed, with_effect, blocks=blocks, label=False)
        if samples is not None:
            halves[int(i >= choice.towers // 2)].append(samples)
    if not all(halves):
        raise UserError(f"{effect}: one half of the towers gave no samples; use more towers than {choice.towers}.")
    seen, fresh = (join(parts) for parts in halves)
    pushes, p_value = predictive_check(learner, seen, reference, rng)
    by_abstraction = pushes.groupby("abstraction").agg({"fails": "sum", "distance": "mean"})
    worst = by_abstraction.sort_values(["fails", "distance"], ascending=False).index[0]
    pushes = pushes.assign(
        affected=pushes["block"].isin(affected_blocks).astype(int),
        abstraction=np.array(learner.names)[pushes["abstraction"]],
    )
    failing = seen.select(np.isin(seen.push, pushes.loc[pushes["fails"] == 1, "push"]))
    stages = {"before": learner}
    if p_value < LEVEL and len(failing) >= MIN_SAMPLES:
        stages["relearned"] = with_new_abstraction(learner, failing, rng)
    errors = [error_rows(model, fresh, affected_blocks).assign(stage=stage) for stage, model in stages.items()]
    table = pd.concat(errors, ignore_index=True).assign(effect=effect)
    row = {"effect": effect, "p_value": p_value, "new_abstraction": int(p_value < LEVEL)}
    row["failing_abstraction"] = learner.names[worst]
    row["relearned_samples"] = len(failing) if "relearned" in stages else 0
    for name, value in (("affected", 1), ("others", 0)):
        part = pushes[pushes["affected"] == value]
        row |= {f"pushes_{name}": len(part), f"failing_{name}": int(part["fails"].sum())}
    return {
        "summary": pd.DataFrame([row]),
        "pushes": pushes.assign(effect=effect),
        "errors": table[["effect", "stage", "group", "error", "low", "high", "n"]],
    }


def error_rows(learner: Hma, samples: PushSamples, affected_blocks: tuple[int, ...]) -> pd.DataFrame:
    """Table of group, error, low, high, n: pushes of blocks in `affected_blocks`, and of the others."""
    mean, _ = predictions(learner, samples)
    dims = list(SEEN)
    off = (np.abs(samples.next_state - mean) / learner.scaling.change)[:, dims].mean(axis=1)
    groups = push_groups(samples)
    per_push = np.array([off[rows].mean() for rows in groups])
    affected = np.array([samples.block[rows[0]] in affected_blocks for rows in groups])
    parts = {"affected": per_push[affected], "others": per_push[~affected]}
    rows = [(name, *student_mean(part), len(part)) for name, part in parts.items() if len(part)]
    return pd.DataFrame(rows, columns=["group", "error", "low", "high", "n"])


def hidden_tables(
    samples: PushSamples,
    reference: PushSamples,
    settings: Chapter5,
    base_seed: int,
    rng: np.random.Generator,
    say: Callable[[str], None] = lambda _: None,
) -> dict[str, pd.DataFrame]:
    """Tables summary, pushes and errors of all effects in the settings, for one learner trained on all `samples`."""
    learner = learner_of("hma", settings).fit(samples, rng)
    results = []
    for i, effect in enumerate(settings.hidden.effects):
        # separate towers, far from those of the reference
        first = settings.towers.first_held_out + APART * (i + 1)
        result = hidden_study(effect, learner, reference, settings.setup, settings.hidden, first, base_seed, rng)
        results.append(result)
        say(f"{effect}: p = {result['summary']['p_value'].iloc[0]:.3f}")
    return {name: pd.concat([result[name] for result in results], ignore_index=True) for name in results[0]}
