"""Sentences of report.html, written from the numbers of diagnosis.json, where.json and the tables."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.words import NAMED, plain_rule
from thesis_lib.critique.proposal.effect_file import capital
from thesis_lib.critique.results.numbers import law_errors
from thesis_lib.critique.results.summary import MUCH_LEFT_OUT, much_left_out
from thesis_lib.critique.results.titles import addition_title, law_title, origin_text
from thesis_lib.effects import EFFECTS
from thesis_lib.figures.critique.errors import laws_sentence
from thesis_lib.pages import element
from thesis_lib.report.critique.tables import states_table
from thesis_lib.report.elements import amount, bullets, fitted, interval, paragraph, percent
from thesis_lib.statistics.wording import listed, number

NOISE_SOURCES = {"arcs": "estimated from the arcs", "differences": "estimated from differences of neighbouring samples"}
METHOD_SOURCES = (
    "Energy ellipse: Chatterjee and Ruina 1998, doi:10.1115/1.2791929.",
    "Best Post Hoc and IRB bound: Fazeli, thesis, section 3.3.2.",
)


PARTS = ("noise", "parameters", "rigid_point_contact", "choice_of_law", "rest")


def data(critique: DropsCritique, d: Mapping) -> Markup:
    train, held, share = critique.training, critique.held_out, d["left_out"]["share"]
    first = f"{d['n_impacts']} impacts of {d['n_trials']} trials are used"
    few = f"{percent(share)} of the detected impacts were left out" if share else "none was left out"
    first += f". {much_left_out(d)[0]}" if share > MUCH_LEFT_OUT else f"; {few}."
    seen = "which rejected an effect but chose none" if d["rejected"] else "which no choice has seen"
    second = (
        f"Law and effects were chosen on {len(np.unique(train.trial))} trials; errors are those of the other "
        f"{len(np.unique(held.trial))} trials ({len(held)} impacts), {seen}. Section 2 alone "
        "looks at all impacts, because a region needs many."
    )
    noise = critique.observations.found.noise
    if critique.observations.arcs and np.isfinite(noise.used[:3]).all():
        sources = [
            "as dataset.yaml states" if np.isfinite(stated) else NOISE_SOURCES.get(noise.source, "estimated")
            for stated in (noise.stated[:2].mean(), noise.stated[2])
        ]
        third = (
            f"One sample is known to {amount(1e3 * float(np.mean(noise.used[:2])), 'mm', 2)} in position "
            f"({sources[0]}) and {amount(1e3 * float(noise.used[2]), 'mrad', 2)} in angle ({sources[1]}), "
            "one sigma each."
        )
    elif critique.observations.noise_known:
        third = "The noise of poses and velocities is that which the dataset states."
    else:
        third = "The dataset states no noise and holds no trajectories to estimate it from: the noise floor is unknown."
    return paragraph(first, second, third) + bullets(critique.observations.found.warnings)


def laws(critique: DropsCritique, d: Mapping, ladder: pd.DataFrame) -> Markup:
    errors, best = law_errors(critique)
    base, unit, error = d["base_model"], d["error"]["unit"], d["error"]
    values, floor = listed([fitted(name, p) for name, p in base["parameters"].items()]), error["noise_floor"]
    ends = interval(ladder["error_low"].iloc[0], ladder["error_high"].iloc[0])
    compared = "the noise floor is unknown"
    if floor:
        compared = f"that is {number(error['base'] / floor, 2)} times the noise floor of {amount(floor, unit)}"
    chosen, after_the_fact = "which stands for all where the angle is not measured", ""
    if len(errors) > 1:
        chosen = "chosen by its score on unseen trials"
        after_the_fact = (
            f"The best of the {len(errors)} laws for each impact, picked after the fact, would err by "
            f"{amount(float(best.mean()), unit)}. "
        )
    bounds = f"If nothing happened at the impact, the error would be {amount(critique.no_impact, unit)}"
    if np.isfinite(critique.irb):
        bounds = (
            "Any rigid impulse at the believed contact point would err by at least "
            f"{amount(critique.irb, unit)} (IRB bound, after the fact); and if nothing happened at the impact, by "
            f"{amount(critique.no_impact, unit)}"
        )
    return paragraph(
        f"The base law, {chosen}, is {law_title(base['name'])} with {values}. Its held-out "
        f"error is {number(error['base'])} {ends} {unit}; {compared}.",
        f"{laws_sentence(errors)}.",
        f"{after_the_fact}{bounds}.",
    )


def budget(tables: Mapping[str, pd.DataFrame]) -> Markup:
    if "budget" not in tables:
        return Markup()
    share = tables["budget"].set_index("part")["share"]
    noise, parameters, rigid, law, rest = (percent(share[name]) for name in PARTS)
    known = f"{noise} is noise and {parameters} the uncertainty of its parameters."
    if not share["noise"] > 0:
        known = f"{parameters} is the uncertainty of its parameters; how much is noise is unknown."
    return paragraph(
        f"Of the mean square error of the base law, {known} {rigid} lies beyond any rigid impulse at the believed "
        f"contact point, so that no friction or restitution can remove it; {law} would go with another law for each "
        f"impact; {rest} is left."
    )


def where_it_fails(where: Mapping) -> Markup:
    if not where:
        return Markup()
    text = "No rule marks a region in which the base law errs more than elsewhere, beyond what chance gives."
    in_flight = then = ""
    if regions := where.get("regions"):
        r = regions[0]
        times = f" ({number(r['ratio'], 2)} times)" if r["ratio"] else ""
        text = (
            f"The base law errs most where {plain_rule(r)}: {amount(r['error_inside'], 'm/s')} there against "
            f"{amount(r['error_outside'], 'm/s')} elsewhere{times}, in {percent(r['support'])} of the impacts "
            f"(p = {number(r['p_value'], 2)}, counting all rules that were tried)."
        )
    used = (
        "Maps, residuals and rules of this section use all impacts, those of training too; the errors told of a region "
        "are those of held-out impacts where at least 30 lie inside and outside it (column “errors of” of the table)."
    )
    if flights := where.get("flight_regions"):
        r = flights[0]
        in_flight = (
            f"Between impacts the base law errs most where {plain_rule(r)}: its accelerations are off by "
            f"{number(r['error_inside'])} there against {number(r['error_outside'])} elsewhere, in standard deviations "
            f"of noise (p = {number(r['p_value'], 2)}, counting all rules for flights)."
        )
    if after := where.get("after"):
        then = "With the effects no such region is left."
        for r in after["regions"][:1]:
            over = "over that expected from noise and scatter"
            most = f"{plain_rule(r)} (p = {number(r['p_value'], 2)})"
            then = f"With the effects the error, {over}, is largest where {most}."
    return paragraph(text, in_flight, then) + paragraph(used)


def residuals() -> Markup:
    return paragraph(
        "The pictures below show what the error depends on: measured minus predicted velocity of the contact point, "
        "and the couple about it that the error needs. A point contact cannot give a couple; one that depends on the "
        "state speaks of geometry, inertia or measurement."
    )


def following(d: Mapping) -> Markup:
    proposed = d.get("next_experiment")
    if not proposed or not proposed.get("why"):
        return Markup()
    return element("heading", "The next experiment") + paragraph(str(proposed["why"])) + states_table(proposed)


def power(d: Mapping) -> Markup:
    if not d["detectable"]:
        return Markup()
    return paragraph(
        "An effect of the size below would have been found with a chance of about 80 % or more, with all other "
        "parameters fitted and all candidates counted. Two things can set that size. Evidence: a smaller effect would "
        "not stand out of the noise; this size falls with the root of the number of drops. Weight: a smaller effect "
        "would stand out but not raise any error by an amount that counts; more drops do not change that, so none are "
        "named."
    )


def sources(d: Mapping) -> list[str]:
    laws = [BASES[d[key]["name"]] for key in ("base_model", "augmented_model") if d[key]["name"] in BASES]
    names = [name for e in d["effects"] for name in (e["name"], *e["indistinguishable_from"][:NAMED])]
    effects = [EFFECTS[name] for name in names if name in EFFECTS and EFFECTS[name].reference]
    lines = [f"{law.title}: {law.reference}." for law in laws]
    lines += [f"{capital(effect.title)}: {effect.reference}." for effect in effects]
    lines += [
        f"{capital(addition_title(one))}: from {origin_text(one)}, no part of the library (SHA-256 {one['sha256']})."
        for one in d.get("additions", ())
    ]
    return list(dict.fromkeys([*lines, *METHOD_SOURCES]))
