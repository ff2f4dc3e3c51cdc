"""The datasets of the table of real contacts, in the order in which they are computed, by several processes.

By source and shape: `NOTHING_HIDDEN` datasets with nothing hidden, whose contact times take turns; each cause once with
each contact time; each pair once, with contact times in turn; every third cause once with `FEW` drops.  Kinds, sources
and shapes are mixed evenly, so that a table of a part of them counts as the whole would.
"""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from thesis_lib.critique.proof.cases import BODIES, CORNERED, NOTHING, SEEDS, Case, pairs, truths
from thesis_lib.critique.proof.compute import code_hash, compute
from thesis_lib.critique.proof.store import STORE, put_row, read_rows
from thesis_lib.foundation.isolated import Task, run_isolated
from thesis_lib.foundation.randomness import generator

REAL = ("mujoco", "drake_point", "drake_hydroelastic", "mechanism")  # sources with contacts as long as real ones
TIMES = (1e-3, 3e-4, 3e-3)  # s
NOTHING_HIDDEN, FEW = 40, 50
LATER = ("marker_offset_x", "marker_offset_y")  # added when others had been computed: not counted among every third


def real_contacts(sources: Sequence[str] = REAL) -> list[Case]:
    """The datasets of the table of real contacts: those from the given sources."""
    bodies = [(source, shape) for source in REAL for shape in BODIES]
    none = [
        Case(source, NOTHING, SEEDS + k, shape=shape, contact_time=TIMES[k % len(TIMES)])
        for k in range(NOTHING_HIDDEN)
        for source, shape in bodies
    ]
    hidden = {
        kind: [
            Case(source, truth, SEEDS + k, shape=shape, contact_time=time)
            for k, time in enumerate(TIMES)
            for source, shape in bodies
            for truth in of_source(source)
            if not (shape == "ellipse" and CORNERED & set(truth.split("+")))
        ]
        for kind, of_source in {"single": lambda source: truths(source)[1:], "pair": pairs}.items()
    }
    hidden["pair"] = [case for i, case in enumerate(hidden["pair"]) if case.seed == SEEDS + i % len(TIMES)]
    few = [
        Case(case.source, case.truth, case.seed, FEW, shape=case.shape, contact_time=case.contact_time)
        for case in [case for case in hidden["single"] if case.seed == SEEDS and case.truth not in LATER][:: len(TIMES)]
    ]
    rng = generator(0, "proof plan")
    placed = []
    for i, cases in enumerate((none, *hidden.values(), few)):
        # datasets with nothing hidden are in turn already
        order = range(len(cases)) if cases is none else rng.permutation(len(cases))
        placed += [((rank + 0.5) / len(cases), i, cases[k]) for rank, k in enumerate(order)]
    return [case for _, _, case in sorted(placed, key=lambda one: one[:2]) if case.source in sources]


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
