"""The effects that came first when one was asked for, each alone with the law that suits it: gain on held-out trials.

They are the first in the order of the quick fits from which the search chose (`Shortlist`).  Held-out data only show
here what each of them gains; they choose none.  `why` says what speaks for those
that were found, and against the others.
"""

from collections.abc import Sequence

import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.judgement import Judgement, channel_is_material, judge, spoilt_channels
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.results.numbers import gain_an_impact
from thesis_lib.critique.results.titles import effect_title
from thesis_lib.statistics.wording import listed

FOUND, ALIKE, REJECTED, OTHER = "found", "cannot be told from it", "rejected", "not needed"
COLUMNS = ("effect", "gain", "gain_low", "gain_high", "standing", "why")


def candidates(critique: DropsCritique) -> pd.DataFrame:
    """A row for each of the first candidates, the largest gain first; none where the search had no choice.

    Columns: effect, gain, gain_low, gain_high (held-out log score an impact over the law that fits the training trials
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
            return FOUND, f"lowers errors of {_errors(falls)}" if falls else "predicts unseen trials better"
        if name in step.alternatives:
            return ALIKE, f"these data cannot tell it from “{effect_title(step.effect.name)}”"
    for one in discovery.rejected:
        if name == one.step.effect.name:
            spoilt = spoilt_channels(one.judged, one.than, settings)
            return REJECTED, f"raises errors of {_errors(spoilt)}" if spoilt else "lowers no held-out error"
    if gain_low <= 0.0:
        return OTHER, "predicts unseen trials no better"
    if spoilt := spoilt_channels(judged, alone, settings):
        return OTHER, f"raises errors of {_errors(spoilt)}"
    if not falls:
        return OTHER, "lowers no error by an amount that matters"
    if discovery.steps:
        return OTHER, f"too little is left for it with {listed([effect_title(s.effect.name) for s in discovery.steps])}"
    return OTHER, "gains no more than the best of all does by chance"


def _errors(channels: Sequence[str]) -> str:
    return listed([CHANNELS[name].short.removeprefix("the ").removesuffix(" between impacts") for name in channels])
