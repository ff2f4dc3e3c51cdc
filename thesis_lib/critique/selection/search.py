"""Forward selection of missing effects with a backward check.

1. Every base is fitted and judged by K-fold over training trials; the search starts from the best.
2. Each step screens all candidates by score tests and quick fits.  The best few are fitted to all data with *all*
   parameters free, and the best of those are judged by K-fold.  Best is the gain less one nat for each parameter, which
   is what K-fold will find of it (Akaike 1974, doi:10.1109/TAC.1974.1100705; Stone 1977,
   doi:10.1111/j.2517-6161.1977.tb01603.x).
3. An effect enters if its gain exceeds the null of the largest gain, its held-out gain has a 95 % interval above zero,
   and it lowers a held-out error materially and raises none so.  A gain near the null is corrected by refits to data
   without the effect.  Bases that take the place of another one raise none, either.
4. Then the other bases are tried again, and an earlier effect that has become superfluous leaves.
5. Where a model leaves an error, a base of the reserve takes the place of its base if it predicts clearly better than
   the next effect would.  Where quick fits say that it gains far more than any effect, no effect is judged before it.
   Where a step leaves an error, the next best effects are tried with these bases, too.  If an error is left in the
   end, the search goes on without the reserve from where it was taken, and the better of the two ends counts.
6. Effects that were found on a simpler base are fitted once more on the reserve, and stay there if it predicts better.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Generic

import numpy as np

from thesis_lib.critique.selection.discovery import Discovery, Path, Step
from thesis_lib.critique.selection.evidence import Drop, Evidence
from thesis_lib.critique.selection.scan import Scan
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import E, F, J, World

JUDGED = 3  # finalists judged by K-fold first; the others if none of these enters
HOPELESS = 0.3  # of the quick gain of the best: candidates with less are no finalists
RUNNERS_UP, NEARLY = 3, 0.8  # effects tried with bases of the reserve where the best leaves an error; of its quick gain
RIVALLED = 8  # candidates, the best by quick fits, that are tried with rival bases, too
FAR_BETTER = 1.2  # times the quick gain of the best effect: a base of the reserve with more is judged first
FAR_BEYOND = 3.0  # times the largest draw of the null: refits stretch no gain this far


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

    `rng` draws the folds and seeds the named streams.  `fixed` are effects to switch on, in this order, instead of the
    automatic choice.  `say` receives a line for each step.
    """
    return _Search(world, settings, rng, say).run(fixed)


class _Search(Generic[E, F, J]):
    """State that stays fixed during the search: data, thresholds and what counts as evidence."""

    def __init__(
        self, world: World[E, F, J], settings: SearchSettings, rng: np.random.Generator, say: Callable[[str], None]
    ) -> None:
        self.world, self.settings, self.say = world, settings, say
        self.evidence = Evidence(world, settings, rng)

    def run(self, fixed: Sequence[str] | None) -> Discovery[E, F, J]:
        world = self.world
        bases = {name: world.fit(name, (), effort="near") for name in world.bases}
        ranked = sorted(bases, key=lambda name: -bases[name].score)
        base, judgements = next(self.evidence.judged_in_turn(bases, ranked))
        judged = judgements[base]
        ranked = [base, *(name for name in ranked if name != base)]
        fitted = bases[base] = self.in_full(bases[base])
        path = Path(base, fitted, judged)
        if fixed is not None or not self.most(fixed):
            other = self.other_base(self.reserve(fitted), fitted, judged)
            if other:
                self.on_other_base(path, other, bases)
        path = self.extend(path, bases, ranked, fixed)
        if path.simpler is not None and world.leaves_an_error(path.judged):
            path = self.better_of(path, path.simpler, bases, ranked)
        if path.steps and (other := self.other_base(self.reserve(path.fitted, refine=True), path.fitted, path.judged)):
            self.on_other_base(path, other, bases, "useless" if fixed is None else "none")
        rest = [e for e in world.candidates.values() if e not in path.fitted.effects]
        last_scan = self.evidence.scan(path.fitted, rest, "last null")
        first_scan = path.first_scan or last_scan
        limit = None
        if fixed is None and len(path.steps) >= self.settings.max_effects:
            more = max(last_scan.gain.values(), default=0.0)
            limit = "max_effects" if last_scan.p_value(more) <= self.settings.alpha else None
        elif path.unasked:
            limit = "finalists"
        return Discovery(
            bases, path.base, tuple(path.steps), first_scan, last_scan, path.below, world.not_testable, limit
        )

    def most(self, fixed: Sequence[str] | None) -> int:
        """Most effects."""
        return self.settings.max_effects if fixed is None else len(fixed)

    def extend(
        self,
        path: Path[E, F, J],
        bases: dict[str, F],
        ranked: Sequence[str],
        fixed: Sequence[str] | None,
        with_reserve: bool = True,
    ) -> Path[E, F, J]:
        """Add effects to a path as long as one enters; the path."""
        world = self.world
        while len(path.steps) < self.most(fixed):
            fitted, judged, steps = path.fitted, path.judged, path.steps
            taken = {step.effect.name for step in steps} | path.dropped
            candidates = [e for e in world.candidates.values() if e.name not in taken]
            if fixed is not None:
                candidates = [world.candidates[fixed[len(steps)]]]
            if not candidates:
                break
            on = [step.effect.name for step in steps]
            tests = self.evidence.scan(fitted, candidates, "null", *on)
            path.first_scan = path.first_scan or tests
            number = len(steps) + 1
            self.say(f"step {number}: trying {len(candidates)} effects")
            # a missing effect may favour the wrong base: the next best bases are tried with it, too
            contenders = [fitted] if steps else [bases[name] for name in ranked[: world.rivals]]
            if fitted.base in world.reserve:
                contenders = [world.fit(fitted.base, fitted.effects, fitted.values, "quick")]
            if fixed is None:
                candidates = self.worth_a_fit(fitted, judged, candidates, tests)
            quick = self.quick_fits(contenders, candidates, fitted)
            # a base of the reserve is asked for where the best effect leaves an error, too
            best = next(iter(quick.values()), fitted)
            leaves = with_reserve and fixed is None and world.leaves_an_error(judged) and self.leaves_an_error(best)
            step, reserve = None, self.reserve(fitted) if leaves else []
            other: tuple[F, J] | None = self.far_better_base(reserve, quick, contenders, judged)
            if other is None:
                step, path.below, path.unasked = self.best_step(
                    fitted, judged, contenders, quick, tests, fixed is not None
                )
                if reserve and (step is None or world.leaves_an_error(step.judged)):
                    rival = step.fitted if step else fitted
                    other = self.other_base(reserve, rival, step.judged if step else judged)
            if other:
                path.remember(step)
            elif step:
                step = self.with_best_base(step)
                self.say(f"step {number}: {step.effect.name} ({step.gain[0]:.2f} nats an {world.unit})")
                steps.append(step)
                if with_reserve and fixed is None and world.reserve and world.leaves_an_error(step.judged):
                    steps[-1] = self.with_other_base(step, quick, contenders, judged)
                    if steps[-1] is not step:
                        other = (steps[-1].fitted, steps[-1].judged)
                        path.remember(step)
            if other:
                self.on_other_base(path, other, bases)
                continue
            if step is None:
                break
            if fixed is None and (name := self.evidence.superfluous(steps, steps[:-1])):
                self.say(f"not needed any more: {name}")
                path.dropped.add(name)
                path.steps = self.without(steps, name)
            path.fitted, path.judged = path.steps[-1].fitted, path.steps[-1].judged
        return path

    def better_of(
        self, path: Path[E, F, J], simpler: Path[E, F, J], bases: dict[str, F], ranked: Sequence[str]
    ) -> Path[E, F, J]:
        """The path on a base of the reserve, or that which goes on without it, if this ends better."""
        self.say(f"on {simpler.fitted.base} once more, with other effects")
        if simpler.steps:
            last = simpler.steps[-1] = self.with_best_base(simpler.steps[-1])
            simpler.fitted = last.fitted
        simpler = self.extend(simpler, bases, ranked, None, with_reserve=False)
        gain = self.evidence.gain(simpler.judged, path.judged, "simpler", simpler.base)
        errs_more = self.world.errs_more(simpler.judged, path.judged, self.settings)
        return simpler if gain[1] > 0.0 and not errs_more else path

    def leaves_an_error(self, fitted: F) -> bool:
        """Whether a model errs by more than noise where it was fitted."""
        return self.world.leaves_an_error(self.world.judge(fitted))

    def in_full(self, fitted: F) -> F:
        """The same model, fitted until nothing changes."""
        return self.world.fit(fitted.base, fitted.effects, fitted.values)

    def reserve(self, fitted: F, refine: bool = False) -> list[F]:
        """Quick fits of bases of the reserve with the same effects; none for a fit that has one of them."""
        world = self.world
        return world.reserve_fits(fitted, refine) if world.reserve and fitted.base not in world.reserve else []

    def far_better_base(
        self, reserve: Sequence[F], quick: Mapping[str, F], contenders: Sequence[F], judged: J
    ) -> tuple[F, J] | None:
        """`other_base` if its quick fit gains far more over the `contenders` than any effect does by its own."""
        world = self.world
        gain = max((world.quick_gain(fit, contenders) for fit in reserve), default=0.0)
        most = max((world.quick_gain(fit, contenders) for fit in quick.values()), default=0.0)
        if gain < max(FAR_BETTER * most, self.settings.tell_apart):
            return None
        return self.other_base(reserve, max(contenders, key=lambda fit: fit.score), judged)

    def other_base(self, reserve: Sequence[F], rival: F, to_beat: J) -> tuple[F, J] | None:
        """Fit and judgement of the best base of the reserve, if it predicts better than `rival` and errs no more.

        `reserve` holds quick fits; `to_beat` is the judgement of `rival`.
        """
        world, least = self.world, self.settings.tell_apart
        if not reserve:
            return None
        best = max(reserve, key=lambda fit: fit.score)
        best = world.fit(best.base, best.effects, best.values, "near")
        if best.score - rival.score < least:
            return None
        other = self.evidence.judge(best)
        gain = self.evidence.gain(other, to_beat, "reserve", best.base)
        better = gain[1] > 0.0 and other.total - to_beat.total > least
        better = better and not world.errs_more(other, to_beat, self.settings)
        return (self.in_full(best), other) if better else None

    def worth_a_fit(self, fitted: F, judged: J, candidates: Sequence[E], tests: Scan) -> list[E]:
        """Candidates whose score test is at least half of what is significant, and all that act on what is left."""
        least = 0.5 * np.quantile(tests.null, 1.0 - self.settings.alpha)
        told = self.world.leaves_little
        return [e for e in candidates if tests.gain[e.name] >= least or not told(fitted, judged, e)]

    def quick_fits(self, contenders: Sequence[F], candidates: Sequence[E], fitted: F) -> dict[str, F]:
        """The best quick fit with each candidate, by its name, the best first.

        They rank better than score tests: far from the null a robust fit may treat as outliers what the effect
        explains, and the slope at the null then means nothing.
        """
        world = self.world

        def with_effect(f: F, e: E) -> F:
            return world.fit(f.base, (*f.effects, e), world.start_with(f, e), "quick")

        first, *rivals = contenders
        quick = {e.name: with_effect(first, e) for e in candidates}
        ranked = self.ranked(quick, fitted)
        turned = [name for name in ranked[RIVALLED:] if world.turns_bases(quick[name].effects[-1])]
        for name in [*ranked[:RIVALLED], *turned] if rivals else []:
            others = [with_effect(f, quick[name].effects[-1]) for f in rivals]
            quick[name] = max([quick[name], *others], key=lambda fit: fit.score)
        return {name: quick[name] for name in self.ranked(quick, fitted)}

    def ranked(self, fits: Mapping[str, F], fitted: F) -> list[str]:
        """Names of fits with one effect more than `fitted`, by score less one nat a parameter."""
        return sorted(fits, key=lambda name: len(fits[name].values) - len(fitted.values) - fits[name].score)

    def best_step(
        self, fitted: F, judged: J, contenders: Sequence[F], quick: Mapping[str, F], tests: Scan, forced: bool
    ) -> tuple[Step[E, F, J] | None, F | None, tuple[str, ...]]:
        """The step that enters, or None with the fit of a significant but immaterial effect, and `Path.unasked`."""
        world, settings = self.world, self.settings
        on = [e.name for e in fitted.effects]
        gains = {name: world.quick_gain(fit, contenders) for name, fit in quick.items()}
        least = 0.5 * np.quantile(tests.null, 1.0 - settings.alpha)
        least = max(least, HOPELESS * max(gains.values(), default=0.0))
        worth = [name for i, name in enumerate(quick) if i == 0 or gains[name] >= least]
        names = worth[: settings.finalists]
        unasked = tuple(n for n in worth[len(names) :] if not forced and tests.p_value(gains[n]) <= settings.alpha)
        if fitted.base in world.reserve and quick:
            # quick fits are of its limit, which may be far away; slopes are its own
            best_slope = max(quick, key=lambda name: tests.gain[name])
            names += [best_slope] * (best_slope not in names)
        bases = {name: fitted.base if fitted.base in world.reserve else quick[name].base for name in names}
        near = {name: world.fit(bases[name], quick[name].effects, quick[name].values, "near") for name in names}
        near |= self.simpler_fits(near, quick, fitted)
        # relative to the best base without the effect: a rival that fits better by itself is no gain of the effect
        best = max([fitted, *contenders], key=lambda fit: fit.score)
        gains |= {name: fit.score - best.score for name, fit in near.items()}
        below = None
        p_values = {name: tests.p_value(gains[name]) for name in near}
        names = [name for name in self.ranked(near, fitted) if not self.is_simpler_as_good(name, near)]
        finalists = [name for name in names if forced or p_values[name] <= settings.alpha]
        parts = (self.evidence.judged_in_turn(near, names) for names in (finalists[:JUDGED], finalists[JUDGED:]))
        for name, judgements in chain.from_iterable(parts):
            e, p_value, judgement = near[name].effects[-1], p_values[name], judgements[name]
            if not forced and self.is_simpler_enough(e, judgements):
                continue
            gain = self.evidence.gain(judgement, judged, "gain", *on, name)
            significant = gain[1] > 0.0 and p_value <= settings.alpha
            fails = self.evidence.failure(judgement, judged, e) if significant else "chance"
            if fails == "immaterial":
                below = below or near[name]
            if fails == "spoils":
                self.say(f"{name} predicts better, but spoils another error")
            if fails is None and gains[name] < FAR_BEYOND * tests.null.max():
                stretch = self.evidence.stretch_of_null(best, e, tests, "refits", *on, name)
                p_value = tests.p_value(gains[name] / stretch)
                fails = None if p_value <= settings.alpha else "chance"
            if forced or fails is None:
                others = self.evidence.alternatives(name, gains, tests, judgements)
                return Step(e, others, fails, p_value, gain, near[name], judgement, tests), None, ()
        return None, below, unasked

    def simpler_fits(self, near: Mapping[str, F], quick: Mapping[str, F], fitted: F) -> dict[str, F]:
        """Fits with effects that the best one is at some of its parameters, from where that one ends, if better."""
        better = {}
        for name in self.ranked(near, fitted)[:1]:
            for other in (other for other in quick if self.world.includes(name, other)):
                again = self.world.fit(near[name].base, quick[other].effects, near[name].values)
                if other not in near or again.score > near[other].score:
                    better[other] = again
        return better

    def is_simpler_as_good(self, name: str, near: Mapping[str, F]) -> bool:
        """Whether an effect that this one is at some of its parameters fits as well."""
        enough = near[name].score - self.settings.tell_apart
        return any(self.world.includes(name, other) and near[other].score > enough for other in near if other != name)

    def is_simpler_enough(self, effect: E, judgements: Mapping[str, J]) -> bool:
        """Whether an effect that this one is at some of its parameters leaves no error that this one lowers."""
        others = [other for name, other in judgements.items() if self.world.includes(effect.name, name)]
        return any(self.evidence.failure(judgements[effect.name], other, effect) for other in others)

    def with_best_base(self, step: Step[E, F, J]) -> Step[E, F, J]:
        """The step, fitted in full, with the base that fits best; without the effect another may have compensated."""
        world, fitted, least = self.world, step.fitted, self.settings.tell_apart
        others = [world.fit(name, fitted.effects, fitted.values, "quick") for name in world.bases]
        others += world.reserve_fits(fitted) if fitted.base in world.reserve else []
        others = [fit for fit in others if fit.base != fitted.base]
        for quick in sorted(others, key=lambda fit: -fit.score)[:1]:
            best = world.fit(quick.base, quick.effects, quick.values, "near")
            if best.score - fitted.score >= least:
                judged = self.evidence.judge(best)
                if judged.total - step.judged.total >= least and not world.errs_more(
                    judged, step.judged, self.settings
                ):
                    step = replace(step, fitted=best, judged=judged)
        return replace(step, fitted=self.in_full(step.fitted))

    def with_other_base(
        self, step: Step[E, F, J], quick: Mapping[str, F], contenders: Sequence[F], before: J
    ) -> Step[E, F, J]:
        """The step, or an effect that gains nearly as much, on a base of the reserve, if these predict better."""
        # an effect may have been chosen because the base was the wrong one, and a base because the effect was missing
        world = self.world
        gains = {name: world.quick_gain(quick[name], contenders) for name in list(quick)[:RUNNERS_UP]}
        rivals = [quick[name] for name, gain in gains.items() if gain >= NEARLY * max(gains.values())]
        reserve = [fit for rival in rivals if len(rivals) > 1 for fit in world.reserve_fits(rival)]
        if (other := self.other_base(reserve, step.fitted, step.judged)) is None:
            return step
        for simpler in (fit for fit in reserve if fit.base == other[0].base):
            if world.includes(other[0].effects[-1].name, simpler.effects[-1].name):
                near = world.fit(simpler.base, simpler.effects, simpler.values, "near")
                judged = self.evidence.judge(near)
                if self.evidence.failure(other[1], judged, other[0].effects[-1]):
                    other = self.in_full(near), judged
        fitted, effect = other[0], other[0].effects[-1]
        scores = {fit.effects[-1].name: fit.score for fit in reserve if fit.base == fitted.base}
        least = scores.pop(effect.name) - self.settings.tell_apart
        others = tuple(name for name, score in scores.items() if score > least)
        gain = self.evidence.gain(other[1], before, "gain", *(e.name for e in other[0].effects))
        p_value = step.scan.p_value(gains[effect.name])
        return replace(
            step, effect=effect, alternatives=others, p_value=p_value, gain=gain, fitted=other[0], judged=other[1]
        )

    def on_other_base(
        self, path: Path[E, F, J], other: tuple[F, J], bases: dict[str, F], drop: Drop = "immaterial"
    ) -> None:
        """Put a path on another base; what had stood in for it is dropped."""
        world, (fitted, judged), steps = self.world, other, path.steps
        self.say(f"another base, {fitted.base}")
        steps[-1:] = [replace(step, fitted=fitted, judged=judged) for step in steps[-1:]]
        while drop != "none" and steps and (name := self.evidence.superfluous(steps, steps, drop)):
            self.say(f"not needed any more: {name}")
            path.dropped.add(name)
            smaller = tuple(e for e in fitted.effects if e.name != name)
            fitted = world.fit(fitted.base, smaller, fitted.values)
            judged, steps = self.evidence.judge(fitted), self.without(steps, name)
            steps[-1:] = [replace(step, fitted=fitted, judged=judged) for step in steps[-1:]]
        path.fitted, path.judged, path.steps = fitted, judged, steps
        if not steps:
            bases[fitted.base], path.base = fitted, fitted.base

    def without(self, steps: Sequence[Step[E, F, J]], name: str) -> list[Step[E, F, J]]:
        """The steps without one effect; all later ones are fitted and judged again."""
        at = [step.effect.name for step in steps].index(name)
        kept = list(steps[:at])
        for step in steps[at + 1 :]:
            effects = (*(earlier.effect for earlier in kept), step.effect)
            fitted = self.world.fit(step.fitted.base, effects, step.fitted.values)
            judged = self.evidence.judge(fitted)
            kept.append(replace(step, fitted=fitted, judged=judged))
        return kept
