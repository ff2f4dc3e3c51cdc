"""Two critiques side by side: verdicts, errors, and parameters with their difference in standard errors.

Each critique is shown with its own law and effects; if these differ, both are also shown with the same law and without
effects.  Errors have 95 % intervals; the standard error of their difference assumes that the two share no trials.

Only diagnosis.json is read, so that runs before and after a repair of the rig can be compared a year later.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_json
from thesis_lib.report.critique.folder import VERDICT_FILE, is_unfinished
from thesis_lib.statistics.intervals import Z95

FAR = 3.0  # standard errors beyond which a difference is pointed out
ALONE = " alone"  # marks rows of a law without effects in both runs
COLUMNS = ("quantity", "a", "a_low", "a_high", "b", "b_low", "b_high", "difference", "sigmas", "unit")


def is_run(path: str | Path) -> bool:
    """Whether a folder was written by a critique, even an interrupted one, and is not a dataset."""
    if any((Path(path) / name).exists() for name in ("dataset.yaml", "recording.yaml")):
        return False
    return (Path(path) / VERDICT_FILE).is_file() or is_unfinished(path)


def read_run(path: str | Path) -> dict:
    """Diagnosis in a critique's folder; UserError if the run was interrupted or the format differs."""
    again, file = "run thesis-lib critique again.", Path(path) / VERDICT_FILE
    if is_unfinished(path):
        raise UserError(f"{path} holds an unfinished run (it has no {VERDICT_FILE}); {again}")
    content = read_json(file)
    try:
        if content.get("schema") != 1 or not {"verdict", "base_model", "effects", "error"} <= set(content):
            raise ValueError("of another form")
        compare(content, content)  # fails if anything that is compared is missing
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        raise UserError(f"{file} is not a diagnosis of schema 1; {again}") from error
    return content


def compare(a: Mapping, b: Mapping) -> pd.DataFrame:
    """Comparison of two diagnoses, row by row; a quantity that only one of them has is empty for the other.

    The first rows compare each with its own law and effects.  If these differ, rows `<law> alone, …` follow for every
    law that either selected, without effects in both.  μ and ε mean different things in different laws, so their
    difference is given only within one law.  UserError if drops are compared with a mechanism.

    Returns:
        Table with columns quantity, a, b with the ends of their 95 % intervals, difference (b − a), sigmas (difference
        over its standard error), unit.
    """
    if (kinds := [content.get("mechanism", "drops") for content in (a, b)])[0] != kinds[1]:
        raise UserError(f"A critique of {kinds[0]} cannot be compared with one of {kinds[1]}.")
    same_law = _law(a, "augmented_model") == _law(b, "augmented_model")
    same_models = same_law and _law(a) == _law(b) and _effects(a) == _effects(b)
    rows = [
        _text("verdict", *(content["verdict"] or "none (too few impacts)" for content in (a, b))),
        _text("base law", _law(a), _law(b)),
        _text("law with the effects", _law(a, "augmented_model"), _law(b, "augmented_model")),
        _text("effects", _effects(a) or "none", _effects(b) or "none"),
    ]
    in_a, in_b = a["error"], b["error"]
    for key in ("base", "augmented", "noise_floor", "irb_bound", "irb_bound_augmented"):
        ends = in_a.get(f"{key}_interval"), in_b.get(f"{key}_interval")
        name = f"error, {key.replace('_', ' ')}"
        rows.append(_measured(name, in_a.get(key), in_b.get(key), in_a.get("unit", "m/s"), *ends))
    in_a, in_b = _own(a), _own(b)
    for name in dict.fromkeys([*in_a, *in_b]):
        comparable = same_law or name not in a["base_model"]["parameters"]
        rows.append(_parameter(name, in_a.get(name), in_b.get(name), comparable))
    if not same_models:
        for law in dict.fromkeys([_law(a), _law(b)]):
            rows += _alone(law, a, b)
    return pd.DataFrame(rows, columns=COLUMNS)


def comparison_text(table: pd.DataFrame, a: str, b: str) -> str:
    """Text of the table for a terminal, followed by sentences on the differences."""
    cells = [["", a, b, "difference", "in std errors"]]
    for row in table.to_dict("records"):
        unit = "" if row["unit"] in ("", "1") else f" ({row['unit']})"
        values = [*(_with_ends(row, run) for run in "ab"), _cell(row["difference"]), _cell(row["sigmas"], 2)]
        cells.append([row["quantity"] + unit, *values])
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in cells]
    said = table.set_index("quantity")
    law, then, effects = (tuple(said.loc[name, ["a", "b"]]) for name in ("base law", "law with the effects", "effects"))
    lines.append("")
    alone = table["quantity"].str.contains(ALONE, regex=False).any()
    which, pair = ("The base laws", law) if law[0] != law[1] else ("With the effects the laws", then)
    if pair[0] != pair[1]:
        rows = " and ".join(f"“{name}{ALONE}”" for name in dict.fromkeys(law))
        like = f"; the same law is compared in the rows {rows}" if alone else ""
        lines.append(
            f"{which} differ: {a} has {pair[0]}, {b} has {pair[1]}. μ and ε of different laws mean different "
            f"things{like}."
        )
    if effects[0] != effects[1]:
        same = f"; the rows “…{ALONE}” compare the same law without effects" if alone else ""
        lines.append(
            f"The effects differ: {a} has {effects[0]}, {b} has {effects[1]}. A parameter can change because an effect "
            f"was added or removed{same}."
        )
    sigmas = pd.to_numeric(table["sigmas"]).abs()
    far = table.loc[sigmas > FAR, "quantity"].tolist()
    if far:
        lines.append(f"Different by more than {FAR:g} standard errors: {'; '.join(far)}.")
    elif sigmas.notna().any():
        lines.append(f"No error and no common parameter differs by more than {FAR:g} standard errors.")
    else:
        lines.append("No error and no parameter can be compared.")
    return "\n".join(lines)


def _alone(law: str, a: Mapping, b: Mapping) -> list[dict]:
    """Rows of a law without effects in both runs; empty if a run contains only its selected law."""
    in_a, in_b = (content.get("laws", {}).get(law) for content in (a, b))
    if in_a is None or in_b is None:
        return []
    ends = in_a.get("interval"), in_b.get("interval")
    error = _measured(f"{law}{ALONE}, error", in_a["error"], in_b["error"], "m/s", *ends)
    parameters = in_a["parameters"].items()
    return [error, *(_parameter(f"{law}{ALONE}, {name}", p, in_b["parameters"].get(name)) for name, p in parameters)]


def _law(content: Mapping, key: str = "base_model") -> str:
    return (content.get(key) or content["base_model"])["name"]


def _effects(content: Mapping) -> str:
    return " + ".join(sorted(effect["name"] for effect in content["effects"]))


def _own(content: Mapping) -> dict[str, Mapping]:
    """Parameters of a run's final model."""
    model = content.get("augmented_model") or content["base_model"]
    parameters = dict(model["parameters"])
    for effect in content["effects"]:
        parameters |= {f"{effect['name']}.{name}": p for name, p in effect["parameters"].items()}
    return parameters


def _parameter(quantity: str, p: Mapping | None, q: Mapping | None, comparable: bool = True) -> dict:
    values = [fit["value"] if fit else None for fit in (p, q)]
    ends = [[fit["value"] + s * Z95 * fit["std"] for s in (-1, 1)] if fit and fit["std"] else None for fit in (p, q)]
    row = _measured(quantity, values[0], values[1], (p or q or {})["unit"], *ends)
    if bounds := {word: run for run, fit in zip("ab", (p, q)) if fit and (word := fit.get("bound"))}:
        row["quantity"] += f" ({' and '.join(f'{word} bound in {run}' for word, run in bounds.items())})"
        comparable = False
    return row if comparable else row | {"difference": None, "sigmas": None}


def _text(quantity: str, a: str, b: str) -> dict:
    return dict.fromkeys(COLUMNS) | {"quantity": quantity, "a": a, "b": b, "unit": ""}


def _measured(quantity: str, a: float | None, b: float | None, unit: str, *ends: Sequence[float] | None) -> dict:
    """Row of two numbers, with the `ends` of their 95 % intervals if known."""
    row: dict = dict.fromkeys(COLUMNS) | {"quantity": quantity, "a": a, "b": b, "unit": unit}
    for run, of_run in zip("ab", ends):
        if of_run and None not in of_run:
            row |= {f"{run}_low": of_run[0], f"{run}_high": of_run[1]}
    if a is None or b is None:
        return row
    row["difference"] = b - a
    # a value without an interval (an effect that is on or off) is taken as exact
    widths = [row[f"{run}_high"] - row[f"{run}_low"] for run in "ab" if row[f"{run}_low"] is not None]
    std = math.hypot(*widths) / (2.0 * Z95)
    row["sigmas"] = row["difference"] / std if std > 0 else None
    return row


def _with_ends(row: Mapping, run: str) -> str:
    low, high = _cell(row[f"{run}_low"]), _cell(row[f"{run}_high"])
    return _cell(row[run]) + (f" [{low}, {high}]" if "-" not in (low, high) else "")


def _cell(value: object, digits: int = 4) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return value if isinstance(value, str) else f"{value:.{digits}g}"
