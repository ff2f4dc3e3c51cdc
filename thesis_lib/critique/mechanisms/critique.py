"""Which effect a mechanism's believed model lacks: the critique of residual generalised forces.

The whitened window equations z (`mechanism_windows`) are unit noise if the model holds.  Trials are split once: the
held-out ones are seen by no choice.  On the others, forward selection as for impacts:

1. score tests of all candidates (`mechanism_fit`), whose null counts how many were tried;
2. K-fold over trials; an effect enters if p <= α, if its paired gain is positive (bootstrap over trials), and if it
   lowers the misfit, the root mean square of z, by `material_share` of it and `material_floor` of the floor 1;
3. earlier effects that it has made superfluous leave again;
4. candidates within `tell_apart` nats of the chosen one on this design are named with it.

`effects` is the verdict if what is found explains the held-out trials; `unexplained` if their misfit stays beyond noise
by both thresholds; `mechanism_dependence` then says what the rest depends on.

The noise enters the columns, too (errors in variables), to second order only: the misfit after the fit would show it.

| on paper | in code  | unit  | shape | meaning                              |
|----------|----------|-------|-------|--------------------------------------|
| z        | `z`      | 1     | (N,)  | whitened residual generalised forces |
| rms z    | `ladder` | sigma |       | misfit, 1 if noise alone is left     |

Source: none; the procedure is that of `discover`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.mechanisms.dependence import dependence
from thesis_lib.critique.mechanisms.effects import MechanismEffect
from thesis_lib.critique.mechanisms.fit import (
    ForceFit,
    ForceScan,
    fit_effects,
    scan_effects,
    solve,
    total_force,
)
from thesis_lib.critique.mechanisms.model import BelievedModel
from thesis_lib.critique.mechanisms.settings import MechanismSettings
from thesis_lib.critique.mechanisms.windows import Trial, WeakForm
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.statistics.bootstrap import bootstrap_gain, central_95, draw_counts

GROUP = 3  # most members of a group that counts as an answer
MIN_TRIALS = 4


@dataclass(frozen=True)
class ForceStep:
    """A chosen effect: `alternatives` cannot be told from it; `gain` nats a window with 95 % interval, held out."""

    effect: MechanismEffect
    alternatives: tuple[str, ...]
    cosines: dict[str, float]
    p_value: float
    gain: tuple[float, float, float]


@dataclass(frozen=True)
class Remaining:
    """What is left, on the held-out trials where nothing else is said.

    Attributes:
        structured: misfit beyond noise by both thresholds; p_value: of |z|² against its χ² distribution.
        depends_on: coordinates and velocities that it depends on, on the training trials.
    """

    structured: bool
    p_value: float
    depends_on: tuple[str, ...]


@dataclass(frozen=True)
class MechanismCritique:
    """What was found.

    Attributes:
        model: as believed; fitted: effects on all training trials; steps: in order of selection.
        verdict: adequate, effects or unexplained.
        ladder: held-out misfit (rms of z, low, high) after 0, 1, ... effects.
        below: name of an effect that is significant but too small to be material; '' if there is none.
        training, held_out: window equations; scan: at the final model; first_scan: at the believed one.
        candidates: all that were tried.
    """

    model: BelievedModel
    fitted: ForceFit
    steps: tuple[ForceStep, ...]
    verdict: str
    ladder: tuple[tuple[float, float, float], ...]
    remaining: Remaining
    below: str
    training: WeakForm
    held_out: WeakForm
    first_scan: ForceScan
    scan: ForceScan
    candidates: tuple[MechanismEffect, ...]
    settings: MechanismSettings

    @property
    def found(self) -> tuple[str, ...]:
        """The first effect and those that the data cannot tell from it; empty where nothing was found."""
        return (self.steps[0].effect.name, *self.steps[0].alternatives) if self.steps else ()


def criticise_mechanism(
    trials: Sequence[Trial],
    model: BelievedModel,
    candidates: Sequence[MechanismEffect],
    rng: np.random.Generator,
    settings: MechanismSettings | None = None,
) -> MechanismCritique:
    """Criticise the believed model of a mechanism with measured trials.

    Args:
        trials: measured motion, all of one mechanism and one time step.
        model: as believed.
        candidates: effects that may be missing.
        rng: splits the trials and draws null distributions.
        settings: thresholds.

    Raises:
        UserError: there are fewer than four trials, or no window can be used.
    """
    settings = settings or MechanismSettings()
    s = settings.thresholds
    if len(trials) < MIN_TRIALS:
        raise UserError(
            f"The critique of a mechanism needs {MIN_TRIALS} trials or more to hold some out; got {len(trials)}."
        )
    if len({t.h for t in trials}) > 1:
        raise UserError(
            "The trials of one critique share a time step; resample them or criticise them apart."
        )
    order = rng.permutation(len(trials))
    cut = min(max(round(s.held_out_share * len(trials)), 1), len(trials) - 2)
    held = WeakForm([trials[i] for i in order[:cut]], model, settings.windows)
    weak = WeakForm([trials[i] for i in order[cut:]], model, settings.windows)
    folds = rng.permutation(np.arange(len(trials) - cut) % min(s.folds, len(trials) - cut))

    choice = _choose(weak, folds, candidates, settings, int(rng.integers(2**63)))
    chosen, fitted, minor = choice.effects, choice.fitted, choice.minor
    steps, ladder = [], [_misfit(held.residual(np.zeros_like(held.f)), held, settings.resamples, rng)]
    last = applied(held, fitted)
    for i, e in enumerate(chosen):
        others = fit_effects(weak, [c for c in chosen if c is not e])
        gain = _paired(applied(held, others), last, held, settings.resamples, rng)
        p_value, before = choice.found[e.name]
        names = [c for c in before.basis if c != e.name and before.lost(e.name, c) < s.tell_apart]
        names.sort(key=lambda name: before.lost(e.name, name))
        cosines = {c: before.cosine(e.name, c) for c in before.basis if c != e.name}
        steps.append(ForceStep(e, tuple(names), cosines, p_value, gain))
        rung = applied(held, fit_effects(weak, chosen[: i + 1]))
        ladder.append(_misfit(rung, held, settings.resamples, rng))
    structured, p_value = _structure(last, s)
    if minor:
        # a named effect that explains it all, if too small a one to matter, leaves nothing unexplained
        structured = structured and _structure(applied(held, minor), s)[0]
    # a description of the whole, which needs many windows and chooses nothing
    depends_on = dependence(weak, fitted.z, s.alpha, rng)[0] if structured else ()
    remaining = Remaining(structured, p_value, depends_on)
    below = minor.effects[-1].name if minor else ""
    verdict = "unexplained" if remaining.structured else "effects" if steps else "adequate"
    return MechanismCritique(
        model,
        fitted,
        tuple(steps),
        verdict,
        tuple(ladder),
        remaining,
        below,
        weak,
        held,
        choice.first,
        choice.scan,
        tuple(candidates),
        settings,
    )


@dataclass(frozen=True)
class _Choice:
    """Result of the forward selection: `found` has the p-value of each effect and the scan in which it was chosen."""

    effects: list[MechanismEffect]
    found: dict[str, tuple[float, ForceScan]]
    fitted: ForceFit
    minor: ForceFit | None
    first: ForceScan
    scan: ForceScan


def _choose(
    weak: WeakForm,
    folds: np.ndarray,
    candidates: Sequence[MechanismEffect],
    settings: MechanismSettings,
    seed: int,
) -> _Choice:
    """Forward selection with a backward check on training trials, steps 1 to 3 of the module's docstring.

    Streams derive from `seed` by name, so that a further candidate shifts no draw of another.
    """
    s = settings.thresholds
    chosen: list[MechanismEffect] = []
    found: dict[str, tuple[float, ForceScan]] = {}
    dropped: set[str] = set()
    minor: ForceFit | None = None
    fitted = fit_effects(weak, ())
    first = scan = scan_effects(weak, fitted, candidates, settings.resamples, generator(seed, "null"))
    while len(chosen) < s.max_effects:
        by_cv = _cross_validated(weak, fitted, folds)
        best = None
        for e in candidates:
            if e in chosen or e.name in dropped:
                continue
            trial_fit = fit_effects(weak, (*chosen, e))
            judged = _cross_validated(weak, trial_fit, folds)
            if best is None or judged @ judged < best[2] @ best[2]:
                best = (e, trial_fit, judged)
        if best is None:
            break
        e, trial_fit, judged = best
        p_value = scan.p_value(0.5 * (fitted.z @ fitted.z - trial_fit.z @ trial_fit.z))  # pyright: ignore[reportArgumentType]
        on = [c.name for c in chosen]
        gain = _paired(by_cv, judged, weak, settings.resamples, generator(seed, "gain", *on, e.name))
        if p_value > s.alpha or gain[1] <= 0.0:
            break
        if not _material(rms(by_cv), rms(judged), s):
            minor = trial_fit
            break
        chosen.append(e)
        found[e.name] = (p_value, scan)
        fitted = trial_fit
        gone = _superfluous(weak, fitted, e, found, s.alpha)
        if gone:
            dropped |= gone
            chosen = [c for c in chosen if c.name not in gone]
            fitted = fit_effects(weak, chosen)
        rest = [c for c in candidates if c not in chosen]
        on = [c.name for c in chosen]
        scan = scan_effects(weak, fitted, rest, settings.resamples, generator(seed, "null", *on))
    return _Choice(chosen, found, fitted, minor, first, scan)


def smallest_sizes(critique: MechanismCritique) -> dict[str, dict[str, float]]:
    """Smallest size of each candidate's parameters that these trials would have shown, all else as found.

    A parameter x alone raises the log score by x² I / 2 and the mean square of z by x² I / N.
    """
    s = critique.settings.thresholds
    limit = float(np.quantile(critique.first_scan.null, 1.0 - s.alpha))
    N = len(critique.training.trial)
    material = ((1.0 + s.material_floor) ** 2 - 1.0) * N
    found = {}
    for e in critique.candidates:
        information = np.diag(critique.first_scan.information[e.name])
        found[e.name] = {
            p.name: float(np.sqrt(max(2.0 * limit, material) / i)) if i > 0 else np.inf
            for p, i in zip(e.parameters, information)
        }
    return found


def applied(weak: WeakForm, fitted: ForceFit) -> np.ndarray:
    """z (N,) of other trials with fitted effects."""
    return weak.residual(total_force(weak, fitted.effects, fitted.values))


def _cross_validated(weak: WeakForm, fitted: ForceFit, folds: np.ndarray) -> np.ndarray:
    """z (N,) with each fold's parameters refitted to the other folds, to first order."""
    z = fitted.z.copy()
    fold = folds[weak.trial]
    for k in np.unique(folds):
        rest, own = fold != k, fold == k
        z[own] -= fitted.columns[own] @ solve(fitted.columns[rest], fitted.z[rest])
    return z


def _superfluous(
    weak: WeakForm, fitted: ForceFit, new: MechanismEffect, found: Mapping, alpha: float
) -> set[str]:
    """Earlier effects whose loss would be within the null of the scan in which they were chosen."""
    gone = set()
    for e in fitted.effects:
        if e is new:
            continue
        without = fit_effects(weak, [c for c in fitted.effects if c is not e])
        loss = 0.5 * (without.z @ without.z - fitted.z @ fitted.z)
        if found[e.name][1].p_value(loss) > alpha:
            gone.add(e.name)
    return gone


def _paired(
    before: np.ndarray, after: np.ndarray, weak: WeakForm, draws: int, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Gain of log score a window with its 95 % interval, bootstrap over trials; nats."""
    trials = np.unique(weak.trial)
    gain = np.bincount(weak.trial, 0.5 * (before**2 - after**2), minlength=trials[-1] + 1)[trials]
    n = len(np.unique(weak.window))
    return bootstrap_gain(gain, n, draws, rng)


def _misfit(
    z: np.ndarray, weak: WeakForm, draws: int, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Root mean square of z with its 95 % interval, bootstrap over trials."""
    trials = np.unique(weak.trial)
    squares = np.bincount(weak.trial, z**2, minlength=trials[-1] + 1)[trials]
    rows = np.bincount(weak.trial, minlength=trials[-1] + 1)[trials]
    counts = draw_counts(len(trials), draws, rng)
    return rms(z), *central_95(np.sqrt((counts @ squares) / (counts @ rows)))


def rms(z: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(z**2)))


def _material(before: float, after: float, s: CritiqueSettings) -> bool:
    return before - after >= max(s.material_share * before, s.material_floor)


def _structure(z: np.ndarray, s: CritiqueSettings) -> tuple[bool, float]:
    """Whether the misfit is beyond noise by both thresholds, and the p-value of |z|² against its χ² distribution."""
    p_value = float(chi2.sf(z @ z, len(z)))
    return p_value <= s.alpha and _material(rms(z), 1.0, s), p_value
