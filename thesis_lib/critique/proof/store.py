"""The stored results of the proof: config/proof/<source>.csv, with a row per dataset.

Rows are sorted, and numbers have the shortest exact form, so that git shows what changed.

| column                            | unit | meaning                                                                   |
|-----------------------------------|------|---------------------------------------------------------------------------|
| truth, ratio, drops, noise, seed  |      | the dataset (`Case`)                                                      |
| shape, contact_time               | s    | its body, and how long a central contact lasts                            |
| sizes                             |      | `Case.sizes`, "name=size" joined by ";"; empty: unknown                   |
| verdict, law, n_impacts, why      |      | as in `Row`                                                               |
| named                             |      | groups of effects in the order of selection: "a/b + c"                    |
| base, augmented, floor            | m/s  | held-out error of the impacts before and after, and its noise floor       |
| flight_..., touch_...             | 1    | held-out misfit of flights and gaps, in units of noise; empty: none       |
| remaining_p                       | 1    | p-value of the remaining structure                                        |
| parameters                        |      | "name=true:found:std:fisher" of each, joined by ";"                       |
| code, made                        |      | `code_hash` of the code that made the row, empty: unknown; and the date   |
"""

import math
from collections.abc import Mapping
from pathlib import Path

from thesis_lib.critique.proof.cases import Case
from thesis_lib.critique.proof.compute import Recovered, Row
from thesis_lib.critique.proof.sizes import CONFIG
from thesis_lib.foundation.rows import Rows, as_cell

STORE = CONFIG / "proof"
VERDICTS = ("adequate", "effects", "unexplained", "refused")
ERRORS = ("base", "augmented", "floor", "flight_base", "flight_augmented", "touch_base", "touch_augmented")
KEY = ("truth", "ratio", "drops", "noise", "shape", "contact_time", "seed")
COLUMNS = (
    *("truth", "ratio", "drops", "noise", "seed", "shape", "contact_time", "sizes", "verdict", "law", "named"),
    *("n_impacts", *ERRORS, "remaining_p", "parameters", "why", "code", "made"),
)


def table_of(source: str, store: Path = STORE) -> Rows:
    """The table of a source."""
    return Rows(Path(store) / f"{source}.csv", COLUMNS, KEY, "python -m thesis_lib.critique.proof run")


def read_rows(source: str, store: Path = STORE) -> dict[Case, Row]:
    """The stored rows of a source, empty if there is no table.

    CorruptFileError if a row is unreadable or duplicate, or its truth unknown.
    """
    rows: dict[Case, Row] = {}

    def add(cells: dict[str, str]) -> None:
        row = _row(source, cells)
        if row.case in rows:
            raise ValueError("the dataset stands twice")
        rows[row.case] = row

    table_of(source, store).parsed(add)
    return rows


def put_row(row: Row, store: Path = STORE, *, replace: bool = False) -> None:
    """Add a row to the table of its source, or `replace` an existing one; parallel runs wait for each other."""
    table_of(row.case.source, store).put(cells_of(row), keep=not replace)


def cells_of(row: Row) -> Mapping[str, object]:
    """The row as it is stored."""
    parameters = (f"{name}={':'.join(map(as_cell, values))}" for name, values in sorted(row.parameters.items()))
    sizes = (f"{name}={as_cell(size)}" for name, size in row.sizes.items())
    return (
        {name: getattr(row.case, name) for name in KEY}
        | {name: getattr(row, name) for name in ("verdict", "law", "named", "n_impacts")}
        | {name: row.errors.get(name, math.nan) for name in ERRORS}
        | {name: getattr(row, name) for name in ("remaining_p", "why", "code", "made")}
        | {"sizes": ";".join(sizes), "parameters": ";".join(parameters)}
    )


def _number(text: str) -> float:
    return float(text) if text else math.nan


def _named(text: str) -> list[list[str]]:
    """Pairs of "name=value" joined by ";"; ValueError if one is not."""
    pairs = [part.split("=") for part in filter(None, text.split(";"))]
    if any(len(pair) != 2 for pair in pairs):
        raise ValueError(f"{text[:80]!r} is no list of name=value")
    return pairs


def _row(source: str, cells: dict[str, str]) -> Row:
    drops, seed = int(cells["drops"]), int(cells["seed"])
    size = float(cells["noise"]), float(cells["ratio"])
    contact = cells["shape"], float(cells["contact_time"])
    case = Case(source, cells["truth"], seed, drops, *size, *contact)
    _ = case.kind  # raises KeyError if the truth is unknown
    if cells["verdict"] not in VERDICTS:
        raise ValueError(f"no verdict is called {cells['verdict']!r}")
    parameters = {name: Recovered(*map(_number, values.split(":"))) for name, values in _named(cells["parameters"])}
    return Row(
        case,
        cells["verdict"],
        law=cells["law"],
        groups=tuple(tuple(group.split("/")) for group in cells["named"].split(" + ") if group),
        n_impacts=int(cells["n_impacts"]),
        errors={name: _number(cells[name]) for name in ERRORS},
        remaining_p=_number(cells["remaining_p"]),
        parameters=parameters,
        why=cells["why"],
        code=cells["code"],
        made=cells["made"],
        sizes={name: float(size) for name, size in _named(cells["sizes"])},
    )
