"""Which effect is missing: forward selection with a backward check, and its refusals.

At each step all candidates are screened by score tests, the best few are fitted with *all* parameters free and judged
by K-fold over training trials.  An effect enters if it clears the null of the largest of all candidates' gains, if its
held-out gain is positive by its paired interval, and if it lowers a held-out error materially; earlier ones that it has
made superfluous leave again.  The null is that of the score test; where a gain is not far beyond it, refits to data
drawn without the effect say by how much refits stretch it.  Candidates that this design cannot tell from the chosen one
are named with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.contact import CANDIDATE_LAWS, LAWS
from thesis_lib.critique.drops.fit import Fit, fit
from thesis_lib.critique.drops.held_out import Judgement, cross_validate, is_material, paired_gain
from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.screen import Scan, expected_difference, scan
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.drops.synthetic import synthesise
from thesis_lib.effects import EFFECTS, Effect
from thesis_lib.foundation.randomness import generator

REFITS = 199  # of data drawn without the effect, where its gain is near the null
FAR_BEYOND = 3.0  # times the largest draw of the null: no refit would stretch it as far


@dataclass(frozen=True)
class Step:
    """One chosen effect.

    Attributes:
        effect: chosen; alternatives: names that the data cannot tell from it, nearest first.
        clears: whether it passes all three tests; always so unless it was switched on by hand.
        p_value: of its gain against the null of the largest gain.
        gain: held-out gain an impact by K-fold, with 95 % interval, nats.
        fitted: the model with it, on all training trials; judged: by K-fold.
        scan: score tests before it was added.
    """

    effect: Effect
    alternatives: tuple[str, ...]
    clears: bool
    p_value: float
    gain: tuple[float, float, float]
    fitted: Fit
    judged: Judgement
    scan: Scan


@dataclass(frozen=True)
class Discovery:
    """The chosen model and how it was found.

    Attributes:
        laws: by name, fit and K-fold judgement without effects.
        base: name of the chosen law; steps: in order of selection.
        last_scan: score tests at the final model.
        not_testable: name -> why.
    """

    laws: dict[str, tuple[Fit, Judgement]]
    base: str
    steps: tuple[Step, ...]
    last_scan: Scan
    not_testable: dict[str, str]

    @property
    def fitted(self) -> Fit:
        """The final model."""
        return self.steps[-1].fitted if self.steps else self.laws[self.base][0]

    @property
    def judged(self) -> Judgement:
        """Its K-fold judgement."""
        return self.steps[-1].judged if self.steps else self.laws[self.base][1]


def discover(
    training: Observations,
    settings: CritiqueSettings,
    rng: np.random.Generator,
    fixed: Sequence[str] | None = None,
    say=lambda text: None,
) -> Discovery:
    """Choose law and effects on training trials; `fixed` names the effects instead of the automatic choice."""
    trials = np.unique(training.trial)
    folds = rng.permutation(np.arange(len(trials)) % min(settings.folds, len(trials)))
    seed = int(rng.integers(2**63))  # streams by name: a further candidate shifts no draw of another
    say(f"fitting {len(CANDIDATE_LAWS)} laws")
    laws = {}
    for name in CANDIDATE_LAWS:
        fitted = fit(Model(LAWS[name]), training)
        laws[name] = (fitted, cross_validate(fitted, training, folds))
    base = max(laws, key=lambda name: laws[name][1].total)
    fitted, judged = laws[base]
    testable, why_not = testable_effects(training)
    steps: list[Step] = []
    dropped: set[str] = set()
    wanted = list(fixed) if fixed is not None else None
    while len(steps) < (settings.max_effects if wanted is None else len(wanted)):
        taken = {step.effect.name for step in steps} | dropped
        candidates = [effect for effect in testable.values() if effect.name not in taken]
        if wanted is not None:
            candidates = [EFFECTS[wanted[len(steps)]]]
        if not candidates:
            break
        on = tuple(step.effect.name for step in steps)
        found = scan(fitted, training, candidates, generator(seed, "null", *on))
        say(f"step {len(steps) + 1}: trying {len(candidates)} effects")
        # a missing effect may have made the wrong law the best one: the next best are tried with it, too
        rivals = sorted(laws, key=lambda name: -laws[name][1].total)[: settings.rivals]
        contenders = [fitted] if steps else [laws[name][0] for name in rivals]
        step = _best_step(
            fitted, judged, contenders, training, folds, candidates, found, settings, seed, wanted is not None
        )
        if step is None:
            break
        step = _with_best_law(step, training, folds, settings)
        say(f"step {len(steps) + 1}: {step.effect.name} ({step.gain[0]:.2f} nats an impact)")
        steps.append(step)
        if wanted is None:
            gone = _not_needed_any_more(steps, training, folds, settings, seed)
            if gone:
                say(f"not needed any more: {', '.join(sorted(gone))}")
                dropped |= gone
                steps = _without(steps, gone, training, folds)
        fitted, judged = steps[-1].fitted, steps[-1].judged
    taken = {step.effect.name for step in steps}
    rest = [effect for effect in testable.values() if effect.name not in taken]
    last_scan = scan(fitted, training, rest, generator(seed, "last null"))
    return Discovery(laws, base, tuple(steps), last_scan, why_not)


def testable_effects(observations: Observations) -> tuple[dict[str, Effect], dict[str, str]]:
    """Effects that this dataset can test, and why it cannot test the others."""
    testable, why_not = {}, {}
    for name, effect in EFFECTS.items():
        if not effect.applies_to(observations.rig):
            why_not[name] = f"does not apply to a body of shape {observations.rig.shape.kind}"
        elif effect.needs_trajectories and not observations.arcs:
            why_not[name] = "no trajectories"
        else:
            testable[name] = effect
    return testable, why_not


def _best_step(
    fitted: Fit,
    judged: Judgement,
    contenders: Sequence[Fit],
    training: Observations,
    folds: np.ndarray,
    candidates: Sequence[Effect],
    found: Scan,
    settings: CritiqueSettings,
    seed: int,
    forced: bool,
) -> Step | None:
    by_name = {effect.name: effect for effect in candidates}
    on = tuple(effect.name for effect in fitted.model.effects)
    quick = {}
    for effect in candidates:
        discrete = any(p.discrete is not None for p in effect.parameters)
        tries = []
        for one in contenders:
            # a mirrored axis turns the world over: (μ, ε) found without it are no start
            own = {k: v for k, v in one.values.items() if not (discrete and k in ("mu", "epsilon"))}
            tries.append(fit(one.model.with_effect(effect), training, own, rounds=1))
        quick[effect.name] = max(tries, key=lambda one: one.score)
    # ranked by a quick fit and not by the score test: far from the null a robust fit may have called outliers what the
    # effect explains, and then the slope at the null says nothing
    names = sorted(quick, key=lambda name: -quick[name].score)[: settings.finalists]
    full = {name: fit(quick[name].model, training, quick[name].values) for name in names}
    # over the best law without it: that one of the rivals may fit better by chance is no gain of the effect
    best = max([fitted, *contenders], key=lambda one: one.score)
    gains = {name: one.score - best.score for name, one in (quick | full).items()}
    names = sorted(names, key=lambda name: -gains[name])[:3]
    judgements = {name: cross_validate(full[name], training, folds) for name in names}
    for name in sorted(names, key=lambda name: -judgements[name].total):
        gain = paired_gain(judgements[name], judged, generator(seed, "gain", *on, name))
        clears = gain[1] > 0.0 and _is_material(judgements[name], judged, by_name[name], settings)
        p_value = found.p_value(gains[name])
        if clears and p_value <= settings.alpha and gains[name] < FAR_BEYOND * found.null.max():
            stretch = _stretch_of_null(
                best, by_name[name], training, found, generator(seed, "refits", *on, name)
            )
            p_value = found.p_value(gains[name] / stretch)
        clears = clears and p_value <= settings.alpha
        if forced or clears:
            alternatives = _alternatives(name, gains, found, settings)
            return Step(
                by_name[name], alternatives, clears, p_value, gain, full[name], judgements[name], found
            )
    return None


def _is_material(better: Judgement, worse: Judgement, effect: Effect, settings: CritiqueSettings) -> bool:
    return is_material(better, worse, effect.channels, settings.material_share, settings.material_floor)


def _stretch_of_null(
    fitted: Fit, effect: Effect, training: Observations, found: Scan, rng: np.random.Generator
) -> float:
    """Factor by which gains of full refits exceed those of the score test where nothing is hidden, at least 1.

    The mean gain of `REFITS` refits to data drawn from the model without the effect, over half the number of its
    columns: the mean of the score test (Bartlett's correction).
    """
    with_it = fitted.model.with_effect(effect)
    gains = []
    for _ in range(REFITS):
        drawn = synthesise(fitted.model, fitted.values, training, rng, fitted.sigma_m)
        plain = fit(fitted.model, drawn, fitted.values, rounds=1)
        gains.append(fit(with_it, drawn, plain.values, rounds=1).score - plain.score)
    expected = 0.5 * max(found.columns[effect.name].shape[1], 1)
    return max(1.0, float(np.mean(np.maximum(gains, 0.0))) / expected)


def _not_needed_any_more(
    steps: Sequence[Step],
    training: Observations,
    folds: np.ndarray,
    settings: CritiqueSettings,
    seed: int,
) -> set[str]:
    """The earlier effect that the last one has made superfluous, if there is one (backward check)."""
    last = steps[-1]
    for step in steps[:-1]:
        smaller = last.fitted.model.without(step.effect.name)
        start = {k: v for k, v in last.fitted.values.items() if k in smaller.parameters}
        judged = cross_validate(fit(smaller, training, start), training, folds)
        names = [one.effect.name for one in steps]
        gain = paired_gain(last.judged, judged, generator(seed, "needed", *names, step.effect.name))
        if gain[1] <= 0.0 or not _is_material(last.judged, judged, step.effect, settings):
            return {step.effect.name}
    return set()


def _without(steps: Sequence[Step], gone: set[str], training: Observations, folds: np.ndarray) -> list[Step]:
    """The steps without the effects `gone`, all that came after them fitted and judged again."""
    kept: list[Step] = []
    changed = False
    for step in steps:
        if step.effect.name in gone:
            changed = True
            continue
        if changed:
            model = Model(step.fitted.model.law, (*(one.effect for one in kept), step.effect))
            start = {k: v for k, v in step.fitted.values.items() if k in model.parameters}
            fitted = fit(model, training, start)
            step = replace(step, fitted=fitted, judged=cross_validate(fitted, training, folds))
        kept.append(step)
    return kept


def _with_best_law(
    step: Step,
    training: Observations,
    folds: np.ndarray,
    settings: CritiqueSettings,
) -> Step:
    """The step with the law that fits best now that the effect is in: without it another law may have stood in."""
    model = step.fitted.model
    fits = {
        name: fit(Model(LAWS[name], model.effects), training, step.fitted.values) for name in CANDIDATE_LAWS
    }
    best = max(fits, key=lambda name: fits[name].score)
    if best == model.law.name or fits[best].score - step.fitted.score < settings.tell_apart:
        return step
    judged = cross_validate(fits[best], training, folds)
    if judged.total - step.judged.total < settings.tell_apart:
        return step
    return replace(step, fitted=fits[best], judged=judged)


def _alternatives(
    name: str, gains: dict[str, float], found: Scan, settings: CritiqueSettings
) -> tuple[str, ...]:
    """Effects that would explain the same on this design, nearest first."""
    close = {}
    for other in found.columns:
        if other == name or not found.columns[other].shape[1]:
            continue
        loss = expected_difference(found, name, other)
        # what the data say counts, too
        loss = max(loss, gains[name] - gains[other])
        if loss < settings.tell_apart:
            close[other] = loss
    return tuple(sorted(close, key=lambda other: close[other]))
