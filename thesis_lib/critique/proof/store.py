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

import csv
import fcntl
import io
import math
import os
from pathlib import Path

from thesis_lib.critique.proof.cases import Case
from thesis_lib.critique.proof.compute import Recovered, Row
from thesis_lib.critique.proof.sizes import CONFIG
from thesis_lib.foundation.errors import CorruptFileError
from thesis_lib.foundation.files import MAX_TABLE, write_text
from thesis_lib.foundation.regular_file import FileProblem, MissingFile, read_bytes

STORE = CONFIG / "proof"
VERDICTS = ("adequate", "effects", "unexplained", "refused")
ERRORS = ("base", "augmented", "floor", "flight_base", "flight_augmented", "touch_base", "touch_augmented")
COLUMNS = (
    *(
        "truth",
        "ratio",
        "drops",
        "noise",
        "seed",
        "shape",
        "contact_time",
        "sizes",
        "verdict",
        "law",
        "named",
        "n_impacts",
    ),
    *ERRORS,
    *("remaining_p", "parameters", "why", "code", "made"),
)


def read_rows(source: str, store: Path = STORE) -> dict[Case, Row]:
    """The stored rows of a source, empty if there is no table.

    CorruptFileError if a row is unreadable or duplicate, or its truth unknown.
    """
    path = Path(store) / f"{source}.csv"
    rows: dict[Case, Row] = {}
    line = 1
    try:
        text = read_bytes(path, MAX_TABLE).decode("utf-8")
        header, *lines = csv.reader(io.StringIO(text, newline=""), strict=True)
        if tuple(header) != COLUMNS:
            raise ValueError(f"the columns are not {', '.join(COLUMNS)}")
        for cells in lines:
            line += 1
            row = _row(source, dict(zip(header, cells, strict=True)))
            if row.case in rows:
                raise ValueError("the dataset stands twice")
            rows[row.case] = row
    except MissingFile:
        return {}
    except (ValueError, KeyError, TypeError, FileProblem, csv.Error) as error:
        raise CorruptFileError(
            f"{path}, line {line}, is no result of the proof ({type(error).__name__}: {str(error)[:200]}); delete the "
            "line and run it again with python -m thesis_lib.critique.proof run."
        ) from error
    return rows


def put_row(row: Row, store: Path = STORE, *, replace: bool = False) -> None:
    """Add a row to the table of its source, or `replace` an existing one; parallel runs wait for each other."""
    Path(store).mkdir(parents=True, exist_ok=True)
    folder = os.open(store, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)  # the kernel releases it when the process ends
        rows = read_rows(row.case.source, store)
        if replace or row.case not in rows:
            rows[row.case] = row
            write_rows(row.case.source, rows, store)
    finally:
        os.close(folder)


def write_rows(source: str, rows: dict[Case, Row], store: Path) -> None:
    """Write the table of a source, sorted and atomically."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    order = sorted(rows, key=_place)
    writer.writerows([_text(value) for value in _cells(rows[case])] for case in order)
    write_text(text.getvalue(), Path(store) / f"{source}.csv")


def _place(case: Case) -> tuple:
    return case.truth, case.ratio, case.drops, case.noise, case.shape, case.contact_time, case.seed


def _cells(row: Row) -> list[object]:
    case = row.case
    parameters = (f"{name}={':'.join(map(_text, values))}" for name, values in sorted(row.parameters.items()))
    return [
        *(case.truth, case.ratio, case.drops, case.noise, case.seed, case.shape, case.contact_time),
        ";".join(f"{name}={_text(size)}" for name, size in row.sizes.items()),
        *(row.verdict, row.law, row.named, row.n_impacts),
        *(row.errors.get(name, math.nan) for name in ERRORS),
        *(row.remaining_p, ";".join(parameters), row.why, row.code, row.made),
    ]


def _text(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return "" if math.isnan(value) else repr(int(value) if value.is_integer() else value)


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
