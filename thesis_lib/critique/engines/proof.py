"""The proof of the comparison: drops that an engine made, hidden from the fits; is it recognised, and right?

A dataset is made by MuJoCo or by Drake (point contact), with nothing or one cause hidden, and goes through the critique
and the comparison of both engines.  Asked:

    recognised   the engine that made the drops errs least of both, with the effects that were named
    adequate     with nothing hidden, or with the hidden cause named, it errs by no more than `ENOUGH` noise floors
    agree        with the named effects the engines' μ are within a tenth

config/proof/engines.csv holds a row per dataset:

| column                          | unit | meaning                                                          |
|---------------------------------|------|------------------------------------------------------------------|
| engine, shape, truth, seed      |      | the dataset                                                      |
| verdict, named                  |      | of the critique; effects joined by +                             |
| best                            |      | engine that errs least with them                                 |
| own, other, floor               | m/s  | held-out error of the engine that made the drops, of the other   |
| ratio_default                   | 1    | μ of the engines, larger over smaller: default contact, μ fitted |
| ratio_before, ratio_after       | 1    | with the contact fitted, too, without and with the named effects |
| mu, mu_std                      | 1    | of the engine that made the drops                                |
| code, made                      |      | hash of the code that made the row, empty: unknown; date         |
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import STAMP, put_row, read_rows, stamp
from thesis_lib.statistics.intervals import wilson

if TYPE_CHECKING:
    import pandas as pd

    from thesis_lib.datasets.format.dataset import Dataset

STORE = Path(__file__).resolve().parents[3] / "config" / "proof" / "engines.csv"
SEEDS = 1000  # the table's begin here
ENGINES = ("mujoco", "drake")
SHAPES = ("ellipse", "square")
NOTHING = "nothing"
TRUTHS = {NOTHING: 0.0, "com_offset_x": 1e-3, "size_error": 0.05, "tilt": 0.1}  # and sizes: twice those of `CAUSES`
DROPS = 60
MU, EPSILON, CONTACT_TIME = 0.2, 0.6, 1e-3
ENOUGH, AGREE = 1.5, 1.1
ASKED = ("recognised", "adequate", "agreed_default", "agreed_before", "agree")
KEY = ("engine", "shape", "truth", "seed")
RATIOS = ("ratio_default", "ratio_before", "ratio_after")
COLUMNS = (*KEY, "verdict", "named", "best", "own", "other", "floor", *RATIOS, "mu", "mu_std", *STAMP)


@dataclass(frozen=True)
class EngineCase:
    """One dataset."""

    engine: str
    shape: str
    truth: str
    seed: int


def cases(seeds: int) -> list[EngineCase]:
    """The whole table, `seeds` of each engine and shape and truth, mixed: a part of it is like the whole."""
    return [
        EngineCase(engine, shape, truth, SEEDS + i)
        for i in range(seeds)
        for truth in TRUTHS
        for engine in ENGINES
        for shape in SHAPES
    ]


def make(case: EngineCase, drops: int = DROPS) -> "Dataset":
    """The drops of a case, as a rig records them."""
    from thesis_lib.datasets.format.dataset import Dataset
    from thesis_lib.simulate.rig.hidden_causes import (
        ELLIPSE_BODY,
        PROOF_RELEASE,
        RIG_NOISE,
        SQUARE,
        CompliantContact,
        HiddenCauses,
    )

    body = {"ellipse": ELLIPSE_BODY, "square": SQUARE}[case.shape]
    hidden: dict[str, Any] = {} if case.truth == NOTHING else {case.truth: TRUTHS[case.truth]}
    rng = generator(case.seed, "engines proof", case.engine, case.shape, case.truth)
    contact: dict[str, Any] = {"mu": MU, "epsilon": EPSILON, "contact_time": CONTACT_TIME}
    if case.engine == "mujoco":
        from thesis_lib.simulate.mujoco.causes import MujocoCauses
        from thesis_lib.simulate.mujoco.contact import MujocoContact
        from thesis_lib.simulate.mujoco.drops import simulate_mujoco_drops

        own: dict[str, Any] = {"contact": MujocoContact(**contact), "hidden": MujocoCauses(**hidden)}
        made = simulate_mujoco_drops(body, PROOF_RELEASE, drops, noise=RIG_NOISE, rng=rng, **own)
    else:
        from thesis_lib.simulate.drake.drops import simulate_drake_drops

        own = {"contact": CompliantContact(**contact), "hidden": HiddenCauses(**hidden), "surface": "point"}
        made = simulate_drake_drops(body, PROOF_RELEASE, drops, noise=RIG_NOISE, rng=rng, **own)
    return Dataset("proof", made.header, made.trajectories)


def compute(case: EngineCase) -> dict[str, object]:
    """Criticise, compare both engines, and sum up: a row of the table."""
    from thesis_lib.critique.drops.criticise import whole_critique
    from thesis_lib.critique.engines.compare import WITH, WITHOUT, compare_models, spread

    rng = generator(case.seed, "engines proof critique", case.engine, case.shape, case.truth)
    judged = whole_critique(make(case, DROPS), rng=rng)
    table = compare_models(judged, ENGINES)
    label = WITH if judged.ladder[-1][1].effects else WITHOUT
    last = table[(table["effects"] == label) & (table["kind"] == "engine")].set_index("model")
    own = last.loc[case.engine]
    numbers = {
        "own": own["error"],
        "other": last["error"].drop(case.engine).min(),
        "floor": own["noise_floor"],
        "ratio_default": spread(table, WITHOUT, "friction"),
        "ratio_before": spread(table, WITHOUT),
        "ratio_after": spread(table, label),
        "mu": own["mu"],
        "mu_std": own["mu_std"],
    }
    named = "+".join(step.effect.name for step in judged.discovery.steps)
    row: dict[str, object] = {**vars(case), "verdict": judged.verdict, "named": named}
    row["best"] = str(last["error"].idxmin())
    return row | {name: float(f"{value:.4g}") for name, value in numbers.items()} | stamp(__file__)


def run(todo: Sequence[EngineCase], jobs: int, say: Callable[[str], None] = print, store: Path = STORE) -> None:
    """Compute the cases that are not stored yet, several at a time; each is stored as it ends."""
    done = {tuple(row) for row in read_rows(store, COLUMNS)[list(KEY)].itertuples(index=False)}
    left = [case for case in todo if tuple(vars(case).values()) not in done]
    say(f"{len(todo) - len(left)} of {len(todo)} are stored, {len(left)} to compute, about 40 s of CPU each")
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for i, future in enumerate(as_completed([pool.submit(compute, case) for case in left]), 1):
            row = future.result()
            put_row(row, KEY, store, COLUMNS)
            where = " ".join(str(row[name]) for name in KEY)
            say(f"{i} of {len(left)}  {where}: {row['best']}, {row['named'] or 'nothing named'}")


def shares(table: "pd.DataFrame") -> "pd.DataFrame":
    """Counts of what is asked, by engine and by what was hidden: hits and n of each question."""
    import pandas as pd

    if table.empty:
        raise UserError("The proof of engines holds no row: python -m thesis_lib.critique.engines run.")
    right = table.assign(
        recognised=table["best"] == table["engine"],
        adequate=table["own"] < ENOUGH * table["floor"],
        agree=table["ratio_after"].astype(float) < AGREE,
        agreed_before=table["ratio_before"].astype(float) < AGREE,
        agreed_default=table["ratio_default"].astype(float) < AGREE,
    )
    rows = []
    for (engine, truth), part in right.groupby(["engine", "truth"], sort=False):
        counts = {name: int(part[name].sum()) for name in ASKED}
        rows.append({"engine": engine, "hidden": truth, "n": len(part)} | counts)
    return pd.DataFrame(rows)


def as_markdown(table: "pd.DataFrame") -> str:
    """The shares as a table of a page, and their sums with 95 % intervals."""
    counted = shares(table)
    head = "| drops of | hidden | recognised | adequate | μ agree: default contact | contact fitted | effects, too |"
    lines = [head, "|---|---|---|---|---|---|---|"]
    for row in counted.to_dict("records"):
        cells = [f"{row[name]} of {row['n']}" for name in ASKED]
        lines.append(f"| {row['engine']} | {row['hidden']} | {' | '.join(cells)} |")
    n, sums = int(counted["n"].sum()), []
    for name in ASKED:
        low, high = wilson(int(counted[name].sum()), n)
        sums.append(f"{counted[name].sum()} of {n} ({100 * low:.0f} to {100 * high:.0f} %)")
    lines.append(f"| both | all | {' | '.join(sums)} |")
    medians = [f"{table[name].astype(float).median():.3g}" for name in RATIOS]
    lines.append(f"| both | all: median factor between their μ | | | {' | '.join(medians)} |")
    return "\n".join(lines)
