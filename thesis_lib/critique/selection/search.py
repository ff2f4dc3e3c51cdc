"""Forward selection of missing effects with a backward check.

1. Every base is fitted and judged by K-fold over training trials; the search starts from the best.
2. Each step screens all candidates by score tests and quick fits.  The best few are fitted to all data with *all*
   parameters free, and the best of those are judged by K-fold.  The ranking is by gain less one nat per parameter, the
   gain that K-fold is expected to find (Akaike 1974, doi:10.1109/TAC.1974.1100705; Stone 1977,
   doi:10.1111/j.2517-6161.1977.tb01603.x).
3. An effect enters if its gain exceeds the null of the largest gain, its held-out gain has a 95 % interval above zero,
   and it lowers a held-out error materially and raises none materially.  A gain near the null is corrected by refits to
   data without the effect.  Of two effects that predict equally well, one that moves earlier effects much further from
   their nulls comes second: a wrong scale, size and gravity together act like another inertia.  A base that replaces
   another one must not raise an error, either.
4. Then the other bases are tried again, and an earlier effect that is superfluous leaves; it may come back later, once.
5. If a model leaves an error, a second-stage base (`reserve`) replaces its base if it predicts clearly better than the
   next effect would.  In space a base of the reserve that leaves no error is taken before any effect is tried.  If
   quick fits show that it gains far more than any effect, no effect is judged before it.  If a step leaves an error,
   the next best effects are tried with these bases, too; in space also if none enters, and such a step must leave no
   error.  If an error remains in the end, and few effects were found on the reserve, the search resumes without it from
   the point where it was taken; in space, if it was not taken, it resumes from the end with the best of the reserve,
   because base and effect may only help together.  The better of the two ends counts.
6. Effects found on a simpler base are fitted once more on the reserve, and keep that base if it predicts better.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Generic

import numpy as np

from thesis_lib.critique.selection.bases import Bases
from thesis_lib.critique.selection.discovery import Discovery, Path, Shortlist, Step
from thesis_lib.critique.selection.evidence import Drop, Evidence
from thesis_lib.critique.selection.scan import Scan
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Asked, E, F, J, World


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
    automatic choice.  `say` receives one line of text per step.
    """
    return Search(world, settings, rng, say, fixed).run()


class Search(Generic[E, F, J]):
    """A search that starts from the best base; data, thresholds and tests stay fixed."""

    def __init__(
        self,
        world: World[E, F, J],
        settings: SearchSettings,
        rng: np.random.Generator,
        say: Callable[[str], None],
        fixed: Sequence[str] | None = None,
    ) -> None:
        self.world, self.settings, self.say, self.fixed = world, settings, say, fixed
        self.evidence = Evidence(world, settings, rng)
        self.bases = Bases(self.evidence)
        most = world.most_effects if settings.max_effects is None else settings.max_effects
        self.most = most if fixed is None else len(fixed)
        self.plain: dict[str, F] = {}  # the bases without effects
        self.ranked_bases: list[str] = []  # their names, the best first

    def run(self) -> Discovery[E, F, J]:
        world, fixed = self.world, self.fixed
        plain = dict(zip(world.bases, world.fits([(name, (), None, "near") for name in world.bases])))
        ranked = sorted(plain, key=lambda name: -plain[name].score)
        base, judgements = next(self.evidence.judged_in_turn(plain, ranked))
        judged = judgements[base]
        fitted = plain[base] = self.bases.in_full(plain[base])
        self.plain, self.ranked_bases = plain, [base, *(name for name in ranked if name != base)]
        path = Path(base, fitted, judged)
        if fixed is not None or not self.most:
            other = self.bases.other(self.bases.reserve(fitted), fitted, judged)
            if other:
                self.on_other_base(path, other)
        path = self.extend(path)
        simpler = path.simpler_within(self.settings.enough_on_reserve)
        if simpler and world.leaves_an_error(path.judged):
            path = self.better_of(path, simpler)
        elif fixed is None and world.asks_reserve_first and world.leaves_an_error(path.judged):
            path = self.better_on_reserve(path)
        if path.steps:
            self.refine(path, "useless" if fixed is None else "none")
        rest = [e for e in world.candidates.values() if e not in path.fitted.effects]
        last_scan = self.evidence.scan(path.fitted, rest, "last null")
        limit = None
        if fixed is None and len(path.steps) >= self.most:
            more = max(last_scan.gain.values(), default=0.0)
            limit = self.most if last_scan.p_value(more) <= self.settings.alpha else None
        return Discovery(
            self.plain, path.base, tuple(path.steps), path.first, last_scan, path.below, world.not_testable, limit
        )

    def extend(self, path: Path[E, F, J], with_reserve: bool = True) -> Path[E, F, J]:
        """Add effects to a path until none enters, and return the path."""
        world, bases, forced = self.world, self.bases, self.fixed is not None
        while not path.ended and len(path.steps) < self.most:
            first = self.reserve_first(path) if with_reserve and not forced and not path.shortlist else None
            if first:
                path.remember(None, None)
                self.on_other_base(path, first)
            if not (shortlist := path.shortlist or self.shortlist(path)):
                break
            path.shortlist = None
            fitted, judged, number = path.fitted, path.judged, len(path.steps) + 1
            quick, contenders = shortlist.quick, shortlist.contenders
            path.first = path.first or shortlist.best()
            # a base of the reserve is tried only if the best effect leaves an error, too
            best = next(iter(quick.values()), fitted)
            leaves = with_reserve and not forced and world.leaves_an_error(judged) and bases.leaves_an_error(best)
            step, reserve = None, bases.reserve(fitted) if leaves else []
            other: tuple[F, J] | None = bases.far_better(reserve, quick, contenders, judged)
            if other is None:
                step, path.below = self.best_step(fitted, judged, shortlist)
                asks = step is None and leaves and world.asks_reserve_first
                if joint := bases.together(shortlist, fitted, judged) if asks else None:
                    path.remember(None, shortlist)
                    self.say(f"step {number}: {joint.effect.name}, together with the base")
                    path.steps, path.entered = [*path.steps, joint], path.entered + 1
                    self.on_other_base(path, (joint.fitted, joint.judged))
                    continue
                path.ended, path.entered = step is None, path.entered + (step is not None)
                if reserve and (step is None or world.leaves_an_error(step.judged)):
                    rival = step.fitted if step else fitted
                    other = bases.other(reserve, rival, step.judged if step else judged)
            if other:
                path.remember(step, shortlist)
            elif step:
                chosen, step = step.fitted.base, bases.with_best_base(step)
                self.say(f"step {number}: {step.effect.name} ({step.gain[0]:.2f} nats an {world.unit})")
                if step.fitted.base != chosen:
                    self.say(f"another base, {step.fitted.base}")
                # a model of the shortlist may lack effects of the path
                on = {e.name for e in step.fitted.effects}
                path.steps = steps = [*(one for one in path.steps if one.effect.name in on), step]
                if with_reserve and not forced and world.reserve and world.leaves_an_error(step.judged):
                    moved = bases.with_other_base(step, quick, contenders, judged)
                    if moved is not step:
                        path.remember(step, shortlist)
                        steps[-1], other = moved, (moved.fitted, moved.judged)
            if other:
                self.on_other_base(path, other)
                continue
            if step is None:
                break
            if not forced and (name := self.evidence.superfluous(path.steps, path.steps[:-1])):
                self.say(f"not needed any more: {name}")
                path.drop(name)
                path.steps = self.without(path.steps, name)
            path.fitted, path.judged = path.steps[-1].fitted, path.steps[-1].judged
        return path

    def reserve_first(self, path: Path[E, F, J]) -> tuple[F, J] | None:
        """A base of the reserve that leaves no error, unlike that of the path, if the world tries the reserve first.

        Otherwise an effect may compensate for the wrong base, and all effects would be fitted in vain.
        """
        world, bases = self.world, self.bases
        if not world.asks_reserve_first or not world.leaves_an_error(path.judged):
            return None
        reserve = bases.reserve(path.fitted)
        if not reserve or bases.leaves_an_error(max(reserve, key=lambda fit: fit.score)):
            return None
        other = bases.other(reserve, path.fitted, path.judged)
        return None if other is None or world.leaves_an_error(other[1]) else other

    def shortlist(self, path: Path[E, F, J]) -> Shortlist[F] | None:
        """Fits from which the next step chooses; None if there are none."""
        world, fitted, steps, fixed = self.world, path.fitted, path.steps, self.fixed
        taken = {step.effect.name for step in steps} | path.barred
        candidates = [e for e in world.candidates.values() if e.name not in taken]
        if fixed is not None:
            candidates = [world.candidates[fixed[len(steps)]]]
        if not candidates:
            return None
        tests = self.evidence.scan(fitted, candidates, "null", *(step.effect.name for step in steps))
        self.say(f"step {len(steps) + 1}: trying {len(candidates)} effects")
        # a missing effect may favour the wrong base: the next best bases are tried with it, too
        contenders = [fitted] if steps else [self.plain[name] for name in self.ranked_bases[: world.rivals]]
        base = fitted.base if fitted.base in world.reserve else None
        if base:
            contenders = [world.fit(base, fitted.effects, fitted.values, "quick")]
        if fixed is None:
            candidates = self.worth_a_fit(fitted, path.judged, candidates, tests)
        return Shortlist(self.quick_fits(contenders, candidates, fitted), contenders, tests, base)

    def better_of(self, path: Path[E, F, J], other: Path[E, F, J]) -> Path[E, F, J]:
        """The path, or `other` continued to its end, if that ends better."""
        self.say(f"on {other.fitted.base} once more, with other effects")
        if other.steps:
            last = other.steps[-1] = self.bases.with_best_base(other.steps[-1])
            other.fitted, other.judged = last.fitted, last.judged
        other = self.extend(other, with_reserve=False)
        gain = self.evidence.gain(other.judged, path.judged, "simpler", other.base)
        errs_more = self.world.errs_more(other.judged, path.judged, self.settings)
        return other if gain[1] > 0.0 and not errs_more else path

    def better_on_reserve(self, path: Path[E, F, J]) -> Path[E, F, J]:
        """The path, or its continuation on the best base of the reserve, if that ends better."""
        if not (reserve := self.bases.reserve(path.fitted)):
            return path
        fitted = self.bases.in_full(max(reserve, key=lambda fit: fit.score))
        other = replace(path, steps=list(path.steps), left={name: list(at) for name, at in path.left.items()})
        self.on_other_base(other, (fitted, self.evidence.judge(fitted)))
        return self.better_of(path, other)

    def refine(self, path: Path[E, F, J], drop: Drop) -> None:
        """Move a path to the same base with fewer approximations, of the reserve, if that predicts better."""
        other = self.bases.other(self.bases.reserve(path.fitted, refine=True), path.fitted, path.judged)
        if other:
            self.on_other_base(path, other, drop)

    def worth_a_fit(self, fitted: F, judged: J, candidates: Sequence[E], tests: Scan) -> list[E]:
        """Candidates whose score test is large enough, and all that act where an error remains."""
        least, leaves_little = self.least_gain(tests), self.world.leaves_little
        return [e for e in candidates if tests.gain[e.name] >= least or not leaves_little(fitted, judged, e)]

    def least_gain(self, tests: Scan) -> float:
        """Nats below which a candidate is not worth a fit."""
        return self.settings.worth_a_fit * float(np.quantile(tests.null, 1.0 - self.settings.alpha))

    def quick_fits(self, contenders: Sequence[F], candidates: Sequence[E], fitted: F) -> dict[str, F]:
        """The best quick fit with each candidate, by its name, the best first.

        They rank better than score tests: far from the null a robust fit may treat as outliers what the effect
        explains, and the slope at the null then means nothing.
        """
        world, rivalled = self.world, self.settings.rivalled

        def with_effect(f: F, e: E) -> Asked:
            return f.base, (*f.effects, e), world.start_with(f, e), "quick"

        first, *rivals = contenders
        quick = dict(zip((e.name for e in candidates), world.fits([with_effect(first, e) for e in candidates])))
        ranked = self.ranked(quick, fitted)
        turned = [name for name in ranked[rivalled:] if world.turns_bases(quick[name].effects[-1])]
        # one that fits far worse with the best base is wrong with all of them
        turned = [n for n in turned if rivals and world.quick_gain(quick[n], [first]) > -self.settings.close]
        asked = [with_effect(f, quick[n].effects[-1]) for n in [*ranked[:rivalled], *turned] for f in rivals]
        for other in world.fits(asked):
            name = other.effects[-1].name
            quick[name] = max(quick[name], other, key=lambda fit: fit.score)
        return {name: quick[name] for name in self.ranked(quick, fitted)}

    def ranked(self, fits: Mapping[str, F], fitted: F) -> list[str]:
        """Names of fits with one effect more than `fitted`, by score less one nat a parameter."""
        return sorted(fits, key=lambda name: len(fits[name].values) - len(fitted.values) - fits[name].score)

    def best_step(self, fitted: F, judged: J, shortlist: Shortlist[F]) -> tuple[Step[E, F, J] | None, F | None]:
        """The step that enters, or None with the fit of a significant but immaterial effect.

        The shortlisted candidates (`finalists`) come first.  If none of them enters, the others that gain more than
        chance follow, as many at a time: the number of candidates does not end a search.
        """
        quick, tests, number = shortlist.quick, shortlist.tests, self.settings.finalists
        gains = {name: self.world.quick_gain(fit, shortlist.contenders) for name, fit in quick.items()}
        least = max(self.least_gain(tests), self.settings.finalist_gain * max(gains.values(), default=0.0))
        worth = [name for i, name in enumerate(quick) if i == 0 or gains[name] >= least]
        names, others = worth[:number], []
        if self.fixed is None:
            others = [name for name in worth[number:] if tests.p_value(gains[name]) <= self.settings.alpha]
        if shortlist.base and quick:
            # quick fits are of the base's limit, which may be far away; slopes are of the base itself
            best_slope = max(quick, key=lambda name: tests.gain[name])
            misjudged = [name for name, fit in quick.items() if self.world.misjudged(fit.effects[-1])]
            names = list(dict.fromkeys([*names, best_slope, *misjudged]))
            others = [name for name in others if name not in names]
        step, below = self.step_among(names, fitted, judged, shortlist, gains)
        while step is None and others:
            step, also_below = self.step_among(others[:number], fitted, judged, shortlist, gains)
            below, others = below or also_below, others[number:]
        return step, below

    def step_among(
        self, names: list[str], fitted: F, judged: J, shortlist: Shortlist[F], quick_gains: Mapping[str, float]
    ) -> tuple[Step[E, F, J] | None, F | None]:
        """As `best_step`, but only among the candidates `names`; `quick_gains`: gains of all candidates."""
        world, settings, forced = self.world, self.settings, self.fixed is not None
        quick, contenders, tests = shortlist.quick, shortlist.contenders, shortlist.tests
        on, gains = [e.name for e in fitted.effects], dict(quick_gains)
        near = dict(zip(names, world.fits([self.near_fit(quick[n], fitted, shortlist.base) for n in names])))
        near |= self.simpler_fits(near, quick, fitted)
        # relative to the best base without the effect: a rival that fits better by itself does not count for the effect
        best = max([fitted, *contenders], key=lambda fit: fit.score)
        gains |= {name: fit.score - best.score for name, fit in near.items()}
        below = None
        p_values = {name: tests.p_value(gains[name]) for name in near}
        names = [name for name in self.ranked(near, fitted) if not self.is_simpler_as_good(name, near)]
        finalists = [name for name in names if forced or p_values[name] <= settings.alpha]
        parts = (
            self.evidence.judged_in_turn(near, names)
            for names in (finalists[: settings.judged], finalists[settings.judged :])
        )
        for name, judgements in self.evidence.unmoved_first(chain.from_iterable(parts), near, fitted):
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
            if fails is None and gains[name] < settings.far_beyond * tests.null.max():
                least = np.inf if forced else gains[name]
                stretch = self.evidence.stretch_of_null(best, e, tests, "refits", *on, name, gain=least)
                p_value = tests.p_value(gains[name] / stretch)
                fails = None if p_value <= settings.alpha else "chance"
            if forced or fails is None:
                others = shortlist.alike
                if others is None:
                    others = self.evidence.alternatives(name, gains, tests, judgements)
                moving = self.evidence.as_good_by_moving(name, judgements, near, fitted)
                moving = [other for other in moving if not world.includes(other, name)]
                others = tuple(dict.fromkeys((*others, *moving)))
                return Step(e, others, fails, p_value, gain, near[name], judgement, tests), None
        return None, below

    def near_fit(self, quick: F, fitted: F, base: str | None) -> Asked:
        """Arguments of the fit to judge; with a `base` whose limit was the quick fit, it starts from the model's base.

        The effects start from the quick fit, which has moved them together: from those of the model, a fit of many
        effects may end hundreds of nats lower.
        """
        if base is None:
            return quick.base, quick.effects, quick.values, "near"
        of_base = {} if self.world.turns_bases(quick.effects[-1]) else self.world.values_of_base(fitted)
        return base, quick.effects, {**quick.values, **of_base}, "near"

    def simpler_fits(self, near: Mapping[str, F], quick: Mapping[str, F], fitted: F) -> dict[str, F]:
        """Fits with special cases of the best effect, started from the fit with that effect, if better."""
        better = {}
        for name in self.ranked(near, fitted)[:1]:
            for other in (other for other in quick if self.world.includes(name, other)):
                again = self.world.fit(near[name].base, quick[other].effects, near[name].values)
                if other not in near or again.score > near[other].score:
                    better[other] = again
        return better

    def is_simpler_as_good(self, name: str, near: Mapping[str, F]) -> bool:
        """Whether a special case of an effect fits as well."""
        enough = near[name].score - self.settings.tell_apart
        return any(self.world.includes(name, other) and near[other].score > enough for other in near if other != name)

    def is_simpler_enough(self, effect: E, judgements: Mapping[str, J]) -> bool:
        """Whether a special case of an effect leaves no error that the effect itself lowers."""
        others = [other for name, other in judgements.items() if self.world.includes(effect.name, name)]
        return any(self.evidence.failure(judgements[effect.name], other, effect) for other in others)

    def on_other_base(self, path: Path[E, F, J], other: tuple[F, J], drop: Drop = "immaterial") -> None:
        """Move a path to another base, and drop effects that had compensated for the former one."""
        (path.fitted, path.judged), path.ended = other, False
        self.say(f"another base, {path.fitted.base}")
        path.steps[-1:] = [replace(step, fitted=path.fitted, judged=path.judged) for step in path.steps[-1:]]
        self.drop_superfluous(path, drop)
        if not path.steps:
            self.plain[path.fitted.base], path.base = path.fitted, path.fitted.base

    def drop_superfluous(self, path: Path[E, F, J], drop: Drop) -> None:
        """Remove, one after the other, the effects that a path does not need any more."""
        while drop != "none" and path.steps and (name := self.evidence.superfluous(path.steps, path.steps, drop)):
            self.say(f"not needed any more: {name}")
            path.drop(name)
            smaller = tuple(e for e in path.fitted.effects if e.name != name)
            path.fitted = self.world.fit(path.fitted.base, smaller, path.fitted.values)
            path.judged, path.steps = self.evidence.judge(path.fitted), self.without(path.steps, name)
            path.steps[-1:] = [replace(step, fitted=path.fitted, judged=path.judged) for step in path.steps[-1:]]

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
