"""The model with each choice of the effects that were found and of their closest rival: what a reader can switch.

Choices that are rungs of the ladder are taken from it.  The others are fitted to the training trials, from where the
final model stands; all are judged on the held-out ones.  Without any of the effects found the law is the base law, with
one of them that of the final model.
"""

from dataclasses import dataclass
from itertools import chain, combinations

import pandas as pd

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.judgement import Judgement
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.results.candidates import ALIKE, OTHER
from thesis_lib.statistics.intervals import clustered_mean

MOST = 3  # effects that can be switched, for each choice is a fit
NOTHING = "no effect"
COLUMNS = ("effects", "law", "error", "error_low", "error_high")


@dataclass(frozen=True)
class Choice:
    """A model with the named effects of those that can be switched, and its held-out judgement."""

    effects: tuple[str, ...]
    fitted: Fit
    judged: Judgement


def choices(critique: DropsCritique, candidates: pd.DataFrame) -> list[Choice]:
    """All choices, with few effects first; none where no effect was found, or more than `MOST` were.

    `candidates`: the table of `thesis_lib.critique.results.candidates`.
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
    """A row for each choice: effects (joined by +, or `NOTHING`), law, held-out error with its 95 % interval in m/s."""
    rows = [
        (" + ".join(one.effects) or NOTHING, one.fitted.base, *clustered_mean(one.judged.error, one.judged.trial))
        for one in made
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))
