"""Evidence for or against an effect: score tests, gains by K-fold, refits of drawn data, indistinguishable effects.

Random streams are named by effects, so a further candidate does not change the draws of the others.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Generic, Literal

import numpy as np

from thesis_lib.critique.selection.discovery import Failure, Step, paired_gain
from thesis_lib.critique.selection.scan import Scan, scan
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import E, F, HeldOutScores, J, Slopes, World
from thesis_lib.foundation.forked import processes
from thesis_lib.foundation.randomness import generator

# effects that are removed: "useless" those that do not predict better or that raise an error, "immaterial" also those
# that lower none by an amount that matters
Drop = Literal["none", "useless", "immaterial"]


class Evidence(Generic[E, F, J]):
    """Tests on the training trials of a world, with the same folds during a search."""

    def __init__(self, world: World[E, F, J], settings: SearchSettings, rng: np.random.Generator) -> None:
        self.world, self.settings = world, settings
        n = len(world.trials)
        self.folds = rng.permutation(np.arange(n) % min(settings.folds, n))
        self.seed = int(rng.integers(2**63))
        self.known: tuple[F, Slopes] | None = None  # the last fit that was scanned, and its slopes

    def judge(self, fitted: F) -> J:
        """Judge each fold by a fit to the others."""
        return self.world.cross_validate(fitted, self.folds)

    def judged(self, fits: Sequence[F]) -> list[J]:
        """Several models, each as `judge` does."""
        return self.world.cross_validated(fits, self.folds)

    def scan(self, fitted: F, candidates: Sequence[E], *stream: str) -> Scan:
        """Score tests of the candidates."""
        known = self.known
        if known is None or known[0] is not fitted or any(e.name not in known[1].candidates for e in candidates):
            self.known = known = fitted, self.world.slopes(fitted, candidates)
        slopes = known[1]
        of_candidates = {e.name: slopes.candidates[e.name] for e in candidates}
        return scan(replace(slopes, candidates=of_candidates), self.world.resamples, generator(self.seed, *stream))

    def gain(self, better: J, worse: J, *stream: str) -> tuple[float, float, float]:
        """Gain in nats per unit of one judgement over another, with 95 % interval."""
        return paired_gain(better, worse, generator(self.seed, *stream), self.world.resamples)

    def failure(self, better: J, worse: J, effect: E) -> Failure | None:
        """Reason why the errors exclude an effect that predicts better; None if they do not."""
        if self.world.is_vetoed(better, worse, self.settings):
            return "spoils"
        return None if self.world.is_material(better, worse, effect, self.settings) else "immaterial"

    def judged_in_turn(self, near: Mapping[str, F], names: Sequence[str]) -> Iterator[tuple[str, dict[str, J]]]:
        """Yield `names` with K-fold judgements of their part, best first: those close to the best, then the others."""
        top = near[names[0]].score if names else 0.0
        for is_close in (True, False):
            part = [name for name in names if (near[name].score > top - self.settings.close) == is_close]
            judgements = dict(zip(part, self.judged([near[name] for name in part])))
            yield from ((name, judgements) for name in sorted(part, key=lambda name: -judgements[name].total))

    def stretch_of_null(self, fitted: F, effect: E, tests: Scan, *stream: str, gain: float = np.inf) -> float:
        """Mean gain of `World.refits` full refits to data without the effect, over that of the score test; at least 1.

        The mean gain of the score test is half the number of its columns (Bartlett's correction).  Once the refits show
        that `gain` (nats) may be chance, whatever the others gain, none follows, and a lower bound is returned.
        """
        gains, stretch, rng = [], 1.0, generator(self.seed, *stream)
        expected = 0.5 * max(tests.basis[effect.name].shape[1], 1)
        for _ in range(self.world.refits):
            drawn = self.world.drawn(fitted, rng)
            if drawn is None:
                return 1.0
            plain = drawn.fit(fitted.base, fitted.effects, fitted.values, "quick")
            with_it = drawn.fit(fitted.base, (*fitted.effects, effect), plain.values, "quick")
            gains.append(max(with_it.score - plain.score, 0.0))
            stretch = max(1.0, float(np.sum(gains)) / self.world.refits / expected)
            if tests.p_value(gain / stretch) > self.settings.alpha:
                break
        return stretch

    def alternatives(
        self, name: str, gains: Mapping[str, float], tests: Scan, judgements: Mapping[str, J]
    ) -> tuple[str, ...]:
        """Effects that would explain the same as `name` here, nearest first; `judgements` are of it and of others."""
        # the observed difference counts as well as the expected one
        loss = {
            other: max(tests.expected_loss(name, other), gains[name] - gains.get(other, tests.gain[other]))
            for other, columns in tests.basis.items()
            if other != name and columns.shape[1] and not self.world.includes(other, name)
        }
        # log scores of a wrong model scatter more than its noise predicts
        least = {o: max(self.settings.tell_apart, scatter(judgements[name], judgements[o])) for o in judgements}
        return tuple(o for o in sorted(loss, key=lambda o: loss[o]) if loss[o] < least.get(o, self.settings.tell_apart))

    def unmoved_first(
        self, ranked: Iterable[tuple[str, dict[str, J]]], near: Mapping[str, F], fitted: F
    ) -> Iterator[tuple[str, dict[str, J]]]:
        """Finalists in turn, but one that moves effects of `fitted` after those that predict as well without that."""
        seen = set()
        for name, judgements in ranked:
            still = (one for one in judgements if name in self.as_good_by_moving(one, judgements, near, fitted))
            for one in (*sorted(still, key=lambda one: -judgements[one].total), name):
                if one not in seen:
                    seen.add(one)
                    yield one, judgements

    def as_good_by_moving(self, name: str, judgements: Mapping[str, J], near: Mapping[str, F], fitted: F) -> list[str]:
        """Candidates that predict as well as `name`, apart from chance, and move earlier effects much further."""
        least = self.world.moved(near[name], fitted) + self.settings.moved
        further = [other for other in judgements if self.world.moved(near[other], fitted) > least]
        best = judgements[name].total
        return [o for o in further if abs(judgements[o].total - best) < scatter(judgements[name], judgements[o])]

    def superfluous(
        self, steps: Sequence[Step[E, F, J]], asked: Sequence[Step[E, F, J]], drop: Drop = "immaterial"
    ) -> str | None:
        """The first of the effects `asked` that the model of the last step does not need, or None (backward check)."""
        world, last = self.world, steps[-1]
        names = [step.effect.name for step in steps]
        at_fit = world.judge(last.fitted)
        for first in range(0, len(asked), processes()):
            part = asked[first : first + processes()]
            others = [tuple(e for e in last.fitted.effects if e.name != step.effect.name) for step in part]
            fits = world.fits([(last.fitted.base, rest, last.fitted.values, "near") for rest in others])
            smaller = dict(zip((step.effect.name for step in part), fits))
            clear = {step.effect.name for step in part if self.is_clear(at_fit, smaller[step.effect.name], step, last)}
            doubtful = [name for name in smaller if name not in clear]
            judgements = dict(zip(doubtful, self.judged([smaller[name] for name in doubtful])))
            for step in part:
                if (name := step.effect.name) in clear:
                    continue
                useless = self.gain(last.judged, judgements[name], "needed", *names, name)[1] <= 0.0
                failure = self.failure(last.judged, judgements[name], step.effect)
                if useless or failure == "spoils" or (drop == "immaterial" and failure):
                    return name
        return None

    def is_clear(self, at_fit: J, smaller: F, step: Step[E, F, J], last: Step[E, F, J]) -> bool:
        """Whether fits clearly show that an effect is needed, without K-fold; `at_fit` is the judgement with it.

        The gain of a fit on its own data exceeds that on others by two nats per parameter (Stone 1977).
        """
        settings, effect = self.settings, step.effect
        without = self.world.judge(smaller)
        more = len(last.fitted.values) - len(smaller.values)
        low = self.gain(at_fit, without, "clear", effect.name)[1] * at_fit.units
        twice = {name: 2.0 * getattr(settings, name) for name in ("material_share", "material_floor")}
        return (
            low > settings.far_beyond * 2.0 * more
            and not self.world.is_vetoed(at_fit, without, settings)
            and self.world.is_material(at_fit, without, effect, settings.model_copy(update=twice))
        )


def scatter(one: HeldOutScores, other: HeldOutScores) -> float:
    """Two standard errors of the difference of the log scores of two judgements of the same trials, in nats."""
    difference = one.by_trial(one.trials) - other.by_trial(one.trials)
    return 2.0 * float(np.sqrt(len(difference)) * np.std(difference))
