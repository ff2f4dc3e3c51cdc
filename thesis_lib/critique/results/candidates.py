"""Best candidate effects of a search, and models with each combination of the effects found and their rival.

Candidates are the best effects by the quick fits from which the search chose (`Shortlist`), each alone with the law
that suits it.  Held-out data show the gain of each candidate but choose none.  `why` gives the reason for an effect
that was found, and against any other.  Choices are the combinations of effects that a reader can switch on and off.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.judgement import Judgement, channel_is_material, judge, spoilt_channels
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.channels import CHANNELS, concerned
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.results.numbers import gain_an_impact
from thesis_lib.critique.results.titles import effect_title
from thesis_lib.statistics.intervals import clustered_mean
from thesis_lib.statistics.wording import listed

FOUND, ALIKE, REJECTED, OTHER = "found", "cannot be told from it", "rejected", "not needed"
MOST = 3  # effects that can be switched, because each choice costs a fit
NOTHING = "no effect"
COLUMNS = ("effect", "gain", "gain_low", "gain_high", "standing", "why")


def candidates(critique: DropsCritique) -> pd.DataFrame:
    """Table of the best candidates, largest gain first; empty if the search had no choice.

    Columns: effect, gain, gain_low, gain_high (held-out log score per impact over the law that fits the training trials
    best, nats, with the 95 % interval), standing (`FOUND`, `ALIKE`, `REJECTED` or `OTHER`), why.
    """
    first = critique.discovery.first
    if first is None or len(first.quick) < 2:
        return pd.DataFrame(columns=list(COLUMNS))
    alone = judge(max(first.contenders, key=lambda fitted: fitted.score), critique.held_out)
    rows = []
    for name, fitted in first.quick.items():
        judged = judge(fitted, critique.held_out)
        gain = gain_an_impact(judged, alone)
        rows.append((name, *gain, *_standing(critique, name, judged, alone, gain[1])))
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("gain", ascending=False, ignore_index=True)


def _standing(
    critique: DropsCritique, name: str, judged: Judgement, alone: Judgement, gain_low: float
) -> tuple[str, str]:
    """Standing of a candidate, and the reason for or against it."""
    discovery, settings = critique.discovery, critique.settings
    falls = [channel for channel in CHANNELS if channel_is_material(judged, alone, channel, settings)]
    for step in discovery.steps:
        if name == step.effect.name:
            own = [channel for channel in falls if channel in concerned(step.effect)]
            return FOUND, f"lowers errors of {_errors(own)}" if own else "predicts held-out trials better"
        if name in step.alternatives:
            return ALIKE, f"these data cannot tell it from “{effect_title(step.effect.name)}”"
    for one in discovery.rejected:
        if name == one.step.effect.name:
            spoilt = spoilt_channels(one.judged, one.than, settings)
            return REJECTED, f"raises errors of {_errors(spoilt)}" if spoilt else "lowers no held-out error"
    if gain_low <= 0.0:
        return OTHER, "is not significant on held-out trials"
    if spoilt := spoilt_channels(judged, alone, settings):
        return OTHER, f"raises errors of {_errors(spoilt)}"
    if not falls:
        return OTHER, "lowers no error by an amount that matters"
    if discovery.steps:
        return OTHER, f"too little is left for it with {listed([effect_title(s.effect.name) for s in discovery.steps])}"
    if gain_low > gain_by_chance(critique):
        return OTHER, "predicts better, but raises another error on the training trials"
    return OTHER, "gains no more than the best candidate does by chance"


def gain_by_chance(critique: DropsCritique) -> float:
    """Gain in nats per impact that the best of all candidates exceeds by chance in a share α of the cases."""
    null = critique.discovery.first_scan.null
    return float(np.quantile(null, 1.0 - critique.settings.alpha)) / len(critique.training)


def _errors(channels: Sequence[str]) -> str:
    return listed([CHANNELS[name].short.removeprefix("the ").removesuffix(" between impacts") for name in channels])


@dataclass(frozen=True)
class Choice:
    """A model with some of the effects that can be switched, and its held-out judgement."""

    effects: tuple[str, ...]
    fitted: Fit
    judged: Judgement


def choices(critique: DropsCritique, candidates: pd.DataFrame) -> list[Choice]:
    """All choices, with few effects first; none if no effect or more than `MOST` were found.

    Models of the ladder are reused.  The others are fitted to the training trials, starting from the final model; all
    are judged on the held-out trials.  A choice without any of the effects found has the base law, the others have the
    law of the final model.  `candidates`: the table of the function of this name.
    """
    found = [step.effect for step in critique.discovery.steps]
    if not 0 < len(found) <= MOST:
        return []
    training, unseen = Drops(critique.training, critique.settings), Drops(critique.held_out, critique.settings)
    rivals = candidates[candidates["standing"].isin((ALIKE, OTHER)) & (candidates["gain"] > 0.0)]["effect"]
    every = [*found, *(training.candidates[name] for name in rivals[: MOST - len(found)][:1])]
    final, base = critique.ladder[-1][1], critique.discovery.base
    known = {frozenset(e.name for e in fitted.effects): (fitted, judged) for _, fitted, judged in critique.ladder}
    chosen = list(chain.from_iterable(combinations(every, n) for n in range(len(every) + 1)))
    missing = [one for one in chosen if frozenset(e.name for e in one) not in known]
    laws = [final.base if any(effect in found for effect in one) else base for one in missing]
    fits = training.fits([(law, one, final.values, "near") for law, one in zip(laws, missing)])
    known |= {frozenset(e.name for e in fitted.effects): (fitted, unseen.judge(fitted)) for fitted in fits}
    names = [tuple(effect.name for effect in one) for one in chosen]
    return [Choice(one, *known[frozenset(one)]) for one in names]


def choices_table(made: list[Choice]) -> pd.DataFrame:
    """Table of choices: effects (joined by +, or `NOTHING`), law, held-out error with its 95 % interval in m/s."""
    rows = [
        (" + ".join(one.effects) or NOTHING, one.fitted.base, *clustered_mean(one.judged.error, one.judged.trial))
        for one in made
    ]
    return pd.DataFrame(rows, columns=["effects", "law", "error", "error_low", "error_high"])
