"""Two critiques side by side: verdicts, errors, and parameters with their difference in standard errors.

Each is shown with the law and the effects that it chose; where these differ, also both with the same law and none.

Read from diagnosis.json, so that a run of last year can be compared with today's, before and after a repair of the rig.
"""

import math
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from thesis_lib.critique.output import VERDICT_FILE
from thesis_lib.errors import UserError
from thesis_lib.files import read_json

FAR = 3.0  # standard errors beyond which a difference is pointed out
ALONE = " alone"  # marks rows of one law without effects, in both runs
OLD_RUN = (
    "one of the runs was written by an older version; run python -m thesis_lib critique on its dataset again."
)
COLUMNS = ("quantity", "a", "b", "difference", "sigmas", "unit")


def is_run(path: str | Path) -> bool:
    """Whether a folder is what a critique wrote, rather than a dataset."""
    return (Path(path) / VERDICT_FILE).is_file() and not (Path(path) / "dataset.yaml").exists()


def read_run(path: str | Path) -> dict:
    """The diagnosis in a folder that a critique wrote.

    Raises:
        UserError: it is no diagnosis of this format.
    """
    content = read_json(Path(path) / VERDICT_FILE)
    needed = {"verdict", "base_model", "effects", "error"}
    if content.get("schema") != 1 or not needed <= set(content):
        raise UserError(
            f"{Path(path) / VERDICT_FILE} is no diagnosis of schema 1; run python -m thesis_lib critique again."
        )
    return content


def compare(a: Mapping, b: Mapping) -> pd.DataFrame:
    """Two diagnoses, row by row; what only one of the two has is empty in the other.

    First each with its own law and effects.  Where the two models differ in law or effects, every law that either of
    them chose follows without effects, in both: `<law> alone, …`.  μ and ε of different laws mean different things, so
    their difference is told in standard errors only within one law.

    Returns:
        Columns quantity, a, b, difference (b − a), sigmas (difference over its standard error), unit.
    """
    same_law = _law(a) == _law(b)
    rows = [
        _text("verdict", a["verdict"], b["verdict"]),
        _text("base law", _law(a), _law(b)),
        _text("effects", _effects(a) or "none", _effects(b) or "none"),
    ]
    for key in ("base", "augmented", "noise_floor", "irb_bound", "irb_bound_augmented"):
        rows.append(
            _number(f"error, {key.replace('_', ' ')}", a["error"].get(key), b["error"].get(key), "m/s")
        )
    one, two = _own(a), _own(b)
    for name in dict.fromkeys([*one, *two]):
        comparable = same_law or name not in a["base_model"]["parameters"]
        rows.append(_parameter(name, one.get(name), two.get(name), comparable))
    if not same_law or _effects(a) != _effects(b):
        for law in dict.fromkeys([_law(a), _law(b)]):
            rows += _alone(law, a, b)
    return pd.DataFrame(rows, columns=COLUMNS)


def comparison_text(table: pd.DataFrame, a: str, b: str) -> str:
    """The table for a terminal, with what differs pointed out in plain words."""
    cells = [["", a, b, "difference", "in std errors"]]
    for row in table.to_dict("records"):
        unit = "" if row["unit"] in ("", "1") else f" ({row['unit']})"
        cells.append(
            [
                row["quantity"] + unit,
                _cell(row["a"]),
                _cell(row["b"]),
                _cell(row["difference"]),
                _cell(row["sigmas"], 2),
            ]
        )
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in cells]
    said = table.set_index("quantity")
    law, effects = (tuple(said.loc[name, ["a", "b"]]) for name in ("base law", "effects"))
    lines.append("")
    if law[0] != law[1]:
        lines.append(
            f"The base laws differ: {a} has {law[0]}, {b} has {law[1]}. μ and ε of different laws mean different "
            f"things; like is compared with like in the rows “{law[0]}{ALONE}” and “{law[1]}{ALONE}”."
        )
    if effects[0] != effects[1]:
        lines.append(
            f"The effects differ: {a} has {effects[0]}, {b} has {effects[1]}. A parameter can move because an effect "
            f"came or went; the rows “…{ALONE}” hold the same law without effects in both."
        )
    alone = table["quantity"].str.contains(ALONE, regex=False)
    if (law[0] != law[1] or effects[0] != effects[1]) and not alone.any():
        lines.append(f"Those rows are missing: {OLD_RUN}")
    sigmas = pd.to_numeric(table["sigmas"]).abs()
    far = table.loc[sigmas > FAR, "quantity"].tolist()
    if far:
        lines.append(f"Different by more than {FAR:g} standard errors: {'; '.join(far)}.")
    elif sigmas.notna().any():
        lines.append(f"No parameter that both have differs by more than {FAR:g} standard errors.")
    else:
        lines.append("No parameter can be compared.")
    return "\n".join(lines)


def _alone(law: str, a: Mapping, b: Mapping) -> list[dict]:
    """Rows of one law without effects in both; none where a run holds no law but its own."""
    one, two = (content.get("laws", {}).get(law) for content in (a, b))
    if one is None or two is None:
        return []
    rows = [_number(f"{law}{ALONE}, error", one["error"], two["error"], "m/s")]
    for name, p in one["parameters"].items():
        rows.append(_parameter(f"{law}{ALONE}, {name}", p, two["parameters"].get(name)))
    return rows


def _law(content: Mapping) -> str:
    return content["base_model"]["name"]


def _effects(content: Mapping) -> str:
    return " + ".join(sorted(effect["name"] for effect in content["effects"]))


def _own(content: Mapping) -> dict[str, Mapping]:
    """Parameters of a run's final model."""
    model = content.get("augmented_model") or content["base_model"]
    found = dict(model["parameters"])
    for effect in content["effects"]:
        found |= {f"{effect['name']}.{name}": p for name, p in effect["parameters"].items()}
    return found


def _parameter(quantity: str, p: Mapping | None, q: Mapping | None, comparable: bool = True) -> dict:
    row = _number(quantity, p and p["value"], q and q["value"], (p or q)["unit"])
    if p and q and comparable:
        std = math.hypot(p["std"] or 0.0, q["std"] or 0.0)
        row["sigmas"] = row["difference"] / std if std > 0 else None
    return row if comparable else row | {"difference": None}


def _text(quantity: str, a: str, b: str) -> dict:
    return {"quantity": quantity, "a": a, "b": b, "difference": None, "sigmas": None, "unit": ""}


def _number(quantity: str, a: float | None, b: float | None, unit: str) -> dict:
    difference = None if a is None or b is None else b - a
    return {"quantity": quantity, "a": a, "b": b, "difference": difference, "sigmas": None, "unit": unit}


def _cell(value: object, digits: int = 4) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return value if isinstance(value, str) else f"{value:.{digits}g}"
