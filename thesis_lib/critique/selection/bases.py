"""Choice of the base of a model: from the competing laws, and from the reserve, second-stage bases that fit slowly.

A missing effect may favour the wrong base, and a wrong base an effect that only compensates for it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Generic

from thesis_lib.critique.selection.discovery import Shortlist, Step
from thesis_lib.critique.selection.evidence import Evidence
from thesis_lib.critique.selection.scan import Scan
from thesis_lib.critique.selection.world import E, F, J


class Bases(Generic[E, F, J]):
    """The bases of a world, and tests of whether one should replace another."""

    def __init__(self, evidence: Evidence[E, F, J]) -> None:
        self.world, self.settings, self.evidence = evidence.world, evidence.settings, evidence

    def in_full(self, fitted: F) -> F:
        """The same model, fitted until nothing changes."""
        return self.world.fit(fitted.base, fitted.effects, fitted.values)

    def leaves_an_error(self, fitted: F) -> bool:
        """Whether a model errs by more than noise where it was fitted."""
        return self.world.leaves_an_error(self.world.judge(fitted))

    def reserve(self, fitted: F, refine: bool = False) -> list[F]:
        """Quick fits of bases of the reserve with the same effects; empty if the model has such a base already."""
        world = self.world
        return world.reserve_fits(fitted, refine) if world.reserve and fitted.base not in world.reserve else []

    def far_better(
        self, reserve: Sequence[F], quick: Mapping[str, F], contenders: Sequence[F], judged: J
    ) -> tuple[F, J] | None:
        """Result of `other`, if the reserve gains far more over the `contenders` by quick fits than any effect does."""
        if not reserve:
            return None
        world = self.world
        gain = max(world.quick_gain(fit, contenders) for fit in reserve)
        most = max((world.quick_gain(fit, contenders) for fit in quick.values()), default=0.0)
        if gain < max(self.settings.far_better * most, self.settings.tell_apart):
            return None
        return self.other(reserve, max(contenders, key=lambda fit: fit.score), judged)

    def other(self, reserve: Sequence[F], rival: F, to_beat: J) -> tuple[F, J] | None:
        """Fit and judgement of the best base of the reserve, if it predicts better than `rival` and raises no error.

        `reserve` holds quick fits; `to_beat` is the judgement of `rival`.
        """
        least, best = self.settings.tell_apart, self._better(reserve, rival)
        if best is None:
            return None
        other = self.evidence.judge(best)
        gain = self.evidence.gain(other, to_beat, "reserve", best.base)
        better = gain[1] > 0.0 and other.total - to_beat.total > least
        return (self.in_full(best), other) if better and not self.spoils(best, other, to_beat) else None

    def _better(self, reserve: Sequence[F], rival: F) -> F | None:
        """The best of quick fits of the reserve, near enough to be compared, if it is clearly better than `rival`."""
        if not reserve:
            return None
        best = max(reserve, key=lambda fit: fit.score)
        best = self.world.fit(best.base, best.effects, best.values, "near")
        return None if best.score - rival.score < self.settings.tell_apart else best

    def spoils(self, fitted: F, judged: J, than: J) -> bool:
        """Whether a base errs more than another one, even with any one effect that acts on these errors alone.

        A base that fits better may reveal an effect missing in another channel, for which a worse base compensated:
        friction while sliding, for example, if the right base finds the friction of the hits.
        """
        world, settings = self.world, self.settings
        if not world.errs_more(judged, than, settings):
            return False
        for effect in world.acting_on(judged, than, settings):
            if effect not in fitted.effects:
                near = world.fit(fitted.base, (*fitted.effects, effect), fitted.values, "near")
                if not world.errs_more(self.evidence.judge(near), than, settings):
                    return False
        return True

    def with_best_base(self, step: Step[E, F, J]) -> Step[E, F, J]:
        """The step, fitted in full, with the base that fits best; another one may have compensated for the effect."""
        world, fitted, least = self.world, step.fitted, self.settings.tell_apart
        laws = world.fits([(name, fitted.effects, fitted.values, "quick") for name in world.bases])
        reserve = world.reserve_fits(fitted) if fitted.base in world.reserve else []
        # in space quick fits of the two kinds do not compare: a law may be better than all of the reserve
        for others in (laws, reserve) if world.asks_reserve_first else (laws + reserve,):
            others = [fit for fit in others if fit.base != step.fitted.base]
            for quick in sorted(others, key=lambda fit: -fit.score)[:1]:
                best = world.fit(quick.base, quick.effects, quick.values, "near")
                if best.score - step.fitted.score >= least:
                    judged = self.evidence.judge(best)
                    if judged.total - step.judged.total >= least and not self.spoils(best, judged, step.judged):
                        step = replace(step, fitted=best, judged=judged)
        return replace(step, fitted=self.in_full(step.fitted))

    def with_other_base(
        self, step: Step[E, F, J], quick: Mapping[str, F], contenders: Sequence[F], before: J
    ) -> Step[E, F, J]:
        """The step, or an effect that gains nearly as much, on a base of the reserve, if that predicts better."""
        # an effect may have been chosen because the base was the wrong one, and a base because the effect was missing
        world = self.world
        gains = {name: world.quick_gain(quick[name], contenders) for name in list(quick)[: self.settings.runners_up]}
        rivals = [quick[name] for name, gain in gains.items() if gain >= self.settings.nearly * max(gains.values())]
        reserve = [fit for rival in rivals if len(rivals) > 1 for fit in world.reserve_fits(rival)]
        if (other := self.other(reserve, step.fitted, step.judged)) is None:
            return step
        for simpler in (fit for fit in reserve if fit.base == other[0].base):
            if world.includes(other[0].effects[-1].name, simpler.effects[-1].name):
                near = world.fit(simpler.base, simpler.effects, simpler.values, "near")
                judged = self.evidence.judge(near)
                if self.evidence.failure(other[1], judged, other[0].effects[-1]):
                    other = self.in_full(near), judged
        return self._as_step(*other, before, reserve, gains, step.scan)

    def together(self, shortlist: Shortlist[F], fitted: F, judged: J) -> Step[E, F, J] | None:
        """A step to an effect and a base of the reserve that together leave no error, if neither enters by itself.

        Without the effect no base may be better than another, and with the wrong base no effect may help: as for a
        body with many corners, whose contacts only the right law resolves.
        """
        world, names = self.world, list(shortlist.quick)[: self.settings.runners_up]
        reserve = [fit for name in names for fit in world.reserve_fits(shortlist.quick[name])]
        best = self._better(reserve, fitted)
        if best is None:
            return None
        found = self.evidence.judge(best)
        if world.leaves_an_error(found) or self.evidence.failure(found, judged, best.effects[-1]):
            return None
        gains = {best.effects[-1].name: best.score - fitted.score}
        step = self._as_step(self.in_full(best), found, judged, reserve, gains, shortlist.tests)
        return step if step.gain[1] > 0.0 and step.p_value <= self.settings.alpha else None

    def _as_step(
        self, fitted: F, judged: J, before: J, reserve: Sequence[F], gains: Mapping[str, float], tests: Scan
    ) -> Step[E, F, J]:
        """The step to a model whose last effect was chosen among fits of the reserve."""
        effect = fitted.effects[-1]
        scores = {fit.effects[-1].name: fit.score for fit in reserve if fit.base == fitted.base}
        least = scores.pop(effect.name) - self.settings.tell_apart
        others = tuple(name for name, score in scores.items() if score > least)
        gain = self.evidence.gain(judged, before, "gain", *(e.name for e in fitted.effects))
        return Step(effect, others, None, tests.p_value(gains[effect.name]), gain, fitted, judged, tests)
