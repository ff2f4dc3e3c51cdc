"""Recompute stored rows of the proof, a random sample or all, and compare the results.

A row agrees if verdict and groups of effects are equal and its numbers are within `MOVED`.  The order of effects within
a group does not count, since they cannot be distinguished.  Changed answers and numbers are always reported; only a
right answer (`is_right`) that became wrong counts against the code.  Stored rows may be older than the code, and a few
are so close to a threshold that a small change or another processor turns them; `check_sample` therefore fails on the
second such row, not the first.  The p-value of the remaining structure is random and is not compared.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.studies.proof.cases import SEEDS, SOURCES, Case
from thesis_lib.studies.proof.compute import compute, is_of_today, numbers_of_row, read_rows, table_of
from thesis_lib.studies.proof.results import is_right
from thesis_lib.studies.proof.store import STORE, Cells, code_of, groups_of, said_of, stamped

MOVED = 1e-3  # relative; searches that end elsewhere in the last digits differ by less than 1e-5
FLOOR_MOVED = 0.05  # relative; the floor comes from random draws and differs by up to 2 % between streams
MORE = 4  # rows that are added to a sample in which a right answer became wrong

AGREES, MOVES, DIFFERS, WORSE = "agrees", "moved", "differs", "was right and is wrong"


def compare(case: Case, stored: Cells, again: Cells) -> tuple[str, str]:
    """Return `AGREES`, `MOVES` (numbers changed), `DIFFERS` (answer changed) or `WORSE`, and the differences."""
    rows = (stored, again)
    answers = [(row["verdict"], row["why"], [set(group) for group in groups_of(row["named"])]) for row in rows]
    if answers[0] != answers[1]:
        right = [is_right(case, row["verdict"], groups_of(row["named"])) for row in rows]
        return (WORSE if right == [True, False] else DIFFERS), f"stored {said_of(stored)}; now {said_of(again)}"
    numbers = [numbers_of_row(row) for row in rows]
    pairs = {name: [of_row.get(name, math.nan) for of_row in numbers] for name in sorted(set().union(*numbers))}
    moved = [f"{name} {was:.4g} → {now:.4g}" for name, (was, now) in pairs.items() if not _close(name, was, now)]
    return (MOVES if moved else AGREES), ", ".join(moved)


def check(
    cases: Iterable[Case],
    store: Path = STORE,
    *,
    stamp: bool = False,
    tell: Callable[[str], object] = print,
    failing: Sequence[str] = (WORSE,),
) -> bool:
    """Recompute stored rows, report each comparison with `tell`, and return whether no status is in `failing`.

    If `stamp` is set, each new row whose verdict and groups agree is stored with today's hash.
    """
    passed = True
    for case in cases:
        rows = table_of(case.source, store)
        again = rows.cells(stamped(compute(case), compute))
        status, differences = compare(case, read_rows(case.source, store)[case], again)
        passed &= status not in failing
        tell(f"{case}: {status}{f' ({differences})' if differences else ''}")
        if stamp and status in (AGREES, MOVES):
            rows.put(again)
    return passed


def check_sample(
    size: int,
    sources: Sequence[str] = SOURCES,
    store: Path = STORE,
    *,
    stamp: bool = False,
    tell: Callable[[str], object] = print,
) -> bool:
    """`check` some older rows, and `MORE` if a right answer became wrong; return whether at most one became wrong."""
    cases, worse = rows_to_check(size + MORE, sources, store), 0
    for i, case in enumerate(cases):
        if i >= size and not worse:
            break
        worse += not check([case], store, stamp=stamp, tell=tell)
    return worse <= 1


def rows_to_check(sample: int | None, sources: Sequence[str] = SOURCES, store: Path = STORE) -> list[Case]:
    """Rows that other code or sizes than today's made: `sample` of them in random order, or all of them (None).

    The random order depends only on the code.
    """
    rows = [pair for source in sources for pair in read_rows(source, store).items()]
    older = [case for case, row in rows if not is_of_today(case, row)]
    if sample is None:
        return older
    chosen = generator(0, "proof check", code_of(compute)).permutation(len(older))[:sample]
    return [older[i] for i in chosen]


def ages(store: Path = STORE) -> str:
    """Table as text: number of rows of each source by the code that made them."""
    lines = [f"Today's code is {code_of(compute)}. Rows by the code that made them:"]
    for source in SOURCES:
        rows = read_rows(source, store)
        older = Counter(row["code"] for case, row in rows.items() if not is_of_today(case, row))
        each = [f"{count} {code or 'not known'}" for code, count in older.most_common()]
        listed = f" ({', '.join(each)})" if each else ""
        lines.append(f"    {source:<10}{len(rows) - older.total():>5} today's, {older.total():>5} older{listed}")
    return "\n".join(lines) + "\n"


def rerun(names: Sequence[str], store: Path = STORE) -> pd.DataFrame:
    """Recompute the first dataset of each "source/truth": columns source, truth, verdict, agrees (1).

    UserError if a result is not stored or differs from the stored one.
    """
    cases = [Case(source, truth, SEEDS) for source, truth in (name.split("/") for name in names)]
    if missing := [case for case in cases if case not in read_rows(case.source, store)]:
        named = ", ".join(f"{case.source}/{case.truth}" for case in missing)
        raise UserError(
            f"The proof holds no stored result of {named} to compare with. Compute it with python -m "
            f"thesis_lib.studies.proof run --source {missing[0].source} --truths {missing[0].truth}, or leave it out "
            "of critique.proof in the configuration."
        )
    lines: list[str] = []
    if not check(cases, store, tell=lines.append, failing=(DIFFERS, WORSE)):
        raise UserError(
            "\n".join(["The critique now gives other results than the stored proof:", *lines])
            + f"\nIf this is intended, delete these lines in {store} and run python -m thesis_lib.studies.proof run."
        )
    rows = [(case.source, case.truth, read_rows(case.source, store)[case]["verdict"], 1) for case in cases]
    return pd.DataFrame(rows, columns=["source", "truth", "verdict", "agrees"])


def _close(name: str, before: float, after: float) -> bool:
    if name == "remaining_p" or (math.isnan(before) and math.isnan(after)):
        return True
    return math.isclose(before, after, rel_tol=FLOOR_MOVED if name == "floor" else MOVED)
