"""Propose a term where the critique leaves something unexplained.

1. What the critique named may only stand in for the cause.  So the search for a term starts from its final model, and
   from the best impact law and the energetic one, both without effects.
2. At each start sparse regression (`regression`) ranks all terms; the best of them, and all single factors, are fitted
   with all parameters free, to single hits, as impulses.
3. The best few, less a nat for each parameter, are tried with every impact law, and the best is fitted to all impacts.
4. It enters as any effect does: its gain over the critique's final model exceeds the null of the largest gain of all
   terms that were tried, its gain by K-fold has a 95 % interval above zero, and an error falls by what matters.
5. The same is then asked for a second term, and for the effects that the critique had named.

Only training trials choose.  The errors told are those of the trials that no choice has seen.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from thesis_lib.critique.contacts.kinds import kind_of
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.world import Drops, Judgement
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.proposal.effect_file import effect_of
from thesis_lib.critique.proposal.regression import regress
from thesis_lib.critique.proposal.terms import Term, testable_terms
from thesis_lib.critique.selection.discovery import paired_gain
from thesis_lib.critique.selection.evidence import Evidence
from thesis_lib.critique.selection.scan import Scan, scan
from thesis_lib.critique.selection.search import FAR_BEYOND
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.foundation.randomness import streams

ENERGETIC = "mirtich"  # the law to which contacts that take time come as these get shorter
MOST_STEPS = 4
FITTED = 12  # terms fitted at each start, the best by the regression, beside the single factors
SIMPLER = 1.0  # nats that a product must gain over a single factor
FINALISTS = 4  # of all terms are tried with every law
LEAST_SCORE = 10.0  # nats by a quick fit, below which an effect that was named is not judged again


@dataclass(frozen=True)
class Accepted:
    """One term that entered.

    Attributes:
        p_value: of its gain against the null of the largest gain of all terms.
        gain: by K-fold, nats an impact, with 95 % interval.
        alternatives: terms that explain the same within `tell_apart` nats, the best first.
        share: of the halves of the trials in which sparse regression chose it.
    """

    term: Term
    p_value: float
    gain: tuple[float, float, float]
    alternatives: tuple[Term, ...]
    share: float


@dataclass(frozen=True)
class Proposal:
    """What is proposed.

    Attributes:
        terms: in the order in which they entered; fitted: the model with them, on all training trials.
        before, after: held-out judgements of the critique's final model, and with the proposal.
        held_out_gain: nats an impact on held-out trials, with 95 % interval.
        tried: number of terms; limit: `max_terms` if more may be found beyond it.
    """

    terms: tuple[Accepted, ...]
    fitted: Fit
    before: Judgement
    after: Judgement
    held_out_gain: tuple[float, float, float]
    tried: int
    limit: int | None = None

    @property
    def kept(self) -> tuple[Effect, ...]:
        """Effects of the library that the model still has."""
        own = {one.term.name for one in self.terms}
        return tuple(effect for effect in self.fitted.effects if effect.name not in own)


@dataclass(frozen=True)
class _Try:
    """A quick fit with one more term or effect, and the regression from which it came."""

    fitted: Fit
    term: Term | None
    tests: Scan
    share: float
    score: float  # nats, less one for each parameter


@threadpool_limits.wrap(limits=1)
def propose(
    critique: DropsCritique, rng: np.random.Generator, say: Callable[[str], None] = lambda text: None
) -> Proposal | None:
    """The terms that pass the test of every effect, or None; `rng` draws folds and nulls."""
    return _Proposer(critique, rng, say).run()


class _Proposer:
    def __init__(self, critique: DropsCritique, rng: np.random.Generator, say: Callable[[str], None]) -> None:
        self.critique, self.settings, self.say = critique, critique.settings, say
        self.stream = streams(rng)
        self.world = Drops(critique.training, critique.settings.rivals, critique.settings.contact_time)
        self.screen = Drops(self.world.quick, timed=critique.settings.contact_time)
        self.evidence = Evidence(self.world, self.settings, self.stream("folds"))
        # one that was added from a file is an effect like any other
        self.terms = [
            term for term in testable_terms(self.world.observations.rig.has_angle) if term.name not in EFFECTS
        ]

    def run(self) -> Proposal | None:
        final, steps = self.critique.discovery.fitted, self.critique.discovery.steps
        rejected = self.critique.discovery.rejected
        rival, judged = final, steps[-1].judged if steps and not rejected else self.evidence.judge(final)
        accepted: list[Accepted] = []
        named = tuple(effect for effect in final.effects)
        for number in range(1, MOST_STEPS + 1):
            starts = self.starts() if not accepted else [self.quick(rival)]
            self.say(f"proposal {number}: trying {len(self.terms)} terms")
            more = len(accepted) < self.settings.max_terms
            tries = [one for start in starts for one in self.tries(start, more, named)]
            if not tries:
                break
            finalists = self.with_every_law(tries)
            best = self.simplest(finalists)
            fitted = self.world.fit(best.fitted.base, best.fitted.effects, best.fitted.values, "near")
            entered = self.enters(fitted, best, rival, judged)
            if entered is None:
                break
            gain, p_value, judged, rival = *entered, fitted
            if best.term is not None:
                accepted.append(Accepted(best.term, p_value, gain, self.alternatives(best, finalists), best.share))
            rival, judged = self.without_stand_ins(rival, judged)
            if judged.excess <= self.settings.excess_scatter:
                break
        if not accepted:
            return None
        rival = self.world.fit(rival.base, rival.effects, rival.values)
        rival = self.refined(rival, judged)
        unseen = Drops(self.critique.held_out)
        before, after = self.critique.ladder[-1][2], unseen.judge(rival)
        gain = paired_gain(after, before, self.stream("held out"))
        is_full = len(accepted) == self.settings.max_terms and judged.excess > self.settings.excess_scatter
        limit = self.settings.max_terms if is_full else None
        return Proposal(tuple(accepted), rival, before, after, gain, len(self.terms), limit)

    def starts(self) -> list[Fit]:
        """Quick fits from which a term is looked for: the final model, and without what may only stand in."""
        discovery, final = self.critique.discovery, self.critique.discovery.fitted
        rigid = max((discovery.bases[name] for name in self.world.bases), key=lambda fit: fit.score)
        base = final.base if self.has_formula(final) else rigid.base
        starts = {(base, final.effects): final, (rigid.base, ()): rigid, (ENERGETIC, ()): discovery.bases[ENERGETIC]}
        return [self.world.fit(name, effects, fit.values, "quick") for (name, effects), fit in starts.items()]

    def quick(self, fitted: Fit) -> Fit:
        """The same model as an impulse, fitted to single hits."""
        base = fitted.base if self.has_formula(fitted) else ENERGETIC
        return self.world.fit(base, fitted.effects, fitted.values, "quick")

    @staticmethod
    def has_formula(fitted: Fit) -> bool:
        """Whether its impulse is a formula, in the limit of short contacts."""
        return not kind_of(fitted.model.limit).integrated

    def tries(self, start: Fit, with_terms: bool, named: Sequence[Effect]) -> list[_Try]:
        """Quick fits with one more term, or one of the effects that the critique named."""
        on, found = {effect.name for effect in start.effects}, []
        key = (start.base, *sorted(on))
        if with_terms:
            terms = [term for term in self.terms if term.name not in on]
            regression = regress(self.screen, start, terms, self.stream("terms", *key))
            gain, share = regression.tests.gain, regression.share
            ranked = sorted(gain, key=lambda name: -gain[name])[:FITTED]
            ranked += [name for name in list(share)[:FITTED] if share[name] > 0.0]
            cheap = {term.name for term in terms if len(term.factors) == 1 and not term.follows}
            chosen = [term for term in terms if term.name in cheap.union(ranked)]
            for term in chosen:
                fitted = self.with_effect(start, effect_of(term))
                found.append(self.one_try(fitted, term, regression.tests, share.get(term.name, 0.0)))
        others = [effect for effect in named if effect.name not in on]
        if others and any(name in {term.name for term in self.terms} for name in on):
            tests = scan(self.screen.slopes(start, others), self.world.resamples, self.stream("named", *key))
            fits = [self.with_effect(start, effect) for effect in others]
            found += [self.one_try(fit, None, tests, 0.0) for fit in fits if fit.score > start.score + LEAST_SCORE]
        return found

    def with_effect(self, start: Fit, effect: Effect) -> Fit:
        return self.world.fit(start.base, (*start.effects, effect), start.values, "quick")

    @staticmethod
    def one_try(fitted: Fit, term: Term | None, tests: Scan, share: float) -> _Try:
        return _Try(fitted, term, tests, share, fitted.score - len(fitted.values))

    def simplest(self, tries: Sequence[_Try]) -> _Try:
        """The best; a single factor that explains as much as the best product is taken instead."""
        best = max(tries, key=lambda one: one.score)
        close = [one for one in tries if one.score > best.score - SIMPLER and one.term and len(one.term.factors) == 1]
        return max(close, key=lambda one: one.score, default=best)

    def alternatives(self, best: _Try, finalists: Sequence[_Try]) -> tuple[Term, ...]:
        """Terms whose fits say as much as that of the best, the best first."""
        least = best.score - self.settings.tell_apart
        close = sorted((one for one in finalists if one.score > least), key=lambda one: -one.score)
        return tuple(one.term for one in close if one.term and one.term is not best.term)

    def with_every_law(self, tries: Sequence[_Try]) -> list[_Try]:
        """The best tries of different terms, each with the law that suits it best: a wrong law hides a right term."""
        first: dict[str, _Try] = {}
        for one in sorted(tries, key=lambda one: -one.score):
            first.setdefault(one.fitted.effects[-1].name, one)
        moved = []
        for one in list(first.values())[:FINALISTS]:
            others = [base for base in self.world.bases if base != one.fitted.base]
            fits = [self.world.fit(base, one.fitted.effects, one.fitted.values, "quick") for base in others]
            fitted = max([one.fitted, *fits], key=lambda fit: fit.score)
            moved.append(replace(one, fitted=fitted, score=fitted.score - len(fitted.values)))
        return moved

    def without_stand_ins(self, fitted: Fit, judged: Judgement) -> tuple[Fit, Judgement]:
        """The model without those effects that had stood in for the term, and lower no error that matters beside it."""
        own = {term.name for term in self.terms}
        for effect in [effect for effect in fitted.effects if effect.name not in own]:
            others = tuple(other for other in fitted.effects if other is not effect)
            smaller = self.world.fit(fitted.base, others, fitted.values, "near")
            worse = self.evidence.judge(smaller)
            useless = self.evidence.gain(judged, worse, "needed", effect.name)[1] <= 0.0
            if useless or self.evidence.failure(judged, worse, effect):
                fitted, judged = smaller, worse
        return fitted, judged

    def refined(self, fitted: Fit, judged: Judgement) -> Fit:
        """The same on the contact with the fewest approximations, if the impulse errs and that predicts better."""
        world = self.world
        if fitted.base in world.reserve or not world.leaves_an_error(judged):
            return fitted
        for quick in world.reserve_fits(fitted, refine=True):
            near = world.fit(quick.base, quick.effects, quick.values, "near")
            if near.score < fitted.score + self.settings.tell_apart:
                continue
            better = self.evidence.judge(near)
            gain = self.evidence.gain(better, judged, "refined")
            if gain[1] > 0.0 and not world.errs_more(better, judged, self.settings):
                return world.fit(near.base, near.effects, near.values)
        return fitted

    def enters(
        self, fitted: Fit, best: _Try, rival: Fit, judged: Judgement
    ) -> tuple[tuple[float, float, float], float, Judgement] | None:
        """Gain by K-fold, p-value and judgement of a model that passes the test of an effect; else None."""
        effect = best.fitted.effects[-1]
        others = self.world.fit(fitted.base, fitted.effects[:-1], fitted.values, "near")
        worse = max([rival, others], key=lambda fit: fit.score)
        gain, null = fitted.score - worse.score, best.tests.null
        if best.tests.p_value(gain) > self.settings.alpha:
            return None
        better = self.evidence.judge(fitted)
        kfold = self.evidence.gain(better, judged, "gain", effect.name)
        if kfold[1] <= 0.0 or self.evidence.failure(better, judged, effect):
            return None
        if gain < FAR_BEYOND * null.max():
            tests = replace(best.tests, basis={effect.name: best.tests.basis[effect.name]})
            gain /= self.evidence.stretch_of_null(self.quick(others), effect, tests, "refits", effect.name)
        p_value = best.tests.p_value(gain)
        return (kfold, p_value, better) if p_value <= self.settings.alpha else None
