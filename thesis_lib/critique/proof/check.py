"""Compute stored rows of the proof again: a random sample, or all.

A row agrees if verdict and groups of effects are equal, and its numbers are within `MOVED`.  Effects of one group
cannot be told apart, so that their order does not count.  Another answer and moved numbers are always told; only a
right answer (`is_right`) that became a wrong one counts against the code.  Rows are older than the code, and a few lie
where a small change or another processor turns them, so that `check_sample` fails on the second such row, not on the
first.  The p-value of what remains is random and is not compared.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import pandas as pd

from thesis_lib.critique.proof.cases import SEEDS, SOURCES, Case
from thesis_lib.critique.proof.compute import Row, code_hash, compute
from thesis_lib.critique.proof.results import is_right
from thesis_lib.critique.proof.store import STORE, put_row, read_rows
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator

MOVED = 1e-3  # relative; searches that end elsewhere in the last digits differ by less than 1e-5
FLOOR_MOVED = 0.05  # relative; the floor is drawn, and differs by up to 2 % between streams
MORE = 4  # rows that a sample grows by if a right answer in it became wrong

AGREES, MOVES, DIFFERS, WORSE = "agrees", "moved", "differs", "was right and is wrong"


def compare(stored: Row, again: Row) -> tuple[str, str]:
    """`AGREES`, `MOVES` (numbers), `DIFFERS` (the answer) or `WORSE`, and the differences."""
    answers = [(row.verdict, row.why, [set(group) for group in row.groups]) for row in (stored, again)]
    if answers[0] != answers[1]:
        was, now = (f"{row.verdict}, {row.named or row.why or 'nothing named'}" for row in (stored, again))
        right = [is_right(row.case, row.verdict, row.groups) for row in (stored, again)]
        return (WORSE if right == [True, False] else DIFFERS), f"stored {was}; now {now}"
    numbers = [_numbers(row) for row in (stored, again)]
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
    """Compute stored rows again, `tell` how each compares, and return whether none fails.

    `stamp` stores each new row, with today's hash, whose verdict and groups agree.
    """
    passed = True
    for case in cases:
        stored, again = read_rows(case.source, store)[case], compute(case)
        status, differences = compare(stored, again)
        passed &= status not in failing
        tell(f"{case}: {status}{f' ({differences})' if differences else ''}")
        if stamp and status in (AGREES, MOVES):
            put_row(again, store, replace=True)
    return passed


def check_sample(
    size: int,
    sources: Sequence[str] = SOURCES,
    store: Path = STORE,
    *,
    stamp: bool = False,
    tell: Callable[[str], object] = print,
) -> bool:
    """`check` that many older rows, and `MORE` if a right answer became wrong; return whether at most one did."""
    cases, worse = rows_to_check(size + MORE, sources, store), 0
    for i, case in enumerate(cases):
        if i >= size and not worse:
            break
        worse += not check([case], store, stamp=stamp, tell=tell)
    return worse <= 1


def rows_to_check(sample: int | None, sources: Sequence[str] = SOURCES, store: Path = STORE) -> list[Case]:
    """Rows made by other code or sizes than today's: the first of a random order, or all of them (None).

    The order is the same for equal code.
    """
    older = [case for source in sources for case, row in read_rows(source, store).items() if not row.is_of_today]
    if sample is None:
        return older
    chosen = generator(0, "proof check", code_hash()).permutation(len(older))[:sample]
    return [older[i] for i in chosen]


def ages(store: Path = STORE) -> str:
    """Text that counts the rows of each source by the code that made them."""
    lines = [f"Today's code is {code_hash()}. Rows by the code that made them:"]
    for source in SOURCES:
        rows = read_rows(source, store).values()
        today = sum(row.is_of_today for row in rows)
        counts = Counter(row.code for row in rows if not row.is_of_today)
        older = [f"{count} {code or 'not known'}" for code, count in counts.most_common()]
        listed = f" ({', '.join(older)})" if older else ""
        lines.append(f"    {source:<10}{today:>5} today's, {sum(counts.values()):>5} older{listed}")
    return "\n".join(lines) + "\n"


def rerun(names: Sequence[str], store: Path = STORE) -> pd.DataFrame:
    """Compute the first dataset of each "source/truth" again: columns source, truth, verdict, agrees (1).

    UserError if a result is not stored, or differs now.
    """
    cases = [Case(source, truth, SEEDS) for source, truth in (name.split("/") for name in names)]
    if missing := [case for case in cases if case not in read_rows(case.source, store)]:
        named = ", ".join(f"{case.source}/{case.truth}" for case in missing)
        raise UserError(
            f"The proof holds no result of {named} to compare with. Make it with python -m "
            f"thesis_lib.critique.proof run --source {missing[0].source} --truths {missing[0].truth}, or leave it out "
            "of critique.proof in the configuration."
        )
    lines: list[str] = []
    if not check(cases, store, tell=lines.append, failing=(DIFFERS, WORSE)):
        raise UserError(
            "\n".join(["The critique says something else than the stored proof:", *lines])
            + f"\nIf it is meant, delete these lines in {store} and run python -m thesis_lib.critique.proof run."
        )
    rows = [(case.source, case.truth, read_rows(case.source, store)[case].verdict, 1) for case in cases]
    return pd.DataFrame(rows, columns=["source", "truth", "verdict", "agrees"])


def _numbers(row: Row) -> dict[str, float]:
    parameters = {
        f"{name} {kind}": value for name, values in row.parameters.items() for kind, value in values._asdict().items()
    }
    return {"n_impacts": row.n_impacts, **row.errors, **parameters}


def _close(name: str, before: float, after: float) -> bool:
    unknown = math.isnan(before) and math.isnan(after)
    return unknown or math.isclose(before, after, rel_tol=FLOOR_MOVED if name == "floor" else MOVED)
