"""Sentences of report.html on effects: those found, the remaining misfit, and the changes by adding them."""

# pandas' type stubs do not describe the contents of a row
# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false, reportOptionalMemberAccess=false

from collections.abc import Mapping, Sequence

import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.words import NAMED, alternatives_listed, feature_text
from thesis_lib.critique.likelihood.channels import CHANNELS
from thesis_lib.critique.proposal.effect_file import capital
from thesis_lib.critique.proposal.results import UNTESTABLE, sized
from thesis_lib.critique.results import effect_sentences as told
from thesis_lib.critique.results.clock_and_size import said
from thesis_lib.critique.results.numbers import MATERIAL, MOVED, compensated
from thesis_lib.critique.results.summary import above_noise, restitution_differs, struck_elsewhere, worst
from thesis_lib.critique.results.titles import effect_title, law_title, new_law, symbol
from thesis_lib.critique.selection.settings import search_ended
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import equation_in
from thesis_lib.mechanics.space import PLANE, SPACE
from thesis_lib.report.critique.tables import sizes
from thesis_lib.report.elements import amount, bullets, interval, paragraph, percent, table
from thesis_lib.statistics.wording import listed, number


def faults(d: Mapping) -> Markup:
    measured = [effect for effect in told.effects_found(d) if told.is_fault(effect) and not effect.get("stand_in")]
    sentences = [f"{_effect_sentence(effect, d)} {_doubt(effect)}".strip() for effect in measured]
    return paragraph(*sentences) + Markup().join(map(paragraph, told.faults(d)))


def effects(d: Mapping) -> Markup:
    more = paragraph(*map(told.rejected, d["rejected"]), *search_ended(d["search"], "critique.settings"))
    if not d["effects"]:
        return more + paragraph(
            "No candidate passes all tests: a gain of log score beyond the gain of the best of all candidates by "
            "chance, a gain on trials to which it was not fitted, a material fall of one error, and no rise of another."
        )
    return Markup().join(_effect(effect, d) for effect in d["effects"]) + more


def _effect(effect: Mapping, d: Mapping) -> Markup:
    title = capital(effect_title(effect["name"]))
    if not effect["clears"]:
        by_hand = f"{title} was switched on by you; {told.why_not(effect)}."
        return paragraph(by_hand, _effect_sentence(effect, d))
    if effect.get("stand_in"):
        return paragraph(told.stands_in(effect), _effect_sentence(effect, d), _shown_by(effect))
    if told.is_fault(effect):
        return paragraph(f"{title} is a fault of the measurement; see above.")
    end = told.at_its_end(effect) if told.is_at_end(effect) else ""
    return paragraph(_effect_sentence(effect, d), _doubt(effect), *said([effect]), _shown_by(effect), end)


def _shown_by(effect: Mapping) -> str:
    """Return a sentence on the channels in which the effect matters; empty if the velocity after impact is one."""
    channels = effect["material_in"]
    if not channels or "impact" in channels:
        return ""
    named = listed([CHANNELS[name].text for name in channels])
    return f"The evidence is the misfit of {named}, not the error of the velocity after impact."


def _effect_sentence(effect: Mapping, d: Mapping) -> str:
    name, gain = effect["name"], effect["gain"]
    space = SPACE if "dimensions" in d else PLANE
    equation = f" ({equation_in(EFFECTS[name], space)})" if name in EFFECTS else ""
    (low, high), size = gain["interval"], gain["held_out_log_score_per_impact"]
    change = f"lower by {number(size)} {interval(low, high)}"
    if size < 0:
        change = f"higher by {number(-size)} {interval(-high, -low)}"
    sentence = (
        f"{capital(effect_title(name))}{equation}: {listed(sizes(effect))}. Without it, after refitting, the "
        f"held-out log score is {change} nats per impact (p = {number(gain['p_value'], 2)} against the best of all "
        "candidates by chance)."
    )
    return f"{sentence} {told.unseen(effect)}".rstrip()


def _doubt(effect: Mapping) -> str:
    others = effect["indistinguishable_from"]
    if len(others) > NAMED:
        return f"These data cannot tell which effect it is: {_alternatives(others)} would explain as much."
    return f"These data cannot distinguish it from {_alternatives(others)}." if others else ""


def _alternatives(names: Sequence[str]) -> str:
    return alternatives_listed([effect_title(name) for name in names])


def remaining(critique: DropsCritique, d: Mapping) -> Markup:
    """Return text on the misfit after the last effect: structure, scatter beyond the noise, or nothing that matters."""
    rest, judged = d["remaining"], critique.ladder[-1][2]
    p, most = number(rest["p_value"], 2), number(critique.settings.excess_scatter, 2)
    elsewhere = [struck_elsewhere(rest["elsewhere"])] if rest.get("elsewhere") else []
    if not rest["structured"]:
        no_structure = f"The remaining residuals have no structure that matters (p = {p} by permutation)."
        return paragraph(*elsewhere, no_structure, *above_noise(d)) + _worst(d["error"])
    over_noise = {name: misfit for name, (misfit, _) in judged.over_noise().items()}
    sentences = elsewhere + [
        f"With all effects found, the held-out misfit of {CHANNELS[channel].text} is {number(over_noise[channel], 2)} "
        f"times the misfit from noise alone (well above {most} counts as unexplained)."
        for channel in rest["channels"]
    ]
    if critique.is_learnable or not rest["channels"]:
        sentences.append(f"Structure remains that no named effect explains (p = {p} by permutation).")
        if rest.get("error") is not None and rest.get("error_without_it") is not None:
            ends, floor = (rest["error"], rest["error_without_it"]), d["error"]["noise_floor"]
            change = critique.settings.change(*ends, floor, lambda error: amount(error, "m/s"))
            sentences.append(
                f"With a Gaussian process fitted to it, the error {change} on training trials to which the process was "
                "not fitted."
            )
        if rest["depends_on"]:
            sentences.append(f"It depends most on: {'; '.join(map(feature_text, rest['depends_on']))}.")
    elif rest["p_value"] <= critique.settings.alpha:
        sentences.append(f"A Gaussian process learns too little of it to matter (p = {p} by permutation).")
    else:
        sentences.append(
            f"A Gaussian process learns no part of it from the state (p = {p} by permutation): it is scatter whose "
            "cause is not part of the state before impact."
        )
    if rest["restitution"]:
        sentences.append(
            f"{restitution_differs(rest['restitution'])} With a separate ε for each impact, only noise is left."
        )
    if d["effects"]:
        sentences.append(
            "As long as something is unexplained, the effects above may stand in for its cause, and the errors of "
            "their sizes may exceed their intervals."
        )
    return paragraph(*sentences)


def _worst(error: Mapping) -> Markup:
    if not error["worst"]:
        return Markup()
    at = ["–" if r["t"] is None else number(r["t"], 4) for r in error["worst"]]
    rows = [(f"{r['trial']}", t, number(r["error"])) for r, t in zip(error["worst"], at)]
    return paragraph(*worst(error)) + table(
        "Largest held-out errors", ("trial", "t (s)", "error (m/s)"), rows, numeric=(1, 2)
    )


def ladder_text(critique: DropsCritique, d: Mapping, ladder: pd.DataFrame) -> Markup:
    if not d["effects"]:
        return paragraph("No effect was added, so there is only the error of the base law.")
    error, unit, flight = d["error"], d["error"]["unit"], d["error"]["flight"]
    steps = [
        f"{number(row.error)} {interval(row.error_low, row.error_high)} {unit} with {effect_title(row.label)}"
        + (f" (law now {law})" if (law := new_law(critique, i)) else "")
        for i, row in enumerate(ladder.iloc[1:].itertuples(), start=1)
    ]
    text = f"The held-out error is {amount(error['base'], unit)} without effects, and {listed(steps)}."
    share = error["explained_share"]
    if share is not None and share > 0.0:
        way = "all the way" if share >= 0.995 else f"{percent(share)} of the way"
        text += f" That is {way} to the noise floor of {amount(error['noise_floor'], unit)}."
    if flight:
        moves = critique.settings.change(flight["base"], flight["augmented"], 1.0)
        text += f" The misfit of the flights {moves} standard deviations of the noise, where 1 is noise alone."
    bound, put_right = error["irb_bound"], error["irb_bound_augmented"]
    if number(bound, 2) != number(put_right, 2):
        text += (
            f" The IRB bound is {amount(bound, unit)} with poses, geometry and inertia as believed, and "
            f"{amount(put_right, unit)} with these as corrected by the effects."
        )
    return paragraph(text)


def moved(critique: DropsCritique) -> Markup:
    if len(critique.ladder) < 2:
        return Markup()
    first, last = (law_title(critique.ladder[i][1].model.law.name) for i in (0, -1))
    if first != last:
        return paragraph(
            f"With the effects {last} fits better than {first} and is the law of the final model: without them, the "
            "other law compensated for part of the missing effects. μ and ε of different laws have different meanings "
            "and are not compared."
        )
    much, little = (_moves(compensated(critique, material)) for material in (True, False))
    sentences = []
    if much:
        sentences.append(f"Parameters that had compensated for missing effects change: {listed(much)}.")
    if little:
        move = "change" if len(little) > 1 else "changes"
        sentences.append(f"By a significant amount, but less than {percent(MATERIAL)}, {move} {listed(little)}.")
    within = f"μ and ε stay within {number(MOVED, 1)} standard errors of their values without effects"
    return paragraph(*(sentences or [f"{within}: they had not compensated for missing effects."]))


def _moves(rows: pd.DataFrame) -> list[str]:
    return [
        f"{symbol(row.parameter)} from {number(row.before, 4)} to {number(row.after, 4)} "
        f"({number(abs(row.sigmas), 2)} standard errors)"
        for row in rows.itertuples()
    ]


def untold(d: Mapping) -> Markup:
    same = "on these data they predict the same within the noise."
    content = bullets(
        f"{effect_title(e['name'])}, or {_alternatives(e['indistinguishable_from'])}: {same}"
        for e in d["effects"]
        if e["indistinguishable_from"] and e["clears"]
    )
    rows = [(effect_title(e["name"]), e["why"]) for e in d["not_testable"]]
    if not content and d["effects"] and all(e["clears"] for e in d["effects"]):
        content = paragraph(
            "Each effect that was found predicts these data better than any other effect of the library would in its "
            "place."
        )
    return content + table("Effects that these data cannot test", ("effect", "why"), rows)


def proposed(d: Mapping) -> Markup:
    """Return text on the proposed term, its evidence, and how to add it; empty if no term was looked for."""
    if "proposal" not in d:
        return Markup()
    found = d["proposal"]
    if found is None:
        of = "slip, approach, spin, lever, place on the body, place and number of the release"
        change = "restitution, friction, the direction of the impulse or add a couple"
        if any(one["name"] == UNTESTABLE for one in d["not_testable"]):
            of, change = "approach, place and number of the release", "restitution or friction"
        return paragraph(
            f"A search for additional terms, products of {of} that would change {change}, found none that passes the "
            "tests of an effect."
        )
    error, gain, file = found["error"], found["gain"], found["file"]
    rows = [
        (
            one["equation"],
            one["title"],
            sized(one).removeprefix("a ").removeprefix("= "),
            number(one["gain"]["p_value"], 2),
            percent(one["share_of_halves"]),
            listed(one["indistinguishable_from"]) if one["indistinguishable_from"] else "–",
        )
        for one in found["terms"]
    ]
    columns = ("law", "in words", "a", "p", "chosen in halves", "indistinguishable from")
    kept = [EFFECTS[name].title if name in EFFECTS else name for name in found["effects"]]
    beside = f", beside {listed(kept)}" if kept else ""
    return (
        paragraph(
            f"No named effect explains the remaining misfit. Of {found['tried']} terms offered to sparse regression, "
            "the following passes the test of an effect, in which the null counts all of them. "
            f"{law_title(found['law'])} is the law with it{beside}."
        )
        + table("Proposed", columns, rows, numeric=(2, 3, 4))
        + paragraph(
            f"The held-out error changes from {amount(error['before'], error['unit'])} to "
            f"{amount(error['after'], error['unit'])} (noise floor {amount(error['noise_floor'], error['unit'])}); the "
            f"held-out log score is higher by {number(gain['held_out_log_score_per_impact'])} "
            f"{interval(*gain['interval'])} nats per impact than with the named effects alone.",
            "This is the form of the missing effect in these data, not its cause: other laws may have a similar form.",
        )
        + paragraph(
            f"{file}, beside this folder, contains it as an effect. Read it, give it a name, and change its equation "
            f"if physics requires; thesis-lib effects --check {file} tests it, and thesis-lib critique "
            f"DATA --effects {file} adds it."
        )
    )
