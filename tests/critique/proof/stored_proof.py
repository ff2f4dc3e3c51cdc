"""Results of the proof as they are stored, made up, and what is counted of them."""

from pathlib import Path

import pandas as pd

from thesis_lib.simulate.rig.hidden_causes import CAUSES
from thesis_lib.studies.proof.cases import SEEDS, Case
from thesis_lib.studies.proof.compute import read_rows, sizes_of, table_of
from thesis_lib.studies.proof.results import confusion
from thesis_lib.studies.proof.store import Cells, numbers_in
from thesis_lib.studies.proof.summary import summary

FLOOR = 0.01  # m/s
OUTSIDE = next(name for name, cause in CAUSES.items() if not cause.effects)


def error(before: float = 3.0, after: float = 1.0, **channels: float) -> dict:
    """Errors as a result stores them: those of impacts over the floor, and other channels at their floor."""
    others = {f"{c}_{when}": 1.0 for c in ("flight", "touch") for when in ("base", "augmented")}
    return {"base": before * FLOOR, "augmented": after * FLOOR, "floor": FLOOR} | others | channels


def named(groups: list[list[str]]) -> str:
    return " + ".join(map("/".join, groups))


def row_of(case: Case, groups: list[list[str]] | None = None, **content) -> Cells:
    """A result; what is not given is that of effects named rightly, each in a group of its own."""
    groups = [[names[0]] for names in case.expected if names] if groups is None else groups
    fields = {"verdict": "effects" if groups else "adequate", "law": "mirtich", "n_impacts": 300, "remaining_p": 0.4}
    fields |= error() | {"named": named(groups), "sizes": sizes_of(case)} | content
    return table_of(case.source).cells(vars(case) | fields)


def put(folder: Path, case: Case, groups: list[list[str]] | None = None, **content) -> Cells:
    """Store a result, as `row_of` makes it."""
    table_of(case.source, folder).put(row_of(case, groups, **content))
    return read_rows(case.source, folder)[case]


def refuse(folder: Path, case: Case, why: str = "too few impacts") -> None:
    nothing = dict.fromkeys(error(), "") | {"remaining_p": "", "law": "", "sizes": ""}
    put(folder, case, [], verdict="refused", n_impacts=0, why=why, **nothing)


def cell(store: Path, source: str, truth: str) -> pd.Series:
    table = confusion(store)
    (row,) = [row for _, row in table.iterrows() if (row["source"], row["truth"]) == (source, truth)]
    return row


def figure_of(store: Path, figure: str, source: str) -> pd.Series:
    table = summary(store)
    (row,) = [row for _, row in table.iterrows() if (row["figure"], row["source"]) == (figure, source)]
    return row


def parameter(z: float, width: float = 1.1, name: str = "w") -> str:
    """A stored parameter whose distance from the truth is z standard errors."""
    return numbers_in({name: (2.0, 2.0 + 0.3 * z, 0.3, 0.3 / width)})


def many(folder: Path, source: str, truth: str, right: int, wrong: int, **size) -> None:
    for i in range(right + wrong):
        put(folder, Case(source, truth, SEEDS + i, **size), None if i < right else [])
