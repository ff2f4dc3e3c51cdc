"""Tables and captions of report.html."""

# pandas' type stubs do not describe the contents of a row
# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false, reportOptionalMemberAccess=false
# pyright: reportCallIssue=false

from collections.abc import Mapping

import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.words import alternatives_listed, plain_rule, reason_text
from thesis_lib.critique.engines.compare import bounded_text, missed_tosses, model_sentences, row_title
from thesis_lib.critique.likelihood.channels import CHANNELS, IMPACT, concerned
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.results.titles import counted_from, effect_title, law_title, origin_text, symbol
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Parameter
from thesis_lib.report.elements import amount, estimate, fitted, interval, paragraph, percent, plus_minus, sized, table
from thesis_lib.statistics.wording import listed, number

BOUND_WORDS = {
    "best_post_hoc": "Best Post Hoc",
    "irb_bound": "IRB bound",
    "no_impact": "no impulse",
    "augmented": "with the effects",
}
TESTS = {
    "rigid_point": "A rigid point impulse can explain each impact",
    "momentum_balance": "Angular momentum balances about the believed contact point (a = b = 1)",
    "parity": "A mirrored throw gives the mirrored outcome",
    "homogeneity": "Twice the velocity gives twice the outcome",
}
LEVEL = 0.01
# text on the rows of the residuals, and on the second map of the error; by whether the motion is planar
ROWS_AND_PLACES = {
    True: (
        "parts of the error",
        "The map over the energy disc shows the outcome of each impact: the centre is the dead stop, the circle "
        "conserves the energy at the contact, the lowest point is zero impulse, the highest complete reversal.",
    ),
    False: (
        "parts of the error, along the slip before impact (tangential), across it (lateral), along the normal, and the "
        "couple",
        "The lower map shows where the body is hit, by the direction of the contact point from the centre of mass; "
        "larger marks stand for more impacts.",
    ),
}


def captions(critique: DropsCritique) -> dict[str, str]:
    """Return the caption of each picture; it is also the alternative text, after the title of the picture."""
    states = "Histograms of the states before impact, training and held-out trials stacked"
    in_plane, o = critique.space.is_plane, critique.observations
    if in_plane and o.arcs and critique.source is not None and critique.source.trajectories is not None:
        states = (
            "Top: three trials in the plane, with samples, the flights fitted on either side of each impact, and the "
            f"body's outline at the impacts that were used and left out. Below: h{states[1:]}"
        )
    out = "; the bars count impacts used and left out, by reason." if len(critique.observations.found.left_out) else "."
    two = "left for the base law, right with the effects" if len(critique.ladder) > 1 else "for the base law"
    misfits = ""
    if critique.observations.arcs:
        parts = "flights, of the poses before and after each impact against each other, and of the gap at impact"
        misfits = f" Right: misfit of {parts}, in standard deviations of the noise."
    parts, place = ROWS_AND_PLACES[in_plane]
    return {
        "data": states + out,
        "laws": "Left: mean held-out error of each law with its 95 % interval, and the bounds. Right: held-out log "
        "score of each law minus that of the base law.",
        "budget": "The mean square of the base law's held-out error, split into parts that add up to it.",
        "where": f"Mean error of the impacts in each hexagon, {two}; rectangles mark the regions of the table "
        f"below that can be drawn on these axes. {place}",
        "residuals": f"Rows: {parts}; columns: the states on which it depends most. Grey: single impacts of "
        "the base law; lines: means in eight bins with 95 % intervals. The number in each panel is the share of the "
        "base law's error variance that the state explains.",
        "flights": "Acceleration in flight, measured minus predicted, in units of noise (1 is noise alone), of all "
        "flights, training and held out. Rows: its parts; columns: the states at mid-flight on which it depends most; "
        "velocities are those of the centre of mass. Grey: single flights of the base law; lines: means in eight bins "
        "with 95 % intervals. Long flights show deviations that noise hides in short flights.",
        "candidates": "Gain of each effect if added alone, on held-out trials, with the law that suits it best and "
        "its 95 % interval; the axis is linear near zero and logarithmic beyond. Only the effects that fitted the "
        "training trials best are shown. Dashed: gain that the best of all candidates exceeds by chance in 5 % of the "
        "cases, on the training trials.",
        "ladder": "Mean held-out error with its 95 % interval after each added effect, on a logarithmic axis, with "
        f"noise floor and bounds as lines.{misfits}",
        "models": "Left: mean held-out error of each model with its 95 % interval, on a logarithmic axis. Right: its "
        "friction. Open: fitted without the named effects; filled: with them; diamonds are physics engines.",
        "parameters": "Each parameter with its 95 % interval, from top to bottom as effects are added. Arrows: the "
        "data give only a bound.",
    }


def sizes(effect: Mapping) -> list[str]:
    """Return each parameter of an effect with its 95 % interval; effects that are on or off have no size."""
    switches = {name: p for name, p in _declared(effect["name"]).items() if p.discrete is not None}
    found = effect["parameters"].items()
    return [switches[name].said(p["value"]) if name in switches else fitted(name, p) for name, p in found]


def _declared(effect: str) -> dict[str, Parameter]:
    """Return the parameters of an effect by name; empty if the effect is not in the library."""
    of = EFFECTS.get(effect)
    return {p.name: p for p in (*of.parameters, *of.own_in_space)} if of else {}


def _family(name: str) -> str:
    return "law of contact" if name == "contact_law" else name


def effects_table(d: Mapping) -> Markup:
    """Return the table of the effects found, with sizes and gains."""
    rows = []
    for e in d["effects"]:
        title = effect_title(e["name"]) + ("" if e["clears"] else " (switched on by you)")
        title += " (a stand-in)" if e.get("stand_in") else ""
        origin = [one for one in d.get("additions", ()) if (one["kind"], one["name"]) == ("effect", e["name"])]
        title += f" (from {origin_text(origin[0])})" if origin else ""
        gain = f"{number(e['gain']['held_out_log_score_per_impact'])} {interval(*e['gain']['interval'])}"
        others = [*map(effect_title, e["indistinguishable_from"]), *(e.get("could_be") or {}).get("causes", ())]
        size = "; ".join([*sizes(e), *filter(None, [counted_from(e["name"], d.get("reference", {}), e["parameters"])])])
        rows.append(
            (
                title,
                _family(e["family"]),
                size,
                gain,
                number(e["gain"]["p_value"], 2),
                alternatives_listed(others) or "–",
            )
        )
    columns = ("effect", "family", "size [95 % interval]", "gain (nats per impact)", "p", "could also be")
    return table("Effects in the order in which they were selected", columns, rows, numeric=(3, 4))


def evidence_table(d: Mapping) -> Markup:
    """Return the table of changes in each channel's held-out misfit, by each effect found or rejected."""
    shown = [name for name, channel in CHANNELS.items() if channel is IMPACT or d["error"].get(name)]
    rows = []
    for e in d["effects"]:
        of = concerned(EFFECTS[e["name"]]) if e["name"] in EFFECTS else ()
        words = ["falls" if n in e["material_in"] else "stays" if n in of else "–" for n in shown]
        rows.append((effect_title(e["name"]), *words, "found" if e["clears"] else "switched on by you"))
    for e in d["rejected"]:
        words = ["rises" if n in e["rises"] else "does not rise" for n in shown]
        rows.append((effect_title(e["name"]), *words, "rejected"))
    caption = (
        "Agreement of the evidence: whether the held-out misfit of each channel falls, stays or rises with a candidate "
        "by an amount that matters; –: this channel does not concern it"
    )
    return table(caption, ("candidate", *(CHANNELS[name].short for name in shown), "status"), rows)


def regions_table(where: Mapping) -> Markup:
    """Return the table of regions in which the base law fails, and of regions that remain with the effects."""
    rows = []
    for model, of_model in (("base law", where), ("with the effects", where["after"] or {})):
        for r in of_model.get("regions", []):
            errors = [number(r[key]) for key in ("error_inside", "error_outside")]
            over = [number(r[key], 2) for key in ("sigmas_inside", "sigmas_outside", "p_value")]
            errors_of = "held-out" if r["on"] == "held_out" else "all impacts"
            rows.append((plain_rule(r), model, percent(r["support"]), *errors, *over, errors_of))
    columns = (
        *("region", "model", "impacts", "error inside (m/s)", "outside (m/s)"),
        *("inside over expected", "outside over expected", "p", "errors of"),
    )
    caption = (
        "Regions in which the error is larger than elsewhere. Expected is the error from noise and the mean scatter of "
        "the model at the same states; p counts all rules that were tried"
    )
    return table(caption, columns, rows, numeric=range(2, 8))


def tests_table(where: Mapping) -> Markup:
    """Return the table of tests of whole classes of models; empty without tests."""
    rows = []
    for name, test in where["class_tests"].items():
        p, detail = test["p_value"], ""
        if p is None:
            rows.append((TESTS[name], "–", f"not tested: {test['why_not']}"))
            continue
        verdict = "contradicted" if p < LEVEL else "not contradicted"
        if name == "rigid_point":
            couple, gain = percent(test["share_couple"]), percent(test["share_energy_gain"])
            detail = f": {couple} of the impacts need a couple and {gain} gain energy, by more than 3 sigma"
        elif name == "momentum_balance":
            parts = [f"{k} = {estimate(test[k]['value'], test[k]['std'])}" for k in ("a", "b") if test.get(k)]
            detail = f": {listed(parts)}" if parts else ""
        elif name == "homogeneity" and "speed_ratio" in test:
            detail = f", over speeds that differ by a factor of {number(test['speed_ratio'], 2)}"
        rows.append((TESTS[name], number(p, 2) if p >= 1e-4 else "< 0.0001", verdict + detail))
    columns = ("property of such laws", "p", "result")
    return table("Tests of the whole class of laws, before any effect is tried", columns, rows, numeric=(1,))


def parameters_table(critique: DropsCritique) -> Markup:
    """Return the table of each parameter without effects and with all effects."""
    fits = [critique.ladder[i][1] for i in ((0, -1) if len(critique.ladder) > 1 else (0,))]
    rows = []
    for full in dict.fromkeys(name for fit in fits for name in fit.model.parameters):
        effect, _, name = full.rpartition(".")
        ends = [sized(fit.content(full)) if full in fit.values else "–" for fit in fits]
        start = counted_from(effect, critique.training.rig.reference.content(critique.space), {})
        of = f"{effect_title(effect)}{start and f', {start}'}" if effect else "base law"
        rows.append((symbol(name), of, *ends))
    if len(fits) == 1:
        return table("Parameters [95 % interval]", ("parameter", "of", "value"), rows, numeric=(2,))
    columns = ("parameter", "of", "before", "with all effects")
    return table("Parameters before and after [95 % interval]", columns, rows, numeric=(2, 3))


def choices_table(found: pd.DataFrame | None) -> Markup:
    """Return the held-out error with each choice of the effects found and their closest rival; empty without any."""
    if found is None:
        return Markup()
    rows = [
        (
            " and ".join(effect_title(name) for name in str(r.effects).split(" + ")),
            *(law_title(str(r.law)), f"{number(r.error)} {interval(r.error_low, r.error_high)}"),
        )
        for r in found.itertuples()
    ]
    caption = "The model with each choice of the effects found and their closest rival, each refitted"
    return table(caption, ("effects", "law", "held-out error [95 %] (m/s)"), rows, numeric=(2,))


def comparison_table(tables: Mapping[str, pd.DataFrame], fits: Mapping[str, Fit]) -> Markup:
    """Return the table of held-out errors of laws, bounds and baseline; `fits` are the models, by name."""
    rows = []
    for r in tables["comparison"].itertuples():
        fit = fits.get(str(r.model))
        parameters = ["–" if fit is None else _short(fit.content(name)) for name in ("mu", "epsilon")]
        score = "–" if pd.isna(r.score) else number(r.score)
        share = "–" if pd.isna(r.share_in_range) else percent(r.share_in_range)
        errors = (number(r.mean), number(r.median), number(r.quantile_90))
        name = BOUND_WORDS.get(r.model) or law_title(r.model)
        rows.append((name, *parameters, *errors, score, str(int(r.n_failed)), share))
    columns = ("model", "μ", "ε", "mean", "median", "90 %", "score", "failed", "in range")
    caption = (
        "Held-out error (m/s), log score per impact (nats), failed solves, and share of the outcomes that the law "
        "reaches with some μ and ε, different for each impact; ± half the 95 % interval"
    )
    return table(caption, columns, rows, numeric=range(1, 9))


def _short(p: Mapping) -> str:
    """Return value ± half the 95 % interval, or ≥ or ≤ a bound."""
    if p["std"] is not None:
        return plus_minus(p["value"], p["std"])
    known = p["bound"] == "upper" or p["value"] > p["range"][0]
    return f"{'≥' if p['bound'] == 'lower' else '≤'} {number(p['value'], 2)}" if known else "not shown"


def left_out_table(d: Mapping) -> Markup:
    """Return the table of impacts left out, by reason."""
    reasons = sorted(d["left_out"]["reasons"].items(), key=lambda reason: -reason[1])
    counts = [*((reason_text(name), n) for name, n in reasons), ("used", d["n_impacts"])] if reasons else []
    total = sum(n for _, n in counts)
    rows = [(name, str(n), percent(n / total)) for name, n in counts]
    return table("Impacts detected, left out and used", ("reason", "impacts", "share"), rows, numeric=(1, 2))


def detectable_table(d: Mapping) -> Markup:
    """Return the smallest detectable size of each effect; below the table, effects not detectable at any size."""
    rows, unseen = [], []
    for e in d["detectable"]:
        declared, parts = _declared(e["name"]), []
        for name, size in e["smallest"].items():
            p = declared.get(name)
            if p is not None and p.discrete is not None:
                parts.append("would show" if size is not None else "would not show")
            elif size is not None:
                parts.append(f"{symbol(name)} = {amount(size, p.unit if p else '', 2)}")
        if not parts:
            unseen.append(effect_title(e["name"]))
            continue
        family = EFFECTS[e["name"]].family if e["name"] in EFFECTS else ""
        rows.append((effect_title(e["name"]), _family(family), "; ".join(parts), *_set_by(e)))
    columns = ("effect", "family", "smallest size", "set by", "drops for half of it")
    none = f"Not detectable at any size within their bounds: {'; '.join(unseen)}." if unseen else ""
    return table("Smallest effects that would have been found", columns, rows, numeric=(4,)) + paragraph(none)


def _set_by(entry: Mapping) -> tuple[str, str]:
    """Return the criterion that sets the smallest size, and the number of drops that would show half this size."""
    known = [name for name, size in entry["smallest"].items() if size is not None]
    by = ["evidence" if entry["significant"][n] > entry["material"][n] else "weight" for n in known]
    drops = entry["drops_for_half"]
    return "; ".join(dict.fromkeys(by)) or "–", "–" if drops is None else str(drops)


def states_table(following: Mapping) -> Markup:
    """Return the table of proposed states before impact."""
    what, which = "difference", "at which the two predictions differ most"
    if following.get("shows") == "misfit":
        what, which = "misfit", "around which the misfit is largest"
    states = following.get("states", [])
    names = {"vx": "v_x (m/s)", "vy": "v_y (m/s)", "omega": "ω (rad/s)", "theta": "θ (rad)", "x": "x (m)"}
    if not (states and "x" in states[0]):
        del names["x"]  # x matters only for some effects
    columns = ["state", *names.values()]
    rows = [[str(i), *(number(state[name]) for name in names)] for i, state in enumerate(states, 1)]
    if sigmas := following.get("sigmas"):
        columns.append(f"{what} (sigma)")
        rows = [[*row, number(sigma, 2)] for row, sigma in zip(rows, sigmas)]
    return table(f"States just before impact {which}", columns, rows, numeric=range(1, len(columns)))


CAPTION = (
    "Every model is fitted to the training trials and judged on the others: held-out error (m/s) with its 95 % "
    "interval, friction and restitution (at 1 m/s) with ± half the 95 % interval, duration of a central contact at "
    "1 m/s. An engine at its defaults is not fitted: it has the contact that it uses if none is specified. “Friction "
    "fitted”: the same with the friction that fits the training trials best"
)
OF_WHOLE_TOSSES = (
    ". Tosses: mean error over all frames of whole held-out tosses, of the position in % of the body's width and of "
    "the angle in degrees"
)


def models(found: pd.DataFrame | None) -> Markup:
    """Return the table with sentences on it; `found` is the result of `compare_models`, None if it was not run."""
    if found is None:
        return Markup()
    rows, follows = [], "position" in found
    for row in found.to_dict("records"):
        lacks = listed([effect_title(name) for name in str(row["lacks"]).split(" + ")]) if row["lacks"] else ""
        lasting = f"{1e3 * row['contact_time']:.3g} ms" if pd.notna(row["contact_time"]) else "–"
        pairs = [
            bounded_text(row, name, 3) if row[f"{name}_bound"] else plus_minus(row[name], row[f"{name}_std"])
            for name in ("mu", "epsilon")
        ]
        error = (number(row["error"]), interval(row["error_low"], row["error_high"]))
        tosses = missed_tosses(row) if follows else []
        rows.append((row_title(row), str(row["effects"]), *error, *tosses, *pairs, lasting, lacks or "–"))
    of_tosses = ("tosses: position", "angle") if follows else ()
    columns = ("model", "named effects", "error", "95 % interval", *of_tosses, "μ", "ε", "contact", "cannot have")
    caption = CAPTION + (OF_WHOLE_TOSSES if follows else "")
    return paragraph(*model_sentences(found)) + table(caption, columns, rows, numeric=(2, *range(4, len(columns) - 1)))
