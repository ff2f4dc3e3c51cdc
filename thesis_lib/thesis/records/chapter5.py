"""Functions for the findings of chapter 5, and the names of policies and effects."""

import math
from collections.abc import Sequence
from itertools import groupby

from thesis_lib.statistics.wording import listed, number
from thesis_lib.thesis.records.rows import DataFrame, Row, counted, lies

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


def known(row: Row, of: float) -> str:
    """Word for the position of a row's interval relative to a value; a single tower has no interval."""
    return "too few to compare with" if math.isnan(row["low"]) else lies(row, of)


def policy(name: str, sizes: Sequence[float]) -> str:
    """Title of a policy, with its numbers of samples if it has any."""
    title = POLICIES.get(name, name.replace("_", " "))
    learned = [f"{size:,.0f}" for size in sorted(sizes) if size]
    return f"{title} with {' to '.join(dict.fromkeys([learned[0], learned[-1]]))} samples" if learned else title


def against_robot(success: DataFrame) -> str:
    """Sentence on the real robot's shares outside our intervals: how many, and which over all blocks (figure 5-6)."""
    tried = success[(success["attempts"] > 0) & success["published"].notna()]
    words = ("ours is lower for", "", "ours is higher for")
    sides = tried.assign(word=[lies(row, row["published"], words) for _, row in tried.iterrows()])
    outside = sides[sides["word"] != ""]
    of_all = [
        f"{word} {listed([f'{action} ({phase})' for action, phase in zip(rows['action'], rows['phase'])])}"
        for word, rows in outside[outside["position"] == "all"].groupby("word", sort=False)
    ]
    apart = f"{len(outside) or 'none'} of {counted(len(tried), 'share')} of the thesis's real robot lie"
    return f"{apart} outside our intervals{'; over all blocks ' if of_all else ''}{', '.join(of_all)}"


def beaten(comparisons: DataFrame, size: float) -> list[str]:
    """Phrases that compare the extracted blocks of HMA with `size` samples with those of each other policy."""
    words = ("fewer blocks than", "a number indistinguishable from that of", "more blocks than")
    judged = comparisons.assign(word=[lies(row, 0.0, words) for _, row in comparisons.iterrows()])
    parts = []
    for word, group in judged.groupby("word", sort=False):
        names = []
        for rival, rows in group.groupby("rival", sort=False):
            least = rows.loc[rows["difference"].abs().idxmin()]
            low, high = sorted(abs(least[name]) for name in ("low", "high"))
            ends = f"{abs(least['difference']):.1f} ({low:.1f} to {high:.1f})"
            by = "" if word == words[1] else f" by {'at least ' if len(rows) > 1 else ''}{ends}"
            names.append(policy(str(rival), [n for n in rows["rival_size"] if n != size]) + by)
        parts.append(f"{word} {listed(names)}")
    return parts


def settled(beliefs: DataFrame, case: str) -> str:
    """Sentence with the abstractions on which the belief settles during the push of a case, and their steps."""
    beliefs = beliefs[beliefs["case"] == case]
    leads = beliefs.loc[beliefs.groupby("step")["belief"].idxmax()].sort_values("step")
    leads = leads[leads["belief"] > SURE]
    last = beliefs["step"].max()
    parts = []
    for name, rows in groupby(leads.itertuples(), key=lambda row: row.abstraction):
        steps = [row.step for row in rows]
        parts.append(f"“{name}” from step {steps[0]}" + (" on" if steps[-1] == last else f" to {steps[-1]}"))
    return f"the {case} block is {listed(parts)}" if parts else f"the {case} block is never one abstraction"


def effect_name(effect: str) -> str:
    """Name of an effect of the tower in words."""
    return EFFECTS.get(effect) or effect.replace("_", " ")


def by_check(summary: DataFrame, new: int) -> list[str]:
    """Effects, with p-values, for which the predictive check requires a new abstraction (1) or does not (0)."""
    rows = summary[summary["new_abstraction"] == new].to_dict("records")
    return [f"{effect_name(row['effect'])} (p = {number(row['p_value'], digits=2)})" for row in rows]
