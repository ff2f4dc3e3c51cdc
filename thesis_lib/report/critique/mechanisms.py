"""report.html for the critique of a mechanism: the same four steps as for impacts, from diagnosis.json."""

from collections.abc import Mapping

import numpy as np
from markupsafe import Markup

from thesis_lib.critique.mechanisms.critique import MechanismCritique
from thesis_lib.critique.mechanisms.diagnosis import mechanism_diagnosis, misfit_table, residual_tables
from thesis_lib.critique.mechanisms.effects import CANDIDATES
from thesis_lib.critique.results.findings import Findings
from thesis_lib.critique.results.titles import symbol
from thesis_lib.figures.critique.mechanisms import figure_residuals
from thesis_lib.report.critique.folder import Contents, critique_page
from thesis_lib.report.elements import amount, bullets, estimate, fitted, interval, paragraph, percent, picture, table
from thesis_lib.statistics.wording import listed, number

UNITS = {(e.name, p.name): p.unit for effects in CANDIDATES.values() for e in effects for p in e.parameters}
RESIDUALS = (
    "Left: residual generalised forces of held-out windows in units of their noise, with the believed model and with "
    "the effects found. Right: gain of each candidate alone."
)


def mechanism_findings(critique: MechanismCritique, name: str, rng: np.random.Generator) -> Findings:
    """Return the findings on a mechanism, under the `name` of its recording; `rng` permutes windows."""
    return Findings(mechanism_diagnosis(critique, name, rng), {"misfit": misfit_table(critique)})


def mechanism_contents(critique: MechanismCritique, findings: Findings) -> Contents:
    """Return picture and page of a mechanism."""
    drawn = figure_residuals(*residual_tables(critique))
    page = mechanism_page(findings.diagnosis, picture(drawn[0], RESIDUALS))
    return Contents(page, {"mechanism_residuals": drawn})


def mechanism_page(d: Mapping, *shown: Markup) -> str:
    """Return report.html, from the content of diagnosis.json and the pictures."""
    error, lost = d["error"], d["left_out"]
    reasons = "; ".join(f"{name}: {count}" for name, count in lost["reasons"].items())
    why = f" ({reasons} {lost['unit']})" if reasons else ""
    compare = paragraph(
        f"{d['n_windows']} windows of {d['n_trials']} trials are used, {percent(lost['share'])} of the steps are left "
        f"out{why}. In each window, the equations of motion with the believed parameters are summed over the steps, "
        "contact forces are projected out, and the residual is divided by the noise of the measured states.",
        f"On held-out trials, the root mean square of this residual is {number(error['base'])} "
        f"{interval(*error['base_interval'])} standard deviations; noise alone gives 1.",
    )
    where = paragraph(
        f"The misfit depends most on {listed(d['where']['depends_on'])} (p = {number(d['where']['p_value'], 2)}, all "
        "coordinates and speeds counted)."
        if d["where"]["depends_on"]
        else "The misfit depends on no coordinate or speed more than by chance."
    ) + table(
        "Held-out misfit by free direction and contacts, in standard deviations",
        ("direction", "contacts", "values", "believed model", "with the effects"),
        [
            (r["coordinate"], r["contacts"], str(r["rows"]), number(r["before"]), number(r["after"]))
            for r in d["where"]["by_contact"]
        ],
        numeric=(2, 3, 4),
    )
    untold = bullets(
        f"{e['title']}, or {_others(e)}: on these data they predict the same within the noise."
        for e in d["effects"]
        if e["indistinguishable_from"]
    ) + paragraph(d["next_experiment"]["why"])
    contents = {
        "1. How far the believed model is from the measurements": ("compare", compare),
        "2. Where it fails": ("where", where, *shown),
        "3. Which effect is missing": ("which", _effects(d)),
        "4. What adding it changes" if d["effects"] else "4. Nothing was added": ("added", _added(d)),
        "What remains open, and how to decide it": ("open", untold),
        "What these data could have shown": ("power", _detectable(d)),
    }
    return critique_page(d, contents, "force")


def _others(effect: Mapping) -> str:
    """Return the names of the effects that the data cannot distinguish from `effect`."""
    return listed([name.replace("_", " ") for name in effect["indistinguishable_from"]], "or")


def _effects(d: Mapping) -> Markup:
    if not d["effects"]:
        return paragraph(
            "No candidate passes all three tests: a gain of log score beyond the gain of the best of all candidates by "
            "chance, a gain on trials to which it was not fitted, and a fall of the misfit that matters."
        )
    rows = []
    for e in d["effects"]:
        sizes = [fitted(name, p) for name, p in e["parameters"].items()]
        gain = f"{number(e['gain']['held_out_log_score_per_window'])} {interval(*e['gain']['interval'])}"
        others = _others(e) or "–"
        rows.append((e["title"], e["equation"], "; ".join(sizes), gain, number(e["gain"]["p_value"], 2), others))
    columns = ("effect", "equation", "size", "gain (nats per window)", "p", "indistinguishable from")
    return table("Effects, in the order in which they were found", columns, rows)


def _added(d: Mapping) -> Markup:
    if not d["effects"]:
        return Markup()
    error = d["error"]
    rungs = [number(x) for x in error["ladder"]]
    text = paragraph(
        f"The held-out misfit changes from {rungs[0]} to {listed(rungs[1:])} standard deviations (noise alone: 1). "
        "Base inertial parameters identified without the effects compensate for them; with the effects they recover."
    )
    after = d["augmented_model"]["parameters"]
    rows = [
        (
            name,
            amount(p["believed"], p["unit"], 4),
            *(estimate(q["value"], q["std"], q["unit"]) for q in (p, after[name])),
        )
        for name, p in d["base_model"]["parameters"].items()
        if name in after
    ]
    columns = ("base parameter", "believed", "identified without effects", "with the effects")
    return text + table("Base inertial parameters", columns, rows, numeric=(1, 2, 3))


def _detectable(d: Mapping) -> Markup:
    rows = []
    for e in d["detectable"]:
        sizes = [f"{symbol(k)} = {amount(v, UNITS.get((e['name'], k), ''), 2)}" for k, v in e["smallest"].items()]
        rows.append((e["name"].replace("_", " "), "; ".join(sizes)))
    return table("Smallest effects that would have been found", ("effect", "smallest size"), rows)
