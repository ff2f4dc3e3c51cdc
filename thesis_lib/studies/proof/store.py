"""Shared by all proofs: tables in config/proof/, cells with several values, and runs that resume where they stopped.

A row identifies a dataset (its case) and holds the results for it, the code version and the date.  Rows are sorted to
keep the differences in git short.

| cell       | form                                                                                        |
|------------|---------------------------------------------------------------------------------------------|
| groups     | "a/b + c": effects in the order of selection, each with its indistinguishable alternatives  |
| numbers    | "name=1:2;other=3"                                                                          |
| code, made | hash of the code that made the row, empty: unknown; and the date                            |
"""

import functools
import inspect
import tempfile
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import permutations
from operator import itemgetter
from pathlib import Path
from typing import Any

import pandas as pd

import thesis_lib
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.critique.selection.discovery import Step
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.isolated import Task, run_isolated
from thesis_lib.foundation.provenance import lib_hash
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, Rows, as_cell, today
from thesis_lib.statistics.intervals import wilson

CONFIG = Path(thesis_lib.__file__).resolve().parent.parent / "config"  # exists in a checkout, not in an installation
STORE = CONFIG / "proof"
COMMAND = "python -m thesis_lib.studies.proof"
NOTHING = "nothing"  # truth of a dataset in which nothing is hidden
LARGEST_GROUP = 3  # largest number of effects in a group that still counts as right
Cells = Mapping[str, str]


def stored(name: str, key: Sequence[str], others: Sequence[str], command: str, **how: Any) -> Rows:
    """The table config/proof/`name`.csv with the columns `key`, `others` and `STAMP`; `how` as in `Rows`."""
    return Rows(STORE / f"{name}.csv", (*key, *others, *STAMP), key, f"{COMMAND} {command}", **how)


def groups_of(cell: str) -> list[list[str]]:
    """The groups of effects in a cell."""
    return [group.split("/") for group in cell.split(" + ") if group]


def groups_in(steps: Iterable[Step]) -> str:
    """The cell with the effects of `steps`, each with the alternatives that cannot be distinguished from it."""
    return " + ".join("/".join((step.effect.name, *step.alternatives)) for step in steps)


def is_exact(verdict: str, expected: Sequence[Collection[str]], groups: Sequence[Sequence[str]]) -> bool:
    """Return whether the verdict names each hidden cause, by any of its `expected` names, in a group of its own.

    If nothing is expected, only `adequate` is exact; if a cause has no expected name, only `unexplained`.
    """
    if not any(expected):
        return verdict == ("unexplained" if expected else "adequate")
    if verdict != "effects" or len(groups) != len(expected) or any(len(group) > LARGEST_GROUP for group in groups):
        return False
    return any(
        all(set(names) & set(group) for names, group in zip(expected, chosen)) for chosen in permutations(groups)
    )


def with_effects(critique: DropsCritique) -> str:
    """The cell with the effects of a critique without their alternatives, joined by +."""
    return "+".join(step.effect.name for step in critique.discovery.steps)


def criticised(dataset: Dataset, seed: int, **options: Any) -> tuple[dict[str, Any], DropsCritique | None]:
    """The results of the critique of a dataset by column, and the critique; if refused, the reason, and None."""
    try:
        critique = criticise_drops(dataset, rng=generator(seed, "critique", dataset.digest()), **options)
    except UserError as error:
        return {"verdict": "refused", "n_impacts": 0, "why": str(error).splitlines()[0][:200]}, None
    base, augmented = critique.ladder[0][2], critique.ladder[-1][2]
    found = {
        "verdict": critique.verdict,
        "law": critique.discovery.fitted.model.law.name,
        "named": groups_in(step for step in critique.discovery.steps if step.effect.name not in critique.stand_ins),
        "n_impacts": len(critique.observations),
        "base": float(base.error.mean()),
        "augmented": float(augmented.error.mean()),
        "floor": augmented.floor,
        "remaining_p": critique.remaining.p_value,
    }
    return found, critique


def said_of(row: Mapping[str, Any]) -> str:
    """The verdict and the named effects in words."""
    return f"{row['verdict']}, {row['named'] or row['why'] or 'nothing named'}"


def value_of(cell: str) -> float:
    """The number in a cell, NaN in an empty one."""
    return float(cell or "nan")


def numbers_of(cell: str) -> dict[str, list[float]]:
    """The numbers in a cell, by name; ValueError if one cannot be read."""
    parts = (part.split("=") for part in cell.split(";") if part)
    return {name: [value_of(value) for value in values.split(":")] for name, values in parts}


def numbers_in(named: Mapping[str, Iterable[float]], digits: int | None = None) -> str:
    """The cell with numbers by name, to `digits` significant digits (None: all)."""
    return ";".join(f"{name}={':'.join(as_cell(x, digits) for x in values)}" for name, values in named.items())


def share(hits: pd.Series) -> dict[str, float]:
    """The `share` of hits, its 95 % Wilson interval `low`, `high`, and their number `n`; NaN if there are none."""
    n = len(hits)
    low, high = wilson(int(hits.sum()), n)
    return {"share": float(hits.mean()) if n else float("nan"), "low": low, "high": high, "n": n}


@functools.cache
def code_of(compute: Callable) -> str:
    """Hash (16 hex digits) of all code that the module of a function uses."""
    return lib_hash(inspect.getfile(compute))


def stamped(row: Mapping[str, Any], compute: Callable) -> dict[str, Any]:
    """A row made by `compute`, with the hash of its code and today's date added."""
    return {**row, **dict(zip(STAMP, (code_of(compute), today())))}


def put_missing(
    cases: Iterable[Any],
    compute: Callable[[Any], dict[str, Any]],
    rows_of: Callable[[Any], Rows],
    told: Callable[[dict], str],
    tell: Callable[[str], object],
    *,
    jobs: int = 1,
    again: bool = False,
    is_of_today: Callable[[Any, Cells], bool] | None = None,
) -> bool:
    """Compute and store the missing rows of cases, report each one, and return whether all succeeded.

    Args:
        cases: dataclasses whose fields include the key of their table; cases with a stored row are skipped.
        compute: function of an importable module that makes a row; runs in separate processes, `jobs` at a time.
        told, again: function that returns a row in words for `tell`; whether to then recompute rows of older code.
        is_of_today: whether today's code made the stored row of a case; None: compare it with the hash of `compute`.
    """
    is_of_today = is_of_today or (lambda case, row: row["code"] == code_of(compute))
    cases, stored = list(cases), {rows.path: rows for rows in map(rows_of, cases)}
    known = {path: {itemgetter(*rows.key)(row): row for row in rows.parsed(dict)} for path, rows in stored.items()}

    def row_of(case: Any) -> Cells | None:
        rows = rows_of(case)
        return known[rows.path].get(tuple(as_cell(vars(case)[k]) for k in rows.key))

    missing = [case for case in cases if row_of(case) is None]
    older = [case for case in cases if again and (row := row_of(case)) and not is_of_today(case, row)]
    tell(f"{len(cases) - len(missing)} of {len(cases)} are stored, {len(missing) + len(older)} to compute")
    complete, todo = True, {str(case): case for case in (*missing, *older)}
    with tempfile.TemporaryDirectory() as logs:
        tasks = [Task(name, (case,), Path(logs) / f"{i}.txt") for i, (name, case) in enumerate(todo.items())]
        for i, done in enumerate(run_isolated(compute, tasks, jobs=jobs, preload=(__name__,)), 1):
            said = done.failure
            if done.result is None:
                complete = False
            else:
                rows_of(todo[done.name]).put(stamped(done.result, compute))
                said = told(done.result)
            spent = "" if done.cpu_s is None else f"  [{done.cpu_s:.0f} s]"
            tell(f"{i} of {len(todo)}  {done.name}: {said}{spent}")
    return complete
