"""Drops as the statistical problem (world) of the search: laws as bases, testable effects, impacts and flights.

Columns of the score test are secants over a parameter's `scale`, because some effects have no slope at their null.
They include the weights of the t distribution, so that a bad impact counts as little as in the fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from thesis_lib.contact import CANDIDATE_LAWS, LAWS_IN_SPACE
from thesis_lib.contact.compliant.normal_force import HuntCrossley, PressureField
from thesis_lib.critique.contacts.bases import BASES, RESERVE, RESERVE_IN_SPACE
from thesis_lib.critique.contacts.contact_time import BASE_PARAMETERS, OF_FRICTION
from thesis_lib.critique.contacts.kinds import BRIEF
from thesis_lib.critique.contacts.model import Model, inward
from thesis_lib.critique.drops.judgement import (
    Judgement,
    channel_is_material,
    is_buried,
    joined,
    judge,
    spoilt_channels,
)
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.sliding import of_motion
from thesis_lib.critique.likelihood.channels import CHANNELS, IMPACT, SLIDE, concerned
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import (
    ENOUGH_SINGLE,
    ROUNDS,
    SLOPE_STEP,
    WIDER,
    Fit,
    Noise,
    fit,
    fit_each,
    fit_parts,
    jumps,
)
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.synthesis import synthesise
from thesis_lib.critique.likelihood.whitening import Whitening, weight
from thesis_lib.critique.selection.discovery import Discovery
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Asked, Effort, Slopes, World
from thesis_lib.effects import EFFECTS, Effect, effects_in
from thesis_lib.effects.at_wall import effects_at
from thesis_lib.effects.effect import Rig
from thesis_lib.extensions.registry import added_laws
from thesis_lib.foundation.forked import each
from thesis_lib.mechanics.space import Space

# the integrated form of an impulse that takes time; in space, hits are so precise that gravity during a contact, and so
# the contact force, matters
REFINED = RESERVE[:1]
ONE_LAW = ("mirtich",)
MOST_IN_SPACE = 12  # effects; hits are so precise that small causes show
REFITS_IN_SPACE = 49  # each takes seconds; the relative error of their mean is then a seventh, enough near a threshold
ROUNDING = 1e-6  # standard deviations; a smaller change of residuals is not a slope


DropsDiscovery = Discovery[Effect, Fit, Judgement]


class Drops(World[Effect, Fit, Judgement]):
    """Impacts and flights of some trials."""

    unit = "impact"

    def __init__(self, observations: Observations, settings: CritiqueSettings | None = None) -> None:
        self.settings = settings or CritiqueSettings()
        self.timed = self.settings.contact_time and observations.arcs
        self.observations, self.rivals = observations, self.settings.rivals
        # in space hits are so precise that most rigid laws fail because contacts take time
        self.asks_reserve_first = self.forgives_rungs = not observations.space.is_plane
        self.most_effects = type(self).most_effects if observations.space.is_plane else MOST_IN_SPACE
        self.refits = type(self).refits if observations.space.is_plane else REFITS_IN_SPACE
        self.always = (*of_motion(observations), *observations.written)
        # without a lever arm the laws differ only in the meaning of μ: one of them represents all
        of_space = CANDIDATE_LAWS if self.space.is_plane else LAWS_IN_SPACE
        laws = of_space if observations.rig.has_angle else ONE_LAW
        # and a friction with its own parameter depends on a slip that is only partly known
        integrated = RESERVE if self.space.is_plane else RESERVE_IN_SPACE
        slow = [name for name in integrated if observations.rig.has_angle or type(BASES[name].force) not in OF_FRICTION]
        added = (name for name in added_laws() if self.space.dimension in BASES[name].dimensions)
        self.bases, self.reserve = (*laws, *added), tuple(slow) * self.timed
        self.trials = np.unique(observations.trial)
        self.candidates, self.not_testable = testable_effects(observations, self.timed)
        self._noises: dict[tuple, Noise] = {}

    @property
    def space(self) -> Space:
        """Where the body moves."""
        return self.observations.space

    def model(self, base: str, effects: tuple[Effect, ...] = ()) -> Model:
        """The model of a base with effects for these data."""
        return Model(BASES[base], effects, self.timed, self.always, self.space)

    def fit(
        self, base: str, effects: tuple[Effect, ...], start: Mapping[str, float] | None = None, effort: Effort = "full"
    ) -> Fit:
        model = self.model(base, effects)
        if effort == "quick":
            return fit(model.limit, self.quick, start, 1, self._noise_without(model.limit, start))
        return fit(model, self.observations, start, rounds=ROUNDS if effort == "full" else 1)

    def fits(self, asked: Sequence[Asked]) -> list[Fit]:
        sent = each(lambda one: self._sent(self.fit(*one)), asked)
        return [self._received(one, parts) for one, parts in zip(asked, sent)]

    def _sent(self, fitted: Fit) -> tuple:
        """The content of a fit that a forked process sends back: neither model nor data."""
        found, of = fitted.whitening, fitted.whitening.observations
        return fitted.values, fitted.score, found.S, found.sigma_m, found.known, of is self.observations

    def _received(self, asked: Asked, sent: tuple) -> Fit:
        base, effects, _, effort = asked
        values, score, S, sigma_m, known, of_all = sent
        model, of = self.model(base, effects), self.observations if of_all else self.quick
        model = model.limit if effort == "quick" else model
        return Fit(model, values, score, len(of), Whitening(model, of, S, sigma_m, known))

    def cross_validated(self, fits: Sequence[Fit], folds: np.ndarray) -> list[Judgement]:
        return each(lambda fitted: self.cross_validate(fitted, folds), fits)

    def _noise_without(self, model: Model, start: Mapping[str, float] | None) -> Noise | None:
        """Noise of the quick impacts in a model without its last effect, if `start` is a fit of this; cached."""
        smaller = replace(model, effects=model.effects[:-1])
        if start is None or not model.effects or set(start) != set(smaller.parameters):
            return None
        key = model.law.name, smaller.effects, tuple(start.items())
        if key not in self._noises:
            whitening = Whitening.at(smaller, start, self.quick)
            self._noises[key] = whitening.S, whitening.sigma_m
        return self._noises[key]

    @cached_property
    def quick(self) -> Observations:
        """The impacts of quick fits: single hits, as an episode takes fifty times as long; all if these are few."""
        single = self.observations.single
        return single if len(single) >= ENOUGH_SINGLE else self.observations

    def quick_gain(self, fitted: Fit, contenders: Sequence[Fit]) -> float:
        if self.quick is self.observations:
            return super().quick_gain(fitted, contenders)
        best = max(
            sum(map(np.sum, Whitening.at(f.model, f.values, self.quick).log_scores(f.values))) for f in contenders
        )
        # expected gain of all impacts, if episodes are as informative as single hits
        return float(fitted.score - best) * len(self.observations) / len(self.quick)

    def judge(self, fitted: Fit) -> Judgement:
        return judge(fitted, self.observations)

    def cross_validate(self, fitted: Fit, folds: np.ndarray) -> Judgement:
        o, known = self.observations, fitted.whitening if fitted.whitening.observations is self.observations else None
        inside = [self.trials[folds == k] for k in np.unique(folds)]
        others = [self.trials[folds != k] for k in np.unique(folds)]
        if known:
            fits = fit_parts(known, fitted.values, others)
        else:
            fits = fit_each(fitted.model, [(o.select(trials), fitted.values) for trials in others], 1)
        return joined([judge(fit, o.select(trials)) for fit, trials in zip(fits, inside)])

    def leaves_an_error(self, judged: Judgement) -> bool:
        # no base is better than a contact that takes time, unless that is far from noise
        is_last = judged.integrated and not self.space.is_plane
        return judged.excess > (self.settings.near_noise if is_last else self.settings.reserve_excess)

    def reserve_fits(self, fitted: Fit, refine: bool = False) -> list[Fit]:
        if refine and fitted.values["tau"] <= BRIEF:
            return []
        here = fitted.on(self.observations)
        before, after = here.before, here.after
        is_compliant = fitted.base in self.reserve
        turn = fitted.values["tau"] * float(np.median(np.linalg.norm(after.spin - before.spin, axis=0)))
        rigid = fit(fitted.model, self.quick, fitted.values, rounds=1)
        of_law = {p.name for p in BASE_PARAMETERS}
        start = {name: value for name, value in rigid.values.items() if name not in of_law}

        def fitted_with(name: str) -> Fit | None:
            model = self.model(name, fitted.effects)
            if model.limit is model:
                return fit(model, self.quick, rigid.values, rounds=2)
            limit = fit(model.limit, self.quick, start, rounds=1)
            gains = limit.score > rigid.score + self.settings.reserve_gain
            # in space, data are so precise that the limit does not show the gain of a contact that takes time
            if not self.space.is_plane or refine or is_compliant or gains or turn > self.settings.reserve_turn:
                return fit(model, self.quick, limit.values, rounds=1)
            return None

        if not self.space.is_plane:
            sent = each(lambda name: self._sent(one) if (one := fitted_with(name)) else (), self.reserve)
            found = zip(self.reserve, sent)
            return [self._received((name, fitted.effects, None, "near"), one) for name, one in found if one]
        fits = []
        for name in REFINED if refine else self.reserve:
            best = max(fits, key=lambda fit: fit.score, default=rigid)
            # a pressure field dissipates as Hunt and Crossley's contact does, and takes ten times as long
            if not isinstance(BASES[name].force, PressureField) or isinstance(best.model.law.force, HuntCrossley):
                fits += filter(None, [fitted_with(name)])
        return fits

    def errs_more(self, judged: Judgement, than: Judgement, settings: SearchSettings) -> bool:
        # the log score tolerates a minority of large errors, as of hits of two corners, and one channel for another
        return bool(spoilt_channels(judged, than, settings))

    def is_vetoed(self, judged: Judgement, than: Judgement, settings: SearchSettings) -> bool:
        # sliding may have its own friction, which with a wrong base may by chance equal that of the hits
        forgiven = {SLIDE.name} if any(e.channels == (SLIDE.name,) for e in self.candidates.values()) else set()
        near, far = self.settings.near_noise, self.settings.far_from_noise
        if not self.space.is_plane and judged.total > than.total:
            if than.excess > far:
                return False
            # of two causes that act on the flights, for example, the first one found may leave more to the second
            forgiven |= {name for name, square in than.sigmas.items() if square > far**2}
        if judged.integrated and settings.matters(than.excess, judged.excess, 1.0):
            # the end of a contact follows from velocities that were wrong or still are, and was wrong before
            wrong = (name for name, square in than.sigmas.items() if square > near)
            forgiven |= {name for name in wrong if CHANNELS[name].of_contact and not self.space.is_plane}
        return not forgiven.issuperset(spoilt_channels(judged, than, settings))

    def acting_on(self, judged: Judgement, than: Judgement, settings: SearchSettings) -> list[Effect]:
        spoilt = {*spoilt_channels(judged, than, settings)} - {IMPACT.name}  # velocities are the task of bases
        return [e for e in self.candidates.values() if e.channels and spoilt.issuperset(e.channels)]

    def leaves_little(self, fitted: Fit, judged: Judgement, candidate: Effect) -> bool:
        if fitted.base in self.reserve and fitted.values["tau"] <= BRIEF:
            return False  # hardly a slope along the time of an integrated contact
        if self.misjudged(candidate):
            return False
        squares = [judged.sigmas.get(channel, np.nan) for channel in concerned(candidate)]
        near = self.settings.near_noise
        is_noise = judged.excess <= near and all(square <= near for square in squares if np.isfinite(square))
        return is_noise or super().leaves_little(fitted, judged, candidate)

    def is_material(self, better: Judgement, worse: Judgement, candidate: Effect, settings: SearchSettings) -> bool:
        channels = set(concerned(candidate))
        if self.timed and "touch" in channels:
            channels.add("impact")  # a contact time that compensated for the touch spoilt the velocities
        if better.integrated and worse.integrated and "touch" in channels:
            channels.add("meet")  # where a contact begins decides where it ends
        if any(p.of for p in candidate.parameters):
            channels.add("impact")  # a μ shared with slides spoilt the velocities
        if any(channel_is_material(better, worse, channel, settings) for channel in channels):
            return True
        least = self.settings.buried_excess
        return (
            not self.space.is_plane
            and IMPACT.name in channels
            and is_buried(worse, least)
            and settings.matters(worse.excess, better.excess, 1.0)
        )

    def includes(self, candidate: str, other: str) -> bool:
        return other in self.candidates[candidate].includes

    def misjudged(self, candidate: Effect) -> bool:
        # one of several minima may be flat, as for a friction that depends on speed if all hits stick
        parameters = self.model(self.bases[0]).parameters_of(candidate)
        return not self.space.is_plane and any(len(p.starts) > 1 for p in parameters)

    def turns_bases(self, candidate: Effect) -> bool:
        return any(p.discrete is not None for p in candidate.parameters)

    def start_with(self, fitted: Fit, candidate: Effect) -> Mapping[str, float]:
        if not self.turns_bases(candidate):
            return fitted.values
        # a mirrored axis inverts the contact: (μ, ε) fitted without it are a bad start
        of_law = {p.name for p in BASE_PARAMETERS}
        return {name: value for name, value in fitted.values.items() if name not in of_law}

    def values_of_base(self, fitted: Fit) -> Mapping[str, float]:
        return {name: value for name, value in fitted.values.items() if "." not in name}

    def moved(self, fitted: Fit, before: Fit) -> float:
        model, values = before.model, (before.values, fitted.values)
        sizes = [
            (name, p)
            for effect in model.effects
            if effect in fitted.effects
            for p in model.parameters_of(effect)
            if p.discrete is None and not p.along
            for name in (f"{effect.name}.{p.name}",)
        ]
        then, now = (sum(((at[name] - p.absent_at(at)) / p.scale) ** 2 for name, p in sizes) for at in values)
        return now - then

    def drawn(self, fitted: Fit, rng: np.random.Generator) -> Self:
        synthetic = synthesise(Comparison(fitted.model.limit, fitted.values, self.observations), rng, fitted.sigma_m)
        return type(self)(synthetic, self.settings)

    def slopes(self, fitted: Fit, candidates: Sequence[Effect]) -> Slopes:
        model, S = fitted.model, fitted.on(self.observations).covariance()
        here = Whitening(model, self.observations, S, fitted.sigma_m)
        base = here.stacked(fitted.values)
        weights = np.concatenate([np.repeat(weight(z), z.shape[1]) for z in here(fitted.values)])

        def slope(whitening: Whitening, values: Mapping[str, float], name: str, step: float) -> np.ndarray:
            # one by one: points computed together differ by the error of an iteration, not by a slope
            change = whitening.stacked({**values, name: values[name] + step}) - base
            return weights * change / step if np.abs(change).max(initial=0.0) > ROUNDING else 0.0 * change

        def of_fitted(name: str) -> np.ndarray:
            share, p = SLOPE_STEP * (WIDER[-1] if jumps(model) else 1.0), model.fitted_parameters[name]
            return slope(here, fitted.values, name, inward(p, fitted.values[name], share * p.scale))

        def of_candidate(effect: Effect) -> np.ndarray:
            with_it = Whitening(model.with_effect(effect), self.observations, S, fitted.sigma_m)
            parameters = model.parameters_of(effect)
            values = fitted.values | {f"{effect.name}.{p.name}": p.absent_at(fitted.values) for p in parameters}
            secants = []
            for p in parameters:
                name = f"{effect.name}.{p.name}"
                steps = [option - p.null for option in p.options] or [inward(p, values[name], p.scale)]
                secants += [slope(with_it, values, name, step) for step in steps]
            return np.stack(secants, axis=1)

        columns = np.stack(each(of_fitted, list(model.fitted_parameters)), axis=1)
        of_candidates = dict(zip((effect.name for effect in candidates), each(of_candidate, candidates)))
        return Slopes(weights * base, columns, of_candidates, unit_noise=False)


def testable_effects(observations: Observations, timed: bool) -> tuple[dict[str, Effect], dict[str, str]]:
    """Testable effects by name, and by name why the others cannot be tested; `timed`: whether contacts take time."""
    testable, why_not, rig = {}, {}, observations.rig
    slides = any(len(beside) for beside in observations.supports if beside.channel == SLIDE.name)
    library = effects_in(rig.space) if rig.space.is_plane else EFFECTS
    for name, effect in [*library.items(), *((effect.name, effect) for effect in effects_at(rig.walls))]:
        if rig.space.dimension not in effect.dimensions:
            why_not[name] = f"is not defined in {rig.space.dimension} dimensions"
        elif effect.needs_history and rig.recorded is None:
            why_not[name] = "no trajectories of whole tosses: it depends on the motion before a hit"
        elif not effect.applies_to(rig):
            flat = rig.gravity == 0.0 and effect.channels == ("flight",)
            why_not[name] = "there is no gravity" if flat else f"does not apply to a body of shape {_shape_of(rig)}"
        elif effect.needs_angle and not rig.has_angle:
            what = "theta" if rig.space.is_plane else "orientation"
            why_not[name] = f"{what} is not measured: it shows only in the spin, or an unknown spin has the same effect"
        elif effect.needs_one_surface and rig.walls:
            why_not[name] = "there are walls instead of one surface"
        elif effect.needs_trajectories and not observations.arcs:
            why_not[name] = "no trajectories"
        elif effect.needs_contact_time and not timed:
            why_not[name] = "contacts are taken as instants"
        elif effect.channels == (SLIDE.name,) and not slides:
            why_not[name] = "no body slides on the surface"
        else:
            testable[name] = effect
    return testable, why_not


def _shape_of(rig: Rig) -> str:
    """Kind of the assumed shape, wherever its origin is."""
    shape: Any = rig.shape
    return getattr(shape, "solid", shape).kind
