"""Section of report.html on the term that is proposed where nothing fits."""

from collections.abc import Mapping

from markupsafe import Markup

from thesis_lib.critique.proposal.results import UNTESTABLE, sized
from thesis_lib.critique.results.titles import law_title
from thesis_lib.effects import EFFECTS
from thesis_lib.report.elements import amount, interval, paragraph, percent, table
from thesis_lib.statistics.wording import listed, number


def proposed(d: Mapping) -> Markup:
    """What is proposed, what it was measured against, and how to add it; nothing where no term was looked for."""
    if "proposal" not in d:
        return Markup()
    found = d["proposal"]
    if found is None:
        of = "slip, approach, spin, lever, place on the body, place and number of the release"
        change = "restitution, friction, the direction of the impulse or add a couple"
        if any(one["name"] == UNTESTABLE for one in d["not_testable"]):
            of, change = "approach, place and number of the release", "restitution or friction"
        return paragraph(
            f"Terms were looked for, products of {of}, that would change {change}. None passes the three tests of an "
            "effect."
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
    columns = ("law", "in words", "a", "p", "chosen in halves", "cannot be told from")
    kept = [EFFECTS[name].title if name in EFFECTS else name for name in found["effects"]]
    beside = f", beside {listed(kept)}" if kept else ""
    return (
        paragraph(
            f"No named effect explains what is left. Of {found['tried']} terms that sparse regression chose from, the "
            f"following passes the test of an effect, in which the null counts all of them. {law_title(found['law'])} "
            f"is the law with it{beside}."
        )
        + table("Proposed", columns, rows, numeric=(2, 3, 4))
        + paragraph(
            f"The held-out error goes from {amount(error['before'], error['unit'])} to "
            f"{amount(error['after'], error['unit'])} (noise floor {amount(error['noise_floor'], error['unit'])}); the "
            f"held-out log score is higher by {number(gain['held_out_log_score_per_impact'])} "
            f"{interval(*gain['interval'])} nats an impact than with all that the critique had named.",
            "It is the form of what is missing on these data, not its cause: other laws may have nearly that form.",
        )
        + paragraph(
            f"{file}, beside this folder, holds it as an effect. Read it, give it a name, and change its equation if "
            f"physics says so; python -m thesis_lib effects --check {file} tests it, and python -m thesis_lib critique "
            f"DATA --effects {file} adds it."
        )
    )
