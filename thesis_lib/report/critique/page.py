"""report.html: one self-contained page with the results of the critique, in the order of a reader's questions.

Verdict, faults of the measurement, the four steps (compare, where it fails, which effect, what adding it changes), what
remains open and which experiment would decide it, what the data could have shown, tables, sources.  All sentences are
written from the numbers of diagnosis.json, where.json and the tables, so that the page claims no more than those files.
The page needs no network, its text no script, and equal content gives equal bytes.
"""

from collections.abc import Mapping

import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.results.effect_sentences import possible_faults
from thesis_lib.critique.results.findings import Findings
from thesis_lib.critique.results.numbers import ladder_table
from thesis_lib.figures.style import Drawn, png_of
from thesis_lib.foundation.terminal import visible
from thesis_lib.report.critique import effects, impacts, tables, text
from thesis_lib.report.critique.folder import Contents, critique_page
from thesis_lib.report.elements import amount, bullets, interval, paragraph, percent, picture


def contents(critique: DropsCritique, findings: Findings) -> Contents:
    """Pictures and page of a critique of drops."""
    from thesis_lib.figures.critique.pictures import pictures

    drawn = pictures(critique, findings.tables, findings.regions)
    images = {name: png_of(figure) for name, (figure, _) in drawn.items()}
    of_findings = (findings.diagnosis, findings.regions or {}, findings.tables)
    return Contents(report_html(critique, *of_findings, drawn, images), drawn, images)


def report_html(
    critique: DropsCritique,
    d: Mapping,
    where: Mapping,
    made: Mapping[str, pd.DataFrame],
    pictures: Mapping[str, Drawn],
    images: Mapping[str, bytes] | None = None,
) -> str:
    """The whole page, from the contents of diagnosis.json and where.json, tables by file stem, and pictures by name.

    `images`: pictures as PNG by name, where they have been made.  The parts for missing
    tables and pictures are left out.
    """
    captions = tables.captions(critique)
    images = images or {}
    drawn = {
        name: picture(figure, captions[name], images.get(name))
        for name, (figure, _) in pictures.items()
        if name in captions
    }
    ladder = ladder_table(critique, made)
    models = {**critique.discovery.bases, "augmented": critique.ladder[-1][1]}
    contents = {
        "First: the measurements themselves": ("faults", effects.faults(d)),
        "1. How far the laws are from the measurements": (
            *("compare", text.data(critique, d), drawn.get("data"), text.laws(critique, d, ladder), drawn.get("laws")),
            *(text.budget(made), drawn.get("budget")),
        ),
        "2. Where the base law fails": (
            *("where", text.where_it_fails(where), drawn.get("where"), impacts.explorer(critique, where)),
            *(
                tables.regions_table(where),
                drawn.get("residuals") and text.residuals(),
                drawn.get("residuals"),
                drawn.get("flights"),
            ),
            tables.tests_table(where),
        ),
        "3. Which effect is missing": (
            *("which", effects.effects(d), tables.effects_table(d), effects.remaining(critique, d)),
        ),
        "A term that is proposed": ("proposed", effects.proposed(d)),
        "4. What adding it does" if d["effects"] else "4. Nothing was added": (
            *("added", effects.ladder_text(critique, d, ladder), drawn.get("ladder"), effects.moved(critique)),
            *(drawn.get("parameters"), tables.parameters_table(critique)),
        ),
        "Which model is right": ("models", tables.models(made.get("models")), drawn.get("models")),
        "What could not be told, and what would tell": ("untold", effects.untold(d), text.following(d)),
        "What these data could have shown": ("power", text.power(d), tables.detectable_table(d)),
        "Tables": ("tables", tables.comparison_table(made, models), tables.left_out_table(d)),
        "Sources": ("sources", bullets(text.sources(d))),
    }
    clearing = [e for e in d["effects"] if e["clears"]]
    fault = any(e["family"] == "measurement" or possible_faults(e) for e in clearing)
    word = ""
    if d["verdict"] == "adequate" and len(clearing) < len(d["effects"]):
        word = "✓ adequate: the effects that you switched on are not needed"
    elif d["verdict"] == "unexplained" and not d["remaining"]["structured"]:
        word = "? unexplained: what would explain it contradicts what is known of the body"
    return critique_page(
        d,
        contents,
        "effect",
        word=word,
        kind="fault" if fault else "",
        about=_description(critique),
        key_numbers=_key_numbers(d, ladder),
        script=impacts.SCRIPT.read_text(encoding="utf-8"),
    )


def _description(critique: DropsCritique) -> Markup:
    words = "" if critique.source is None else (critique.source.header.description or "")
    return paragraph(f"What the dataset says of itself: {visible(words)}" if words.strip() else "", kind="about")


def _key_numbers(d: Mapping, ladder: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Name, value and note of each number at the head of the page."""
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
        return "an upper estimate, with all that bends the flights; the model errs less"
    return "what a perfect model would show"
