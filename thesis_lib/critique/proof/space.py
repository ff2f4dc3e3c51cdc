"""The proof in space: what the critique says of sets of tosses that are drawn from one seed, in config/proof/space.csv.

| column                   | unit | meaning                                                                 |
|--------------------------|------|-------------------------------------------------------------------------|
| world, truth, seed       |      | the dataset (`SpaceCase`)                                               |
| shape                    |      | of its body                                                             |
| verdict, law, named      |      | adequate, effects, unexplained, refused or none; base law; groups       |
| n_impacts                | 1    | hits that are used                                                      |
| base, augmented, floor   | m/s  | held-out error of the hits before and after, and its noise floor        |
| remaining_p              | 1    | p-value of the remaining structure                                      |
| seconds                  | s    | CPU time of the critique                                                |
| why                      |      | reason of a refusal                                                     |
| code, made               |      | as in `store`                                                           |

What is drawn for each set stands in config/proof_in_space.csv, stored before any was computed; a test holds it to what
the seed draws (`simulate.tosses.drawn`).

Right is, with nothing hidden, `adequate`; with one cause `effects` with one group, of at most three, that contains it.
A wrong name is a group without what is hidden.
"""

import time
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.proof.results import LARGEST_GROUP
from thesis_lib.critique.proof.store import (
    COMMAND,
    CONFIG,
    STORE,
    groups_in,
    groups_of,
    is_of_other_code,
    numbers_in,
    put_missing,
)
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, Rows
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.tosses.drawn import DRAWN, NOTHING, WORLDS, SpaceCase, cases, make
from thesis_lib.simulate.tosses.own import OwnTosses
from thesis_lib.simulate.tosses.world import TossEngine
from thesis_lib.statistics.wording import count

KEY = ("world", "truth", "seed")
COLUMNS = (
    *(*KEY, "shape", "verdict", "law", "named", "n_impacts", "base", "augmented", "floor", "remaining_p"),
    *("seconds", "why", *STAMP),
)
ROWS = Rows(STORE / "space.csv", COLUMNS, KEY, f"{COMMAND} space", digits=6)
LIST = Rows(CONFIG / "proof_in_space.csv", (*KEY, *DRAWN), KEY, f"{COMMAND} space-list")
UNKNOWN = "not recorded"


def write_list(path: Path = LIST.path) -> None:
    """Write what is drawn for each set."""
    for case in cases():
        hidden = numbers_in({name: (value,) for name, value in case.hidden.items()})
        LIST.at(path).put({**vars(case), **case.drawn, "hidden": hidden})


def engine_of(case: SpaceCase) -> TossEngine:
    """What moves the bodies of a case."""
    drawn = case.drawn
    if case.world == "own":
        return OwnTosses()
    return MujocoTosses(drawn["cone"], drawn["impratio"], (drawn["impedance"], drawn["impedance"]))


def compute(case: SpaceCase) -> dict[str, object]:
    """Make the dataset of a case, and criticise it: a row of the table."""
    dataset, row = (
        make(case, engine_of(case)),
        {**dict.fromkeys(COLUMNS, ""), **vars(case), "shape": case.drawn["shape"]},
    )
    began = time.process_time()
    try:
        critique = criticise_drops(dataset, rng=generator(case.seed, "critique", dataset.digest()))
    except UserError as error:
        return row | {"verdict": "refused", "n_impacts": 0, "why": str(error).splitlines()[0][:200]}
    base, augmented = critique.ladder[0][2], critique.ladder[-1][2]
    return row | {
        "verdict": critique.verdict,
        "law": critique.discovery.fitted.model.law.name,
        "named": groups_in(critique.discovery.steps),
        "n_impacts": len(critique.observations),
        "base": float(base.error.mean()),
        "augmented": float(augmented.error.mean()),
        "floor": augmented.floor,
        "remaining_p": critique.remaining.p_value,
        "seconds": float(round(time.process_time() - began)),
    }


def told(row: dict) -> str:
    """What a row found, in words."""
    return f"{row['verdict']}, {row['named'] or row['why'] or 'nothing named'}"


def run(jobs: int, only: Collection[str], tell: Callable[[str], object], again: bool = False) -> bool:
    """Compute the datasets that are not stored, and return whether all were; `only`: worlds, truths or shapes.

    With `again` also those whose row other code than today's made, after the others.
    """
    chosen = [c for c in cases() if not only or {c.world, c.truth, c.drawn["shape"]} & set(only)]
    older = is_of_other_code(compute) if again else None
    return put_missing(chosen, compute, lambda case: ROWS, told, tell, jobs=jobs, older=older)


def judged(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with `right`, `first` (the cause is in the first group) and `wrong` (a group without it)."""
    groups = [groups_of(cell) for cell in rows["named"]]
    nothing = rows["truth"] == NOTHING
    inside = [[truth in group for group in named] for truth, named in zip(rows["truth"], groups)]
    alone = [len(named) == 1 and len(named[0]) <= LARGEST_GROUP for named in groups]
    found = (rows["verdict"] == "effects").to_numpy() & np.array(alone) & [any(one) for one in inside]
    return rows.assign(
        right=np.where(nothing, rows["verdict"] == "adequate", found),
        first=[bool(one) and one[0] for one in inside],
        wrong=[not all(one) for one in inside],
    )


def as_markdown(store: Rows = ROWS) -> str:
    """The three figures by world, each miss by name, and which code made the rows."""
    planned = cases()
    try:
        rows = judged(store.table())
    except UserError:
        return f"None of the {len(planned)} datasets is computed yet: `{COMMAND} space`."
    nothing = rows["truth"] == NOTHING
    figures = (
        ("nothing hidden: `adequate`", rows[nothing], "right"),
        ("one cause, named alone or with its group", rows[~nothing], "right"),
        ("one cause, in the first group", rows[~nothing], "first"),
        ("a wrong effect named", rows, "wrong"),
    )
    worlds = {world: (world,) for world in WORLDS} | {"both": WORLDS}
    lines = []
    for title, part, measure in figures:
        of = [part.loc[part["world"].isin(which), measure] for which in worlds.values()]
        lines.append((title, *(count(int(one.sum()), len(one)) if len(one) else "" for one in of)))
    by = Counter(zip(rows["code"], rows["made"]))
    codes = ", ".join(f"{n} by `{code or UNKNOWN}` on {made}" for (code, made), n in by.items())
    misses = [
        (row["world"], f"`{row['truth']}`", row["shape"], row["verdict"], row["named"] or row["why"])
        for row in rows[~rows["right"].astype(bool)].to_dict("records")
    ]
    head = ("world", "hidden", "shape", "verdict", "named")
    missed = f"\n\nNot right:\n\n{markdown(head, misses)}" if misses else ""
    return f"{markdown(('', *worlds), lines)}\n\n{len(rows)} of {len(planned)} datasets: {codes}.{missed}"
