"""Results of the proof as they are stored, made up, and what is counted of them."""

import json
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from thesis_lib.critique.proof.cases import SEEDS, Case
from thesis_lib.critique.proof.summary import summary
from thesis_lib.critique.proof.table import confusion
from thesis_lib.simulate.rig.hidden_causes import CAUSES

FLOOR = 0.01  # m/s
OUTSIDE = next(name for name, cause in CAUSES.items() if not cause.effects)


def error(before: float = 3.0, after: float = 1.0, **channels: float | None) -> dict:
    """Errors as a result stores them: those of impacts over the floor, and other channels at their floor."""
    others = {f"{c}_{when}": 1.0 for c in ("flight", "touch") for when in ("base", "augmented")}
    return {"base": before * FLOOR, "augmented": after * FLOOR, "floor": FLOOR} | others | channels


def put(folder: Path, case: Case, **content) -> dict:
    """Store a result; what is not given is that of an effect named rightly."""
    steps = content.pop("steps", [[case.truth]])
    fields = {"verdict": "effects" if steps else "adequate", "law": "mirtich", "steps": steps, "right": False}
    fields |= {"parameters": {}, "n_impacts": 300, "error": error(), "remaining_p": 0.4}
    result = asdict(case) | fields | content
    path = folder / case.path
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(result))
    return result


def refuse(folder: Path, case: Case, why: str = "too few impacts") -> None:
    path = folder / case.path
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(asdict(case) | {"verdict": "refused", "why": why}))


def cell(store: Path, source: str, truth: str) -> pd.Series:
    table = confusion(store)
    (row,) = [row for _, row in table.iterrows() if (row["source"], row["truth"]) == (source, truth)]
    return row


def figure_of(store: Path, figure: str, source: str) -> pd.Series:
    table = summary(store)
    (row,) = [row for _, row in table.iterrows() if (row["figure"], row["source"]) == (figure, source)]
    return row


def parameter(z: float, width: float | None = 1.1) -> dict:
    """A stored parameter whose distance from the truth is z standard errors."""
    return {"true": 2.0, "found": 2.0 + 0.3 * z, "std": 0.3, "fisher": 0.3 / width if width else None}


def many(folder: Path, source: str, truth: str, right: int, wrong: int, **size) -> None:
    for i in range(right + wrong):
        put(
            folder,
            Case(source, truth, SEEDS + i, **size),
            right=i < right,
            steps=[[truth]] if i < right else [],
        )
