"""report.html: one self-contained page with the results of the critique, in the order of a reader's questions.

Verdict, faults of the measurement, the four steps (compare, where it fails, which effect, what adding it changes), what
remains open and which experiment would decide it, what the data could have shown, tables, sources.  All sentences are
written from the numbers of diagnosis.json, where.json and the tables, so that the page claims no more than those files.
The page needs no network, its text no script, and equal content gives equal bytes.
"""

from collections.abc import Mapping

import pandas as pd
from markupsafe import Markup

from thesis_lib.critique.drops.criticise import Critique
from thesis_lib.critique.results.numbers import ladder_table
from thesis_lib.critique.results.summary import possible_faults
from thesis_lib.figures.style import Drawn
from thesis_lib.foundation.terminal import visible
from thesis_lib.report.critique import effects as report_effects
from thesis_lib.report.critique import impacts as report_impacts
from thesis_lib.report.critique import text as report_text
from thesis_lib.report.critique.skeleton import critique_page
from thesis_lib.report.critique.tables import (
    captions,
    comparison_table,
    detectable_table,
    effects_table,
    left_out_table,
    parameters_table,
    regions_table,
    tests_table,
)
from thesis_lib.report.elements import amount, bullets, interval, paragraph, percent, picture

WORDS = {
    "adequate": "✓ adequate: no effect is missing that these data could show",
    "effects": "+ effects found: named effects explain what was missing",
    "unexplained": "? unexplained: structure remains that no named effect explains",
}
BY_HAND = "✓ adequate: the effects that you switched on are not needed"


def report_html(
    critique: Critique,
    diagnosis: Mapping,
    where: Mapping,
    tables: Mapping[str, pd.DataFrame],
    pictures: Mapping[str, Drawn],
) -> str:
    """The whole page.

    `diagnosis` and `where` are the contents of the JSON files; `tables` are given by file stem, and the part of the
    page for a missing table is left out; `pictures` holds figure and numbers by name.
    """
    text = captions(critique)
    shown = {name: picture(figure, text[name]) for name, (figure, _) in pictures.items() if name in text}

    def draw(name: str) -> Markup:
        return shown.get(name, Markup())

    d = diagnosis
    ladder = ladder_table(critique, tables)
    sections = [
        ("faults", "First: the measurements themselves", [report_effects.faults(d)]),
        (
            "compare",
            "1. How far the laws are from the measurements",
            [
                report_text.data(critique, d),
                draw("data"),
                report_text.laws(critique, d, tables, ladder),
                draw("laws"),
                report_text.budget(tables),
                draw("budget"),
            ],
        ),
        (
            "where",
            "2. Where the base law fails",
            [
                report_text.where_it_fails(where),
                draw("where"),
                report_impacts.explorer(critique, where),
                regions_table(where),
                report_text.residuals(critique),
                draw("residuals"),
                draw("flights"),
                tests_table(where),
            ],
        ),
        (
            "which",
            "3. Which effect is missing",
            [report_effects.effects(d), effects_table(d), report_effects.remaining(critique, d)],
        ),
        (
            "added",
            "4. What adding it does" if d["effects"] else "4. Nothing was added",
            [
                report_effects.ladder_text(critique, d, ladder),
                draw("ladder"),
                report_effects.moved(critique),
                draw("parameters"),
                parameters_table(critique),
            ],
        ),
        ("untold", "What could not be told, and what would tell", [report_effects.untold(d), report_text.following(d)]),
        ("power", "What these data could have shown", [report_text.power(d), detectable_table(d)]),
        ("tables", "Tables", [comparison_table(tables), left_out_table(d)]),
        ("sources", "Sources", [bullets(report_text.sources(d))]),
    ]
    fault = any(e["clears"] and (e["family"] == "measurement" or possible_faults(e)) for e in d["effects"])
    by_hand = any(not e["clears"] for e in d["effects"])
    return critique_page(
        d,
        sections,
        BY_HAND if by_hand and d["verdict"] == "adequate" else WORDS[d["verdict"]],
        kind="fault" if fault else "",
        about=_description(critique),
        key_numbers=_key_numbers(d, ladder),
        script=report_impacts.SCRIPT.read_text(encoding="utf-8"),
    )


def _description(critique: Critique) -> Markup:
    text = "" if critique.source is None else (critique.source.header.description or "")
    return paragraph(f"What the dataset says of itself: {visible(text)}" if text.strip() else "", kind="about")


def _key_numbers(d: Mapping, ladder: pd.DataFrame) -> list[tuple[str, str, str]]:
    error, first, last = d["error"], ladder.iloc[0], ladder.iloc[-1]
    unit = error["unit"]
    cells = [
        ("impacts used", f"{d['n_impacts']}", f"{d['n_trials']} trials, {percent(d['left_out']['share'])} left out"),
        (
            "error of the base law",
            amount(error["base"], unit),
            f"held-out, {interval(first['error_low'], first['error_high'])}",
        ),
    ]
    if d["effects"]:
        ends = f"held-out, {interval(last['error_low'], last['error_high'])}"
        cells.append(("error with the effects", amount(error["augmented"], unit), ends))
    cells.append(("noise floor", amount(error["noise_floor"], unit), "what a perfect model would show"))
    if error["explained_share"] is not None and any(e["clears"] for e in d["effects"]):
        cells.append(
            ("explained", percent(min(error["explained_share"], 1.0)), "of the way from base law to noise floor")
        )
    return cells
