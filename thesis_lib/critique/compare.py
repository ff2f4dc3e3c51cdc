"""Two critiques side by side: verdicts, errors, and parameters with their difference in standard errors.

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
    """Rows (quantity, a, b, difference, sigmas, unit); what only one of the two has is empty in the other."""
    rows = [
        _text("verdict", a["verdict"], b["verdict"]),
        _text("base law", a["base_model"]["name"], b["base_model"]["name"]),
        _text("effects", *(" + ".join(e["name"] for e in one["effects"]) or "none" for one in (a, b))),
    ]
    for key in ("base", "augmented", "noise_floor", "irb_bound"):
        rows.append(
            _number(f"error, {key.replace('_', ' ')}", a["error"].get(key), b["error"].get(key), "m/s")
        )
    one, two = _parameters(a), _parameters(b)
    for name in dict.fromkeys([*one, *two]):
        p, q = one.get(name), two.get(name)
        row = _number(name, p and p["value"], q and q["value"], (p or q)["unit"])
        if p and q:
            std = math.hypot(p["std"] or 0.0, q["std"] or 0.0)
            row["sigmas"] = row["difference"] / std if std > 0 else None
        rows.append(row)
    return pd.DataFrame(rows, columns=COLUMNS)


def comparison_text(table: pd.DataFrame, a: str, b: str) -> str:
    """The table for a terminal, with what differs pointed out."""
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
    sigmas = pd.to_numeric(table["sigmas"]).abs()
    far = table.loc[sigmas > FAR, "quantity"].tolist()
    same_law = table.loc[table["quantity"] == "base law"].eval("a == b").all()
    if not same_law:
        lines.append("The base laws differ: μ and ε of different laws mean different things.")
    if far:
        lines.append(f"Different by more than {FAR:g} standard errors: {', '.join(far)}.")
    else:
        lines.append(f"No parameter differs by more than {FAR:g} standard errors.")
    return "\n".join(lines)


def _parameters(content: Mapping) -> dict[str, Mapping]:
    model = content.get("augmented_model") or content["base_model"]
    found = dict(model["parameters"])
    for effect in content["effects"]:
        found |= {f"{effect['name']}.{name}": p for name, p in effect["parameters"].items()}
    return found


def _text(quantity: str, a: str, b: str) -> dict:
    return {"quantity": quantity, "a": a, "b": b, "difference": None, "sigmas": None, "unit": ""}


def _number(quantity: str, a: float | None, b: float | None, unit: str) -> dict:
    difference = None if a is None or b is None else b - a
    return {"quantity": quantity, "a": a, "b": b, "difference": difference, "sigmas": None, "unit": unit}


def _cell(value: object, digits: int = 4) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    return value if isinstance(value, str) else f"{value:.{digits}g}"
