"""Which model, and why: sentences from the table of `compare_models`."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from thesis_lib.critique.contacts.engine_contact import DEFAULT, STAND_INS, engine_law
from thesis_lib.critique.engines.compare import WITH, WITHOUT, spread
from thesis_lib.critique.results.titles import effect_title, law_title
from thesis_lib.statistics.wording import listed, number

ALIKE = 1.1  # ratio of friction coefficients up to which engines agree
FITTED = ("law", "engine")


def model_title(name: str) -> str:
    """Title of a law or an engine."""
    return engine_law(name).title if name.removesuffix(DEFAULT) in STAND_INS else law_title(name)


def row_title(row: Mapping) -> str:
    """Title of a row of the table."""
    return model_title(str(row["model"])) + (", friction fitted" if row["kind"] == "friction" else "")


def bounded_text(row: Mapping, name: str, digits: int) -> str:
    """μ or ε of a row to some decimals, with ≥ or ≤ before a bound."""
    return {"lower": "≥ ", "upper": "≤ "}.get(row[f"{name}_bound"], "") + f"{row[name]:.{digits}f}"


def model_sentences(table: pd.DataFrame) -> list[str]:
    """Which model errs least; how engines agree on friction; what an engine cannot have."""
    label = WITH if (table["effects"] == WITH).any() else WITHOUT
    last = table[(table["effects"] == label) & table["kind"].isin(FITTED)]
    best = last.iloc[0]
    alike = [model_title(row["model"]) for row in last.iloc[1:].to_dict("records") if row["behind_low"] <= 0.0]
    named = " with the named effects" if label == WITH else ""
    first = f"{model_title(best['model'])} errs least{named}: {number(best['error'])} m/s"
    if np.isfinite(best["noise_floor"]):
        first += f" (noise floor {number(best['noise_floor'])} m/s)"
    if len(last) > 1:
        first += f"; {listed(alike)} cannot be told from it" if alike else "; all others err more"
    first += "."
    sentences = [first]
    before, after = spread(table, WITHOUT), spread(table, WITH)
    if np.isfinite(before):
        second = f"The engines' friction coefficients differ by a factor of {before:.3g}"
        if np.isfinite(after):
            second += f" without the named effects, and of {after:.3g} with them"
            if before > ALIKE >= after:
                second += ": they made up for what was missing"
        sentences.append(f"{second}.")
    if np.isfinite(plain := spread(table, WITHOUT, "friction")):
        rows = table[(table["kind"] == "friction") & (table["effects"] == WITHOUT)].to_dict("records")
        each = listed([f"{row['mu']:.2g} in {model_title(row['model'].removesuffix(DEFAULT))}" for row in rows])
        sentences.append(
            f"With the contact that each has by default, and friction alone fitted, they differ by a factor of "
            f"{plain:.2g}: {each}."
        )
    for row in table[(table["effects"] == label) & (table["kind"] == "default")].to_dict("records"):
        ratio = row["error"] / float(last[last["model"] == row["model"].removesuffix(DEFAULT)]["error"].iloc[0])
        sentences.append(
            f"{model_title(row['model'])} errs by {number(row['error'])} m/s, {ratio:.2g} times as much as fitted."
        )
    for row in last[last["lacks"] != ""].to_dict("records"):
        effects = listed([effect_title(name) for name in row["lacks"].split(" + ")])
        sentences.append(f"{model_title(row['model'])} cannot have {effects}, and is fitted without.")
    return sentences
