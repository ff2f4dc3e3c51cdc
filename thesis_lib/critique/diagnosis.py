"""diagnosis.json: the verdict, what is missing, what could not be told, and what to measure next (design 3.2).

Beside the keys of the design it holds `summary` (sentences for a reader), `augmented_model` (μ and ε with the effects
on, to be compared with `base_model`), `laws` (each law without effects: parameters and held-out error), in `error` the
`irb_bound_augmented` (with geometry, inertia and camera as the effects have them), in `remaining` the `channels` whose
misfit stays far above noise, `smallest_material` beside each smallest size (see detectable.py) and, with each proposed
state, by how many standard deviations of the noise the two models differ there.
"""

import numpy as np

from thesis_lib.contact import LAWS
from thesis_lib.critique.criticise import Critique, gain_of
from thesis_lib.critique.detectable import detectable
from thesis_lib.critique.fit import Fit
from thesis_lib.critique.next_experiment import next_experiment
from thesis_lib.critique.rounding import six_digits
from thesis_lib.critique.tables import left_out_impacts
from thesis_lib.critique.words import CHANNEL_TEXT, feature_text, listed, reasons_listed
from thesis_lib.effects import EFFECTS

FLIGHT_SAID = 0.1  # sigma; smaller falls of the misfit in flight are not worth words
MUCH_LEFT_OUT = 0.2  # share of the impacts above which the verdict says so


def diagnosis(critique: Critique, rng: np.random.Generator) -> dict:
    """The content of diagnosis.json, with numbers of six digits; `rng` draws intervals and trial states."""
    found = critique.discovery
    base, final = critique.ladder[0][1], critique.ladder[-1][1]
    content = {
        "schema": 1,
        "dataset": critique.dataset,
        "n_impacts": len(critique.observations),
        "n_trials": len(np.unique(critique.observations.trial)),
        "verdict": critique.verdict,
        "base_model": {"name": found.base, "parameters": _parameters(base, ("mu", "epsilon"))},
        "augmented_model": {"name": found.base, "parameters": _parameters(final, ("mu", "epsilon"))},
        "effects": [_effect(critique, i, rng) for i in range(len(found.steps))],
        "laws": {name: _law(critique, name) for name in critique.laws},
        "error": _error(critique),
        "remaining": {
            "structured": critique.is_structured,
            "channels": list(critique.misfit_channels),
            "p_value": critique.remaining.p_value,
            "depends_on": list(critique.remaining.depends_on) if critique.is_structured else [],
            "error": critique.remaining.error_before,
            "error_without_it": critique.remaining.error_after,
        },
        "not_testable": [{"name": name, "why": why} for name, why in found.not_testable.items()],
        "left_out": _left_out(critique),
        "detectable": detectable(critique),
        "next_experiment": next_experiment(critique, rng),
    }
    content["summary"] = _summary(content)
    return six_digits(content)


def _parameters(fitted: Fit, names: tuple[str, ...]) -> dict:
    declared = fitted.model.parameters
    return {
        name: {"value": fitted.values[name], "std": fitted.std[name], "unit": declared[name].unit}
        for name in names
    }


def _law(critique: Critique, name: str) -> dict:
    """One law without effects: what two runs that chose different laws can be compared by."""
    fitted, _ = critique.discovery.laws[name]
    error = float(critique.laws[name].error.mean())
    return {"parameters": _parameters(fitted, ("mu", "epsilon")), "error": error, "unit": "m/s"}


def _effect(critique: Critique, i: int, rng: np.random.Generator) -> dict:
    step, final = critique.discovery.steps[i], critique.ladder[-1][1]
    name = step.effect.name
    gain, low, high = gain_of(critique, name, rng)
    prefix = f"{name}."
    parameters = _parameters(final, tuple(prefix + p.name for p in step.effect.parameters))
    return {
        "name": name,
        "family": step.effect.family,
        "parameters": {key.removeprefix(prefix): value for key, value in parameters.items()},
        "gain": {"held_out_log_score_per_impact": gain, "interval": [low, high], "p_value": step.p_value},
        "indistinguishable_from": list(step.alternatives),
    }


def _error(critique: Critique) -> dict:
    (_, _, before), (_, _, after) = critique.ladder[0], critique.ladder[-1]
    base, augmented, floor = float(before.error.mean()), float(after.error.mean()), after.floor
    flight = None
    if np.isfinite(before.sigmas["flight"]):
        flight = {
            "unit": "sigma",
            "base": np.sqrt(before.sigmas["flight"]),
            "augmented": np.sqrt(after.sigmas["flight"]),
            "noise_floor": 1.0,
        }
    return {
        "unit": "m/s",
        "base": base,
        "augmented": augmented,
        "irb_bound": critique.irb,
        "irb_bound_augmented": critique.irb_augmented,
        "no_impact": critique.no_impact,
        "noise_floor": floor,
        "explained_share": (base - augmented) / (base - floor) if base > floor else None,
        "flight": flight,
    }


def _left_out(critique: Critique) -> dict:
    table = left_out_impacts(critique.observations)
    reasons = {str(k): int(v) for k, v in sorted(table["reason"].value_counts().items())}
    total = len(table) + len(critique.observations)
    return {"share": len(table) / total if total else 0.0, "reasons": reasons}


def _summary(content: dict) -> list[str]:
    """The verdict and what to do, in words; before them what is wrong with the measurements themselves."""
    effects, error = content["effects"], content["error"]
    law = LAWS[content["base_model"]["name"]].title
    faults = [e for e in effects if e["family"] == "measurement"]
    sentences = []
    if faults:
        names = listed([_named(e) for e in faults])
        sentences.append(
            f"The measurements look faulty: {names}; correct the camera or its calibration before reading anything "
            "else here as physics."
        )
    if content["left_out"]["share"] > MUCH_LEFT_OUT:
        why = reasons_listed(content["left_out"]["reasons"])
        sentences.append(
            f"{100 * content['left_out']['share']:.0f} % of the detected impacts were left out ({why}), so the verdict "
            "holds for the others only."
        )
    known = np.isfinite(error["noise_floor"])
    floor = f" (noise floor {_speed(error['noise_floor'])})" if known else " (noise unknown)"
    moves = "falls" if error["augmented"] < error["base"] else "goes"
    fall = f"the held-out error {moves} from {_speed(error['base'])} to {_speed(error['augmented'])}{floor}"
    flight = error["flight"]
    if flight and flight["base"] - flight["augmented"] > FLIGHT_SAID:
        fall += (
            f", and the misfit in flight falls from {flight['base']:.3g} to {flight['augmented']:.3g} standard "
            "deviations of noise"
        )
    physics = [e for e in effects if e not in faults]
    names = listed([_named(e) for e in physics])
    taken = "it" if len(effects) == 1 else "all of it"
    if content["verdict"] == "adequate":
        sentences.append(
            f"{law} is adequate: no effect in the library lowers its held-out error of {_speed(error['base'])}{floor} "
            "by an amount that matters."
        )
        sentences.append(
            "Nothing needs to be added; the report lists how small an effect these data could have shown."
        )
    elif content["verdict"] == "effects":
        sentences.append(
            f"{law} leaves out: {names}; with {taken} {fall}."
            if physics
            else f"With this put right, {law} is enough: {fall}."
        )
        if any(e["indistinguishable_from"] for e in effects):
            sentences.append(
                "To tell the named candidates apart, measure at the states listed under the next experiment."
            )
        else:
            sentences.append("Use model.json, which holds all of this, for predictions.")
    else:
        beyond = f"; its held-out error is {_speed(error['base'])}{floor}"
        if effects:
            beyond = f" beyond {names or 'that fault'}; with {taken} {fall}"
        on = listed([f"the {feature_text(name)}" for name in content["remaining"]["depends_on"]])
        sentences.append(f"{law} misses something that no effect in the library explains{beyond}.")
        where = [CHANNEL_TEXT[name] for name in content["remaining"]["channels"] if name != "impact"]
        if where:
            sentences.append(f"Far more than noise is left in {listed(where)}.")
        sentences.append(
            (f"What is left depends on {on}: look there" if on else "Look at what is left")
            + " for a cause that the library does not hold, or learn it as a residual."
        )
    return sentences


def _named(effect: dict) -> str:
    title = EFFECTS[effect["name"]].title
    others = [EFFECTS[name].title for name in effect["indistinguishable_from"]]
    return title + (f" (or {listed(others, 'or')}, which these data cannot tell apart)" if others else "")


def _speed(value: float) -> str:
    return f"{value:.3g} m/s"
