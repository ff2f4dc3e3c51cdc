"""Plain words for the short names in files and code: reasons, states, lists of them."""

from collections.abc import Mapping, Sequence

from thesis_lib.critique.drops.features import FEATURES
from thesis_lib.statistics.wording import listed

AWAY = ("off_wall", "off_surface")  # reasons of hits away from the surface, in the plane and in space
REASONS = {
    "off_wall": "away from every wall: another body or a hand",
    "off_surface": "away from the surface: a hand, another body, or beyond its edge",
    "energy_gain": "leaves faster than any impact allows",
    "lost_frames": "long gap: too few samples on a side",
    "second_hit": "second hit too near to tell apart",
    "unpredictable": "hits that the noise of the flight before makes unpredictable",
    "window_too_short": "trial, or a rest, begins or ends too near",
    "stays_down": "the body stays down after the hit",
    "not_ballistic": "no free flight on a side (held, rolling, bad track)",
    "no_bounce": "the ball seems to bounce higher than before: it rolls, and its rotation is misread",
    "no_push": "no push from the surface: noise, or a hit on something else",
    "no_approach": "contact point does not approach (rest, rolling)",
}
NAMED = 2  # alternatives that are named; the others are counted
FEW = 0.1  # share of the impacts left out below which reasons are summed up


def reason_text(reason: str) -> str:
    """A reason for leaving an impact out, in words."""
    return REASONS.get(reason, reason.replace("_", " "))


def feature_text(feature: str) -> str:
    """A feature in words, followed by its short name."""
    return f"{FEATURES[feature][1].split(',')[0]} ({feature})" if feature in FEATURES else feature


def plain_rule(region: Mapping) -> str:
    """The rule of a region with Greek letters and true minus signs."""
    rule = str(region["rule"])
    for name, letter in (("theta", "θ"), ("omega", "ω"), (" -", " −")):
        rule = rule.replace(name, letter)
    return rule


def alternatives_listed(names: Sequence[str]) -> str:
    """a or b; beyond `NAMED` names, the number of the others."""
    names, more = list(names[:NAMED]), len(names) - NAMED
    return listed([*names, f"{more} more"] if more > 0 else names, "or")


def reasons_listed(reasons: Mapping[str, int]) -> str:
    """Reasons with counts, the most frequent first; rare ones are summed up."""
    total = sum(reasons.values())
    ranked = sorted(reasons.items(), key=lambda item: (-item[1], item[0]))
    often = [(name, count) for name, count in ranked if count >= FEW * total] or ranked
    parts = [f"{count} × {reason_text(name)}" for name, count in often]
    rest = total - sum(count for _, count in often)
    return "; ".join([*parts, f"{rest} for other reasons"] if rest else parts)
