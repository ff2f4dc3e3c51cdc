"""Findings of chapter 5: how well each policy plays, and the hierarchical model and its abstractions."""

import math
from collections.abc import Sequence
from itertools import groupby

from thesis_lib.records.rows import DataFrame, Row, compared, counted, difference, lies, row_of, share, value
from thesis_lib.statistics.wording import listed, number, percent

POLICIES = {  # as in the legend of figure 5-5 B
    "hma": "HMA",
    "hma_without_cost": "HMA without “no move” cost",
    "hma_one_shot": "HMA in one shot",
    "mor": "MOR",
    "mor_with_cost": "MOR with “no move” cost",
    "network": "network",
    "network_with_cost": "network with “no move” cost",
    "ppo": "PPO",
    "oracle": "oracle",
    "rule": "rule",
    "exploration": "exploration",
    "always_push": "always push",
}
GOAL = 21  # extractions that the thesis expects on an untouched tower
MOVABLE = 0.47  # thesis, section 5.4.4
THRESHOLD = 1.0  # mm, fixed on development towers
EFFECTS = {"glued": "glue between blocks", "slippery": "a slippery layer", "heavy_tool": "a heavier pusher"}
ABSTRACTIONS = 4  # thesis, figure 5-8
SURE = 0.95  # belief above which an abstraction counts as settled
CHANCE = 0.5  # balanced accuracy of a guess


def figure_movable(summary: DataFrame) -> str:
    """The share of movable blocks on test towers, and how it depends on the threshold."""
    test = summary[summary["set"] == "test"].sort_values("threshold_mm")
    row = row_of(test, threshold_mm=THRESHOLD)
    verdict = _known(row, MOVABLE)
    least, most = test.iloc[0], test.iloc[-1]
    return (
        f"On {counted(row['n'], 'test tower')} {share(row, 'mean')} of the blocks tried are movable at the threshold "
        f"of {THRESHOLD:g} mm, {verdict} the thesis's {percent(MOVABLE)}. "
        f"With a threshold of {least['threshold_mm']:g} mm they are {percent(least['mean'])}, with "
        f"{most['threshold_mm']:g} mm {percent(most['mean'])}."
    )


def figure_5_5b(curve: DataFrame, needed: DataFrame) -> str:
    """Extractions of the hierarchical model, of the models with as many samples, and of the best other policy."""
    size = row_of(needed, of="hma")["size"]
    hma = row_of(curve, policy="hma", size=size)
    goal = _known(hma, GOAL)
    alike = (curve["size"] == size) & curve["policy"].isin(["mor", "network"])
    rivals = [f"{POLICIES[row['policy']]} {value(row, 'mean')}" for _, row in curve[alike].iterrows()]
    rest = f"; with as many, {listed(rivals)}" if rivals else ""
    others = curve[~alike & (curve["policy"] != "hma")]
    if len(others):
        best = others.loc[others["mean"].idxmax()]
        rest += f"; most of the other policies, {_policy(best['policy'], [best['size']])}: {value(best, 'mean')}"
    return (
        f"With {size:,.0f} samples HMA extracts {value(hma, 'mean')} blocks in a row, the mean of "
        f"{counted(hma['n'], 'tower')}, {goal} the {GOAL} that the thesis expects{rest}."
    )


def figure_5_6(success: DataFrame) -> str:
    """Successful extractions before and after learning, and the thesis's shares outside our intervals."""
    before, after = (
        row_of(success, phase=phase, position="all", action="extract") for phase in ("exploration", "learned")
    )
    tried = success[(success["attempts"] > 0) & success["published"].notna()]
    words = ("ours is lower for", "", "ours is higher for")
    sides = tried.assign(word=[lies(row, row["published"], words) for _, row in tried.iterrows()])
    outside = sides[sides["word"] != ""]
    of_all = [
        f"{word} {listed([f'{action} ({phase})' for action, phase in zip(rows['action'], rows['phase'])])}"
        for word, rows in outside[outside["position"] == "all"].groupby("word", sort=False)
    ]
    apart = f"{len(outside) or 'none'} of {counted(len(tried), 'share')} of the thesis's real robot lie"
    apart += f" outside our intervals{'; over all blocks ' if of_all else ''}{', '.join(of_all)}"
    if not min(before["attempts"], after["attempts"]) > 0:
        return f"Not both phases came so far as to try an extraction. Of what was tried, {apart}."
    change = difference(after, before, ("less often", "not told apart", "more often"), "share")
    return (
        f"Extraction succeeds in {share(after, 'share')} of the attempts with the learned model (thesis: "
        f"{percent(after['published'])}) and in {share(before, 'share')} in exploration (thesis: "
        f"{percent(before['published'])}): {change}. In all, {apart}."
    )


def figure_paired(pairs: DataFrame, needed: DataFrame) -> str:
    """On the same towers: policies that the hierarchical model beats, that beat it, or that are not told apart."""
    size = row_of(needed, of="hma")["size"]
    comparisons = pairs[(pairs["policy"] == "hma") & (pairs["size"] == size)]
    fewest, most = comparisons["n"].min(), comparisons["n"].max()
    if most == 1:
        parts = [
            f"{_policy(row['rival'], [row['rival_size']])} {row['difference']:+.0f}"
            for _, row in comparisons.iterrows()
        ]
        return (
            f"One tower tells no policies apart. On it the extractions of HMA with {size:,.0f} samples minus those of "
            f"each other policy are: {', '.join(parts)}.".replace("-", "−")
        )
    words = ("fewer blocks than", "a number not told apart from that of", "more blocks than")
    judged = comparisons.assign(word=[lies(row, 0.0, words) for _, row in comparisons.iterrows()])
    parts = []
    for word, group in judged.groupby("word", sort=False):
        names = []
        for rival, rows in group.groupby("rival", sort=False):
            least = rows.loc[rows["difference"].abs().idxmin()]
            low, high = sorted(abs(least[name]) for name in ("low", "high"))
            ends = f"{abs(least['difference']):.1f} ({low:.1f} to {high:.1f})"
            by = "" if word == words[1] else f" by {'at least ' if len(rows) > 1 else ''}{ends}"
            names.append(_policy(str(rival), [n for n in rows["rival_size"] if n != size]) + by)
        parts.append(f"{word} {listed(names)}")
    towers = counted(most, "tower") if fewest == most else f"{fewest} to {most} towers"
    return f"On the same {towers} HMA with {size:,.0f} samples extracts {'; '.join(parts)}."


def figure_5_9(pairs: DataFrame) -> str:
    """Distances of the blocks' ends from the goal, steered and straight: the pair shown, and all pairs."""
    wide = pairs.pivot(index=["block", "edge"], columns="steered", values=["stray", "out"])
    straight, steered = (wide["stray"][name] for name in (0, 1))
    out = [int(wide["out"][name].sum()) for name in (1, 0)]
    # the figure shows the straight push that strayed most, among pairs of which both came out
    shown = straight[(wide["out"] == 1).all(axis=1)].idxmax()
    nearer = int((steered < straight).sum())
    return (
        f"In the pair shown the block ends {_mm(steered[shown])} from the goal when steered and {_mm(straight[shown])} "
        f"straight on. Of {counted(len(wide), 'pair')} of pushes the steered one ends nearer in {nearer or 'none'}; "
        f"the medians are {_mm(steered.median())} and {_mm(straight.median())}, and {out[0]} and {out[1]} blocks came "
        "out."
    )


def _mm(value: float) -> str:
    return number(value, 2, "mm")


def _known(row: Row, of: float) -> str:
    """Where a row's interval lies relative to a value; a single tower has no interval."""
    return "too few to compare with" if math.isnan(row["low"]) else lies(row, of)


def _policy(name: str, sizes: Sequence[float]) -> str:
    """A policy's title, with its numbers of samples if there are any."""
    title = POLICIES.get(name, name.replace("_", " "))
    learned = [f"{size:,.0f}" for size in sorted(sizes) if size]
    return f"{title} with {' to '.join(dict.fromkeys([learned[0], learned[-1]]))} samples" if learned else title


def figure_5_7(summary: DataFrame) -> str:
    """How many predicted forces lie inside the friction cone, and whether resistance falls with height."""
    inside, force, predicted = (
        row_of(summary, quantity=name) for name in ("inside_cone", "height_correlation", "height_correlation_predicted")
    )
    words = ("falls", "neither falls nor rises for sure", "rises")
    return (
        f"{share(inside)} of the forces predicted for {counted(inside['n'], 'held-out push', 'es')} lie inside the "
        f"friction cone. With the height of the block the measured force "
        f"{lies(force, 0.0, words)}, rank correlation {value(force)}; the predicted one "
        f"{lies(predicted, 0.0, words)}, {value(predicted)}."
    )


def figure_5_8(beliefs: DataFrame, runs: DataFrame) -> str:
    """The abstraction on which the belief settles along each push, and the distance of sampler and filter."""
    cases = [_settled(beliefs[beliefs["case"] == case], case) for case in ("stuck", "easy")]
    return (
        f"Belief above {percent(SURE)}: {'; '.join(cases)}. The sampler's probabilities differ from the filter's by at "
        f"most {number(runs['belief_apart'].max(), digits=1)} (R-hat of its chains up to {runs['r_hat'].max():.2f})."
    )


def _settled(beliefs: DataFrame, case: str) -> str:
    leads = beliefs.loc[beliefs.groupby("step")["belief"].idxmax()].sort_values("step")
    leads = leads[leads["belief"] > SURE]
    last = beliefs["step"].max()
    parts = []
    for name, rows in groupby(leads.itertuples(), key=lambda row: row.abstraction):
        steps = [row.step for row in rows]
        parts.append(f"“{name}” from step {steps[0]}" + (" on" if steps[-1] == last else f" to {steps[-1]}"))
    return f"the {case} block is {listed(parts)}" if parts else f"the {case} block is never one abstraction"


def figure_abstractions(looks: DataFrame, agreement: DataFrame) -> str:
    """Which abstractions mean stuck, and how well they separate stuck from free pushes."""
    first = looks.iloc[0]
    shares = [
        f"“{row['abstraction']}”{' (counts as stuck)' if row['stuck'] == 1 else ''} {percent(row['stuck_share'])}"
        for _, row in looks[looks["stuck_share"].notna()].iterrows()
    ]
    row = row_of(agreement, size=first["size"], set=first["set"])
    return (
        f"From {first['size']:,.0f} samples the model forms {counted(len(looks), 'abstraction')} (thesis: "
        f"{ABSTRACTIONS}). Of the held-out pushes in each, so many are stuck in truth: {', '.join(shares)}; of all, "
        f"{percent(row['n_stuck'] / (row['n_stuck'] + row['n_free']))}. That count tells stuck from free with a "
        f"balanced accuracy of {value(row, 'balanced_accuracy')}, {lies(row, CHANCE)} that of a guess."
    )


def figure_unseen(summary: DataFrame, errors: DataFrame) -> str:
    """Which effects the predictive check notices, and how relearning changes the error there."""
    effects = summary.assign(
        text=[f"{_effect(row)} (p = {number(row['p_value'], digits=2)})" for _, row in summary.iterrows()]
    )
    noticed, missed = (list(effects.loc[effects["new_abstraction"] == flag, "text"]) for flag in (1, 0))
    verdict = "The predictive check "
    verdict += f"notices {listed(noticed)}" if noticed else f"does not notice {listed(missed)}"
    verdict += f", but not {listed(missed)}" if noticed and missed else ""
    changes = [_relearned(row, errors) for _, row in summary[summary["new_abstraction"] == 1].iterrows()]
    return " ".join([f"{verdict}.", *changes])


def _effect(row: Row) -> str:
    return EFFECTS.get(row["effect"]) or row["effect"].replace("_", " ")


def _relearned(row: Row, errors: DataFrame) -> str:
    affected = errors[(errors["effect"] == row["effect"]) & (errors["group"] == "affected")]
    if not row["relearned_samples"] > 0:
        return f"Too little failed to relearn {_effect(row)}."
    before, after = (row_of(affected, stage=stage) for stage in ("before", "relearned"))
    return (
        f"Where there is {_effect(row)}, the error is {value(after, 'error')} spreads of a change once "
        f"{counted(row['relearned_samples'], 'sample')} were relearned, {compared(after, before)} the "
        f"{value(before, 'error')} before."
    )
