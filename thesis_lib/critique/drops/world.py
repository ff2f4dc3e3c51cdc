"""Drops as a world for the search: laws as bases, testable effects, impacts and flights as data.

The error of an impact is the kinetic norm √(δv_x² + δv_y² + (k δω)²) of the velocity after impact in m/s.  The other
channels need trajectories.  Their misfit is the root mean square of the worst component in units of noise: flight
(acceleration), meet (pose) and touch (gap given the poses).  A fault of the touch may concern few impacts, as of one
corner; its misfit is the larger of those that the median and the upper tenth of the impacts show.  The noise floor is
the error of a perfect model whose inputs and outcome are measured with noise: the mean kinetic norm of draws from the
residual's covariance S.

Columns of the score test are secants over a parameter's `scale`, because some effects have no slope at their null.
They include the weights of the t distribution, so that a bad impact counts as little as in the fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from thesis_lib.contact import CANDIDATE_LAWS
from thesis_lib.contact.compliant.normal_force import HuntCrossley, PressureField
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.contacts.bases import BASES, RESERVE
from thesis_lib.critique.contacts.contact_time import BASE_PARAMETERS, OF_FRICTION
from thesis_lib.critique.contacts.kinds import BRIEF, kind_of
from thesis_lib.critique.contacts.model import Model, inward
from thesis_lib.critique.drops.planar.unknown_spin import left_over
from thesis_lib.critique.likelihood.covariance import noisy_residuals, residual_covariance
from thesis_lib.critique.likelihood.fit import ENOUGH_SINGLE, ROUNDS, SLOPE_STEP, Fit, Noise, fit, fit_each
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.residuals import flight_residuals, states_at_impact, synthesise
from thesis_lib.critique.likelihood.whitening import Whitening, given_the_others, weight
from thesis_lib.critique.selection.discovery import Discovery
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Effort, Slopes, World
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.effects.at_wall import effects_at
from thesis_lib.extensions.registry import added_laws
from thesis_lib.statistics.spread import quantile_std, robust_std

# a compliant contact takes ten times as long; it is tried beyond this median error over noise, where bodies turn by
# this much more (rad) during a contact, or where its limit as an impact law gains this much (nats)
LEAVES, TURNS, GAINS = 1.2, 0.02, 3.0
REFINED = RESERVE[:1]  # an impulse that takes time, integrated
NEAR = 1.5  # median error over noise, and mean squares of the other channels, at which slopes tell what is worth a fit
ONE_LAW = ("mirtich",)
CHANNELS = ("impact", "flight", "meet", "touch")
UPPER = 0.9  # quantile of the touch that a fault of a tenth of the impacts moves
ROUNDING = 1e-6  # standard deviations; what changes residuals by less has no slope
FLOOR_SEED = 0
FLOOR_DRAWS = 64  # per impact; the mean over 100 impacts then has an error of 1 %


@dataclass(frozen=True)
class Judgement:
    """Result of one model on data that it was not fitted to.

    Attributes:
        trial, flight_trial: trial of each impact (n,) and flight (f,).
        score, flight_score: log scores in nats, (n,) and (f,).
        error: (n,) kinetic norm, m/s.
        sigmas: mean square in units of noise, by channel "flight", "meet", "touch"; NaN if absent.
        floor: noise floor of `error`, m/s; excess: median error over that of noise alone; NaN if the noise is unknown.
        integrated: whether the contact was, so that `sigmas` are of where it ends; an impulse moves nothing.
    """

    trial: np.ndarray
    flight_trial: np.ndarray
    score: np.ndarray
    flight_score: np.ndarray
    error: np.ndarray
    sigmas: dict[str, float]
    floor: float
    excess: float
    integrated: bool = False

    @property
    def trials(self) -> np.ndarray:
        return np.unique(np.concatenate([self.trial, self.flight_trial]))

    @property
    def units(self) -> int:
        return len(self.score)

    @property
    def total(self) -> float:
        return float(self.score.sum() + self.flight_score.sum())

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        total = np.zeros(len(trials))
        for trial, score in ((self.trial, self.score), (self.flight_trial, self.flight_score)):
            np.add.at(total, np.searchsorted(trials, trial), score)
        return total


DropsDiscovery = Discovery[Effect, Fit, Judgement]


class Drops(World[Effect, Fit, Judgement]):
    """Impacts and flights of some trials; `rivals` laws are tried with the first effect, `timed` contacts take time."""

    unit = "impact"

    def __init__(self, observations: Observations, rivals: int = 1, timed: bool = True) -> None:
        self.timed = timed and observations.arcs
        self.observations, self.rivals = observations, rivals
        self.slides = observations.arcs and observations.rig.gravity == 0.0
        # without a lever arm the laws differ in what they call μ alone: one of them stands for all
        laws = CANDIDATE_LAWS if observations.rig.has_angle else ONE_LAW
        # and a friction with a parameter of its own acts on a slip that is known by half
        slow = [name for name in RESERVE if observations.rig.has_angle or type(BASES[name].force) not in OF_FRICTION]
        self.bases, self.reserve = (*laws, *added_laws()), tuple(slow) * self.timed
        self.trials = np.unique(observations.trial)
        self.candidates, self.not_testable = testable_effects(observations, self.timed)
        self._noises: dict[tuple, Noise] = {}

    def fit(
        self, base: str, effects: tuple[Effect, ...], start: Mapping[str, float] | None = None, effort: Effort = "full"
    ) -> Fit:
        model = Model(BASES[base], effects, self.timed, self.slides)
        if effort == "quick":
            return fit(model.limit, self.quick, start, 1, self._noise_without(model.limit, start))
        return fit(model, self.observations, start, rounds=ROUNDS if effort == "full" else 1)

    def _noise_without(self, model: Model, start: Mapping[str, float] | None) -> Noise | None:
        """Noise of the quick impacts in a model without its last effect, if `start` is a fit of that; kept."""
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
        """The impacts of quick fits: single hits, for an episode takes fifty times as long; all if these are few."""
        single = self.observations.single
        return single if len(single) >= ENOUGH_SINGLE else self.observations

    def quick_gain(self, fitted: Fit, contenders: Sequence[Fit]) -> float:
        if self.quick is self.observations:
            return super().quick_gain(fitted, contenders)
        best = max(
            sum(map(np.sum, Whitening.at(f.model, f.values, self.quick).log_scores(f.values))) for f in contenders
        )
        # what all impacts will say, if episodes tell as much as single hits
        return float(fitted.score - best) * len(self.observations) / len(self.quick)

    def judge(self, fitted: Fit) -> Judgement:
        model, values, o = fitted.model, fitted.values, self.observations
        noisy = noisy_residuals(model, values, o)
        whitening = Whitening(model, o, noisy.covariance(), fitted.sigma_m, (values, noisy.value))
        R, S = noisy.value, noisy.covariance(o.t_std)
        sigmas: dict[str, float] = dict.fromkeys(CHANNELS[1:], np.nan)
        flight = flight_residuals(model, values, o.flights, o.rig)
        if len(flight):
            sigmas["flight"] = _robust_mean_square(flight / np.sqrt(o.flights.variance))
        if o.arcs:
            sigmas["meet"] = _robust_mean_square(R[:, 3:6] / np.sqrt(np.einsum("nii->ni", S)[:, 3:6]))
            single = o.span == 0.0  # episodes do not measure the touch
            if single.any():
                touch = given_the_others(R[single, 3:], noisy.covariance()[single, 3:, 3:])
                sigmas["touch"] = max(_robust_mean_square(touch), float(np.max(quantile_std(touch, UPPER)) ** 2))
        knows_spin = o.rig.has_angle
        error = velocity_error(R[:, :3] if knows_spin else left_over(model, values, o, R[:, :3]), o.rig.k_told)
        floor, excess = np.nan, np.nan
        if o.noise_known:
            L = np.linalg.cholesky(S[:, :3, :3] + 1e-18 * np.eye(3))
            # the same draws for every model: equal residuals then have equal floors
            unit = np.random.default_rng(FLOOR_SEED).standard_normal((FLOOR_DRAWS, len(o), 3))
            drawn = np.einsum("nij,dnj->dni", L, unit)
            noise = velocity_error(drawn if knows_spin else left_over(model, values, o, drawn), o.rig.k_told)
            floor, excess = float(noise.mean()), float(np.median(error) / np.median(noise))
        scores = whitening.log_scores(values)
        return Judgement(
            o.trial, o.flights.state.trial, *scores, error, sigmas, floor, excess, integrated=kind_of(model).integrated
        )

    def cross_validate(self, fitted: Fit, folds: np.ndarray) -> Judgement:
        tasks, unseen, noise = [], [], []
        known = fitted.whitening if fitted.whitening.observations is self.observations else None
        for k in np.unique(folds):
            others, inside = (self.observations.select(self.trials[rows]) for rows in (folds != k, folds == k))
            tasks.append((others, fitted.values))
            unseen.append(Drops(inside))
            rows = np.isin(self.observations.trial, self.trials[folds != k])
            noise.append((known.S[rows], known.sigma_m) if known else None)
        parts = [world.judge(fit) for world, fit in zip(unseen, fit_each(fitted.model, tasks, 1, noise))]
        weights = np.array([len(part.score) for part in parts], float)

        def mean(values: list[float]) -> float:
            return float(np.average(values, weights=weights))

        return Judgement(
            **{
                name: np.concatenate([getattr(part, name) for part in parts])
                for name in ("trial", "flight_trial", "score", "flight_score", "error")
            },
            sigmas={name: mean([part.sigmas[name] for part in parts]) for name in CHANNELS[1:]},
            floor=mean([part.floor for part in parts]),
            excess=mean([part.excess for part in parts]),
            integrated=kind_of(fitted.model).integrated,
        )

    def leaves_an_error(self, judged: Judgement) -> bool:
        return judged.excess > LEAVES

    def reserve_fits(self, fitted: Fit, refine: bool = False) -> list[Fit]:
        if refine and fitted.values["tau"] <= BRIEF:
            return []
        before, after = states_at_impact(fitted.model, fitted.values, self.observations)
        is_compliant = fitted.base in self.reserve
        turn = fitted.values["tau"] * float(np.median(np.abs(after.omega - before.omega)))
        rigid = fit(fitted.model, self.quick, fitted.values, rounds=1)
        of_law = {p.name for p in BASE_PARAMETERS}
        start, fits = {name: value for name, value in rigid.values.items() if name not in of_law}, []
        for name in REFINED if refine else self.reserve:
            model = Model(BASES[name], fitted.effects, self.timed, self.slides)
            best = max(fits, key=lambda fit: fit.score, default=rigid)
            # a pressure field loses as Hunt and Crossley's contact does, and takes ten times as long
            if isinstance(model.law.force, PressureField) and not isinstance(best.model.law.force, HuntCrossley):
                continue
            if model.limit is model:
                fits.append(fit(model, self.quick, rigid.values, rounds=2))
                continue
            limit = fit(model.limit, self.quick, start, rounds=1)
            if refine or is_compliant or turn > TURNS or limit.score > rigid.score + GAINS:
                fits.append(fit(model, self.quick, limit.values, rounds=1))
        return fits

    def errs_more(self, judged: Judgement, than: Judgement, settings: SearchSettings) -> bool:
        # the log score forgives a minority that is far off, as hits of two corners may be, and one channel for another
        return bool(spoilt_channels(judged, than, settings))

    def leaves_little(self, fitted: Fit, judged: Judgement, candidate: Effect) -> bool:
        if fitted.base in self.reserve and fitted.values["tau"] <= BRIEF:
            return False  # hardly a slope along the time of an integrated contact
        squares = [judged.sigmas.get(channel, np.nan) for channel in candidate.channels]
        is_noise = judged.excess <= NEAR and all(square <= NEAR for square in squares if np.isfinite(square))
        return is_noise or super().leaves_little(fitted, judged, candidate)

    def is_material(self, better: Judgement, worse: Judgement, candidate: Effect, settings: SearchSettings) -> bool:
        channels = set(candidate.channels)
        if self.timed and "touch" in channels:
            channels.add("impact")  # a contact time that made up for the touch erred in the velocities
        if better.integrated and worse.integrated and "touch" in channels:
            channels.add("meet")  # where a contact begins decides where it ends
        return any(channel_is_material(better, worse, channel, settings) for channel in channels)

    def includes(self, candidate: str, other: str) -> bool:
        return other in EFFECTS[candidate].includes

    def turns_bases(self, candidate: Effect) -> bool:
        return any(p.discrete is not None for p in candidate.parameters)

    def start_with(self, fitted: Fit, candidate: Effect) -> Mapping[str, float]:
        if not self.turns_bases(candidate):
            return fitted.values
        # a mirrored axis inverts the contact: (μ, ε) fitted without it are a bad start
        of_law = {p.name for p in BASE_PARAMETERS}
        return {name: value for name, value in fitted.values.items() if name not in of_law}

    def drawn(self, fitted: Fit, rng: np.random.Generator) -> Self:
        synthetic = synthesise(fitted.model.limit, fitted.values, self.observations, rng, fitted.sigma_m)
        return type(self)(synthetic, self.rivals, self.timed)

    def slopes(self, fitted: Fit, candidates: Sequence[Effect]) -> Slopes:
        model, S = fitted.model, residual_covariance(fitted.model, fitted.values, self.observations)
        here = Whitening(model, self.observations, S, fitted.sigma_m)
        base = here.stacked(fitted.values)
        weights = np.concatenate([np.repeat(weight(z), z.shape[1]) for z in here(fitted.values)])

        def slope(whitening: Whitening, values: Mapping[str, float], name: str, step: float) -> np.ndarray:
            # one by one: points that go together differ by what an iteration leaves, which is no slope
            change = whitening.stacked({**values, name: values[name] + step}) - base
            return weights * change / step if np.abs(change).max(initial=0.0) > ROUNDING else 0.0 * change

        columns = [
            slope(here, fitted.values, name, inward(p, fitted.values[name], SLOPE_STEP * p.scale))
            for name, p in model.fitted_parameters.items()
        ]
        of_candidates = {}
        for effect in candidates:
            with_it = Whitening(model.with_effect(effect), self.observations, S, fitted.sigma_m)
            values = fitted.values | {f"{effect.name}.{p.name}": p.null for p in effect.parameters}
            secants = []
            for p in effect.parameters:
                step = inward(p, p.null, p.scale) if p.discrete is None else p.discrete - p.null
                secants.append(slope(with_it, values, f"{effect.name}.{p.name}", step))
            of_candidates[effect.name] = np.stack(secants, axis=1)
        return Slopes(weights * base, np.stack(columns, axis=1), of_candidates, unit_noise=False)


def testable_effects(observations: Observations, timed: bool) -> tuple[dict[str, Effect], dict[str, str]]:
    """Testable effects by name, and by name why the others cannot be tested; `timed`: whether contacts take time."""
    testable, why_not, rig = {}, {}, observations.rig
    for name, effect in [*EFFECTS.items(), *((effect.name, effect) for effect in effects_at(rig.walls))]:
        if not effect.applies_to(rig):
            flat = rig.gravity == 0.0 and effect.channels == ("flight",)
            why_not[name] = "there is no gravity" if flat else f"does not apply to a body of shape {rig.shape.kind}"
        elif effect.needs_angle and not rig.has_angle:
            why_not[name] = "theta is not measured: only the spin shows it, or the unknown spin does the same"
        elif effect.needs_one_surface and rig.walls:
            why_not[name] = "there are walls instead of one surface"
        elif effect.needs_trajectories and not observations.arcs:
            why_not[name] = "no trajectories"
        elif effect.needs_contact_time and not timed:
            why_not[name] = "contacts are taken as instants"
        else:
            testable[name] = effect
    return testable, why_not


def channel_is_material(better: Judgement, worse: Judgement, channel: str, settings: SearchSettings) -> bool:
    """Whether the held-out error of a channel falls by an amount that matters."""
    if channel == "impact":
        before, after, floor = float(worse.error.mean()), float(better.error.mean()), worse.floor
        floor = floor if np.isfinite(floor) else 0.0
    else:
        # root mean squares in units of noise
        before, after, floor = np.sqrt(worse.sigmas[channel]), np.sqrt(better.sigmas[channel]), 1.0
    return bool(np.isfinite(before)) and settings.matters(before, after, floor)


def spoilt_channels(judged: Judgement, than: Judgement, settings: SearchSettings) -> tuple[str, ...]:
    """Channels in which one model errs more than another one by an amount that matters.

    A misfit below noise does not count.  Poses and gaps at impact are compared only if both contacts are integrated, or
    neither.
    """
    channels = CHANNELS if judged.integrated == than.integrated else CHANNELS[:2]
    noise = replace(than, sigmas={name: max(square, 1.0) for name, square in than.sigmas.items()})
    return tuple(name for name in channels if channel_is_material(noise, judged, name, settings))


def _robust_mean_square(z: np.ndarray) -> float:
    """Robust mean square, from the median, of the worst component of z (n, c).

    The median ignores a few flights with an undetected hit; the worst component shows a wrong gravity despite x and θ.
    """
    return float(np.max(robust_std(z)) ** 2)
