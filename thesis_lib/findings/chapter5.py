"""What the figures of chapter 5 show: how far each policy plays Jenga, and what the learned abstractions know.

Intervals are 95 %, over towers, pushes or attempts.  Where the games are of one tower only there are none, and nothing
is told apart.
"""

# pandas' stubs do not know what a row holds
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import math
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from thesis_lib.findings.finding import Finding
from thesis_lib.findings.rows import Row, compared, counted, row_of, share
from thesis_lib.findings.wording import ends, interval, listing, number, percent, side

if TYPE_CHECKING:
    import pandas as pd

POLICIES = {  # as in the legend of figure 5-5 B
    "hma": "HMA",
    "hma_without_cost": "HMA without “no move” cost",
    "hma_one_shot": "HMA in one shot",
    "mor": "MOR",
    "network": "network",
    "ppo": "PPO",
    "oracle": "oracle",
    "rule": "rule",
    "exploration": "exploration",
    "always_push": "always push",
}
EFFECTS = {
    "glued": "glue between blocks",
    "slippery": "a slippery layer",
    "heavy_tool": "a heavier pusher",
}
GOAL = 21  # extractions that the thesis expects on an untouched tower
MOVABLE = 0.47  # thesis, section 5.4.4
THRESHOLD = 1.0  # mm, fixed on development towers
ABSTRACTIONS = 4  # thesis, figure 5-8
SURE = 0.95  # belief with which an abstraction counts as settled on
CHANCE = 0.5  # balanced accuracy of a guess


def figure_5_5b(curve: "pd.DataFrame", needed: "pd.DataFrame") -> str:
    """Extractions of the hierarchical model, of what learned from as many samples, and of the best of the others."""
    size = row_of(needed, of="hma")["size"]
    own = row_of(curve, policy="hma", size=size)
    goal = _known(own, GOAL, ("below", "not told apart from", "above"), "too few to compare with")
    alike = (curve["size"] == size) & curve["policy"].isin(["mor", "network"])
    rivals = [f"{POLICIES[row['policy']]} {_value(row, 'mean')}" for _, row in curve[alike].iterrows()]
    told = f"; with as many, {listing(rivals)}" if rivals else ""
    others = curve[~alike & (curve["policy"] != "hma")]
    if len(others):
        best = others.loc[others["mean"].idxmax()]
        told += (
            f"; most of the other policies, {_policy(best['policy'], [best['size']])}: {_value(best, 'mean')}"
        )
    return (
        f"With {size:,.0f} samples HMA extracts {_value(own, 'mean')} blocks in a row, the mean of "
        f"{counted(own['n'], 'tower')}, {goal} the {GOAL} that the thesis expects{told}."
    )


def figure_paired(pairs: "pd.DataFrame", needed: "pd.DataFrame") -> str:
    """On the same towers: whom the hierarchical model beats, who beats it, and who is not told apart from it."""
    size = row_of(needed, of="hma")["size"]
    own = pairs[(pairs["policy"] == "hma") & (pairs["size"] == size)]
    fewest, most = own["n"].min(), own["n"].max()
    if most == 1:
        told = [
            f"{_policy(row['rival'], [row['rival_size']])} {row['difference']:+.0f}"
            for _, row in own.iterrows()
        ]
        return (
            f"One tower tells no policies apart. On it the extractions of HMA with {size:,.0f} samples minus those of "
            f"each other policy are: {', '.join(told)}.".replace("-", "−")
        )
    words = ("fewer blocks than", "a number not told apart from that of", "more blocks than")
    judged = own.assign(word=[side(row["low"], row["high"], 0.0, words) for _, row in own.iterrows()])
    told = []
    for word, group in judged.groupby("word", sort=False):
        names = []
        for rival, rows in group.groupby("rival", sort=False):
            least = rows.loc[rows["difference"].abs().idxmin()]
            low, high = sorted(abs(least[name]) for name in ("low", "high"))
            ends = f"{abs(least['difference']):.1f} ({low:.1f} to {high:.1f})"
            by = "" if word == words[1] else f" by {'at least ' if len(rows) > 1 else ''}{ends}"
            names.append(_policy(str(rival), [n for n in rows["rival_size"] if n != size]) + by)
        told.append(f"{word} {listing(names)}")
    towers = counted(most, "tower") if fewest == most else f"{fewest} to {most} towers"
    return f"On the same {towers} HMA with {size:,.0f} samples extracts {'; '.join(told)}."


def figure_5_6(success: "pd.DataFrame") -> str:
    """Extraction before and after learning, and how many of the thesis's shares lie outside our intervals."""
    before, after = (
        row_of(success, phase=phase, position="all", action="extract") for phase in ("exploration", "learned")
    )
    tried = success[(success["attempts"] > 0) & success["published"].notna()]
    words = ("ours is lower for", "", "ours is higher for")
    sides = tried.assign(
        word=[side(row["low"], row["high"], row["published"], words) for _, row in tried.iterrows()]
    )
    outside = sides[sides["word"] != ""]
    of_all = [
        f"{word} {listing([f'{action} ({phase})' for action, phase in zip(rows['action'], rows['phase'])])}"
        for word, rows in outside[outside["position"] == "all"].groupby("word", sort=False)
    ]
    apart = f"{len(outside) or 'none'} of {counted(len(tried), 'share')} of the thesis's real robot lie"
    apart += f" outside our intervals{'; over all blocks ' if of_all else ''}{', '.join(of_all)}"
    if not min(before["attempts"], after["attempts"]) > 0:
        return f"Not both phases came so far as to try an extraction. Of what was tried, {apart}."
    change = side(
        *ends(after["share"] - before["share"], (before["std"] ** 2 + after["std"] ** 2) ** 0.5),
        0.0,
        ("less often", "not told apart", "more often"),
    )
    return (
        f"Extraction succeeds in {share(after, 'share')} of the attempts with the learned model (thesis: "
        f"{percent(after['published'])}) and in {share(before, 'share')} in exploration (thesis: "
        f"{percent(before['published'])}): {change}. In all, {apart}."
    )


def figure_5_7(summary: "pd.DataFrame") -> str:
    """How many predicted forces lie inside the friction cone, and whether resistance falls with height."""
    inside, seen, said = (
        row_of(summary, quantity=name)
        for name in ("inside_cone", "height_correlation", "height_correlation_predicted")
    )
    words = ("falls", "neither falls nor rises for sure", "rises")
    return (
        f"{share(inside)} of the forces predicted for {counted(inside['n'], 'held-out push', 'es')} lie inside the "
        f"friction cone. With the height of the block the measured force "
        f"{side(seen['low'], seen['high'], 0.0, words)}, rank correlation {_value(seen)}; the predicted one "
        f"{side(said['low'], said['high'], 0.0, words)}, {_value(said)}."
    )


def figure_5_8(beliefs: "pd.DataFrame", runs: "pd.DataFrame") -> str:
    """What the belief settles on along each push and when, and how far the sampler is from the filter."""
    told = [_settled(beliefs[beliefs["case"] == case], case) for case in ("stuck", "easy")]
    return (
        f"Belief above {percent(SURE)}: {'; '.join(told)}. The sampler's probabilities differ from the filter's by at "
        f"most {number(runs['belief_apart'].max(), digits=1)} (R-hat of its chains up to {runs['r_hat'].max():.2f})."
    )


def _settled(own: "pd.DataFrame", case: str) -> str:
    leads = own.loc[own.groupby("step")["belief"].idxmax()].sort_values("step")
    leads = leads[leads["belief"] > SURE]
    last = own["step"].max()
    parts = []
    for name, rows in groupby(leads.itertuples(), key=lambda row: row.abstraction):
        steps = [row.step for row in rows]
        parts.append(f"“{name}” from step {steps[0]}" + (" on" if steps[-1] == last else f" to {steps[-1]}"))
    return f"the {case} block is {listing(parts)}" if parts else f"the {case} block is never one abstraction"


def figure_5_9(pairs: "pd.DataFrame") -> str:
    """How far off the goal blocks end, steered and straight on: the pair shown, and all pairs."""
    wide = pairs.pivot(index=["block", "edge"], columns="steered", values=["stray", "out"])
    straight, steered = (wide["stray"][name] for name in (0, 1))
    out = [int(wide["out"][name].sum()) for name in (1, 0)]
    # the figure shows the straight push that strayed most, of pairs that both came out
    shown = straight[(wide["out"] == 1).all(axis=1)].idxmax()
    nearer = int((steered < straight).sum())
    return (
        f"In the pair shown the block ends {_mm(steered[shown])} from the goal when steered and {_mm(straight[shown])} "
        f"straight on. Of {counted(len(wide), 'pair')} of pushes the steered one ends nearer in {nearer or 'none'}; "
        f"the medians are {_mm(steered.median())} and {_mm(straight.median())}, and {out[0]} and {out[1]} blocks came "
        "out."
    )


def figure_movable(summary: "pd.DataFrame") -> str:
    """The share of movable blocks on test towers, and how it depends on the threshold."""
    own = summary[summary["set"] == "test"].sort_values("threshold_mm")
    row = row_of(own, threshold_mm=THRESHOLD)
    told = _known(row, MOVABLE, ("below", "not told apart from", "above"), "too few to compare with")
    least, most = own.iloc[0], own.iloc[-1]
    return (
        f"On {counted(row['n'], 'test tower')} {share(row, 'mean')} of the blocks tried are movable at the threshold "
        f"of {THRESHOLD:g} mm, {told} the thesis's {percent(MOVABLE)}. "
        f"With a threshold of {least['threshold_mm']:g} mm they are {percent(least['mean'])}, with "
        f"{most['threshold_mm']:g} mm {percent(most['mean'])}."
    )


def figure_abstractions(looks: "pd.DataFrame", agreement: "pd.DataFrame") -> str:
    """Which abstractions stand for being stuck, and how well they tell stuck from free pushes."""
    first = looks.iloc[0]
    told = [
        f"“{row['abstraction']}”{' (counts as stuck)' if row['stuck'] == 1 else ''} {percent(row['stuck_share'])}"
        for _, row in looks[looks["stuck_share"].notna()].iterrows()
    ]
    row = row_of(agreement, size=first["size"], set=first["set"])
    guess = side(row["low"], row["high"], CHANCE, ("below", "not told apart from", "above"))
    return (
        f"From {first['size']:,.0f} samples the model forms {counted(len(looks), 'abstraction')} (thesis: "
        f"{ABSTRACTIONS}). Of the held-out pushes in each, so many are stuck in truth: {', '.join(told)}; of all, "
        f"{percent(row['n_stuck'] / (row['n_stuck'] + row['n_free']))}. That count tells stuck from free with a "
        f"balanced accuracy of {_value(row, 'balanced_accuracy')}, {guess} that of a guess."
    )


def figure_unseen(summary: "pd.DataFrame", errors: "pd.DataFrame") -> str:
    """Which effects the predictive check notices, and what relearning does to the error there."""
    said = summary.assign(
        text=[f"{_effect(row)} (p = {number(row['p_value'], digits=2)})" for _, row in summary.iterrows()]
    )
    noticed, missed = (list(said.loc[said["new_abstraction"] == flag, "text"]) for flag in (1, 0))
    told = "The predictive check "
    told += f"notices {listing(noticed)}" if noticed else f"does not notice {listing(missed)}"
    told += f", but not {listing(missed)}" if noticed and missed else ""
    changes = [_relearned(row, errors) for _, row in summary[summary["new_abstraction"] == 1].iterrows()]
    return " ".join([f"{told}.", *changes])


def _relearned(row: Row, errors: "pd.DataFrame") -> str:
    own = errors[(errors["effect"] == row["effect"]) & (errors["group"] == "affected")]
    if not row["relearned_samples"] > 0:
        return f"Too little failed to relearn {_effect(row)}."
    before, after = (row_of(own, stage=stage) for stage in ("before", "relearned"))
    return (
        f"Where there is {_effect(row)}, the error is {_value(after, 'error')} spreads of a change once "
        f"{counted(row['relearned_samples'], 'sample')} were relearned, {compared(after, before)} the "
        f"{_value(before, 'error')} before."
    )


def _effect(row: Row) -> str:
    return EFFECTS.get(row["effect"]) or row["effect"].replace("_", " ")


def _policy(name: str, sizes: Sequence[float]) -> str:
    """A policy's title, with what it learned from where that is to be told."""
    title = POLICIES.get(name, name.replace("_", " "))
    learned = [f"{size:,.0f}" for size in sorted(sizes) if size]
    return (
        f"{title} with {' to '.join(dict.fromkeys([learned[0], learned[-1]]))} samples" if learned else title
    )


def _known(row: Row, of: float, words: tuple[str, str, str], unknown: str) -> str:
    """Where a row's interval lies from a value; `unknown` where it has none: one tower."""
    return unknown if math.isnan(row["low"]) else side(row["low"], row["high"], of, words)


def _value(row: Row, column: str = "value") -> str:
    return interval(row[column], row["low"], row["high"])


def _mm(value: float) -> str:
    return number(value, "mm", digits=2)


FINDINGS = {
    "figure_5_5b": Finding(("study_curve.csv", "study_needed.csv"), figure_5_5b),
    "figure_5_6": Finding(("study_success.csv",), figure_5_6),
    "figure_5_7": Finding(("model_summary.csv",), figure_5_7),
    "figure_5_8": Finding(("figure_5_8.csv", "showcase_runs.csv"), figure_5_8),
    "figure_5_9": Finding(("showcase_steering.csv",), figure_5_9),
    "figure_paired": Finding(("study_paired.csv", "study_needed.csv"), figure_paired),
    "figure_movable": Finding(("movable_summary.csv",), figure_movable),
    "figure_abstractions": Finding(("figure_abstractions.csv", "model_agreement.csv"), figure_abstractions),
    "figure_unseen": Finding(("unseen_summary.csv", "unseen_errors.csv"), figure_unseen),
}
