"""Result of a search, and its judgement on held-out data."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from typing import Generic, Literal

import numpy as np

from thesis_lib.critique.selection.scan import Scan
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import E, F, HeldOutScores, J, World
from thesis_lib.statistics.bootstrap import bootstrap_gain

KEPT = 12  # fits of the first step that are kept: enough for a figure
# no better than chance; no error falls by an amount that matters; an error rises by such an amount
Failure = Literal["chance", "immaterial", "spoils"]


@dataclass(frozen=True)
class Step(Generic[E, F, J]):
    """One chosen effect.

    Attributes:
        alternatives: names of effects that the data cannot tell from it, nearest first.
        fails: the test that it does not pass; None unless it was switched on by hand.
        p_value: of its gain against the null of the largest gain.
        gain: held-out gain per unit by K-fold with 95 % interval, nats.
        fitted: the model with it, on all training trials; judged: by K-fold.
        scan: score tests before it was added.
    """

    effect: E
    alternatives: tuple[str, ...]
    fails: Failure | None
    p_value: float
    gain: tuple[float, float, float]
    fitted: F
    judged: J
    scan: Scan

    @property
    def clears(self) -> bool:
        """Whether it passes all tests."""
        return self.fails is None


@dataclass(frozen=True)
class Rejected(Generic[E, F, J]):
    """An effect that the held-out trials reject: the model with it is `judged` no better `than` that without it."""

    step: Step[E, F, J]
    judged: J
    than: J


@dataclass(frozen=True)
class Shortlist(Generic[F]):
    """Fits from which a step chooses.

    Attributes:
        quick: best quick fit with each candidate, by its name, best first.
        contenders: models without any of the candidates, with which the fits are compared.
        tests: score tests, with the null that counts all candidates.
        base: base of the fits that are judged, if the quick fits have another one.
        alike: candidates that explain the same as the first; None: determined by the tests.
    """

    quick: Mapping[str, F]
    contenders: Sequence[F]
    tests: Scan
    base: str | None = None
    alike: tuple[str, ...] | None = None

    def best(self) -> "Shortlist[F]":
        """The same with the `KEPT` best fits."""
        return replace(self, quick=dict(islice(self.quick.items(), KEPT)))


@dataclass
class Path(Generic[E, F, J]):
    """State of a search, and its state before a base of the reserve was taken (`simpler`).

    `first`: best fits from which the first step chose.  `entered`: number of effects that have entered; `left`: that
    number each time an effect left, by the name of the effect.  `ended`: whether no effect enters; `shortlist`: fits
    from which the next step chooses, if known.
    """

    base: str
    fitted: F
    judged: J
    steps: list[Step[E, F, J]] = field(default_factory=list)
    entered: int = 0
    left: dict[str, list[int]] = field(default_factory=dict)
    first: Shortlist[F] | None = None
    below: F | None = None
    ended: bool = False
    shortlist: Shortlist[F] | None = None
    simpler: "Path[E, F, J] | None" = None

    def drop(self, name: str) -> None:
        """Note that an effect leaves."""
        self.left.setdefault(name, []).append(self.entered)

    def simpler_within(self, effects: int) -> "Path[E, F, J] | None":
        """The path before a base of the reserve was taken, if fewer than `effects` effects were found with that."""
        return self.simpler if self.simpler and len(self.steps) < len(self.simpler.steps) + effects else None

    @property
    def barred(self) -> set[str]:
        """Effects that left and may not enter again: until another one has entered; never if they left twice."""
        return {name for name, at in self.left.items() if len(at) > 1 or at[-1] == self.entered}

    def remember(self, step: Step[E, F, J] | None, shortlist: Shortlist[F] | None) -> None:
        """Keep a copy as `simpler`, unless there is one, with the step that would have entered or its shortlist."""
        if self.simpler is None:
            known = [one for one in self.steps if step is None or one.effect.name != step.effect.name]
            copy = replace(
                self, steps=[*known, *([step] if step else [])], left={name: list(at) for name, at in self.left.items()}
            )
            if step:
                copy.fitted, copy.judged = step.fitted, step.judged
            else:
                copy.shortlist = shortlist
            self.simpler = copy


@dataclass(frozen=True)
class Discovery(Generic[E, F, J]):
    """The chosen model and the steps that led to it.

    Attributes:
        bases: fit without effects of each base, by name; base: name of the best.
        first: best fits from which the first step chose; None if there was no choice.
        last_scan: score tests at the final model.
        below: fit with a significant but immaterial effect, at which the search ended.
        not_testable: name -> why.
        limit: `max_effects`, if the search ended there although more may be found; rejected: by the held-out trials.
    """

    bases: dict[str, F]
    base: str
    steps: tuple[Step[E, F, J], ...]
    first: Shortlist[F] | None
    last_scan: Scan
    below: F | None
    not_testable: Mapping[str, str]
    limit: int | None = None
    rejected: tuple[Rejected[E, F, J], ...] = ()

    @property
    def first_scan(self) -> Scan:
        """Score tests at the best base."""
        return self.first.tests if self.first else self.last_scan

    @property
    def fitted(self) -> F:
        """The final model."""
        return self.steps[-1].fitted if self.steps else self.bases[self.base]

    def each(self, change: Callable[[F], F]) -> "Discovery[E, F, J]":
        """The same with each fit changed."""
        bases = {name: change(fitted) for name, fitted in self.bases.items()}
        return replace(self, bases=bases, steps=tuple(replace(s, fitted=change(s.fitted)) for s in self.steps))

    def with_open_alternatives(self) -> "Discovery[E, F, J]":
        """The same without alternatives that the final model contains: it needs both, so they are distinguishable."""
        held = {step.effect.name for step in self.steps}
        return replace(
            self,
            steps=tuple(
                replace(step, alternatives=tuple(name for name in step.alternatives if name not in held))
                for step in self.steps
            ),
        )

    def verdict(self, is_structured: bool) -> str:
        """adequate, effects or unexplained; `is_structured`: an error that matters remains."""
        if is_structured:
            return "unexplained"
        return "effects" if any(step.clears for step in self.steps) else "adequate"


def judge_held_out(
    training: World[E, F, J],
    held_out: World[E, F, J],
    discovery: Discovery[E, F, J],
    settings: SearchSettings,
    by_hand: bool = False,
) -> tuple[Discovery[E, F, J], tuple[tuple[str, F, J], ...], dict[str, J]]:
    """Confirmed discovery, held-out ladder (label, fit, judgement), and judgement of the model without each effect.

    The last is, by effect, that of the final model refitted without it.  An effect is rejected if it raises a held-out
    error by an amount that matters, compared with an earlier model of the ladder or with the model without it, or if it
    lowers none by `confirmed` of such an amount; one that was switched on `by_hand` stays, but fails.  Effects are
    rejected one by one, first the last of those without which the final model is better, and the others are fitted
    again.  Held-out data have no other influence: they remove an effect, but choose none, and fit nothing.
    """
    part = {name: settings.confirmed * getattr(settings, name) for name in ("material_share", "material_floor")}
    confirming = settings.model_copy(update=part)
    fits = [("no effect", discovery.bases[discovery.base])]
    fits += [(step.effect.name, step.fitted) for step in discovery.steps]
    ladder = tuple((label, fitted, held_out.judge(fitted)) for label, fitted in fits)
    while True:
        final, without = discovery.fitted, {}
        spoiled: dict[int, tuple[J, J]] = {}  # by number of a step: with it, and the better one
        alone = []  # numbers of steps without which the final model is better
        rests = [tuple(e for e in final.effects if e.name != step.effect.name) for step in discovery.steps]
        fits = training.fits([(final.base, rest, final.values, "near") for rest in rests])
        for i, (step, fitted) in enumerate(zip(discovery.steps, fits)):
            smaller = without[step.effect.name] = held_out.judge(fitted)
            idle = not by_hand and not held_out.is_material(ladder[-1][2], smaller, step.effect, confirming)
            if idle or held_out.is_vetoed(ladder[-1][2], smaller, settings):
                spoiled[i] = ladder[-1][2], smaller
                alone.append(i)
            else:
                # an error that this effect has raised, not an earlier one
                rungs = [than for _, _, than in ladder[: i + 1] if held_out.is_vetoed(ladder[i + 1][2], than, settings)]
                if held_out.forgives_rungs:
                    rungs = [than for than in rungs if held_out.is_vetoed(ladder[-1][2], than, settings)]
                if worse := [than for than in rungs if not held_out.is_vetoed(ladder[i][2], than, settings)]:
                    spoiled[i] = ladder[i + 1][2], worse[0]
        steps = discovery.steps
        if by_hand:
            failed = tuple(
                replace(step, fails=step.fails or "spoils") if i in spoiled else step for i, step in enumerate(steps)
            )
            return replace(discovery, steps=failed), ladder, without
        if not spoiled:
            return discovery.with_open_alternatives(), ladder, without
        at = max(alone) if alone else min(spoiled)
        rejected = Rejected(steps[at], *spoiled[at])
        kept, scan = _fitted_without(training, steps, at), steps[at].scan
        if at < len(kept):
            scan = discovery.last_scan.with_one_of(scan, steps[at].effect.name)
        discovery = replace(
            discovery, steps=kept, last_scan=scan, below=None, limit=None, rejected=(rejected, *discovery.rejected)
        )
        rungs = [(step.effect.name, step.fitted, held_out.judge(step.fitted)) for step in kept[at:]]
        ladder = (*ladder[: at + 1], *rungs)


def _fitted_without(training: World[E, F, J], steps: Sequence[Step[E, F, J]], at: int) -> tuple[Step[E, F, J], ...]:
    """The steps without step number `at`; later ones are fitted again, the last one until nothing changes."""
    kept = list(steps[:at])
    for step in steps[at + 1 :]:
        effects, effort = (*(one.effect for one in kept), step.effect), "full" if step is steps[-1] else "near"
        kept.append(replace(step, fitted=training.fit(step.fitted.base, effects, step.fitted.values, effort)))
    return tuple(kept)


def paired_gain(
    better: HeldOutScores, worse: HeldOutScores, rng: np.random.Generator, draws: int = 999
) -> tuple[float, float, float]:
    """Gain of log score per unit in nats, with a 95 % interval from the bootstrap over trials."""
    difference = better.by_trial(better.trials) - worse.by_trial(better.trials)
    return bootstrap_gain(difference, better.units, draws, rng)
