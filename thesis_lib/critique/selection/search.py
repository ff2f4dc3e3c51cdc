"""Forward selection of missing effects with a backward check.

1. Every base is fitted and judged by K-fold over training trials; the search starts from the best.
2. Each step screens all candidates by score tests and quick fits.  The best few are fitted with *all* parameters
   free, and the best three of those are judged by K-fold.  Best is the gain less one nat for each parameter, which is
   what K-fold will find of it (Akaike 1974, doi:10.1109/TAC.1974.1100705; Stone 1977,
   doi:10.1111/j.2517-6161.1977.tb01603.x).
3. An effect enters if its gain exceeds the null of the largest gain, its held-out gain has a 95 % interval above zero,
   and it lowers a held-out error materially.  A gain near the null is corrected by refits to data without the effect.
4. Then the other bases are tried again, and an earlier effect that has become superfluous leaves.
5. Where a model leaves an error, a base of the reserve takes the place of its base if it predicts clearly better than
   the next effect would.

Random streams are named by effects, so that a further candidate changes no draw of the others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic

import numpy as np

from thesis_lib.critique.selection.scan import Scan, scan
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import E, F, J, Judgement, World
from thesis_lib.foundation.randomness import generator
from thesis_lib.statistics.bootstrap import bootstrap_gain

JUDGED = 3  # finalists judged by K-fold
REFITS = 199  # of data drawn without the effect, if its gain is near the null
FAR_BEYOND = 3.0  # times the largest draw of the null: refits stretch no gain this far


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


@dataclass(frozen=True)
class Discovery(Generic[E, F, J]):
    """The chosen model and the steps that led to it.

    Attributes:
        bases: by name, fit and K-fold judgement without effects; base: name of the best.
        first_scan, last_scan: score tests at the best base and at the final model.
        below: fit with a significant but immaterial effect, at which the search ended.
        not_testable: name -> why.
    """

    bases: dict[str, tuple[F, J]]
    base: str
    steps: tuple[Step[E, F, J], ...]
    first_scan: Scan
    last_scan: Scan
    below: F | None
    not_testable: Mapping[str, str]

    @property
    def fitted(self) -> F:
        """The final model."""
        return self.steps[-1].fitted if self.steps else self.bases[self.base][0]

    def verdict(self, is_structured: bool) -> str:
        """adequate, effects or unexplained; `is_structured`: something that matters remains."""
        if is_structured:
            return "unexplained"
        return "effects" if any(step.clears for step in self.steps) else "adequate"


def split(trials: np.ndarray, share: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the training and of the held-out trials; at least two of each if there are four."""
    order = rng.permutation(trials)
    count = min(max(2, round(share * len(trials))), len(trials) - 2)
    return order[count:], order[:count]


def search(
    world: World[E, F, J],
    settings: SearchSettings,
    rng: np.random.Generator,
    fixed: Sequence[str] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> Discovery[E, F, J]:
    """Choose base and effects on the training trials of `world`.

    Args:
        rng: draws the folds and seeds the named streams.
        fixed: effects to switch on, in this order, instead of the automatic choice.
        say: receives a line for each step.
    """
    return _Search(world, settings, rng, say).run(fixed)


def judge_held_out(
    training: World[E, F, J], held_out: World[E, F, J], discovery: Discovery[E, F, J]
) -> tuple[tuple[tuple[str, F, J], ...], dict[str, J]]:
    """Held-out judgements: the ladder (label, fit, judgement) after 0, 1, ... effects, and the worth of each effect.

    The latter is, by effect, the judgement of the final model refitted without it.
    """
    fits = [("no effect", discovery.bases[discovery.base][0])]
    fits += [(step.effect.name, step.fitted) for step in discovery.steps]
    ladder = tuple((label, fitted, held_out.judge(fitted)) for label, fitted in fits)
    final, without = discovery.fitted, {}
    for step in discovery.steps:
        others = tuple(e for e in final.effects if e.name != step.effect.name)
        without[step.effect.name] = held_out.judge(training.fit(final.base, others, final.values))
    return ladder, without


def paired_gain(
    better: Judgement, worse: Judgement, rng: np.random.Generator, draws: int = 999
) -> tuple[float, float, float]:
    """Gain of log score per unit in nats, with a 95 % interval from the bootstrap over trials."""
    difference = better.by_trial(better.trials) - worse.by_trial(better.trials)
    return bootstrap_gain(difference, better.units, draws, rng)


class _Search(Generic[E, F, J]):
    """State that stays fixed during the search: data, thresholds, folds and seed."""

    def __init__(
        self, world: World[E, F, J], settings: SearchSettings, rng: np.random.Generator, say: Callable[[str], None]
    ) -> None:
        self.world, self.settings, self.say = world, settings, say
        n = len(world.trials)
        self.folds = rng.permutation(np.arange(n) % min(settings.folds, n))
        self.seed = int(rng.integers(2**63))

    def run(self, fixed: Sequence[str] | None) -> Discovery[E, F, J]:
        world = self.world
        fits = {name: world.fit(name, ()) for name in world.bases}
        bases = {name: (fitted, world.cross_validate(fitted, self.folds)) for name, fitted in fits.items()}
        ranked = sorted(bases, key=lambda name: -bases[name][1].total)
        fitted, judged = bases[ranked[0]]
        most = self.settings.max_effects if fixed is None else len(fixed)
        if (fixed is not None or not most) and (other := self.other_base(fitted, judged, None)):
            bases[other[0].base] = fitted, judged = other
        base = fitted.base
        steps: list[Step[E, F, J]] = []
        dropped: set[str] = set()
        first_scan = below = None
        while len(steps) < most:
            taken = {step.effect.name for step in steps} | dropped
            candidates = [e for e in world.candidates.values() if e.name not in taken]
            if fixed is not None:
                candidates = [world.candidates[fixed[len(steps)]]]
            if not candidates:
                break
            on = [step.effect.name for step in steps]
            tests = self.scan(fitted, candidates, "null", *on)
            first_scan = first_scan or tests
            self.say(f"step {len(steps) + 1}: trying {len(candidates)} effects")
            # a missing effect may favour the wrong base: the next best bases are tried with it, too
            contenders = [fitted] if steps else [bases[name][0] for name in ranked[: world.rivals]]
            if fitted.base in world.reserve:
                contenders = [world.fit(fitted.base, fitted.effects, fitted.values, quick=True)]
            if fixed is None and world.leaves_little(fitted, judged):
                candidates = self.worth_a_fit(candidates, tests)
            step, below = self.best_step(fitted, judged, contenders, candidates, tests, fixed is not None)
            if fixed is None and (other := self.other_base(fitted, judged, step)):
                fitted, judged = other
                self.say(f"step {len(steps) + 1}: another base, {fitted.base}")
                if steps:
                    steps[-1] = replace(steps[-1], fitted=fitted, judged=judged)
                else:
                    bases[fitted.base], base = other, fitted.base
                continue
            if step is None:
                break
            step = self.with_best_base(step)
            self.say(f"step {len(steps) + 1}: {step.effect.name} ({step.gain[0]:.2f} nats an {world.unit})")
            steps.append(step)
            superfluous = self.superfluous(steps) if fixed is None else None
            if superfluous:
                self.say(f"not needed any more: {superfluous}")
                dropped.add(superfluous)
                steps = self.without(steps, superfluous)
            fitted, judged = steps[-1].fitted, steps[-1].judged
        taken = {step.effect.name for step in steps}
        rest = [e for e in world.candidates.values() if e.name not in taken]
        last_scan = self.scan(fitted, rest, "last null")
        return Discovery(bases, base, tuple(steps), first_scan or last_scan, last_scan, below, world.not_testable)

    def other_base(self, fitted: F, judged: J, step: Step[E, F, J] | None) -> tuple[F, J] | None:
        """Fit and judgement of a base of the reserve with the same effects, if it predicts better than the next effect.

        `step` is that with the next effect; None if there is none.
        """
        world, least = self.world, self.settings.tell_apart
        rival, to_beat = (step.fitted, step.judged) if step else (fitted, judged)
        quick = [] if fitted.base in world.reserve else world.reserve_fits(fitted, to_beat)
        if not quick:
            return None
        best = max(quick, key=lambda fit: fit.score)
        best = world.fit(best.base, best.effects, best.values)
        if best.score - rival.score < least:
            return None
        other = world.cross_validate(best, self.folds)
        gain = self.gain(other, to_beat, "reserve", best.base)
        return (best, other) if gain[1] > 0.0 and other.total - to_beat.total > least else None

    def worth_a_fit(self, candidates: Sequence[E], tests: Scan) -> list[E]:
        """The candidates whose score test comes within half of what is significant.

        Where a model leaves little, slopes at the null mean what they say; a base of the reserve is chosen there.
        """
        least = 0.5 * np.quantile(tests.null, 1.0 - self.settings.alpha)
        return [e for e in candidates if tests.gain[e.name] >= least]

    def scan(self, fitted: F, candidates: Sequence[E], *stream: str) -> Scan:
        slopes = self.world.slopes(fitted, candidates)
        return scan(slopes, self.world.resamples, generator(self.seed, *stream))

    def gain(self, better: J, worse: J, *stream: str) -> tuple[float, float, float]:
        return paired_gain(better, worse, generator(self.seed, *stream), self.world.resamples)

    def best_step(
        self, fitted: F, judged: J, contenders: Sequence[F], candidates: Sequence[E], tests: Scan, forced: bool
    ) -> tuple[Step[E, F, J] | None, F | None]:
        """The step that enters, or None and the fit with a significant but immaterial effect."""
        world, settings = self.world, self.settings
        by_name = {e.name: e for e in candidates}
        on = [e.name for e in fitted.effects]

        def quick_fits(e: E) -> list[F]:
            return [world.fit(f.base, (*f.effects, e), world.start_with(f, e), quick=True) for f in contenders]

        quick = {e.name: max(quick_fits(e), key=lambda fit: fit.score) for e in candidates}
        # quick fits rank better than score tests: far from the null a robust fit may treat as outliers what the
        # effect explains, and the slope at the null then means nothing
        cost = {name: len(fit.values) - len(fitted.values) for name, fit in quick.items()}
        names = sorted(quick, key=lambda name: cost[name] - quick[name].score)[: settings.finalists]
        bases = {name: fitted.base if fitted.base in world.reserve else quick[name].base for name in names}
        full = {name: world.fit(bases[name], quick[name].effects, quick[name].values) for name in names}
        # relative to the best base without the effect: a rival that fits better by itself is no gain of the effect
        best = max([fitted, *contenders], key=lambda fit: fit.score)
        gains = {name: world.quick_gain(fit, contenders) for name, fit in quick.items()}
        gains |= {name: fit.score - best.score for name, fit in full.items()}
        names = sorted(names, key=lambda name: cost[name] - gains[name])[:JUDGED]
        judgements = {name: world.cross_validate(full[name], self.folds) for name in names}
        below = None
        for name in sorted(names, key=lambda name: -judgements[name].total):
            e, judgement = by_name[name], judgements[name]
            gain = self.gain(judgement, judged, "gain", *on, name)
            p_value = tests.p_value(gains[name])
            significant = gain[1] > 0.0 and p_value <= settings.alpha
            material = world.is_material(judgement, judged, e, settings)
            if significant and not material:
                below = below or full[name]
            if significant and material and gains[name] < FAR_BEYOND * tests.null.max():
                stretch = self.stretch_of_null(best, e, tests, generator(self.seed, "refits", *on, name))
                p_value = tests.p_value(gains[name] / stretch)
                significant = p_value <= settings.alpha
            clears = significant and material
            if forced or clears:
                others = self.alternatives(name, gains, tests)
                return Step(e, others, clears, p_value, gain, full[name], judgement, tests), None
        return None, below

    def stretch_of_null(self, fitted: F, effect: E, tests: Scan, rng: np.random.Generator) -> float:
        """Mean gain of `REFITS` full refits to data drawn without the effect, over that of the score test; at least 1.

        The mean gain of the score test is half the number of its columns (Bartlett's correction).
        """
        gains = []
        for _ in range(REFITS):
            drawn = self.world.drawn(fitted, rng)
            if drawn is None:
                return 1.0
            plain = drawn.fit(fitted.base, fitted.effects, fitted.values, quick=True)
            with_it = drawn.fit(fitted.base, (*fitted.effects, effect), plain.values, quick=True)
            gains.append(with_it.score - plain.score)
        expected = 0.5 * max(tests.basis[effect.name].shape[1], 1)
        return max(1.0, float(np.mean(np.maximum(gains, 0.0))) / expected)

    def alternatives(self, name: str, gains: Mapping[str, float], tests: Scan) -> tuple[str, ...]:
        """Effects that would explain the same on this design, nearest first."""
        # the observed difference counts as well as the expected one
        loss = {
            other: max(tests.expected_loss(name, other), gains[name] - gains.get(other, tests.gain[other]))
            for other, columns in tests.basis.items()
            if other != name and columns.shape[1]
        }
        return tuple(other for other in sorted(loss, key=lambda o: loss[o]) if loss[other] < self.settings.tell_apart)

    def with_best_base(self, step: Step[E, F, J]) -> Step[E, F, J]:
        """The step with the base that fits best with the effect; without it another base may have compensated."""
        world, fitted, least = self.world, step.fitted, self.settings.tell_apart
        if len(world.bases) == 1:
            return step
        fits = {name: world.fit(name, fitted.effects, fitted.values) for name in world.bases}
        best = max(fits, key=lambda name: fits[name].score)
        if best == fitted.base or fits[best].score - fitted.score < least:
            return step
        judged = world.cross_validate(fits[best], self.folds)
        if judged.total - step.judged.total < least:
            return step
        return replace(step, fitted=fits[best], judged=judged)

    def superfluous(self, steps: Sequence[Step[E, F, J]]) -> str | None:
        """The first earlier effect that the last one makes superfluous, or None (backward check)."""
        world, last = self.world, steps[-1]
        names = [step.effect.name for step in steps]
        for step in steps[:-1]:
            others = tuple(e for e in last.fitted.effects if e.name != step.effect.name)
            smaller = world.fit(last.fitted.base, others, last.fitted.values)
            judged = world.cross_validate(smaller, self.folds)
            gain = self.gain(last.judged, judged, "needed", *names, step.effect.name)
            if gain[1] <= 0.0 or not world.is_material(last.judged, judged, step.effect, self.settings):
                return step.effect.name
        return None

    def without(self, steps: Sequence[Step[E, F, J]], name: str) -> list[Step[E, F, J]]:
        """The steps without one effect; all later ones are fitted and judged again."""
        at = [step.effect.name for step in steps].index(name)
        kept = list(steps[:at])
        for step in steps[at + 1 :]:
            effects = (*(earlier.effect for earlier in kept), step.effect)
            fitted = self.world.fit(step.fitted.base, effects, step.fitted.values)
            judged = self.world.cross_validate(fitted, self.folds)
            kept.append(replace(step, fitted=fitted, judged=judged))
        return kept
