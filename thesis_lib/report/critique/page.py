"""report.html: one self-contained page with the results of the critique, in the order of a reader's questions.

Verdict, faults of the measurement, the four steps (compare, where it fails, which effect, what adding it changes), open
questions and the experiment that would decide them, what the data could have shown, tables, sources.  All sentences are
written from the numbers of diagnosis.json, where.json and the tables, so the page claims no more than these files.  The
page needs no network, its text needs no script, and equal content gives equal bytes.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.contacts.bases import BASES
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.words import NAMED, plain_rule
from thesis_lib.critique.proposal.effect_file import capital
from thesis_lib.critique.results.effect_sentences import possible_faults
from thesis_lib.critique.results.findings import Findings
from thesis_lib.critique.results.numbers import law_errors
from thesis_lib.critique.results.summary import MUCH_LEFT_OUT, much_left_out
from thesis_lib.critique.results.titles import addition_title, law_title, origin_text
from thesis_lib.effects import EFFECTS
from thesis_lib.figures.critique.errors import laws_sentence
from thesis_lib.figures.style import Drawn, png_of
from thesis_lib.foundation.terminal import visible
from thesis_lib.pages import FOLDER, element
from thesis_lib.report.critique import body, effects, impacts, replay, tables
from thesis_lib.report.critique.folder import Contents, critique_page
from thesis_lib.report.elements import amount, bullets, fitted, interval, paragraph, percent, picture
from thesis_lib.statistics.wording import listed, number

NOISE_SOURCES = {"arcs": "estimated from the arcs", "differences": "estimated from differences of neighbouring samples"}
METHOD_SOURCES = (
    "Energy ellipse: Chatterjee and Ruina 1998, doi:10.1115/1.2791929.",
    "Best Post Hoc and IRB bound: Fazeli, thesis, section 3.3.2.",
)
OF_RESIDUALS = (
    "The figures below show what the error depends on: measured minus predicted velocity of the contact point, and "
    "the couple about it that would explain the error. A point contact cannot exert a couple; a couple that depends on "
    "the state indicates wrong geometry, inertia or measurement."
)
UNEXPLAINED = {  # by key of diagnosis.json, although no structure remains
    "elsewhere": "something other than the surface hits the body",
    "stays_down": "slow impacts do not rebound, and no law in the library has such a limit",
}
CONTRADICTS = "the effect that would explain it contradicts the known properties of the body"
PARTS = ("noise", "parameters", "rigid_point_contact", "choice_of_law", "rest")


def contents(critique: DropsCritique, findings: Findings) -> Contents:
    """Return pictures and page of a critique of drops."""
    from thesis_lib.figures.critique.pictures import pictures

    drawn = pictures(critique, findings.tables, findings.regions)  # pyright: ignore[reportArgumentType]
    images = {name: png_of(figure) for name, (figure, _) in drawn.items()}
    return Contents(report_html(critique, findings, drawn, images), drawn, images)


def report_html(
    critique: DropsCritique, findings: Findings, pictures: Mapping[str, Drawn], images: Mapping[str, bytes]
) -> str:
    """Return the whole page, from the findings and the pictures by name, also as PNG; missing pictures are omitted."""
    d, where, made, choices = findings.diagnosis, findings.regions, findings.tables, findings.choices
    assert where is not None  # always set for drops
    captions, ladder = tables.captions(critique), made["ladder"]
    drawn = {name: picture(figure, captions[name], images[name]) for name, (figure, _) in pictures.items()}
    models = {**critique.discovery.bases, "augmented": critique.ladder[-1][1]}
    contents = {
        "The body, and where the model errs": ("body", body.turnable(critique, choices)),
        "First: the measurements themselves": ("faults", effects.faults(d)),
        "1. How far the laws are from the measurements": (
            *("compare", data(critique, d), drawn.get("data"), laws(critique, d, ladder), drawn.get("laws")),
            *(budget(made), drawn.get("budget")),
        ),
        "2. Where the base law fails": (
            *("where", where_it_fails(where), drawn.get("where"), impacts.explorer(critique, where, choices)),
            *(
                tables.regions_table(where),
                drawn.get("residuals") and paragraph(OF_RESIDUALS),
                drawn.get("residuals"),
                drawn.get("flights"),
            ),
            tables.tests_table(where),
        ),
        "3. Which effect is missing": (
            *("which", effects.effects(d), drawn.get("candidates"), tables.effects_table(d), tables.evidence_table(d)),
            effects.remaining(critique, d),
        ),
        "A term that is proposed": ("proposed", effects.proposed(d)),
        "4. What adding it changes" if d["effects"] else "4. Nothing was added": (
            *("added", effects.ladder_text(critique, d, ladder), drawn.get("ladder"), effects.moved(critique)),
            *(tables.choices_table(made.get("choices")), drawn.get("parameters"), tables.parameters_table(critique)),
        ),
        f"{'Drops' if critique.space.is_plane else 'Tosses'}, measured and predicted": (
            "replay",
            replay.replay(critique),
        ),
        "Which model is right": ("models", tables.models(made.get("models")), drawn.get("models")),
        "What remains open, and how to decide it": ("open", effects.untold(d), following(d)),
        "What these data could have shown": ("power", power(d), tables.detectable_table(d)),
        "Tables": ("tables", tables.comparison_table(made, models), tables.left_out_table(d)),
        "Sources": ("sources", bullets(sources(d))),
    }
    clearing = [e for e in d["effects"] if e["clears"]]
    fault = any(e["family"] == "measurement" or possible_faults(e) for e in clearing if not e.get("stand_in"))
    own = "" if critique.source is None else (critique.source.header.description or "")
    return critique_page(
        d,
        contents,
        "effect",
        word=verdict_line(d),
        kind="fault" if fault else "",
        about=paragraph(f"Description in the dataset: {visible(own)}" if own.strip() else "", kind="about"),
        key_numbers=_key_numbers(d, ladder),
        script=script(),
    )


def verdict_line(d: Mapping) -> str:
    """Return the verdict in one line where it has another reason than usual; otherwise ""."""
    if d["verdict"] == "adequate" and not all(e["clears"] for e in d["effects"]):
        return "✓ adequate: the effects that you switched on are not needed"
    if d["verdict"] != "unexplained" or d["remaining"]["structured"]:
        return ""
    return f"? unexplained: {next((why for key, why in UNEXPLAINED.items() if d['remaining'].get(key)), CONTRADICTS)}"


def script() -> str:
    """Return the JavaScript of the page: for the map of impacts, the rotatable body, and the replay."""
    return "\n".join((FOLDER / name).read_text(encoding="utf-8") for name in ("impacts.js", "body.js"))


def _key_numbers(d: Mapping, ladder: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Return name, value and note of each number at the head of the page."""
    error, unit = d["error"], d["error"]["unit"]
    first, last = (
        f"held-out, {interval(row['error_low'], row['error_high'])}" for _, row in ladder.iloc[[0, -1]].iterrows()
    )
    left_out = f"{d['n_trials']} trials, {percent(d['left_out']['share'])} left out"
    cells = [
        ("impacts used", f"{d['n_impacts']}", left_out),
        ("error of the base law", amount(error["base"], unit), first),
        ("error with the effects", amount(error["augmented"], unit), last),
        ("noise floor", amount(error["noise_floor"], unit), _of_noise(error)),
    ]
    if not d["effects"]:
        del cells[2]
    if error["explained_share"] is not None and any(e["clears"] for e in d["effects"]):
        share = percent(error["explained_share"])
        cells.append(("explained", share, "of the way from base law to noise floor"))
    return cells


def _of_noise(error: Mapping) -> str:
    floor = error["noise_floor"]
    if floor is not None and error["augmented"] < floor:
        return "an upper estimate that includes unmodelled accelerations in flight; the model errs less"
    return "error of a perfect model"


def data(critique: DropsCritique, d: Mapping) -> Markup:
    train, held, share = critique.training, critique.held_out, d["left_out"]["share"]
    first = f"{d['n_impacts']} impacts of {d['n_trials']} trials are used"
    few = f"{percent(share)} of the detected impacts were left out" if share else "none was left out"
    first += f". {much_left_out(d)[0]}" if share > MUCH_LEFT_OUT else f"; {few}."
    seen = "which rejected an effect but chose none" if d["rejected"] else "which were used for no choice"
    second = (
        f"Law and effects were chosen on {len(np.unique(train.trial))} trials; errors are from the other "
        f"{len(np.unique(held.trial))} trials ({len(held)} impacts), {seen}. Only section 2 "
        "uses all impacts, because a region needs many."
    )
    noise = critique.observations.found.noise
    if critique.observations.arcs and np.isfinite(noise.used[:3]).all():
        sources = [
            "as dataset.yaml states" if np.isfinite(stated) else NOISE_SOURCES.get(noise.source, "estimated")
            for stated in (noise.stated[:2].mean(), noise.stated[2])
        ]
        third = (
            f"Each sample is known to {amount(1e3 * float(np.mean(noise.used[:2])), 'mm', 2)} in position "
            f"({sources[0]}) and {amount(1e3 * float(noise.used[2]), 'mrad', 2)} in angle ({sources[1]}), "
            "one sigma each."
        )
    elif critique.observations.noise_known:
        third = "The noise of poses and velocities is as stated in the dataset."
    else:
        third = "The dataset states no noise and has no trajectories to estimate it from: the noise floor is unknown."
    return paragraph(first, second, third) + bullets(critique.observations.found.warnings)


def laws(critique: DropsCritique, d: Mapping, ladder: pd.DataFrame) -> Markup:
    errors, best = law_errors(critique)
    base, unit, error = d["base_model"], d["error"]["unit"], d["error"]
    values, floor = listed([fitted(name, p) for name, p in base["parameters"].items()]), error["noise_floor"]
    ends = interval(ladder["error_low"].iloc[0], ladder["error_high"].iloc[0])
    compared = "the noise floor is unknown"
    if floor:
        compared = f"that is {number(error['base'] / floor, 2)} times the noise floor of {amount(floor, unit)}"
    chosen, after_the_fact = "which represents all laws if the angle is not measured", ""
    if len(errors) > 1:
        chosen = "chosen by its score on the training trials"
        after_the_fact = (
            f"Choosing the best of the {len(errors)} laws for each impact after the fact would leave an error of "
            f"{amount(float(best.mean()), unit)}. "
        )
    bounds = f"Without any impulse the error would be {amount(critique.no_impact, unit)}"
    if np.isfinite(critique.irb):
        bounds = (
            "Any rigid impulse at the believed contact point errs by at least "
            f"{amount(critique.irb, unit)} (IRB bound, after the fact); without any impulse the error would be "
            f"{amount(critique.no_impact, unit)}"
        )
    return paragraph(
        f"The base law, {chosen}, is {law_title(base['name'])} with {values}. Its held-out "
        f"error is {number(error['base'])} {ends} {unit}; {compared}.",
        f"{laws_sentence(errors)}.",
        f"{after_the_fact}{bounds}.",
    )


def budget(tables: Mapping[str, pd.DataFrame]) -> Markup:
    share = tables["budget"].set_index("part")["share"]
    noise, parameters, rigid, law, rest = (percent(share[name]) for name in PARTS)
    known = f"{noise} is noise and {parameters} the uncertainty of its parameters."
    if not share["noise"] > 0:
        known = f"{parameters} is the uncertainty of its parameters; how much is noise is unknown."
    return paragraph(
        f"Of the mean square error of the base law, {known} {rigid} lies beyond any rigid impulse at the believed "
        f"contact point, so no friction or restitution can remove it; {law} would vanish with the best law for "
        f"each impact; {rest} is left."
    )


def where_it_fails(where: Mapping) -> Markup:
    text = "No region was found in which the base law errs more than elsewhere by more than chance."
    in_flight = then = ""
    if regions := where["regions"]:
        r = regions[0]
        times = f" ({number(r['ratio'], 2)} times)" if r["ratio"] else ""
        text = (
            f"The base law errs most where {plain_rule(r)}: {amount(r['error_inside'], 'm/s')} there against "
            f"{amount(r['error_outside'], 'm/s')} elsewhere{times}, in {percent(r['support'])} of the impacts "
            f"(p = {number(r['p_value'], 2)}, counting all rules that were tried)."
        )
    used = (
        "Maps, residuals and rules of this section use all impacts, including training; the errors given for a "
        "region are those of held-out impacts if at least 30 lie inside and 30 outside it (“errors of” in the table)."
    )
    if flights := where["flight_regions"]:
        r = flights[0]
        in_flight = (
            f"Between impacts the base law errs most where {plain_rule(r)}: its accelerations are off by "
            f"{number(r['error_inside'])} there against {number(r['error_outside'])} elsewhere, in standard deviations "
            f"of noise (p = {number(r['p_value'], 2)}, counting all rules for flights)."
        )
    if after := where["after"]:
        then = "With the effects no such region is left."
        for r in after["regions"][:1]:
            over = "relative to the error expected from noise and scatter"
            most = f"{plain_rule(r)} (p = {number(r['p_value'], 2)})"
            then = f"With the effects the error, {over}, is largest where {most}."
    return paragraph(text, in_flight, then) + paragraph(used)


def following(d: Mapping) -> Markup:
    proposed = d.get("next_experiment")
    if not proposed or not proposed.get("why"):
        return Markup()
    return element("heading", "The next experiment") + paragraph(str(proposed["why"])) + tables.states_table(proposed)


def power(d: Mapping) -> Markup:
    if not d["detectable"]:
        return Markup()
    return paragraph(
        "An effect of the size below would have been found with a probability of about 80 % or more, with all other "
        "parameters fitted and all candidates counted. Two criteria can set this size. Evidence: a smaller effect "
        "would not stand out from the noise; this size falls with the square root of the number of drops. Weight: a "
        "smaller effect would be significant but not raise any error by an amount that matters; more drops do not "
        "change this, so no number of drops is given."
    )


def sources(d: Mapping) -> list[str]:
    laws = [BASES[d[key]["name"]] for key in ("base_model", "augmented_model") if d[key]["name"] in BASES]
    names = [name for e in d["effects"] for name in (e["name"], *e["indistinguishable_from"][:NAMED])]
    effects = [EFFECTS[name] for name in names if name in EFFECTS and EFFECTS[name].reference]
    lines = [f"{law.title}: {law.reference}." for law in laws]
    lines += [f"{capital(effect.title)}: {effect.reference}." for effect in effects]
    lines += [
        f"{capital(addition_title(one))}: from {origin_text(one)}, not in the library (SHA-256 {one['sha256']})."
        for one in d.get("additions", ())
    ]
    return list(dict.fromkeys([*lines, *METHOD_SOURCES]))
