"""What a search has chosen, and how it does on held-out data."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Generic

import numpy as np

from thesis_lib.critique.selection.scan import Scan
from thesis_lib.critique.selection.world import E, F, J, Judgement, World
from thesis_lib.statistics.bootstrap import bootstrap_gain


@dataclass(frozen=True)
class Step(Generic[E, F, J]):
    """One chosen effect.

    Attributes:
        alternatives: names that the data cannot tell from it, nearest first.
        clears: whether it passes all three tests; false only for an effect switched on by hand.
        p_value: of its gain against the null of the largest gain.
        gain: held-out gain per unit by K-fold with 95 % interval, nats.
        fitted: the model with it, on all training trials; judged: by K-fold.
        scan: score tests before it was added.
    """

    effect: E
    alternatives: tuple[str, ...]
    clears: bool
    p_value: float
    gain: tuple[float, float, float]
    fitted: F
    judged: J
    scan: Scan


@dataclass
class Path(Generic[E, F, J]):
    """How far a search has come, and as it was before a base of the reserve was taken (`simpler`)."""

    base: str
    fitted: F
    judged: J
    steps: list[Step[E, F, J]] = field(default_factory=list)
    dropped: set[str] = field(default_factory=set)
    first_scan: Scan | None = None
    below: F | None = None
    simpler: "Path[E, F, J] | None" = None

    def remember(self, step: Step[E, F, J] | None) -> None:
        """Keep a copy, with a step that would have entered, unless there is one."""
        if self.simpler is None:
            known = [one for one in self.steps if step is None or one.effect.name != step.effect.name]
            copy = replace(self, steps=[*known, *([step] if step else [])], dropped=set(self.dropped))
            if step:
                copy.fitted, copy.judged = step.fitted, step.judged
            self.simpler = copy


@dataclass(frozen=True)
class Discovery(Generic[E, F, J]):
    """The chosen model and the steps that led to it.

    Attributes:
        bases: by name, the fit without effects; base: name of the best.
        first_scan, last_scan: score tests at the best base and at the final model.
        below: fit with a significant but immaterial effect, at which the search ended.
        not_testable: name -> why.
    """

    bases: dict[str, F]
    base: str
    steps: tuple[Step[E, F, J], ...]
    first_scan: Scan
    last_scan: Scan
    below: F | None
    not_testable: Mapping[str, str]

    @property
    def fitted(self) -> F:
        """The final model."""
        return self.steps[-1].fitted if self.steps else self.bases[self.base]

    def verdict(self, is_structured: bool) -> str:
        """adequate, effects or unexplained; `is_structured`: something that matters remains."""
        if is_structured:
            return "unexplained"
        return "effects" if any(step.clears for step in self.steps) else "adequate"


def judge_held_out(
    training: World[E, F, J], held_out: World[E, F, J], discovery: Discovery[E, F, J]
) -> tuple[tuple[tuple[str, F, J], ...], dict[str, J]]:
    """Held-out judgements: the ladder (label, fit, judgement) after 0, 1, ... effects, and the worth of each effect.

    The latter is, by effect, the judgement of the final model refitted without it.
    """
    fits = [("no effect", discovery.bases[discovery.base])]
    fits += [(step.effect.name, step.fitted) for step in discovery.steps]
    ladder = tuple((label, fitted, held_out.judge(fitted)) for label, fitted in fits)
    final, without = discovery.fitted, {}
    for step in discovery.steps:
        others = tuple(e for e in final.effects if e.name != step.effect.name)
        without[step.effect.name] = held_out.judge(training.fit(final.base, others, final.values, "near"))
    return ladder, without


def paired_gain(
    better: Judgement, worse: Judgement, rng: np.random.Generator, draws: int = 999
) -> tuple[float, float, float]:
    """Gain of log score per unit in nats, with a 95 % interval from the bootstrap over trials."""
    difference = better.by_trial(better.trials) - worse.by_trial(better.trials)
    return bootstrap_gain(difference, better.units, draws, rng)
