"""Propose a term if the critique leaves an error unexplained.

1. Effects that the critique named may only compensate for the cause.  So the search for a term starts from the final
   model, and from the best impact law and the energetic one, both without effects.
2. At each start sparse regression ranks all terms; the best of them, and all single factors, are fitted
   with all parameters free, to single hits, as impulses.
3. The best few, by gain less a nat per parameter, are tried with every impact law; the best becomes a candidate effect.
4. Like any effect, it must pass the tests of `search` to enter, and those of `judge_held_out` on held-out trials.
5. The same is then repeated for a second term, and for the effects that the critique had named.

Terms are chosen by sparse regression.  With z the whitened residuals of the fitted model and X their slopes in the
terms, both after the slopes of the fitted parameters are projected out, orthogonal matching pursuit chooses the columns
that explain z best, one after the other.  Columns that depend on each other make one choice fragile.  So it is repeated
on halves of the trials, and terms count by the share of halves in which they were chosen (stability selection).

Sources: Pati, Rezaiifar and Krishnaprasad 1993, doi:10.1109/ACSSC.1993.342465 (orthogonal matching pursuit);
Meinshausen and Bühlmann 2010, doi:10.1111/j.1467-9868.2010.00740.x (stability selection).
"""

from collections.abc import Callable, Sequence, Set
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from thesis_lib.critique.contacts.kinds import kind_of
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.world import Drops, Judgement
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.proposal.effect_file import effect_of
from thesis_lib.critique.proposal.terms import Term, testable_terms
from thesis_lib.critique.selection.discovery import Path, Shortlist, Step, judge_held_out, paired_gain
from thesis_lib.critique.selection.scan import Scan, orthonormal, scan
from thesis_lib.critique.selection.search import Search
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.foundation.randomness import streams

ENERGETIC = "mirtich"  # the law to which contacts that take time come as these get shorter
HALVES = 40  # halves of the trials
CHOSEN = 2  # terms chosen in each
TRIED = 60  # terms of largest gain, from which the halves choose


class Accepted(NamedTuple):
    """One term that entered, with its `step`; `share` of the halves of the trials in which sparse regression chose it.

    The p-value of the step counts all terms; its alternatives explain the same within `tell_apart` nats.
    """

    term: Term
    share: float
    step: Step[Effect, Fit, Judgement]


@dataclass(frozen=True)
class Proposal:
    """A proposed term.

    Attributes:
        terms: in the order in which they entered; fitted: the model with them, on all training trials.
        before, after: held-out judgements of the critique's final model, and with the proposal.
        held_out_gain: nats per impact on held-out trials, with 95 % interval.
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
        """Effects of the library that the model still contains."""
        own = {one.term.name for one in self.terms}
        return tuple(effect for effect in self.fitted.effects if effect.name not in own)


class _Try(NamedTuple):
    """A quick fit with one more term or effect, and the regression from which it came."""

    fitted: Fit
    tests: Scan
    share: float = 0.0

    @property
    def name(self) -> str:
        """Name of the term or effect."""
        return self.fitted.effects[-1].name

    @property
    def score(self) -> float:
        """Log score in nats, less one for each parameter."""
        return self.fitted.score - len(self.fitted.values)


@threadpool_limits.wrap(limits=1)
def propose(
    critique: DropsCritique, rng: np.random.Generator, say: Callable[[str], None] = lambda text: None
) -> Proposal | None:
    """The terms that pass the test of every effect, or None; `rng` draws folds and nulls."""
    return _TermSearch(critique, rng, say).propose()


class _TermSearch(Search[Effect, Fit, Judgement]):
    """A search that continues from the critique's final model, with terms as candidates."""

    def __init__(self, critique: DropsCritique, rng: np.random.Generator, say: Callable[[str], None]) -> None:
        self.critique, self.stream, settings = critique, streams(rng), critique.settings
        self.choice = settings.terms
        world = Drops(critique.training, settings)
        super().__init__(world, settings, self.stream("folds"), say)
        self.screen = Drops(world.quick, settings)
        # a term that was added from a file is an effect like any other
        terms = testable_terms(world.observations.rig.has_angle)
        self.terms = {term.name: term for term in terms if term.name not in EFFECTS}
        self.named = critique.discovery.fitted.effects
        self.most = len(self.named) + settings.max_terms
        self.shares: dict[str, float] = {}  # by term, its share in the regression when it was the best
        world.candidates = {effect.name: effect for effect in (*self.named, *map(effect_of, self.terms.values()))}

    def propose(self) -> Proposal | None:
        critique, settings, found = self.critique, self.critique.settings, self.critique.discovery
        judged = found.steps[-1].judged if found.steps and not found.rejected else self.evidence.judge(found.fitted)
        path = self.extend(Path(found.base, found.fitted, judged, list(found.steps)), with_reserve=False)
        if not self.own(path.steps):
            return None
        self.drop_superfluous(path, "immaterial")  # effects that had compensated for the terms
        if self.world.leaves_an_error(path.judged):
            self.refine(path, "none")
        is_full = len(self.own(path.steps)) == settings.max_terms and path.judged.excess > settings.excess_scatter
        found = replace(found, base=path.base, steps=tuple(path.steps), below=None, rejected=())
        found, ladder, _ = judge_held_out(self.world, Drops(critique.held_out, settings), found, settings)
        own = self.own(found.steps).items()
        terms = tuple(Accepted(self.terms[name], self.shares[name], step) for name, step in own)
        if not terms:
            return None
        before, after = critique.ladder[-1][2], ladder[-1][2]
        gain = paired_gain(after, before, self.stream("held out"))
        limit = settings.max_terms if is_full else None
        return Proposal(terms, found.fitted, before, after, gain, len(self.terms), limit)

    def own(self, steps: Sequence[Step[Effect, Fit, Judgement]]) -> dict[str, Step[Effect, Fit, Judgement]]:
        """The steps of terms, by name."""
        return {step.effect.name: step for step in steps if step.effect.name in self.terms}

    def shortlist(self, path: Path[Effect, Fit, Judgement]) -> Shortlist[Fit] | None:
        own, settings = self.own(path.steps), self.critique.settings
        if own and path.judged.excess <= settings.excess_scatter:
            return None
        starts = [self.quick(path.fitted)] if own else self.starts()
        self.say(f"proposal {len(own) + 1}: trying {len(self.terms)} terms")
        more = len(own) < settings.max_terms
        tries = [one for start in starts for one in self.tries(start, more, path.barred)]
        if not tries:
            return None
        finalists = self.with_every_law(tries)
        best = self.simplest(finalists)
        self.shares[best.name] = best.share
        alike = [one for one in finalists if one.score > best.score - settings.tell_apart and one.name in self.terms]
        alike = sorted((one for one in alike if one is not best), key=lambda one: -one.score)
        fitted = best.fitted
        without = self.world.fit(fitted.base, fitted.effects[:-1], fitted.values, "near")
        return Shortlist({best.name: fitted}, [without], best.tests, alike=tuple(one.name for one in alike))

    def starts(self) -> list[Fit]:
        """Quick fits from which the search for a term starts: the final model, and two laws without effects."""
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

    def tries(self, start: Fit, with_terms: bool, barred: Set[str]) -> list[_Try]:
        """Quick fits with one more term, or one of the effects that the critique named."""
        on, found = {effect.name for effect in start.effects}, list[_Try]()
        key = (start.base, *sorted(on))
        gone = on | barred
        if with_terms:
            terms = [term for name, term in self.terms.items() if name not in gone]
            tests, share = regress(self.screen, start, terms, self.stream("terms", *key))
            ranked = sorted(tests.gain, key=lambda name: -tests.gain[name])[: self.choice.fitted]
            ranked += [name for name in list(share)[: self.choice.fitted] if share[name] > 0.0]
            chosen = [t for t in terms if t.name in ranked or (len(t.factors) == 1 and not t.follows)]
            found = [_Try(self.with_effect(start, effect_of(t)), tests, share.get(t.name, 0.0)) for t in chosen]
        others = [effect for effect in self.named if effect.name not in gone]
        if others and any(name in self.terms for name in on):
            tests = scan(self.screen.slopes(start, others), self.world.resamples, self.stream("named", *key))
            fits, least = [self.with_effect(start, effect) for effect in others], start.score + self.choice.named
            found += [_Try(fit, tests) for fit in fits if fit.score > least]
        return found

    def with_effect(self, start: Fit, effect: Effect) -> Fit:
        return self.world.fit(start.base, (*start.effects, effect), start.values, "quick")

    def simplest(self, tries: Sequence[_Try]) -> _Try:
        """The best try, or instead a single factor that explains as much as the best product."""
        best = max(tries, key=lambda one: one.score)
        least = best.score - self.choice.simpler
        single = {name for name, term in self.terms.items() if len(term.factors) == 1}
        close = [one for one in tries if one.score > least and one.name in single]
        return max(close, key=lambda one: one.score, default=best)

    def with_every_law(self, tries: Sequence[_Try]) -> list[_Try]:
        """The best tries of different terms, each with the law that suits it best: a wrong law hides a right term."""
        first: dict[str, _Try] = {}
        for one in sorted(tries, key=lambda one: -one.score):
            first.setdefault(one.name, one)
        moved = []
        for one in list(first.values())[: self.choice.finalists]:
            others = [base for base in self.world.bases if base != one.fitted.base]
            fits = [self.world.fit(base, one.fitted.effects, one.fitted.values, "quick") for base in others]
            fitted = max([one.fitted, *fits], key=lambda fit: fit.score)
            moved.append(one._replace(fitted=fitted))
        return moved


def regress(
    world: Drops, fitted: Fit, terms: Sequence[Term], rng: np.random.Generator
) -> tuple[Scan, dict[str, float]]:
    """Score tests of all terms at `fitted`, with a null that counts all of them, and how often each is chosen.

    The latter is the share of the halves by name of the term, largest first.
    """
    slopes = world.slopes(fitted, [effect_of(term) for term in terms])
    tests = scan(slopes, world.resamples, rng)
    names = sorted(tests.gain, key=lambda name: -tests.gain[name])[:TRIED]
    Q = orthonormal(slopes.fitted)
    X = np.concatenate([slopes.candidates[name] for name in names], axis=1)
    X, z = (part - Q @ (Q.T @ part) for part in (X, slopes.residual))
    # the trial of each whitened residual: impacts first, then flights
    o = world.observations
    of_flights = np.repeat(o.flights.trial, o.flights.variance.shape[1])
    trial = np.concatenate([np.repeat(o.trial, (len(z) - len(of_flights)) // len(o)), of_flights])
    share = {name: count / HALVES for name, count in _chosen(X, -z, trial, names, rng).items()}
    return tests, dict(sorted(share.items(), key=lambda pair: (-pair[1], -tests.gain[pair[0]])))


def _chosen(
    X: np.ndarray, y: np.ndarray, trial: np.ndarray, names: Sequence[str], rng: np.random.Generator
) -> dict[str, int]:
    """How often each of the columns X (N, p) is chosen for y (N,) on halves of the trials."""
    from sklearn.linear_model import orthogonal_mp_gram

    trials, of = np.unique(trial, return_inverse=True)
    norm = np.linalg.norm(X, axis=0)
    keep = np.flatnonzero(norm > 0.0)
    X = X[:, keep] / norm[keep]
    counts: dict[str, int] = dict.fromkeys(names, 0)
    for _ in range(HALVES):
        half = np.zeros(len(trials), bool)
        half[rng.permutation(len(trials))[: len(trials) // 2]] = True
        rows = half[of]
        scale = np.linalg.norm(X[rows], axis=0) + 1e-300
        part = X[rows] / scale
        chosen = orthogonal_mp_gram(part.T @ part, part.T @ y[rows], n_nonzero_coefs=min(CHOSEN, len(keep)))
        for column in np.flatnonzero(chosen):
            counts[str(names[int(keep[column])])] += 1
    return counts
