"""The rows of config/proof/<source>.csv: results of the critique for each dataset of drops.

| column                            | unit | meaning                                                                   |
|-----------------------------------|------|---------------------------------------------------------------------------|
| truth, ratio, drops, noise, seed  |      | the dataset (`Case`)                                                      |
| shape, contact_time               | s    | its body, and how long a central contact lasts                            |
| sizes                             |      | `Case.sizes`, numbers by name; empty: unknown                             |
| verdict, law, n_impacts           |      | adequate, effects, unexplained, or refused; base law; impacts             |
| named                             |      | groups of effects                                                         |
| base, augmented, floor            | m/s  | held-out error of the impacts before and after, and its noise floor       |
| flight_..., touch_...             | 1    | held-out misfit of flights and gaps, in units of noise; empty: none       |
| remaining_p                       | 1    | p-value of the remaining structure                                        |
| parameters                        |      | of a single hidden effect that the model contains, if it has a true       |
|                                   |      | value: true, found, std, Fisher's bound (empty if no law is true)         |
| why                               |      | reason of a refusal                                                       |
| code, made                        |      | as in `store`                                                             |
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.likelihood.sandwich import cramer_rao
from thesis_lib.effects import EFFECTS
from thesis_lib.effects.effect import Reference
from thesis_lib.foundation.rows import STAMP, Rows, as_cell
from thesis_lib.studies.proof.cases import Case, make
from thesis_lib.studies.proof.sizes import LAW, SLOPES
from thesis_lib.studies.proof.store import (
    COMMAND,
    STORE,
    Cells,
    code_of,
    criticised,
    numbers_in,
    numbers_of,
    put_missing,
    said_of,
    value_of,
)

VERDICTS = ("adequate", "effects", "unexplained", "refused")
ERRORS = ("base", "augmented", "floor", "flight_base", "flight_augmented", "touch_base", "touch_augmented")
RECOVERED = ("true", "found", "std", "fisher")  # of each parameter
KEY = ("truth", "ratio", "drops", "noise", "shape", "contact_time", "seed")
COLUMNS = (
    *("truth", "ratio", "drops", "noise", "seed", "shape", "contact_time", "sizes", "verdict", "law", "named"),
    *("n_impacts", *ERRORS, "remaining_p", "parameters", "why", *STAMP),
)


def table_of(source: str, store: Path = STORE) -> Rows:
    """The table of stored rows of a source."""
    return Rows(Path(store) / f"{source}.csv", COLUMNS, KEY, f"{COMMAND} run")


def read_rows(source: str, store: Path = STORE) -> dict[Case, Cells]:
    """The stored rows of a source, empty if there is no table.

    CorruptFileError if a row is unreadable or duplicate, or its truth is unknown.
    """
    rows: dict[Case, Cells] = {}

    def add(cells: dict[str, str]) -> None:
        sizes = {name: float(cells[name]) for name in ("noise", "ratio", "contact_time")}
        case = Case(source, cells["truth"], int(cells["seed"]), int(cells["drops"]), shape=cells["shape"], **sizes)
        _ = case.kind, numbers_of_row(cells)  # raise KeyError or ValueError
        if cells["verdict"] not in VERDICTS:
            raise ValueError(f"unknown verdict {cells['verdict']!r}")
        if case in rows:
            raise ValueError("the dataset occurs twice")
        rows[case] = cells

    table_of(source, store).parsed(add)
    return rows


def numbers_of_row(cells: Cells) -> dict[str, float]:
    """The numbers of a row by column, for parameters by e.g. "name std"; ValueError if one is not a number."""
    parameters = {
        f"{name} {kind}": value
        for name, values in numbers_of(cells["parameters"]).items()
        for kind, value in zip(RECOVERED, values, strict=True)
    }
    return {name: value_of(cells[name]) for name in ("n_impacts", *ERRORS, "remaining_p")} | parameters


def sizes_of(case: Case) -> str:
    """The cell with today's sizes of the hidden effects or causes."""
    return ";".join(f"{name}={as_cell(size)}" for name, size in case.sizes.items())


def is_of_today(case: Case, row: Cells) -> bool:
    """Return whether today's code made the row, with today's sizes."""
    return row["code"] == code_of(compute) and row["sizes"] == sizes_of(case)


def compute(case: Case) -> dict[str, object]:
    """Simulate the dataset of a case and criticise it; return a row of the table."""
    row: dict[str, object] = {**dict.fromkeys(COLUMNS, ""), **vars(case), "sizes": sizes_of(case)}
    dataset, true = make(case)
    found, critique = criticised(dataset, case.seed)
    if critique is None:
        return row | found
    for when, of in (("base", critique.ladder[0][2]), ("augmented", critique.ladder[-1][2])):
        row |= {f"{channel}_{when}": float(np.sqrt(of.sigmas[channel])) for channel in ("flight", "touch")}
    return row | found | {"parameters": numbers_in(_parameters(critique, true) if len(case.hidden) == 1 else {})}


def _parameters(critique: DropsCritique, true: dict[str, float]) -> dict[str, tuple[float, ...]]:
    """The values `RECOVERED` of each continuous parameter of the hidden effect, sorted by short name."""
    fitted, true = critique.discovery.fitted, counted_from(critique.training.rig.reference, true)
    continuous = {name for name, p in fitted.model.parameters.items() if "." in name and p.discrete is None}
    names = [name for name in true if name in continuous]
    bound = dict.fromkeys(names, np.nan)
    if names and "mu" in true:
        effects = tuple(EFFECTS[name] for name in dict.fromkeys(key.split(".")[0] for key in names))
        bound = cramer_rao(Model(LAWS[LAW], effects), true, critique.training)
    return {
        key.split(".")[1]: (true[key], fitted.values[key], fitted.std[key], bound[key])
        for key in sorted(names, key=lambda key: key.split(".")[1])
    }


def counted_from(reference: Reference, true: Mapping[str, float]) -> dict[str, float]:
    """Parameters by full name, converted from coordinates measured from 0 to coordinates measured from `reference`.

    With m = 1, c (1 + g x) = c (1 + g x_0) (1 + g / (1 + g x_0) (x − x_0)).
    """
    moved = dict(true)
    for name, (coefficient, along, m) in SLOPES.items():
        if name in true:
            factor = 1.0 + m * true[name] * getattr(reference, along)
            moved[name] /= factor
            if coefficient in true:
                moved[coefficient] *= factor ** (1.0 / m)
    places = {f"{name}.{p.name}": p.along for name, effect in EFFECTS.items() for p in effect.parameters if p.along}
    return moved | {name: true[name] - getattr(reference, of) for name, of in places.items() if name in true}


def run(
    cases: Sequence[Case], jobs: int, tell: Callable[[str], object], store: Path = STORE, again: bool = False
) -> bool:
    """Compute the cases that are not stored, about 20 s of CPU each, and return whether all were computed.

    `jobs` run at a time, and `tell` reports each; with `again`, rows made by older code are recomputed afterwards.
    """
    tables = {case.source: table_of(case.source, store) for case in cases}
    own = {"jobs": jobs, "again": again, "is_of_today": is_of_today}
    return put_missing(cases, compute, lambda case: tables[case.source], said_of, tell, **own)
