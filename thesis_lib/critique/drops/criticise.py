"""Critique of one dataset: compare laws, choose effects, and judge the remaining error.

Trials are split once: 70 % for every choice (law, effects, where to stop) by K-fold, and 30 % held out for all reported
errors.  Held-out trials choose nothing, but remove an effect that raises one of their errors or lowers none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from threadpoolctl import threadpool_limits

from thesis_lib.contact.bounds import best_impulse
from thesis_lib.contact.space import velocity_error
from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.elsewhere import HitsElsewhere, hits_elsewhere
from thesis_lib.critique.drops.features import remaining
from thesis_lib.critique.drops.few_impacts import too_few
from thesis_lib.critique.drops.judgement import Judgement
from thesis_lib.critique.drops.one_body import refuse_what_is_not_one_body
from thesis_lib.critique.drops.own_restitution import own_restitution
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.stand_ins import StandIn, partial, stand_ins
from thesis_lib.critique.drops.unpredictable import predictable
from thesis_lib.critique.drops.world import Drops, DropsDiscovery, testable_effects
from thesis_lib.critique.likelihood.channels import FLIGHT
from thesis_lib.critique.likelihood.fit import Fit, seeing
from thesis_lib.critique.likelihood.in_space.hits import observe_in_space
from thesis_lib.critique.likelihood.observations import Observations, observe
from thesis_lib.critique.selection.discovery import judge_held_out
from thesis_lib.critique.selection.search import search, split
from thesis_lib.critique.selection.world import Remaining
from thesis_lib.datasets.checks.tracked_pose import settled
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.impacts import POSE, V_POST, V_PRE
from thesis_lib.datasets.format.samples import ArcSettings
from thesis_lib.datasets.impacts.found import MIN_IMPACTS, MIN_TRIALS, are_enough
from thesis_lib.datasets.space.flights import too_slow
from thesis_lib.effects import EFFECTS, require_known
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.contact import velocity_change
from thesis_lib.mechanics.space import Space


@dataclass(frozen=True)
class DropsCritique:
    """Result of criticising one dataset.

    Attributes:
        observations, training, held_out: all impacts, and the two parts.
        discovery: law and effects, chosen on training trials.
        ladder: (label, fit, held-out judgement) after 0, 1, ... effects.
        laws: held-out judgement of each law without effects.
        without: by effect, held-out judgement of the final model refitted without it.
        remaining: structure in the residuals of training trials after the last effect.
        irb, irb_augmented: held-out IRB bound, m/s, as measured, and with the final geometry, inertia and camera.
        no_impact: held-out error if velocities stayed unchanged, m/s.
        source: the dataset, for plots of its samples.
    """

    dataset: str
    settings: CritiqueSettings
    observations: Observations
    training: Observations
    held_out: Observations
    discovery: DropsDiscovery
    ladder: tuple[tuple[str, Fit, Judgement], ...]
    laws: dict[str, Judgement]
    without: dict[str, Judgement]
    remaining: Remaining
    irb: float
    irb_augmented: float
    no_impact: float
    source: Dataset | None = None

    @property
    def space(self) -> Space:
        """Where the body moves."""
        return self.observations.space

    @property
    def verdict(self) -> str:
        """adequate, effects or unexplained; an error that only a proxy (`stand_ins`) explains is unexplained."""
        nameless = {name for name, found in self.stand_ins.items() if not found.instead}
        clearing = {step.effect.name for step in self.discovery.steps if step.clears}
        missing = self.observations.found.down is not None  # no law has a restitution that vanishes below a speed
        missing |= self.elsewhere is not None
        return self.discovery.verdict(self.is_structured or bool(nameless & clearing) or missing)

    @cached_property
    def elsewhere(self) -> HitsElsewhere | None:
        """Hits on an object other than the surface, if there are more than tracking errors would explain."""
        return hits_elsewhere(self.ladder[-1][1], self.observations, self.settings.elsewhere)

    @cached_property
    def stand_ins(self) -> dict[str, StandIn]:
        """Effects of the final model that are, or may be, only proxies for another cause, by name."""
        steps, (_, fitted, last), s = self.discovery.steps, self.ladder[-1], self.settings
        found = partial(steps, self.ladder[0][2], last, self.without, s, s.explains) if self.is_structured else {}
        if self.source is not None:
            found |= stand_ins(self.source.header.body, steps, fitted, s.contradicts)
        return found

    @property
    def is_structured(self) -> bool:
        """Whether the remaining error is material: learnable from the state, or a misfit far beyond noise."""
        return self.is_learnable or bool(self.misfit_channels)

    @property
    def misfit_channels(self) -> tuple[str, ...]:
        """Channels with a held-out misfit far above noise after all effects."""
        last, limit = self.ladder[-1][2], self.settings.excess_scatter
        far = [name for name, (misfit, std) in last.over_noise().items() if misfit > limit * (1.0 + 2.0 * std)]
        if FLIGHT.name not in far and self.observations.flights.are_bent:
            far.append(FLIGHT.name)
        return tuple(far)

    @property
    def is_learnable(self) -> bool:
        """Whether the structure that a Gaussian process learns is significant and material."""
        floor = self.ladder[-1][2].floor
        return self.remaining.is_structured(self.settings, floor if np.isfinite(floor) else 0.0)

    @cached_property
    def restitution_differs(self) -> tuple[str, float, float] | None:
        """ "trial" or "impact", between which only restitution differs, with no recorded cause; and the range of ε."""
        if not self.is_structured or self.remaining.p_value <= self.settings.alpha:
            return None
        own = own_restitution(self.ladder[-1][1], self.observations)
        by = own.differs(self.settings.excess_scatter)
        return None if by is None else (by, float(own.epsilon.min()), float(own.epsilon.max()))


# BLAS threads do not speed up these small matrices, and their number changes last digits
@threadpool_limits.wrap(limits=1)
def criticise_drops(
    dataset: Dataset,
    *,
    rng: np.random.Generator,
    settings: CritiqueSettings | None = None,
    arcs: ArcSettings | None = None,
    effects: Sequence[str] | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> DropsCritique:
    """Compare contact models with measured drops, choose effects, and judge the remaining error.

    Args:
        rng: for split, folds and resamples; seed it from the dataset's content for reproducible results.
        arcs: settings of the detection of impacts.
        effects: names of effects to switch on instead of the automatic choice.
        say: function that receives one line of text per step.

    Raises:
        TooFew: fewer than 30 usable impacts in 10 trials, or no single hits among training or held-out trials.
        UserError: a channel is constant, contacts last too long for impacts, the motion is not that of one planar
            rigid body, or an effect is unknown or cannot be tested.
    """
    settings = settings or CritiqueSettings()
    say("finding impacts")
    dataset = dataset if dataset.space.is_plane else settled(dataset)  # the saved model predicts with that pose
    observations = _observed(dataset, effects or (), settings, arcs)
    trials = np.unique(observations.trial)
    slow = "" if dataset.space.is_plane or not observations.arcs else too_slow(dataset.rate)
    if slow or not are_enough(len(observations), len(trials)):
        needs = f"the critique needs {MIN_IMPACTS} in {MIN_TRIALS} to keep training and held-out data apart"
        raise too_few(dataset, observations, needs)
    training, held_out = map(observations.select, split(trials, settings.held_out_share, rng))
    if not (len(training.single) and len(held_out.single)):
        raise too_few(dataset, observations, "nearly all follow each other too quickly, but errors need single hits")
    observations, training = (part.counted_from(training.middle) for part in (observations, training))
    observations = predictable(observations, training, settings)
    training, held_out = (observations.select(np.unique(part.trial)) for part in (training, held_out))
    world = Drops(training, settings)
    say(f"fitting {len(world.bases)} laws")
    discovery = search(world, settings, rng, effects, say)
    discovery = discovery.each(lambda fitted: seeing(fitted, observations))
    say("judging on held-out trials")
    unseen = Drops(held_out, settings)
    discovery, ladder, without = judge_held_out(world, unseen, discovery, settings, effects is not None)
    laws = {name: unseen.judge(fitted) for name, fitted in discovery.bases.items()}
    base, final = ladder[0][1], ladder[-1][1]
    say("looking for what remains")
    structure = remaining(final, training.single, rng)
    here = base.on(held_out)
    no_impact = held_out.norm(here.after.v - here.before.v)
    irb, irb_augmented = (float(irb_errors(fitted, held_out).mean()) for fitted in (base, final))
    errors = (irb, irb_augmented, float(no_impact.mean()))
    parts = (observations, training, held_out)
    return DropsCritique(
        dataset.name, settings, *parts, discovery, ladder, laws, without, structure, *errors, source=dataset
    )


@threadpool_limits.wrap(limits=1)
def fit_model(
    dataset: Dataset,
    law: str,
    effects: Sequence[str] = (),
    settings: CritiqueSettings | None = None,
    arcs: ArcSettings | None = None,
) -> Fit:
    """Fit one law with named effects to all impacts and flights; UserError as for `criticise`, or an unknown law."""
    if law not in BASES:
        raise UserError(f"There is no law {law!r}; known are {', '.join(BASES)}.")
    settings = settings or CritiqueSettings()
    observations = _observed(dataset, effects, settings, arcs)
    if not len(observations):
        raise too_few(dataset, observations, "a fit needs one or more")
    observations = observations.counted_from(observations.middle)
    world = Drops(predictable(observations, observations, settings), settings)
    return world.fit(law, tuple(world.candidates[name] for name in dict.fromkeys(effects)))


def irb_errors(fitted: Fit, observations: Observations) -> np.ndarray:
    """Error (n,) in m/s of each single hit with the best impulse of a rigid point contact in the fitted geometry."""
    o = observations.single
    if not o.rig.has_angle:
        return np.zeros(len(o))  # with the right spin an impulse reaches any velocity
    here = fitted.on(o)
    (before, at), (after, _) = (here.dynamics.measured_contact(state, o.offset) for state in here.at_impulse)
    dv = after.motion - before.motion
    left = dv - velocity_change(best_impulse(at, dv), at.r, at.mobility)
    if o.space.is_plane:
        return velocity_error(left.T, at.mobility**-0.5)
    G = np.linalg.inv(np.moveaxis(at.mobility, -1, 0))
    return np.sqrt((left[:3] ** 2).sum(axis=0) + np.einsum("in,nij,jn->n", left[3:], G, left[3:]))


def _refuse_constant(dataset: Dataset) -> None:
    """Raise a UserError if a channel of planar data never changes: it was not measured, so no verdict is possible."""
    direct = dataset.impacts is not None and len(dataset.impacts) > 0
    poses = POSE if dataset.has_angle else POSE[:2]
    table = dataset.impacts if direct else dataset.trajectories
    if table is None or len(table) < 2 or not dataset.space.is_plane:
        return
    columns = (*V_PRE, *V_POST) if direct else poses
    lowest = dataset.shape.contact_point(np.linspace(0.0, 2.0 * np.pi, 181))[:, 1]
    if direct and np.ptp(lowest) > 1e-9 * dataset.shape.extent:
        columns = ("theta", *columns)  # only if the angle moves the contact point
    if stuck := [name for name in columns if table[name].nunique() == 1]:
        column, hold = ("Columns", "hold") if len(stuck) > 1 else ("Column", "holds")
        raise UserError(
            f"{column} {', '.join(stuck)} of {'impacts' if direct else 'trajectories'}.csv in {dataset.name} {hold} "
            f"the same value in all {len(table)} rows, so nothing was measured there and no model can be judged. "
            "Check the export of that channel, or measure it."
        )


def _observed(
    dataset: Dataset, effects: Sequence[str], settings: CritiqueSettings, arcs: ArcSettings | None
) -> Observations:
    """Impacts and flights of one rigid body, in which the named effects can be tested; UserError otherwise."""
    _refuse_constant(dataset)
    require_known(effects, dataset.header.surfaces or ())
    for name in effects:
        if (dimension := dataset.space.dimension) not in EFFECTS[name].dimensions:
            raise UserError(
                f"{dataset.name} cannot test the effect {name}: it is not defined in {dimension} dimensions."
            )
    if dataset.space.is_plane:
        observations = observe(dataset, arcs, settings.episodes, settings.channels)
    else:
        observations = observe_in_space(dataset, arcs, settings.episodes)
    for name, why in testable_effects(observations, settings.contact_time)[1].items():
        if name in effects:
            raise UserError(f"{dataset.name} cannot test the effect {name}: {why}.")
    if observations.found.soft is not None:
        raise UserError(f"{dataset.name} cannot be compared with impact laws. {observations.found.soft.sentence()}")
    refuse_what_is_not_one_body(dataset.name, observations, settings.one_body)
    return observations
