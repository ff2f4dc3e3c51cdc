"""diagnosis.json of a mechanism, with the keys of an impact diagnosis (results/diagnosis.py) and the following keys:

| where           | key                                | meaning |
|---|---|---|
|                 | mechanism                          | name of the mechanism; absent for impacts |
|                 | n_windows, n_trials                | windows of the equations of motion replace impacts |
| base_model      | parameters                         | base inertial parameters without effects, and as `believed` |
| augmented_model | parameters                         | the same with effects |
| effects.gain    | held_out_log_score_per_window      | held-out gain over the model without the effect, nats |
|                 | below_threshold                    | an effect that is significant but not material |
| effects         | cosines                            | cosine of the effect's shift of z with every other candidate |
| error           | unit "sigma"                       | held-out rms of the whitened residual generalised forces |
| where           | coordinate, contacts, before, after| the same by free coordinate and pairs in contact |
| sensors         | found                              | clocks, offsets, and ripple over its stated size; if stated |
|                 | excess, p_value                    | rms of these errors over their stated sizes |
| detectable      | smallest                           | smallest detectable size of each parameter |
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from thesis_lib.critique.mechanisms.critique import (
    MechanismCritique,
    dependence,
    is_excess_material,
    smallest_sizes,
    states_of_windows,
)
from thesis_lib.critique.mechanisms.recovery import identify_parameters
from thesis_lib.critique.mechanisms.world import ForceFit, predict
from thesis_lib.critique.selection.discovery import Step
from thesis_lib.critique.selection.settings import SearchSettings, search_ended
from thesis_lib.foundation.files import six_digits
from thesis_lib.statistics.wording import listed, number

STATED = 4  # a sensor error with more parameters is reported as their rms over its stated size
STATES = 3  # number of states proposed for the next experiment


def mechanism_diagnosis(critique: MechanismCritique, dataset: str, rng: np.random.Generator) -> dict:
    """Return the content of diagnosis.json, rounded to six digits; `rng` permutes windows."""
    weak, held, model = critique.training, critique.held_out, critique.model
    base_fit = critique.discovery.bases[critique.discovery.base]
    depends, p_dependence = dependence(weak, base_fit.z, critique.settings.thresholds.alpha, rng)
    base, augmented = critique.ladder[0], critique.ladder[-1]
    left_out, limit = weak.left_out + held.left_out, critique.discovery.limit
    content = {
        "schema": 1,
        "dataset": dataset,
        "mechanism": model.name,
        "n_windows": int(len(weak.starts) + len(held.starts)),
        "n_trials": int(len(np.unique(weak.trial)) + len(np.unique(held.trial))),
        "verdict": critique.verdict,
        "base_model": {"name": "believed_parameters", "parameters": _parameters(critique, base_fit)},
        "augmented_model": {"name": "believed_parameters", "parameters": _parameters(critique, critique.fitted)},
        "effects": [_effect(critique, step) for step in critique.steps],
        "rejected": [
            {"name": one.step.effect.name, "title": one.step.effect.title, "ends": [one.than.misfit, one.judged.misfit]}
            for one in critique.discovery.rejected
        ],
        "search": {"limit": None if limit is None else "max_effects", "value": limit},
        "error": {
            "unit": "sigma",
            "base": base[0],
            "base_interval": base[1:],
            "augmented": augmented[0],
            "augmented_interval": augmented[1:],
            "noise_floor": 1.0,
            "explained_share": min((base[0] - augmented[0]) / (base[0] - 1.0), 1.0) if base[0] > 1.0 else None,
            "ladder": [rung[0] for rung in critique.ladder],
        },
        "where": {"by_contact": _where(critique, base_fit), "depends_on": list(depends), "p_value": p_dependence},
        "remaining": {
            "structured": critique.is_structured,
            "p_value": critique.remaining.p_value,
            "depends_on": list(critique.remaining.depends_on),
        },
        "below_threshold": [critique.below] if critique.below else [],
        "not_testable": [],
        "left_out": {
            "share": sum(left_out.values()) / (weak.steps + held.steps),
            "unit": "steps",
            "reasons": {str(k): int(v) for k, v in sorted(left_out.items())},
        },
        "detectable": [{"name": k, "smallest": v} for k, v in smallest_sizes(critique).items()],
        "next_experiment": _next_experiment(critique),
    }
    if critique.fitted.sensors:
        content["sensors"] = _sensors(critique)
    content["summary"] = [*_summary(content, critique.settings.thresholds), *_rejected(content), *_clocks(content)]
    content["summary"] += search_ended(content["search"], "chapter2.hidden.critique.thresholds")
    return six_digits(content)


def _parameters(critique: MechanismCritique, fitted: ForceFit) -> dict:
    theta = identify_parameters(critique.training, fitted)
    return {
        name: {"value": v, "std": s, "believed": b, "unit": _unit(name)}
        for name, v, s, b in zip(theta.base.base_names, theta.value, theta.std, theta.believed)
    }


def _unit(name: str) -> str:
    """Return the unit of a base parameter, from its first term."""
    first = name.split()[0].lstrip("-")
    return "kg m²" if first.endswith("I") else "kg m" if "mc_" in first else "kg"


def _effect(critique: MechanismCritique, step: Step) -> dict:
    e, fitted = step.effect, critique.fitted
    gain, low, high = critique.gains[e.name]
    return {
        "name": e.name,
        "family": e.family,
        "title": e.title,
        "equation": e.equation,
        "parameters": {
            p.name: {"value": v, "std": s, "unit": p.unit}
            for p, v, s in zip(e.parameters, fitted.values[e.name], fitted.std[e.name])
        },
        "clears": step.clears,
        "gain": {"held_out_log_score_per_window": gain, "interval": [low, high], "p_value": step.p_value},
        "indistinguishable_from": list(step.alternatives),
        "cosines": {c: step.scan.cosine(e.name, c) for c in step.scan.basis if c != e.name},
    }


def _sensors(critique: MechanismCritique) -> dict:
    fitted, (excess, p_value) = critique.fitted, critique.sensor_excess
    found: dict = {"camera_delay": {"value": critique.camera_delay, "unit": "s"}}
    for e in fitted.sensors:
        if len(e.parameters) > STATED:
            found[e.name] = {
                "value": float(np.sqrt(np.mean(fitted.values[e.name] ** 2)) / e.prior[0]),
                "unit": "stated",
            }
            continue
        for p, value, std in zip(e.parameters, fitted.values[e.name], fitted.std[e.name]):
            found[f"{e.name}.{p.name}"] = {"value": value, "std": std, "unit": p.unit}
    exceeds = is_excess_material(excess, p_value, critique.settings)
    return {"found": found, "excess": excess, "p_value": p_value, "exceeds": exceeds}


def _where(critique: MechanismCritique, base_fit: ForceFit) -> list[dict]:
    """Return the held-out misfit by free coordinate and contacts, before and after the effects were added."""
    held, names = critique.held_out, critique.model.coordinates
    before, after = (predict(held, fitted).z for fitted in (base_fit, critique.fitted))
    contacts = [*critique.model.mechanism.pairs, *(f"{name} at rest" for name in names[: critique.model.joints])]
    pairs = [listed([contacts[j] for j in w]) or "none" for w in held.active_pairs]
    # the wheel's spokes are alike: it matters only whether one is in contact
    if critique.model.name == "wheel":
        pairs = ["one spoke" if p != "none" else p for p in pairs]
    squares = {"before": before**2, "after": after**2}
    rows = pd.DataFrame({"coordinate": [names[c] for c in held.coordinate], "rows": 1} | squares)
    groups = rows.assign(contacts=[pairs[w] for w in held.window]).groupby(["coordinate", "contacts"], as_index=False)
    found = groups.agg({"rows": "sum", "before": "mean", "after": "mean"})
    return found.assign(**{name: np.sqrt(found[name]) for name in squares}).to_dict("records")


def _next_experiment(critique: MechanismCritique) -> dict:
    """Return the measured states at which the chosen effect and its closest alternative differ most, over noise."""
    scan, weak = critique.discovery.first_scan, critique.training
    step = next((s for s in critique.steps if s.alternatives), None)
    if step is None or step.alternatives[0] not in scan.basis or step.effect.name not in scan.shift:
        return {"why": "", "states": []}
    other = step.alternatives[0]
    s, B = scan.shift[step.effect.name], scan.basis[other]
    apart = np.bincount(weak.window, (s - B @ (B.T @ s)) ** 2)
    best = np.argsort(-apart)[:STATES]
    names, means = states_of_windows(weak)
    return {
        "why": f"{step.effect.title} and {other.replace('_', ' ')} differ most around these states: measure there for "
        "longer, at higher speed or with less noise.",
        "states": [dict(zip(names, map(float, row))) for row in means[best]],
        "sigmas": [float(np.sqrt(apart[w])) for w in best],
    }


def _clocks(d: Mapping) -> list[str]:
    """Return sentences on the clocks, if recording.yaml states that their readings may be delayed."""
    found = d.get("sensors", {}).get("found", {})
    if "sensor_delay.d" not in found:
        return []
    joints, camera = (1e3 * found[name]["value"] for name in ("sensor_delay.d", "camera_delay"))
    when = f"{number(abs(camera))} ms {'after' if camera > 0 else 'before'} the joints"
    return [f"The joints are read {number(joints)} ms after the torques act, and the disk is read {when}."]


def _rejected(d: Mapping) -> list[str]:
    return [
        f"{one['title']} was found on the training trials, but on the held-out trials the misfit "
        f"{'rises' if one['ends'][1] > one['ends'][0] else 'does not fall by an amount that matters'}, from "
        f"{' to '.join(map(number, one['ends']))} standard deviations of noise, so this effect is left out."
        for one in d["rejected"]
    ]


def _summary(d: Mapping, settings: SearchSettings) -> list[str]:
    error = d["error"]
    base = f"{number(error['base'])} standard deviations of noise"
    named = []
    for e in d["effects"]:
        others = listed([name.replace("_", " ") for name in e["indistinguishable_from"]], "or")
        named.append(e["title"] + (f" (or {others}, which these data cannot tell apart)" if others else ""))
    if d["verdict"] == "adequate":
        return [
            f"The believed {d['mechanism']} is adequate: the residual generalised forces are {base} on held-out "
            "trials, and no effect in the library lowers that by an amount that matters.",
            *(
                f"The effect {name.replace('_', ' ')} is significant, but too small to matter at this noise."
                for name in d["below_threshold"]
            ),
        ]
    change = settings.change(error["base"], error["augmented"], 1.0)
    fall = f"the held-out misfit {change} standard deviations of noise"
    if d["verdict"] == "effects":
        sentences = [f"The believed {d['mechanism']} leaves out: {listed(named)}; with it {fall} (noise alone: 1)."]
    else:
        what = f"; {listed(named)} was added and {fall}, which is" if named else f": the misfit is {base},"
        on = d["remaining"]["depends_on"]
        sentences = [
            f"The believed {d['mechanism']} misses something that no effect in the library explains{what} far more "
            "than noise.",
            f"The remaining misfit depends on {listed(on)}: look there for the cause." if on else "",
        ]
    if d.get("sensors", {}).get("exceeds"):
        sentences.append(
            f"To explain the motion, the torques would have to err {number(d['sensors']['excess'])} times as much as "
            "recording.yaml states."
        )
    if any(e["family"] == "measurement" for e in d["effects"]):
        sentences.insert(0, "A sensor may be faulty: check it before interpreting these results as physics.")
    return [s for s in sentences if s]


def misfit_table(critique: MechanismCritique) -> pd.DataFrame:
    """Return the held-out misfit with its 95 % interval, of the believed model and after each effect."""
    labels = ["believed_parameters", *(step.effect.name for step in critique.steps)]
    rows = [(label, *rung) for label, rung in zip(labels, critique.ladder)]
    return pd.DataFrame(rows, columns=["label", "misfit", "misfit_low", "misfit_high"])


def residual_tables(critique: MechanismCritique) -> tuple[pd.DataFrame, pd.DataFrame, float]:
    """Return held-out residuals, gains, and 1 % limit in nats, for `figures.critique.mechanisms.figure_residuals`."""
    held, names = critique.held_out, critique.model.coordinates
    base = critique.discovery.bases[critique.discovery.base]
    residuals = pd.DataFrame(
        {
            "window": held.window,
            "coordinate": [names[c] for c in held.coordinate],
            "before": predict(held, base).z,
            "after": predict(held, critique.fitted).z,
        }
    )
    scan = critique.discovery.first_scan
    gains = pd.DataFrame({"candidate": list(scan.gain), "gain": list(scan.gain.values())})
    return residuals, gains, float(np.quantile(scan.null, 0.99))
