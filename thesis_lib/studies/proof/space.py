"""The proofs in space: results of the critique for sets of tosses whose rig is drawn at random from a seed.

The first proof has two worlds (simulators) and at most one cause (config/proof/space.csv); the second has three worlds,
pairs of causes, and causes for which the library has no effect (config/proof/worlds.csv).

| column                   | unit | meaning                                                                 |
|--------------------------|------|-------------------------------------------------------------------------|
| world, truth, seed       |      | the dataset (`SpaceCase`)                                               |
| shape                    |      | of its body                                                             |
| verdict, law, named      |      | adequate, effects, unexplained, refused or none; base law; groups       |
| n_impacts                | 1    | number of hits that are used                                            |
| base, augmented, floor   | m/s  | held-out error of the hits before and after, and its noise floor        |
| remaining_p              | 1    | p-value of the remaining structure                                      |
| sizes                    |      | by parameter of a hidden effect that is named: true, found, its         |
|                          |      | standard error                                                          |
| seconds                  | s    | CPU time of the critique                                                |
| why                      |      | reason of a refusal                                                     |
| code, made               |      | as in `store`                                                           |

config/proof_in_space.csv and config/proof_in_worlds.csv list the random draws for each set; they were stored before any
set was computed, and a test compares them with the seeds' draws (`simulate.tosses.drawn`, `drawn_in_worlds`).

For each set of one cause whose verdict is not right, a second table (…_missed.csv) shows how much evidence the data
contain for the cause: its gain when it is switched on by hand instead of a search.

| column                   | unit | meaning                                                                 |
|--------------------------|------|-------------------------------------------------------------------------|
| world, truth, seed       |      | the dataset                                                             |
| gain, low, high          | nats | held-out gain per impact, with 95 % interval                            |
| without, with_it, floor  | m/s  | held-out error of the hits without and with the cause, and noise floor  |
| why                      |      | reason why the data cannot test the cause                               |

config/proof/lifted.csv holds ten planar sets of the proof, lifted into space (`simulate.tosses.lifted`).  They were
chosen when only the first two had been computed: causes with a single size that exist both in the plane and in space.

| column                | unit | meaning                                                                    |
|-----------------------|------|----------------------------------------------------------------------------|
| truth, shape, seed    |      | the planar set, of the source mechanism (`cases.Case`)                     |
| plane, space          |      | verdicts                                                                   |
| in_plane, in_space    |      | groups of named effects                                                    |
| sizes                 |      | of the parameters that both models have, by the name in space: value in    |
|                       |      | the plane, its standard error, value in space, its standard error          |
| apart                 | 1    | largest difference of these values, over the plane's standard error        |

The right verdict is `adequate` with nothing hidden, `unexplained` with a cause outside the library, and `effects` with
one or two causes, each in a named group of its own (at most three effects).  A group without a hidden cause is wrong.
"""

import time
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from thesis_lib.critique.contacts.contact_time import CONTACT_TIME
from thesis_lib.critique.drops.criticise import DropsCritique, criticise_drops
from thesis_lib.effects.effect import values_in_space
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.markdown import table as markdown
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import Rows
from thesis_lib.simulate.drake.tosses import DrakeTosses
from thesis_lib.simulate.mujoco.tosses import MujocoTosses
from thesis_lib.simulate.tosses.causes import OUTSIDE
from thesis_lib.simulate.tosses.drawn import DRAWN, SpaceCase, cases, make
from thesis_lib.simulate.tosses.drawn_in_worlds import DRAWN_IN_WORLDS, SHAPES_IN, worlds_cases
from thesis_lib.simulate.tosses.lifted import lifted
from thesis_lib.simulate.tosses.own import OwnTosses
from thesis_lib.simulate.tosses.world import TossEngine
from thesis_lib.statistics.intervals import Z95
from thesis_lib.statistics.wording import count
from thesis_lib.studies.proof.cases import SEEDS, Case
from thesis_lib.studies.proof.cases import make as make_in_plane
from thesis_lib.studies.proof.sizes import as_fitted
from thesis_lib.studies.proof.store import (
    COMMAND,
    CONFIG,
    NOTHING,
    criticised,
    groups_in,
    groups_of,
    is_exact,
    numbers_in,
    numbers_of,
    stored,
)

KEY = ("world", "truth", "seed")
FOUND = (
    *("shape", "verdict", "law", "named", "n_impacts", "base", "augmented", "floor", "remaining_p"),
    *("sizes", "seconds", "why"),
)
MISSED = ("gain", "low", "high", "without", "with_it", "floor", "why")
KINDS = {NOTHING: "nothing hidden: `adequate`", "one": "one cause, named alone or with its group"}
KINDS |= {"first": "one cause, in the first group", "pair": "a pair of causes, each named"}
KINDS |= {"outside": "a cause from outside: `unexplained`", "wrong": "a wrong effect named"}
UNKNOWN = "not recorded"
LIFTED = (
    *((NOTHING, "ellipse"), ("com_offset_x", "ellipse"), ("com_offset_y", "ellipse"), ("size_error", "ellipse")),
    *(("inertia_error", "ellipse"), ("tilt", "ellipse"), ("surface_height", "ellipse"), ("linear_drag", "ellipse")),
    *(("gravity_error", "square"), (NOTHING, "square")),
)
OF_BOTH = ("plane", "space", "in_plane", "in_space", "sizes", "apart")
LIFTED_ROWS = stored("lifted", ("truth", "shape", "seed"), OF_BOTH, "lifted", digits=6)


@dataclass(frozen=True)
class SpaceProof:
    """Datasets of a proof, and the tables of their random draws, of their results, and of the evidence in misses."""

    sets: Callable[[], Sequence[SpaceCase]]
    drawn: Rows
    rows: Rows
    missed: Rows


def _proof(name: str, sets: Callable[[], Sequence[SpaceCase]], drawn: Sequence[str], option: str = "") -> SpaceProof:
    """A proof with its tables in config/."""
    return SpaceProof(
        sets,
        Rows(CONFIG / f"proof_in_{name}.csv", (*KEY, *drawn), KEY, f"{COMMAND} space-list{option}"),
        stored(name, KEY, FOUND, f"space{option}", digits=6),
        stored(f"{name}_missed", KEY, MISSED, f"space-missed{option}", digits=4),
    )


FIRST = _proof("space", cases, DRAWN)
IN_WORLDS = _proof("worlds", worlds_cases, DRAWN_IN_WORLDS, " --worlds")


def write_list(proof: SpaceProof) -> None:
    """Write the table of the random draws for each set."""
    for case in proof.sets():
        hidden = numbers_in({name: (value,) for name, value in case.hidden.items()})
        proof.drawn.put({**vars(case), **case.drawn, "hidden": hidden})


def engine_of(case: SpaceCase) -> TossEngine:
    """The simulator that moves the bodies of a case."""
    drawn = case.drawn
    if case.world == "mujoco":
        return MujocoTosses(drawn["cone"], drawn["impratio"], (drawn["impedance"], drawn["impedance"]))
    return OwnTosses() if case.world == "own" else DrakeTosses()


def compute(case: SpaceCase) -> dict[str, object]:
    """Simulate the dataset of a case and criticise it; return a row of the table."""
    dataset = make(case, engine_of(case))
    row: dict[str, object] = {**dict.fromkeys(FOUND, ""), **vars(case), "shape": case.drawn["shape"]}
    began = time.process_time()
    found, critique = criticised(dataset, case.seed)
    if critique is None:
        return row | found
    sizes = numbers_in(_sizes(critique, case.hidden), 6)
    return row | found | {"sizes": sizes, "seconds": float(round(time.process_time() - began))}


def _sizes(critique: DropsCritique, hidden: Mapping[str, float]) -> dict[str, tuple[float, float, float]]:
    fitted = critique.discovery.fitted
    true = as_fitted(fitted.effects, hidden, critique.observations.rig)
    # a hidden 0 is a coordinate, which effects measure from a reference of their own
    both = [name for name, size in hidden.items() if size and fitted.std.get(name, 0.0) > 0.0]
    return {name: (true[name], fitted.values[name], fitted.std[name]) for name in both}


def chosen(proof: SpaceProof, only: Collection[str]) -> list[SpaceCase]:
    """The datasets of a proof; if `only` names worlds, truths or shapes, only datasets with one of them."""
    return [c for c in proof.sets() if not only or {c.world, c.truth, c.drawn["shape"]} & set(only)]


def kind_of(truth: str) -> str:
    """The kind of a truth: "nothing", "one", "pair" or "outside" (see `KINDS`)."""
    if truth == NOTHING or truth in OUTSIDE:
        return NOTHING if truth == NOTHING else "outside"
    return "pair" if "+" in truth else "one"


def judged(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with `kind`, `right`, `first` (the first group contains a cause) and `wrong` (a group contains none)."""
    kinds, made = [kind_of(truth) for truth in rows["truth"]], []
    for truth, kind, verdict, cell in zip(rows["truth"], kinds, rows["verdict"], rows["named"]):
        hidden, groups = truth.split("+") if kind in ("one", "pair") else [], groups_of(cell)
        inside = [bool(set(hidden) & set(group)) for group in groups]
        right = is_exact(verdict, [()] if kind == "outside" else [(name,) for name in hidden], groups)
        made.append((right, bool(inside) and inside[0], not all(inside)))
    right, first, wrong = map(list, zip(*made))
    return rows.assign(kind=kinds, right=right, first=first, wrong=wrong)


def compute_missed(case: SpaceCase) -> dict[str, object]:
    """Evaluate the evidence for the hidden cause in the data of a case; return a row of the table of misses."""
    dataset = make(case, engine_of(case))
    row: dict[str, object] = {**dict.fromkeys(MISSED, ""), **vars(case)}
    found, critique = criticised(dataset, case.seed, effects=[case.truth])
    if critique is None:
        return row | {"why": found["why"]}
    (step,) = critique.discovery.steps
    errors = {"without": found["base"], "with_it": found["augmented"], "floor": found["floor"]}
    return row | dict(zip(("gain", "low", "high"), step.gain)) | errors


def told_missed(row: dict) -> str:
    """A row of `compute_missed` in words."""
    if row["why"]:
        return row["why"]
    errors = " to ".join(f"{float(row[name]):.2g}" for name in ("without", "with_it"))
    gain, low, high = (f"{float(row[name]):.2g}" for name in ("gain", "low", "high"))
    return f"{gain} ({low} to {high}) nats per impact, {errors} m/s, noise {float(row['floor']):.2g}"


def not_right(proof: SpaceProof) -> list[SpaceCase]:
    """The stored datasets of one cause whose verdict is not right; UserError if no rows are stored."""
    rows = judged(proof.rows.table())
    wrong = rows[~rows["right"].astype(bool) & (rows["kind"] == "one")]
    keys = set(wrong[list(KEY)].itertuples(index=False, name=None))
    return [case for case in proof.sets() if (case.world, case.truth, case.seed) in keys]


def as_markdown(proof: SpaceProof) -> str:
    """The shares by world, the coverage of the sizes, a list of all misses, and the code that made the rows."""
    planned = proof.sets()
    try:
        rows = judged(proof.rows.table())
    except UserError:
        return f"None of the {len(planned)} datasets is computed yet: `{proof.rows.command}`."
    names = [world for world in SHAPES_IN if any(case.world == world for case in planned)]
    lines = []
    for kind, title in KINDS.items():
        part = rows if kind == "wrong" else rows[rows["kind"] == ("one" if kind == "first" else kind)]
        measure = kind if kind in ("first", "wrong") else "right"
        of = [part.loc[part["world"].isin(which), measure] for which in (*((name,) for name in names), names)]
        if len(of[-1]):
            lines.append((title, *(count(int(one.sum()), len(one)) if len(one) else "" for one in of)))
    by = Counter(zip(rows["code"], rows["made"]))
    codes = ", ".join(f"{n} by `{code or UNKNOWN}` on {made}" for (code, made), n in by.items())
    by_hand = {tuple(row[k] for k in KEY): told_missed(row) for row in proof.missed.parsed(dict)}
    misses = [
        (row["world"], f"`{row['truth']}`", row["shape"], row["verdict"], row["named"] or row["why"])
        + (by_hand.get(tuple(str(row[k]) for k in KEY), ""),)
        for row in rows[~rows["right"].astype(bool)].to_dict("records")
    ]
    head = ("world", "hidden", "shape", "verdict", "named", "the cause switched on by hand")
    wrong = f"\n\nNot right:\n\n{markdown(head, misses)}" if misses else ""
    made = f"{len(rows)} of {len(planned)} datasets: {codes}."
    return f"{markdown(('', *names, 'all'), lines)}\n\n{_covered(rows)}{_wrong(rows)}{made}{wrong}"


def _wrong(rows: pd.DataFrame) -> str:
    """Verdicts and first groups of the sets in which a wrong effect is named, as a sentence."""
    of = rows[rows["wrong"].astype(bool)]
    left, beside = (of["verdict"] == "unexplained").sum(), (of["first"] & (of["verdict"] == "effects")).sum()
    sets = (
        f"Sets with a wrong effect: {len(of)}, of which `unexplained`: {left}; beside a right one that is named first: "
    )
    return f"{sets}{beside}.  " if len(of) else ""


def _covered(rows: pd.DataFrame) -> str:
    """Number of sizes of named causes that lie in their 95 % interval, as a sentence."""
    of = rows[rows["right"].astype(bool)]["sizes"].astype(str)
    found = [values for cell in of for values in numbers_of(cell).values()]
    inside = [abs(size - true) <= Z95 * std for true, size, std in found]
    return f"Sizes in their 95 % interval: {count(sum(inside), len(inside))}.  " if inside else ""


@dataclass(frozen=True)
class Lifted:
    """A planar set of the proof that is lifted into space."""

    truth: str
    shape: str
    seed: int = SEEDS


def compute_lifted(case: Lifted) -> dict[str, object]:
    """Criticise a set in the plane and in space; return a row of the table."""
    planar, _ = make_in_plane(Case("mechanism", case.truth, case.seed, shape=case.shape))
    made = lifted(planar, generator(case.seed, "lifted", case.truth))
    found = [criticise_drops(data, rng=generator(case.seed, "critique", data.digest())) for data in (planar, made)]
    sizes = shared(*found)
    return vars(case) | {
        "plane": found[0].verdict,
        "space": found[1].verdict,
        "in_plane": groups_in(found[0].discovery.steps),
        "in_space": groups_in(found[1].discovery.steps),
        "sizes": numbers_in(sizes, 6),
        "apart": max(abs(space - plane) / std for plane, std, space, _ in sizes.values()),
    }


def shared(plane: DropsCritique, space: DropsCritique) -> dict[str, tuple[float, float, float, float]]:
    """Value in the plane, its standard error, value in space and its standard error of each parameter of both models.

    Without the contact time, which is 0 within its error.
    """
    flat, deep = plane.discovery.fitted, space.discovery.fitted
    values, std = (dict(numbers) for numbers in (flat.values, flat.std))
    for effect in plane.discovery.fitted.effects:
        for numbers in (values, std):
            own = {p.name: numbers.pop(f"{effect.name}.{p.name}") for p in effect.parameters}
            # a factor of −1 turns the sign of a size, not of its standard error
            there = values_in_space(effect, own)
            numbers |= {f"{effect.name}.{k}": abs(v) if numbers is std else v for k, v in there.items()}
    return {
        name: (values[name], std[name], deep.values[name], deep.std[name])
        for name in values
        if name in deep.values and name != CONTACT_TIME.name and std.get(name, 0.0) > 0.0
    }


def told_lifted(row: dict) -> str:
    """A row in words."""
    return f"{row['plane']}, {row['in_plane'] or 'nothing'}; in space {row['space']}, {row['in_space'] or 'nothing'}"


def lifted_as_markdown(store: Rows = LIFTED_ROWS) -> str:
    """The rows as a Markdown table, and the number of sets on which plane and space agree."""
    try:
        rows = store.table()
    except UserError:
        return f"None of the {len(LIFTED)} sets is computed yet: `{store.command}`."
    same = (rows["plane"] == rows["space"]) & (rows["in_plane"] == rows["in_space"])
    near = rows["apart"].astype(float) <= 1.0
    lines = [
        (f"`{r['truth']}`", r["shape"], told_lifted(r), f"{float(r['apart']):.2g}") for r in rows.to_dict("records")
    ]
    head = ("hidden", "shape", "verdict and effects", "sizes apart, in standard errors")
    agree = f"The same verdict and effects: {count(int(same.sum()), len(rows))}; sizes within one standard error: "
    return f"{markdown(head, lines)}\n\n{agree}{count(int(near.sum()), len(rows))}; {len(rows)} of {len(LIFTED)} sets."
