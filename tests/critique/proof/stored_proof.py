"""Results of the proof as they are stored, made up, and what is counted of them."""

from pathlib import Path

import pandas as pd

from thesis_lib.critique.proof.cases import SEEDS, Case
from thesis_lib.critique.proof.compute import Recovered, Row
from thesis_lib.critique.proof.results import confusion
from thesis_lib.critique.proof.store import put_row
from thesis_lib.critique.proof.summary import summary
from thesis_lib.simulate.rig.hidden_causes import CAUSES

FLOOR = 0.01  # m/s
OUTSIDE = next(name for name, cause in CAUSES.items() if not cause.effects)


def error(before: float = 3.0, after: float = 1.0, **channels: float) -> dict:
    """Errors as a result stores them: those of impacts over the floor, and other channels at their floor."""
    others = {f"{c}_{when}": 1.0 for c in ("flight", "touch") for when in ("base", "augmented")}
    return {"base": before * FLOOR, "augmented": after * FLOOR, "floor": FLOOR} | others | channels


def row_of(case: Case, groups: list[list[str]] | None = None, **content) -> Row:
    """A result; what is not given is that of effects named rightly, each in a group of its own."""
    groups = [[names[0]] for names in case.expected if names] if groups is None else groups
    fields = {"verdict": "effects" if groups else "adequate", "law": "mirtich", "n_impacts": 300}
    fields |= {"errors": error(), "remaining_p": 0.4, "groups": tuple(map(tuple, groups)), "sizes": case.sizes}
    return Row(case, **(fields | content))


def put(folder: Path, case: Case, groups: list[list[str]] | None = None, **content) -> Row:
    """Store a result, as `row_of` makes it."""
    row = row_of(case, groups, **content)
    put_row(row, folder)
    return row


def refuse(folder: Path, case: Case, why: str = "too few impacts") -> None:
    put_row(Row(case, "refused", why=why), folder)


def cell(store: Path, source: str, truth: str) -> pd.Series:
    table = confusion(store)
    (row,) = [row for _, row in table.iterrows() if (row["source"], row["truth"]) == (source, truth)]
    return row


def figure_of(store: Path, figure: str, source: str) -> pd.Series:
    table = summary(store)
    (row,) = [row for _, row in table.iterrows() if (row["figure"], row["source"]) == (figure, source)]
    return row


def parameter(z: float, width: float = 1.1) -> Recovered:
    """A stored parameter whose distance from the truth is z standard errors."""
    return Recovered(true=2.0, found=2.0 + 0.3 * z, std=0.3, fisher=0.3 / width)


def many(folder: Path, source: str, truth: str, right: int, wrong: int, **size) -> None:
    for i in range(right + wrong):
        put(folder, Case(source, truth, SEEDS + i, **size), None if i < right else [])
