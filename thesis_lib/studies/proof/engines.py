"""The proof of the comparison of engines: is the engine that made the drops recognised, and does it fit them?

A dataset is made by MuJoCo or by Drake (point contact), with nothing or one cause hidden.  The critique and the
comparison of both engines then analyse it without using its origin.  The questions:

    recognised   of both engines, the engine that made the drops has the smaller error, with the named effects
    adequate     with the named effects, the error of that engine is less than `ENOUGH` noise floors
    agree        with the named effects the engines' μ agree within a tenth

config/proof/engines.csv holds a row per dataset:

| column                          | unit | meaning                                                          |
|---------------------------------|------|------------------------------------------------------------------|
| engine, shape, truth, seed      |      | the dataset                                                      |
| verdict, named                  |      | of the critique; effects joined by +                             |
| best                            |      | engine with the smallest error with these effects                |
| own, other, floor               | m/s  | held-out error of that which made the drops, of the other; noise |
| ratio_default                   | 1    | μ of the engines, larger over smaller: default contact, μ fitted |
| ratio_before, ratio_after       | 1    | with the contact also fitted, without and with the named effects |
| mu, mu_std                      | 1    | of the engine that made the drops                                |
| code, made                      |      | hash of the code that made the row, empty: unknown; date         |
"""

from dataclasses import dataclass

import pandas as pd

from thesis_lib.critique.drops.criticise import criticise_drops
from thesis_lib.critique.engines.compare import WITH, WITHOUT, compare_models, spread
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.foundation.markdown import table
from thesis_lib.foundation.randomness import generator
from thesis_lib.foundation.rows import Rows
from thesis_lib.simulate.compliant.drops import simulate_compliant_drops
from thesis_lib.simulate.mujoco.contact import MujocoContact
from thesis_lib.simulate.mujoco.drops import DropsInMujoco
from thesis_lib.simulate.rig.hidden_causes import PROOF_RELEASE, RIG_NOISE, HiddenCauses
from thesis_lib.statistics.wording import count
from thesis_lib.studies.proof.cases import BODIES
from thesis_lib.studies.proof.store import NOTHING, stored, with_effects

SEEDS = 1000  # first seed of the table
ENGINES = ("mujoco", "drake")
TRUTHS = {NOTHING: 0.0, "com_offset_x": 1e-3, "size_error": 0.05, "tilt": 0.1}  # hidden causes; sizes twice `CAUSES`
DROPS = 60
MU, EPSILON, CONTACT_TIME = 0.2, 0.6, 1e-3
ENOUGH, AGREE = 1.5, 1.1
ASKED = ("recognised", "adequate", "agreed_default", "agreed_before", "agree")
RATIOS = ("ratio_default", "ratio_before", "ratio_after")
FOUND = ("verdict", "named", "best", "own", "other", "floor", *RATIOS, "mu", "mu_std")
ROWS = stored("engines", ("engine", "shape", "truth", "seed"), FOUND, "engines run", digits=4)


@dataclass(frozen=True)
class EngineCase:
    """One dataset of the table."""

    engine: str
    shape: str
    truth: str
    seed: int


def cases(seeds: int = 5, first: int = SEEDS) -> list[EngineCase]:
    """All datasets of the table, `seeds` for each engine, shape and truth, mixed: any part represents the whole."""
    return [
        EngineCase(engine, shape, truth, first + i)
        for i in range(seeds)
        for truth in TRUTHS
        for engine in ENGINES
        for shape in BODIES
    ]


def make(case: EngineCase, drops: int = DROPS) -> Dataset:
    """Simulate the drops of a case as a rig would record them."""
    from thesis_lib.simulate.drake.drops import DropsInDrake

    made = simulate_compliant_drops(
        BODIES[case.shape],
        PROOF_RELEASE,
        drops,
        contact=MujocoContact(mu=MU, epsilon=EPSILON, contact_time=CONTACT_TIME),
        hidden=HiddenCauses.model_validate({} if case.truth == NOTHING else {case.truth: TRUTHS[case.truth]}),
        noise=RIG_NOISE,
        rng=generator(case.seed, "engines proof", case.engine, case.shape, case.truth),
        engine=DropsInMujoco() if case.engine == "mujoco" else DropsInDrake("point"),
    )
    return Dataset("proof", made.header, made.trajectories)


def compute(case: EngineCase) -> dict[str, object]:
    """Criticise the dataset of a case and compare both engines on it; return a row of the table."""
    rng = generator(case.seed, "engines proof critique", case.engine, case.shape, case.truth)
    judged = criticise_drops(make(case, DROPS), rng=rng)
    models = compare_models(judged, ENGINES)
    label = WITH if judged.ladder[-1][1].effects else WITHOUT
    last = models[(models["effects"] == label) & (models["kind"] == "engine")].set_index("model")
    own = last.loc[case.engine]
    return {
        **vars(case),
        "verdict": judged.verdict,
        "named": with_effects(judged),
        "best": str(last["error"].idxmin()),
        "own": own["error"],
        "other": last["error"].drop(case.engine).min(),
        "floor": own["noise_floor"],
        "ratio_default": spread(models, WITHOUT, "friction"),
        "ratio_before": spread(models, WITHOUT),
        "ratio_after": spread(models, label),
        "mu": own["mu"],
        "mu_std": own["mu_std"],
    }


def told(row: dict) -> str:
    """A row in words."""
    return f"{row['best']}, {row['named'] or 'nothing named'}"


def shares(rows: pd.DataFrame) -> pd.DataFrame:
    """Number of datasets for which each question (`ASKED`) is answered yes, and n, by engine and hidden cause."""
    right = rows.assign(
        recognised=rows["best"] == rows["engine"],
        adequate=rows["own"] < ENOUGH * rows["floor"],
        agree=rows["ratio_after"].astype(float) < AGREE,
        agreed_before=rows["ratio_before"].astype(float) < AGREE,
        agreed_default=rows["ratio_default"].astype(float) < AGREE,
    )
    by = right.groupby(["engine", "truth"], sort=False)
    return by[list(ASKED)].sum().assign(n=by.size()).reset_index()


def as_markdown(store: Rows = ROWS) -> str:
    """The shares as a Markdown table, with totals and 95 % intervals; UserError if no rows are stored."""
    rows = store.table()
    counted = shares(rows)
    head = ("drops of", "hidden", "recognised", "adequate", "μ agree: default contact", "contact fitted")
    lines = [
        (row["engine"], row["truth"], *(f"{row[name]} of {row['n']}" for name in ASKED))
        for row in counted.to_dict("records")
    ]
    lines.append(("both", "all", *(count(counted[name].sum(), counted["n"].sum()) for name in ASKED)))
    medians = (f"{rows[name].astype(float).median():.3g}" for name in RATIOS)
    lines.append(("both", "all: median factor between their μ", "", "", *medians))
    return table((*head, "effects, too"), lines)
