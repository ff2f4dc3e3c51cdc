"""Smallest size of each candidate effect that this dataset would show.

The size at which each test would pass with a chance of 80 %, that is 0.84 standard deviations beyond its threshold:

    significant  max(√(2 c) + 0.84, 2 (1.96 + 0.84)) / √I
                 c: quantile of the largest gain of all candidates under the null, nats; I: Fisher information of the
                 parameter with all others refitted.  A size x/√I gains x²/2 ± x nats on unseen trials; the second term
                 puts the 95 % interval of that gain above zero.
    material     size that raises an error of a channel of the effect by the verdict's least amount plus 0.84 standard
                 errors, if left out of the model with all other parameters refitted
    smallest     the larger of the two

The first falls with the root of the number of drops, the second hardly.  None: no size within the bounds suffices.
"""

from collections.abc import Mapping

import numpy as np

from thesis_lib.critique.contacts.model import Model, inward
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.world import testable_effects
from thesis_lib.critique.likelihood.channels import CHANNELS, Misfits, concerned, present
from thesis_lib.critique.likelihood.comparison import Comparison
from thesis_lib.critique.likelihood.fit import SLOPE_STEP
from thesis_lib.critique.likelihood.whitening import Whitening
from thesis_lib.effects.effect import Effect, Parameter
from thesis_lib.foundation.forked import each
from thesis_lib.statistics.intervals import Z95
from thesis_lib.statistics.spread import robust_std

POWER = 0.8416  # standard deviations: normal quantile of 80 %
MEDIAN_STD = 1.17 / np.sqrt(2.0)  # relative standard error of a root mean square from a median, times √n
BISECTIONS = 30
SMALLEST_SHARE = 1e-6  # of a parameter's range: smaller sizes count as zero

Parts = Mapping[str, np.ndarray]
Sizes = dict[str, dict[str, float | None]]


def detectable(critique: DropsCritique) -> list[dict]:
    """Rows name, smallest, significant, material (each by parameter, in its unit) and drops_for_half.

    drops_for_half: drops that would show half of `smallest` for every parameter; None if half the size is immaterial.
    """
    significant, material = significant_sizes(critique), material_sizes(critique)
    trials = len(np.unique(critique.observations.trial))
    rows, model = [], critique.ladder[-1][1].model
    for name, effect in testable_effects(critique.training, model.takes_time)[0].items():
        if name not in significant:
            continue
        by_score, by_error = significant[name], material[name]
        sizes = {p: (by_score[p], by_error[p]) for p in by_score}
        known = {p: (score, error) for p, (score, error) in sizes.items() if score is not None and error is not None}
        smallest = dict.fromkeys(by_score) | {p: max(pair) for p, pair in known.items()}
        # information grows with the number of drops: the significant size falls with its root
        drops = None
        continuous = all(p.discrete is None for p in model.parameters_of(effect))
        if known and continuous and all(0.5 * max(pair) >= pair[1] for pair in known.values()):
            drops = max(int(np.ceil(trials * (pair[0] / (0.5 * max(pair))) ** 2)) for pair in known.values())
        rows.append(
            {"name": name, "smallest": smallest, "significant": by_score, "material": by_error, "drops_for_half": drops}
        )
    return rows


def significant_sizes(critique: DropsCritique) -> Sizes:
    """By effect and parameter, the size that passes both tests of the log score with a chance of 80 %."""
    discovery, final = critique.discovery, critique.ladder[-1][1]
    testable, _ = testable_effects(critique.training, final.model.takes_time)
    scan = discovery.last_scan
    null = np.sqrt(2.0 * np.quantile(scan.null, 1.0 - critique.settings.alpha)) + POWER
    limit = max(float(null), 2.0 * (Z95 + POWER))  # the second puts 95 % intervals of gains above zero
    sizes: Sizes = {}
    for step in discovery.steps:  # parameters in the model: their covariance is that of the fit
        name = step.effect.name
        parameters = final.model.parameters_of(step.effect)
        sizes[name] = {p.name: _within(limit * final.std[f"{name}.{p.name}"], p) for p in parameters}
    for name, information in scan.information.items():
        if name not in testable:
            continue
        scales = np.sqrt(np.diag(information))
        known = scales > 0
        std = np.full(len(scales), np.inf)
        if known.any():
            # scaled by the information of each parameter, so that units do not matter
            unit = information[np.ix_(known, known)] / np.outer(scales[known], scales[known])
            std[known] = np.sqrt(np.diag(np.linalg.pinv(unit, rcond=1e-8, hermitian=True))) / scales[known]
        sizes[name] = {p.name: _within(limit * s, p) for p, s in zip(final.model.parameters_of(testable[name]), std)}
    return sizes


def material_sizes(critique: DropsCritique) -> Sizes:
    """By effect and parameter, the size that raises an error by a material amount."""
    o, final = critique.training, critique.ladder[-1][1]
    fitted = final.on(o)
    S, sharp = fitted.covariance(), fitted.covariance(o.t_std)
    names = [beside.channel for beside in o.beside]
    floor = critique.ladder[-1][2].floor
    floors = {"impact": floor if np.isfinite(floor) else 0.0}

    def at(model: Model, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Residuals by channel, in m/s or standard deviations, and all whitened residuals."""
        here = Comparison(model, values, o)
        R = here.R
        z, *beside = Whitening(model, o, S, final.sigma_m, (values, R))(values)
        parts = {
            "impact": o.as_speeds(here.velocity_left),
            "all": np.concatenate([part.ravel() for part in (z, *beside)]),
        }
        misfits = Misfits(o, R, S, sharp, dict(zip(names, beside)))
        others = {name: CHANNELS[name].in_sigmas(misfits) for name in present(names)}
        return parts | {name: part for name, part in others.items() if part is not None}

    here = at(final.model, final.values)

    def slope(model: Model, values: Mapping[str, float], name: str, step: float) -> Parts:
        moved = at(model, {**values, name: values[name] + step})
        return {key: (moved[key] - here[key]) / step for key in here}

    def of_fitted(name: str) -> Parts:
        p = final.model.fitted_parameters[name]
        return slope(final.model, final.values, name, inward(p, final.values[name], SLOPE_STEP * p.scale))

    def of_effect(effect: Effect) -> dict[str, float | None]:
        name, inside, sizes = effect.name, effect in final.model.effects, {}
        model = final.model if inside else final.model.with_effect(effect)
        parameters = model.parameters_of(effect)
        values = {f"{name}.{p.name}": p.absent_at(final.values) for p in parameters} | final.values
        others = [column for other, column in slopes.items() if not other.startswith(f"{name}.")]
        for p in parameters:
            key = f"{name}.{p.name}"
            if p.discrete is None:
                step = inward(p, values[key], p.scale)
            else:
                step = p.null - values[key] if inside else p.discrete - p.null
            shift = slope(model, values, key, step) if step else {k: 0.0 * v for k, v in here.items()}
            shift = _compensated(shift, others)
            sizes[p.name] = _material(here, shift, concerned(effect), floors, critique, p)
        return sizes

    fitted, testable = list(final.model.fitted_parameters), testable_effects(o, final.model.takes_time)[0]
    slopes = dict(zip(fitted, each(of_fitted, fitted)))
    return dict(zip(testable, each(of_effect, list(testable.values()))))


def _compensated(shift: Parts, others: list[Parts]) -> Parts:
    """The part of a shift that refitting the other parameters leaves."""
    B = np.stack([other["all"] for other in others], axis=1)
    size = np.linalg.norm(B, axis=0)
    use = np.flatnonzero(size > 0)
    share = np.linalg.lstsq(B[:, use] / size[use], shift["all"], rcond=1e-8)[0] / size[use]
    return {key: shift[key] - sum(share[j] * others[i][key] for j, i in enumerate(use)) for key in shift}


def _material(
    here: Parts,
    shift: Parts,
    channels: tuple[str, ...],
    floors: Mapping[str, float],
    critique: DropsCritique,
    p: Parameter,
) -> float | None:
    s = critique.settings

    def counts(size: float) -> bool:
        for channel in channels:
            if channel not in here or not len(here[channel]):
                continue
            without = _error(here[channel], channel)
            # the effect may have either sign
            moved = [here[channel] + sign * size * shift[channel] for sign in (1.0, -1.0)]
            left_out = float(np.mean([_error(residual, channel) for residual in moved]))
            unsure = float(np.mean([_rise_std(here[channel], residual, channel) for residual in moved]))
            least = max(s.material_share * left_out, s.material_floor * floors.get(channel, 1.0))
            if left_out - without >= least + POWER * unsure:
                return True
        return False

    high = _range(p)
    if not counts(high):
        return None
    if p.discrete is not None:
        return high
    low = SMALLEST_SHARE * high
    for _ in range(BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if counts(middle) else (middle, high)
    return high


def _error(residual: np.ndarray, channel: str) -> float:
    """Error as in `judge`: mean kinetic norm in m/s, or root of the robust mean square in standard deviations."""
    if channel == "impact":
        return float(np.linalg.norm(residual, axis=1).mean())
    return float(robust_std(residual, axis=None))


def _rise_std(before: np.ndarray, after: np.ndarray, channel: str) -> float:
    """Standard error of the rise of `_error`; impacts are paired, medians are treated as independent."""
    n = len(before)
    if channel == "impact":
        rise = np.linalg.norm(after, axis=1) - np.linalg.norm(before, axis=1)
        return float(rise.std() / np.sqrt(n))
    return float(_error(after, channel) * MEDIAN_STD / np.sqrt(n))


def _range(p: Parameter) -> float:
    """Largest distance from the null; for an effect that is on or off, its only size."""
    return max(p.high - p.null, p.null - p.low) if p.discrete is None else abs(p.discrete - p.null)


def _within(size: float, p: Parameter) -> float | None:
    if not size <= _range(p):
        return None
    if p.discrete is not None:
        return _range(p)
    return float(size) if size > 0.0 else None
