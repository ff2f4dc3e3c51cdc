"""Sentences of report.html, written from the numbers of diagnosis.json, where.json and the tables."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS
from thesis_lib.critique.criticise import Critique
from thesis_lib.critique.elements import (
    amount,
    bullets,
    estimate,
    heading,
    interval,
    paragraph,
    percent,
    table,
)
from thesis_lib.critique.report_tables import sizes, states_table
from thesis_lib.critique.words import CHANNEL_TEXT, feature_text, listed, plain_rule
from thesis_lib.effects import EFFECTS
from thesis_lib.figures.critique_errors import laws_sentence
from thesis_lib.figures.critique_numbers import (
    compensated,
    effect_title,
    law_errors,
    law_title,
    number,
    symbol,
)

MUCH_LEFT_OUT = 0.2
METHOD_SOURCES = (
    "Energy ellipse: Chatterjee and Ruina 1998, doi:10.1115/1.2791929.",
    "Best Post Hoc and IRB bound: Fazeli, thesis, section 3.3.2.",
)


def faults(d: Mapping) -> str:
    found = [effect for effect in d["effects"] if effect["family"] == "measurement"]
    if not found:
        return ""
    sentences = [f"{_effect_sentence(effect)} {_doubt(effect)}".strip() for effect in found]
    advice = (
        "This is a fault of camera, clock or calibration, not physics of the contact. Repair it and run the critique "
        "again; until then all parameters below hold only with the fault modelled."
    )
    return paragraph(*sentences) + paragraph(advice)


def data(critique: Critique, d: Mapping) -> str:
    train, held = critique.training, critique.held_out
    share = d["left_out"]["share"]
    first = f"{d['n_impacts']} impacts of {d['n_trials']} trials are used; "
    first += f"{percent(share)} of the detected impacts were left out." if share else "none was left out."
    if share > MUCH_LEFT_OUT:
        first += " That is much: what is said here holds for the kind of impact that could be measured."
    second = (
        f"Law and effects were chosen on {len(np.unique(train.trial))} trials; every error on this page is that of the "
        f"other {len(np.unique(held.trial))} trials ({len(held)} impacts), which no choice has seen."
    )
    noise = critique.observations.found.noise
    known = np.isfinite(noise.used[:2]).all() and np.isfinite(noise.used[2])
    if critique.observations.arcs and known:
        source = {"header": "as dataset.yaml states", "arcs": "estimated from the arcs"}.get(
            noise.source, "estimated"
        )
        third = (
            f"One sample is known to {amount(1e3 * float(np.mean(noise.used[:2])), 'mm', 2)} and "
            f"{amount(1e3 * float(noise.used[2]), 'mrad', 2)} (one sigma, {source})."
        )
    elif critique.observations.noise_known:
        third = "The noise of poses and velocities is that which the dataset states."
    else:
        third = "The dataset states no noise and holds no trajectories to estimate it from: the noise floor is unknown."
    return paragraph(first, second, third) + bullets(critique.observations.found.warnings)


def laws(critique: Critique, d: Mapping, tables: Mapping[str, pd.DataFrame], ladder: pd.DataFrame) -> str:
    errors, best = law_errors(critique)
    base, unit, error = d["base_model"], d["error"]["unit"], d["error"]
    values = listed(
        [
            f"{symbol(name)} = {estimate(p['value'], p['std'], p['unit'])}"
            for name, p in base["parameters"].items()
        ]
    )
    ends = interval(ladder["error_low"].iloc[0], ladder["error_high"].iloc[0])
    floor = error["noise_floor"]
    compared = (
        f"that is {number(error['base'] / floor, 2)} times the noise floor of {amount(floor, unit)}"
        if floor
        else "the noise floor is unknown"
    )
    return paragraph(
        f"The base law, chosen by its score on unseen trials, is {law_title(base['name'])} with {values}. Its held-out "
        f"error is {number(error['base'])} {ends} {unit}; {compared}.",
        f"{laws_sentence(errors)}.",
        f"The best of the six laws for each impact, picked after the fact, would err by "
        f"{amount(float(best.mean()), unit)}; any rigid impulse at the believed contact point by at least "
        f"{amount(critique.irb, unit)} (IRB bound, after the fact); "
        f"and if nothing happened at the impact, by {amount(critique.no_impact, unit)}.",
    )


def budget(tables: Mapping[str, pd.DataFrame]) -> str:
    if "budget" not in tables:
        return ""
    share = tables["budget"].set_index("part")["share"]
    noise = (
        f"{percent(share['noise'])} is noise and {percent(share['parameters'])} the uncertainty of its parameters. "
        if share["noise"] > 0
        else f"{percent(share['parameters'])} is the uncertainty of its parameters; how much is noise is unknown. "
    )
    return paragraph(
        f"Of the mean square error of the base law, {noise}"
        f"{percent(share['rigid_point_contact'])} lies beyond any rigid impulse at "
        f"the believed contact point, so that no friction or restitution can remove it; "
        f"{percent(share['choice_of_law'])} would go with another of the six laws; {percent(share['rest'])} is left."
    )


def where_it_fails(where: Mapping) -> str:
    regions = where.get("regions", [])
    if not regions:
        text = (
            "No rule marks a region in which the base law errs more than elsewhere, beyond what chance gives."
        )
    else:
        r = regions[0] | {"rule": plain_rule(regions[0])}
        times = f" ({number(r['ratio'], 2)} times)" if r["ratio"] else ""
        text = (
            f"The base law errs most where {r['rule']}: {amount(r['error_inside'], 'm/s')} there against "
            f"{amount(r['error_outside'], 'm/s')} elsewhere{times}, in {percent(r['support'])} of the impacts "
            f"(p = {number(r['p_value'], 2)}, counting all rules that were tried)."
        )
    after = where.get("after")
    if not after:
        return paragraph(text)
    left = after["regions"]
    then = (
        f"With the effects the error, over what noise and scatter let expect, is largest where {plain_rule(left[0])} "
        f"(p = {number(left[0]['p_value'], 2)})."
        if left
        else "With the effects no such region is left."
    )
    return paragraph(text, then)


def residuals(critique: Critique) -> str:
    return paragraph(
        "The pictures below show what the error depends on: measured minus predicted velocity of the contact point, "
        "and the couple about it that the error needs. A point contact cannot give a couple; one that depends on the "
        "state speaks of geometry, inertia or measurement."
    )


def effects(d: Mapping) -> str:
    if not d["effects"]:
        return paragraph(
            "No candidate passes all three tests: a gain of log score beyond what the best of all candidates gains by "
            "chance, a gain on trials it was not fitted to, and a fall of the error that matters."
        )
    return "".join(
        paragraph(f"{_capital(effect_title(effect['name']))} is a fault of the measurement; see above.")
        if effect["family"] == "measurement"
        else paragraph(_effect_sentence(effect), _doubt(effect))
        for effect in d["effects"]
    )


def _effect_sentence(effect: Mapping) -> str:
    gain = effect["gain"]
    title = _capital(effect_title(effect["name"]))
    equation = f" ({EFFECTS[effect['name']].equation})" if effect["name"] in EFFECTS else ""
    low, high = gain["interval"]
    return (
        f"{title}{equation}: {listed(sizes(effect))}. Without it, and all else refitted, the held-out "
        f"log score is lower by {number(gain['held_out_log_score_per_impact'])} {interval(low, high)} nats an impact "
        f"(p = {number(gain['p_value'], 2)} against the best of all candidates by chance)."
    )


def _doubt(effect: Mapping) -> str:
    others = effect["indistinguishable_from"]
    if not others:
        return ""
    return f"These data cannot tell it from {listed([effect_title(name) for name in others], 'or')}."


def remaining(critique: Critique, d: Mapping) -> str:
    """What is left after the last effect: structure, scatter beyond the noise, or nothing that matters."""
    left = d["remaining"]
    p = number(left["p_value"], 2)
    if not left["structured"]:
        return paragraph(
            f"What is left in the residuals shows no structure that matters (p = {p} by permutation)."
        )
    sentences = []
    judged = critique.ladder[-1][2]
    for channel in left["channels"]:
        times = judged.excess if channel == "impact" else np.sqrt(judged.sigmas[channel])
        sentences.append(
            f"With all that was found the held-out misfit of {CHANNEL_TEXT[channel]} is {number(times, 2)} times what "
            f"noise alone would give (far more than {number(critique.settings.excess_scatter, 2)} counts as "
            "unexplained)."
        )
    if left["p_value"] <= critique.settings.alpha or not left["channels"]:
        sentences.append(f"Structure remains that no named effect explains (p = {p} by permutation).")
        if left.get("error") is not None and left.get("error_without_it") is not None:
            sentences.append(
                f"A Gaussian process learns part of it: the error falls from {amount(left['error'], 'm/s')} to "
                f"{amount(left['error_without_it'], 'm/s')} on training trials it was not fitted to."
            )
        names = [feature_text(name) for name in left["depends_on"]]
        sentences.append(f"It depends most on: {'; '.join(names)}." if names else "")
    else:
        sentences.append(
            f"A Gaussian process learns no part of it from the state (p = {p} by permutation): it is scatter whose "
            "cause is not in the state before impact."
        )
    if d["effects"]:
        sentences.append(
            "As long as something is unexplained, the effects above may stand in for its cause, and their sizes may be "
            "off by more than their intervals say."
        )
    return paragraph(*sentences)


def ladder_text(d: Mapping, ladder: pd.DataFrame) -> str:
    error, unit = d["error"], d["error"]["unit"]
    if not d["effects"]:
        return paragraph("No effect was added, so the ladder has a single rung.")
    steps = [
        f"{number(row.error)} {interval(row.error_low, row.error_high)} {unit} with {effect_title(row.label)}"
        for row in ladder.iloc[1:].itertuples()
    ]
    text = f"The held-out error goes from {amount(error['base'], unit)} to {listed(steps)}."
    share = error["explained_share"]
    if share is not None:
        text += f" That is {way(share)} to the noise floor of {amount(error['noise_floor'], unit)}."
    flight = error["flight"]
    if flight:
        before, after = number(flight["base"]), number(flight["augmented"])
        moves = f"stays at {after}" if before == after else f"goes from {before} to {after}"
        text += (
            f" The misfit of the flights {moves} standard deviations of the noise, where 1 is noise alone."
        )
    bound, put_right = error["irb_bound"], error["irb_bound_augmented"]
    if number(bound, 2) != number(put_right, 2):
        text += (
            f" The IRB bound is {amount(bound, unit)} with poses, geometry and inertia as believed, and "
            f"{amount(put_right, unit)} as the effects have them."
        )
    return paragraph(text)


def way(share: float) -> str:
    """How much of the way from the base law to the noise floor."""
    return "all the way" if share >= 0.995 else f"{percent(share)} of the way"


def moved(critique: Critique) -> str:
    if len(critique.ladder) < 2:
        return ""
    table_of = compensated(critique)
    if table_of.empty:
        return paragraph("μ and ε hardly move: they had not compensated for what was missing.")
    parts = [
        f"{symbol(row.parameter)} from {number(row.before)} to {number(row.after)} "
        f"({number(abs(row.sigmas), 2)} standard errors)"
        for row in table_of.itertuples()
    ]
    return paragraph(f"Parameters that had compensated for what was missing move: {listed(parts)}.")


def untold(d: Mapping) -> str:
    groups = [
        f"{effect_title(e['name'])}, or {listed([effect_title(n) for n in e['indistinguishable_from']], 'or')}: on "
        "these data they predict the same within the noise."
        for e in d["effects"]
        if e["indistinguishable_from"]
    ]
    untested = table(
        "Effects that these data cannot test",
        ("effect", "why"),
        [(effect_title(e["name"]), e["why"]) for e in d["not_testable"]],
    )
    told = ""
    if groups:
        told = bullets(groups)
    elif d["effects"]:
        told = paragraph(
            "Each effect that was found predicts these data better than any other in the library could in its place."
        )
    return told + untested


def following(d: Mapping) -> str:
    proposed = d.get("next_experiment")
    if not proposed or not proposed.get("why"):
        return ""
    return heading("The next experiment") + paragraph(str(proposed["why"])) + states_table(proposed)


def power(d: Mapping) -> str:
    if not d["detectable"]:
        return ""
    drops = [e["drops_for_half"] for e in d["detectable"] if e.get("drops_for_half")]
    more = f" Half that size would show with four times the drops, about {max(drops)}." if drops else ""
    return paragraph(
        "An effect of the size below would have been found with a chance of 80 %, with all other parameters fitted and "
        f"all candidates counted.{more}"
    )


def sources(d: Mapping) -> list[str]:
    law = LAWS.get(d["base_model"]["name"])
    found = [f"{law.title}: {law.reference}."] if law else []
    for effect in d["effects"]:
        for name in (effect["name"], *effect["indistinguishable_from"]):
            if name in EFFECTS and EFFECTS[name].reference:
                found.append(f"{_capital(EFFECTS[name].title)}: {EFFECTS[name].reference}.")
    return list(dict.fromkeys([*found, *METHOD_SOURCES]))


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
