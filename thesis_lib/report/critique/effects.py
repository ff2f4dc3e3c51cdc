"""Sentences of report.html on the effects: which were found, what remains, and what adding them changes."""

# pandas' stubs do not know the contents of a row
# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false, reportOptionalMemberAccess=false

from collections.abc import Mapping

import numpy as np
import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.drops.criticise import Critique
from thesis_lib.critique.drops.words import CHANNEL_TEXT, NAMED, alternatives_listed, feature_text
from thesis_lib.critique.results.numbers import MATERIAL, MOVED, compensated, moved_little
from thesis_lib.critique.results.summary import possible_faults
from thesis_lib.critique.results.titles import effect_title, law_title, new_law, symbol
from thesis_lib.effects import EFFECTS
from thesis_lib.report.critique.tables import sizes
from thesis_lib.report.elements import amount, bullets, interval, paragraph, percent, table
from thesis_lib.statistics.wording import listed, number


def faults(d: Mapping) -> Markup:
    clear = [effect for effect in d["effects"] if effect["clears"]]
    measured = [effect for effect in clear if effect["family"] == "measurement"]
    doubtful = [effect for effect in clear if possible_faults(effect)]
    maybe = Markup().join(
        paragraph(
            f"What is told below as “{effect_title(effect['name'])}” may be a fault of the measurement: these data "
            f"cannot tell it from “{alternatives_listed([effect_title(n) for n in possible_faults(effect)])}”. Rule "
            "that out first."
        )
        for effect in doubtful
    )
    if not measured:
        return maybe
    sentences = [f"{_effect_sentence(effect)} {_doubt(effect)}".strip() for effect in measured]
    physics = any(
        name in EFFECTS and EFFECTS[name].family != "measurement"
        for effect in measured
        for name in effect["indistinguishable_from"]
    )
    which = "This may be" if physics else "This is"
    advice = (
        f"{which} a fault of camera, clock or calibration, not physics of the contact. Repair it and run the critique "
        "again; until then all parameters below hold only with the fault modelled."
    )
    return paragraph(*sentences) + paragraph(advice) + maybe


def effects(d: Mapping) -> Markup:
    if not d["effects"]:
        return paragraph(
            "No candidate passes all three tests: a gain of log score beyond what the best of all candidates gains by "
            "chance, a gain on trials it was not fitted to, and a fall of the error that matters."
        )
    return Markup().join(
        paragraph(_by_hand(effect), _effect_sentence(effect))
        if not effect["clears"]
        else paragraph(f"{capital(effect_title(effect['name']))} is a fault of the measurement; see above.")
        if effect["family"] == "measurement"
        else paragraph(_effect_sentence(effect), _doubt(effect), _shown_by(effect))
        for effect in d["effects"]
    )


def _by_hand(effect: Mapping) -> str:
    return f"{capital(effect_title(effect['name']))} was switched on by you; these data do not ask for it."


def _shown_by(effect: Mapping) -> str:
    """Channels in which the effect matters, unless it is the velocity after impact."""
    channels = effect["material_in"]
    if not channels or "impact" in channels:
        return ""
    return (
        f"What shows it is the misfit of {listed([CHANNEL_TEXT[name] for name in channels])}, not the error of the "
        "velocity after impact."
    )


def _effect_sentence(effect: Mapping) -> str:
    gain = effect["gain"]
    title = capital(effect_title(effect["name"]))
    equation = f" ({EFFECTS[effect['name']].equation})" if effect["name"] in EFFECTS else ""
    low, high = gain["interval"]
    size = gain["held_out_log_score_per_impact"]
    ends = interval(low, high) if size >= 0 else interval(-high, -low)
    change = f"is {'lower' if size >= 0 else 'higher'} by {number(abs(size))} {ends}"
    return (
        f"{title}{equation}: {listed(sizes(effect))}. Without it, and all else refitted, the held-out "
        f"log score {change} nats an impact "
        f"(p = {number(gain['p_value'], 2)} against the best of all candidates by chance)."
    )


def _doubt(effect: Mapping) -> str:
    others = effect["indistinguishable_from"]
    if not others:
        return ""
    named = alternatives_listed([effect_title(name) for name in others])
    if len(others) > NAMED:
        return f"These data cannot tell which it is: {named} would explain as much."
    return f"These data cannot tell it from {named}."


def remaining(critique: Critique, d: Mapping) -> Markup:
    """What remains after the last effect: structure, scatter beyond the noise, or nothing that matters."""
    rest = d["remaining"]
    p = number(rest["p_value"], 2)
    if not rest["structured"]:
        return paragraph(
            f"What is left in the residuals shows no structure that matters (p = {p} by permutation)."
        ) + _worst(d["error"])
    sentences = []
    judged = critique.ladder[-1][2]
    for channel in rest["channels"]:
        times = judged.excess if channel == "impact" else np.sqrt(judged.sigmas[channel])
        sentences.append(
            f"With all that was found the held-out misfit of {CHANNEL_TEXT[channel]} is {number(times, 2)} times what "
            f"noise alone would give (far more than {number(critique.settings.excess_scatter, 2)} counts as "
            "unexplained)."
        )
    if rest["p_value"] <= critique.settings.alpha or not rest["channels"]:
        sentences.append(f"Structure remains that no named effect explains (p = {p} by permutation).")
        if rest.get("error") is not None and rest.get("error_without_it") is not None:
            sentences.append(
                f"A Gaussian process learns part of it: the error falls from {amount(rest['error'], 'm/s')} to "
                f"{amount(rest['error_without_it'], 'm/s')} on training trials it was not fitted to."
            )
        names = [feature_text(name) for name in rest["depends_on"]]
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


def _worst(error: Mapping) -> Markup:
    if not error["worst"]:
        return Markup()
    rows = [
        (f"{r['trial']}", number(r["t"], 4) if r["t"] is not None else "–", number(r["error"])) for r in error["worst"]
    ]
    times = number(error["augmented"] / error["noise_floor"], 2)
    return paragraph(
        f"But the mean held-out error is {times} times the noise floor, while half of the impacts lie near it: single "
        "impacts go wrong. Look at the samples around the worst of them."
    ) + table("Largest held-out errors", ("trial", "t (s)", "error (m/s)"), rows, numeric=(1, 2))


def ladder_text(critique: Critique, d: Mapping, ladder: pd.DataFrame) -> Markup:
    error, unit = d["error"], d["error"]["unit"]
    if not d["effects"]:
        return paragraph("No effect was added, so the ladder has a single rung.")
    steps = [
        f"{number(row.error)} {interval(row.error_low, row.error_high)} {unit} with {effect_title(row.label)}"
        + (f" (law now {law})" if (law := new_law(critique, i)) else "")
        for i, row in enumerate(ladder.iloc[1:].itertuples(), start=1)
    ]
    text = f"The held-out error goes from {amount(error['base'], unit)} to {listed(steps)}."
    share = error["explained_share"]
    if share is not None and share > 0.0:
        text += f" That is {way(share)} to the noise floor of {amount(error['noise_floor'], unit)}."
    flight = error["flight"]
    if flight:
        before, after = number(flight["base"]), number(flight["augmented"])
        moves = f"stays at {after}" if before == after else f"goes from {before} to {after}"
        text += f" The misfit of the flights {moves} standard deviations of the noise, where 1 is noise alone."
    bound, put_right = error["irb_bound"], error["irb_bound_augmented"]
    if number(bound, 2) != number(put_right, 2):
        text += (
            f" The IRB bound is {amount(bound, unit)} with poses, geometry and inertia as believed, and "
            f"{amount(put_right, unit)} as the effects have them."
        )
    return paragraph(text)


def way(share: float) -> str:
    """How far the error came from the base law towards the noise floor."""
    return "all the way" if share >= 0.995 else f"{percent(share)} of the way"


def moved(critique: Critique) -> Markup:
    if len(critique.ladder) < 2:
        return Markup()
    first, last = (law_title(critique.ladder[i][1].model.law.name) for i in (0, -1))
    if first != last:
        return paragraph(
            f"With the effects {last} fits better than {first}, so it is the law of the final model: without them the "
            "other law stood in for what was missing. μ and ε of different laws mean different things and are not "
            "compared."
        )
    much, little = (
        [
            f"{symbol(row.parameter)} from {number(row.before, 4)} to {number(row.after, 4)} "
            f"({number(abs(row.sigmas), 2)} standard errors)"
            for row in rows.itertuples()
        ]
        for rows in (compensated(critique), moved_little(critique))
    )
    if not much and not little:
        return paragraph(
            f"μ and ε stay within {number(MOVED, 1)} standard errors of what they were: they had not compensated for "
            "what was missing."
        )
    sentences = []
    if much:
        sentences.append(f"Parameters that had compensated for what was missing move: {listed(much)}.")
    if little:
        sentences.append(
            f"Surely, but by less than {percent(MATERIAL)}, which hardly matters, "
            f"{'move' if len(little) > 1 else 'moves'} {listed(little)}."
        )
    return paragraph(*sentences)


def untold(d: Mapping) -> Markup:
    groups = [
        f"{effect_title(e['name'])}, or "
        f"{alternatives_listed([effect_title(n) for n in e['indistinguishable_from']])}: on these data they predict "
        "the same within the noise."
        for e in d["effects"]
        if e["indistinguishable_from"] and e["clears"]
    ]
    untested = table(
        "Effects that these data cannot test",
        ("effect", "why"),
        [(effect_title(e["name"]), e["why"]) for e in d["not_testable"]],
    )
    content = Markup()
    if groups:
        content = bullets(groups)
    elif d["effects"] and all(e["clears"] for e in d["effects"]):
        content = paragraph(
            "Each effect that was found predicts these data better than any other in the library could in its place."
        )
    return content + untested


def capital(text: str) -> str:
    return text[:1].upper() + text[1:]
