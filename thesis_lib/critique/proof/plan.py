"""The datasets of the headline table, in the order in which they are computed, by several processes.

Worlds of three simulators, with contacts as long as real ones under both shapes.  In each world `NOTHING_HIDDEN`
datasets hide nothing, `CAUSES` one cause, `PAIRS` two, and `OUTSIDE` a cause that no effect describes.  Truths, shapes
and contact times take turns, and kinds and worlds are mixed evenly, so that a table of a part of them counts as the
whole would.  Seeds begin at `FRESH`, which no earlier table has.
"""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from thesis_lib.critique.proof.cases import BODIES, CORNERED, FRESH, NOTHING, Case, pairs, truths
from thesis_lib.critique.proof.compute import code_hash, compute
from thesis_lib.critique.proof.store import STORE, put_row, read_rows
from thesis_lib.foundation.isolated import Task, run_isolated
from thesis_lib.foundation.randomness import generator

WORLDS = {"own": ("mechanism",), "MuJoCo": ("mujoco", "mujoco_usual"), "Drake": ("drake_point", "drake_hydroelastic")}
TIMES = (1e-3, 3e-4, 3e-3)  # s, contact times
NOTHING_HIDDEN, CAUSES, PAIRS, OUTSIDE = 60, 208, 20, 20  # datasets of each world


def headline() -> list[Case]:
    """All datasets of the headline table."""
    placed = []
    for i, sources in enumerate(WORLDS.values()):
        for j, (kind, count) in enumerate(_counts().items()):
            cases = _cases(sources, kind, count)
            placed += [((rank + 0.5) / count, i, j, case) for rank, case in enumerate(cases)]
    return [case for *_, case in sorted(placed, key=lambda one: one[:3])]


def _counts() -> dict[str, int]:
    return {NOTHING: NOTHING_HIDDEN, "single": CAUSES, "pair": PAIRS, "outside": OUTSIDE}


def _cases(sources: Sequence[str], kind: str, count: int) -> list[Case]:
    """`count` datasets of a kind: every truth once before any comes again, with another contact time."""
    rng, cases = generator(0, "headline", *sources, kind), []
    bodies = [
        (source, shape, truth)
        for source in sources
        for shape in BODIES
        for truth in [*truths(source), *pairs(source)]
        if not (shape == "ellipse" and CORNERED & set(truth.split("+"))) and _kind(source, truth) == kind
    ]
    for turn in range(-(-count // len(bodies))):
        for k in rng.permutation(len(bodies)):
            source, shape, truth = bodies[k]
            time = TIMES[(turn + k) % len(TIMES)]
            cases.append(Case(source, truth, FRESH + turn, shape=shape, contact_time=time))
    return cases[:count]


def _kind(source: str, truth: str) -> str:
    return Case(source, truth, FRESH, shape="square").kind


def run(
    cases: Sequence[Case], jobs: int, tell: Callable[[str], object], store: Path = STORE, again: bool = False
) -> bool:
    """Compute the cases that are not stored, `jobs` at a time, `tell` each, and return whether all were computed.

    With `again` also those whose row was made by other code than today's, after the others.
    """
    stored = {source: read_rows(source, store) for source in {case.source for case in cases}}
    missing = [case for case in cases if case not in stored[case.source]]
    older = [case for case in cases if case in stored[case.source] and not stored[case.source][case].is_of_today]
    tell(f"{len(cases) - len(missing)} of {len(cases)} are stored, {len(older)} by older code")
    missing += older if again else []
    tell(f"{len(missing)} to compute, about 20 s of CPU each")
    done, complete = 0, True
    with tempfile.TemporaryDirectory() as logs:
        tasks = [Task(str(case), (case, store, code_hash()), Path(logs) / f"{i}.txt") for i, case in enumerate(missing)]
        for outcome in run_isolated(_work, tasks, jobs=jobs, preload=(__name__,)):
            done, complete = done + 1, complete and outcome.result is not None
            said = outcome.failure or (outcome.result or {})["said"]
            spent = "" if outcome.cpu_s is None else f"  [{outcome.cpu_s:.0f} s]"
            tell(f"{done} of {len(missing)}  {outcome.name}: {said}{spent}")
    return complete


def _work(case: Case, store: Path, code: str) -> dict:
    row = compute(case, code)
    put_row(row, store, replace=True)
    return {"said": f"{row.verdict}, {row.named or row.why or 'nothing named'}"}
