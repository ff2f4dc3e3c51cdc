"""Study of the critique of mechanisms: hide known effects in simulations, criticise these, and compare the results.

For each mechanism, seed, hidden effect and signal-to-noise ratio, trials are planned with the believed mechanism,
simulated with the true one, measured with noise, and criticised without knowledge of the truth.  `right` means

    nothing hidden          verdict adequate
    an effect               this effect named first or in the first group, of at most three
    outside the library     verdict unexplained

| table      | row                                      | columns                                                   |
|------------|------------------------------------------|-----------------------------------------------------------|
| effects    | dataset                                  | named effects, misfit, errors of forces and parameters    |
| parameters | parameter of the hidden effect, if found | truth, estimate, standard error                           |
| summary    | mechanism, truth, noise                  | share that is right, Wilson interval, median errors       |
| forces     | step and pair of one trial               | true force, and estimates without and with the effect     |

Force errors refer to exact states of one trial, with effects fitted to noisy states and believed inertia.  Errors of Θ
are relative root mean squares over the base parameters.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd

from thesis_lib.critique.mechanisms.critique import GROUP, MechanismCritique, criticise_mechanism
from thesis_lib.critique.mechanisms.effects import CANDIDATES, PAYLOAD
from thesis_lib.critique.mechanisms.model import BelievedArm, BelievedModel, BelievedWheel
from thesis_lib.critique.mechanisms.recovery import force_error, identify_parameters
from thesis_lib.critique.mechanisms.settings import HiddenStudy
from thesis_lib.critique.mechanisms.steps import measured
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.mechanisms.world import fit_effects
from thesis_lib.foundation.randomness import streams
from thesis_lib.simulate.mechanisms import motions as chapter2
from thesis_lib.simulate.mechanisms.hidden_forces import TRUTHS, HiddenSizes, MechanismKind, planned, run_with
from thesis_lib.simulate.mechanisms.motions import Chapter2Bodies
from thesis_lib.simulate.stepping.stepping import SimulatedMotion
from thesis_lib.statistics.intervals import wilson

OUTSIDE = "cogging"  # hidden effect that is not in the library


def believed(kind: MechanismKind, bodies: Chapter2Bodies, sizes: HiddenSizes) -> BelievedModel:
    """Return the believed model of a mechanism of chapter 2."""
    if kind == "arm":
        return BelievedArm(chapter2.arm_disk(bodies))
    return BelievedWheel(chapter2.wheel(bodies), sizes.payload_radius)


def true_sizes(kind: MechanismKind, truth: str, sizes: HiddenSizes) -> dict[str, float]:
    """Return the true parameters of a hidden effect by the critique's names; empty for one outside the library."""
    return {
        "viscous_joint_friction": dict(zip(("b_1", "b_2"), sizes.viscous)),
        "coulomb_joint_friction": dict(zip(("f_1", "f_2"), sizes.coulomb)),
        "gravity_direction": {"alpha": sizes.tilt},
        "payload": {"m_p": sizes.payload if kind == "arm" else sizes.wheel_payload},
        "rolling_resistance": {"c_rr": sizes.rolling},
    }.get(truth, {})


def is_right(truth: str, critique: MechanismCritique) -> bool:
    """Return whether the critique is right; see the module's docstring."""
    without_answer = {"nothing": "adequate", OUTSIDE: "unexplained"}
    if truth in without_answer:
        return critique.verdict == without_answer[truth]
    return truth in critique.first_group and len(critique.first_group) <= GROUP


def hidden_effect_study(
    settings: HiddenStudy,
    rng: np.random.Generator,
    bodies: Chapter2Bodies = chapter2.DEFAULT,
    say: Callable[[str], None] = lambda text: None,
) -> tuple[dict[str, pd.DataFrame], dict[str, MechanismCritique]]:
    """Run the study.

    Returns:
        Tables `effects`, `parameters`, `summary`, `forces`, and critiques by "mechanism/truth" ("arm/payload") of
        the first seed at the noise closest to 60 dB.

    Raises:
        UserError: the settings leave too few trials.
    """
    effects, parameters, forces = [], [], pd.DataFrame()
    shown: dict[str, MechanismCritique] = {}
    ratios = [np.inf if db is None else db for db in settings.snr_db]
    main = min(ratios, key=lambda db: abs(db - 60.0) if np.isfinite(db) else 1e3)
    named = streams(rng)
    for kind in TRUTHS:
        model = believed(kind, bodies, settings.sizes)
        for seed, rng_of_seed in enumerate(named(kind).spawn(settings.seeds)):
            plans = planned(kind, settings.trials, rng_of_seed, bodies, settings.sizes)
            stream = streams(rng_of_seed)
            for truth in TRUTHS[kind]:
                say(f"{kind} {truth} {seed}")
                records = run_with(kind, truth, plans, bodies, settings.sizes)
                exact = exact_form(records, model, settings)
                for db in ratios:
                    noise, choices = (stream(truth, db, what) for what in ("noise", "choices"))
                    trials = measured(records, db, noise, settings.critique.windows)
                    critique = criticise_mechanism(trials, model, CANDIDATES[kind], choices, settings.critique)
                    key = {"mechanism": kind, "truth": truth, "snr_db": db, "seed": seed}
                    true = true_sizes(kind, truth, settings.sizes)
                    row, table_of_forces = _effects_row(critique, exact, records, truth, true)
                    effects.append(key | {"trials": len(records)} | row)
                    parameters += [key | row for row in _parameter_rows(truth, critique, true)]
                    if seed == 0 and db == main:
                        shown[f"{kind}/{truth}"] = critique
                        if (kind, truth) == settings.forces_of:
                            forces = table_of_forces
    table = pd.DataFrame(effects)
    summary = _summary_table(table)
    return {"effects": table, "parameters": pd.DataFrame(parameters), "summary": summary, "forces": forces}, shown


def exact_form(records: tuple[SimulatedMotion, ...], model: BelievedModel, settings: HiddenStudy) -> WeakForm:
    """Return the window equations of the exact states of the last record."""
    windows = settings.critique.windows
    # an infinite ratio adds no noise, so this generator draws nothing
    return WeakForm(measured(records[-1:], np.inf, np.random.default_rng(0), windows), model, windows)


def _effects_row(
    critique: MechanismCritique,
    exact: WeakForm,
    records: tuple[SimulatedMotion, ...],
    truth: str,
    true_sizes: dict[str, float],
) -> tuple[dict, pd.DataFrame]:
    first, tests = critique.steps[0] if critique.steps else None, critique.discovery.first_scan
    believed = fit_effects(critique.training, ())
    before, estimate, reference = force_error(exact, records[-1], believed)
    after, with_it, _ = force_error(exact, records[-1], critique.fitted)
    without = identify_parameters(critique.training, believed)
    identified = identify_parameters(critique.training, critique.fitted)
    # a payload changes the parameters themselves: the error refers to the believed parameters
    start = without.believed if PAYLOAD.name in critique.fitted.values else without.value
    model, true = critique.model, critique.model.parameters
    if truth == PAYLOAD.name:
        true = true + true_sizes["m_p"] * model.payload
    row = {
        "verdict": critique.verdict,
        "first_effect": first.effect.name if first else "",
        "group": "; ".join(critique.first_group[1:]),
        "n_effects": len(critique.steps),
        "right": int(is_right(truth, critique)),
        "p_value": first.p_value if first else tests.p_value(max(tests.gain.values())),
        "gain": critique.gains[first.effect.name][0] if first else 0.0,
        "misfit_before": critique.ladder[0][0],
        "misfit_after": critique.ladder[-1][0],
        "force_error_before": before,
        "force_error_after": after,
        "theta_error_before": _relative(start, without.of(true)),
        "theta_error_after": _relative(identified.value, identified.of(true)),
    }
    return row, _force_table(model, exact, estimate, with_it, reference)


def _relative(value: np.ndarray, true: np.ndarray) -> float:
    return float(np.sqrt(np.mean(((value - true) / true) ** 2)))


def _parameter_rows(truth: str, critique: MechanismCritique, true: dict[str, float]) -> list[dict]:
    values, std = critique.fitted.values, critique.fitted.std
    return [
        {"parameter": p.name, "unit": p.unit, "true": true[p.name], "estimate": x, "std": s}
        for step in critique.steps
        if step.effect.name == truth
        for p, x, s in zip(step.effect.parameters, values[truth], std[truth])
    ]


def _force_table(
    model: BelievedModel, weak: WeakForm, before: np.ndarray, after: np.ndarray, true: np.ndarray
) -> pd.DataFrame:
    """Return forces in N for steps and pairs in contact: t, pair, component, true, without, with_effects."""
    rows = [
        (weak.h * weak.step[k], pair, component, true[k, i, j], before[k, i, j], after[k, i, j])
        for j, pair in enumerate(model.mechanism.pairs)
        for i, component in enumerate(("normal", "tangential"))
        for k in np.flatnonzero(np.isfinite(true[:, i, j]))
    ]
    return pd.DataFrame(rows, columns=["t", "pair", "component", "true", "without", "with_effects"])


def _summary_table(effects: pd.DataFrame) -> pd.DataFrame:
    """Return the share of right answers by mechanism, truth and noise, with 95 % Wilson interval, and median errors."""
    rows = []
    medians = [name for name in effects.columns if name.startswith(("misfit_", "force_error_", "theta_error_"))]
    for key, datasets in effects.groupby(["mechanism", "truth", "snr_db"], sort=False):
        low, high = wilson(int(datasets["right"].sum()), len(datasets))
        row = dict(zip(("mechanism", "truth", "snr_db"), key)) | {"datasets": len(datasets)}
        row |= {"right": datasets["right"].mean(), "right_low": low, "right_high": high}
        row |= {"group_size": (1 + datasets["group"].str.count(";") + (datasets["group"] != "")).mean()}
        rows.append(row | {name: datasets[name].median() for name in medians})
    return pd.DataFrame(rows)
