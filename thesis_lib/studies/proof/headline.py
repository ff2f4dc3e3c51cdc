"""The headline table of the proof: right verdicts for each simulator, all computed with one state of the code.

There are three worlds (simulators), with contacts of realistic duration and both body shapes.  In each world `PLANNED`
datasets hide nothing, one cause, two causes, or a cause that no effect describes.  Truths, shapes and contact times
alternate, and kinds and worlds are mixed evenly: a partial table is representative of the whole.  Seeds begin at
`FRESH`; no earlier table uses them.  A second table gives the age of each table of the proof.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP
from thesis_lib.statistics.wording import count
from thesis_lib.studies.proof.cases import BODIES, CORNERED, FRESH, Case, pairs, truths
from thesis_lib.studies.proof.compute import read_rows
from thesis_lib.studies.proof.results import of_table, outcomes, recovered
from thesis_lib.studies.proof.store import COMMAND, NOTHING, STORE

WORLDS = {"own": ("mechanism",), "MuJoCo": ("mujoco", "mujoco_usual"), "Drake": ("drake_point", "drake_hydroelastic")}
TIMES = (1e-3, 3e-4, 3e-3)  # s, contact times
PLANNED = {NOTHING: 60, "single": 208, "pair": 20, "outside": 20}  # datasets of each world, by kind
# labels of the rows, and the kind of datasets whose verdicts are counted
FIGURES = {
    "nothing hidden: `adequate`": NOTHING,
    "one cause, named alone": "single",
    "both of a pair, and nothing else": "pair",
    "outside the library: `unexplained`": "outside",
}
WRONG = "a wrong effect named"
COVERED = "parameter in its 95 % interval"
UNKNOWN = "not recorded"


def planned() -> list[Case]:
    """All datasets of the headline table."""
    placed = []
    for i, sources in enumerate(WORLDS.values()):
        for j, (kind, wanted) in enumerate(PLANNED.items()):
            cases = _cases(sources, kind, wanted)
            placed += [((rank + 0.5) / wanted, i, j, case) for rank, case in enumerate(cases)]
    return [case for *_, case in sorted(placed, key=lambda one: one[:3])]


def _cases(sources: Sequence[str], kind: str, wanted: int) -> list[Case]:
    """`wanted` datasets of a kind; all truths occur once before one is repeated, with another contact time."""
    rng, cases = generator(0, "headline", *sources, kind), []
    bodies = [
        (source, shape, truth)
        for source in sources
        for shape in BODIES
        for truth in [*truths(source), *pairs(source)]
        if not (shape == "ellipse" and CORNERED & set(truth.split("+")))
        and Case(source, truth, FRESH, shape="square").kind == kind
    ]
    for turn in range(-(-wanted // len(bodies))):
        for k in rng.permutation(len(bodies)):
            source, shape, truth = bodies[k]
            time = TIMES[(turn + k) % len(TIMES)]
            cases.append(Case(source, truth, FRESH + turn, shape=shape, contact_time=time))
    return cases[:wanted]


def as_markdown(store: Path = STORE) -> str:
    """The headline table in Markdown, and the code versions that computed its rows."""
    cases = planned()
    rows = [read_rows(source, store) for source in dict.fromkeys(case.source for case in cases)]
    made = [of[case] for case in cases for of in rows if case in of]
    if not made:
        return f"None of the {len(cases)} datasets is computed yet: `{COMMAND} run-table`."
    found, parameters = (of_table(table[table["seed"] >= FRESH]) for table in (outcomes(store), recovered(store)))
    columns = [(name, found[found["kind"] == kind], "right") for name, kind in FIGURES.items()]
    columns += [(WRONG, found.assign(wrong=found["wrong_names"] > 0), "wrong"), (COVERED, parameters, "inside")]
    worlds = WORLDS | {"all": tuple(source for of in WORLDS.values() for source in of)}
    lines = []
    for figure, table, measure in columns:
        parts = [table.loc[table["source"].isin(sources), measure] for sources in worlds.values()]
        lines.append((figure, *(count(int(part.sum()), len(part)) if len(part) else "" for part in parts)))
    by = Counter(row["code"] for row in made)
    codes = ", ".join(f"{n} by `{code or UNKNOWN}`" for code, n in by.most_common())
    days = sorted({row["made"] for row in made})
    span = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    made_by = f"{len(made)} of {len(cases)} planned datasets, made on {span}: {codes}."
    return f"{markdown(('', *worlds), lines)}\n\n{made_by}"


def ages_as_markdown(store: Path = STORE) -> str:
    """Age of each stored table of the proof, in Markdown: its rows, their dates, and how many record their code."""
    lines = []
    for path in sorted(Path(store).glob("*.csv")):
        code, made = pd.read_csv(path, usecols=list(STAMP), keep_default_na=False)[list(STAMP)].to_numpy().T
        days = ", ".join(f"{day} ({n})" for day, n in sorted(Counter(made).items()))
        lines.append((f"`{path.stem}`", str(len(code)), days, str(sum(map(bool, code)))))
    return markdown(("table", "rows", "made", "rows that name the code that made them"), lines)
