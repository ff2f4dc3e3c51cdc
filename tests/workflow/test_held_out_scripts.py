"""The scripts of the impact study, run on a small dataset: what identification saw is never judged on."""

import runpy
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from known_truth import K_G, MASS, SHAPE, falling_ellipses
from pipeline_copy import ROOT

from thesis_lib.bodies.body import Body
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.thesis.impact_study.settings import Chapter3

TABLES = ("ensemble", "convergence", "topography", "individual", "split")
JUDGED = ("errors", "summary", "table_3_1", "table_3_2", "coverage", "statements")
SETTINGS = Chapter3(
    bootstrap=2, convergence={"sizes": (5, 10), "subsets": 2}, topography={"points": 5, "n": 10}
).model_dump(mode="json")


def small_dataset(folder) -> None:
    """40 trials of one or two impacts that AP Newton made, with a little noise."""
    pairs = falling_ellipses(np.random.default_rng(3), 80, "anitescu_potra_newton", 0.1, 0.5, noise=0.02)
    table = pairs.select((pairs.impact == 0) | (pairs.trial % 2 == 1)).to_table()
    body = Body(shape=SHAPE, mass=MASS, radius_of_gyration=K_G)
    write_dataset(Dataset("small", Header(schema=1, body=body, rate=250.0), None, table), folder)


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> dict[str, pd.DataFrame]:
    """Tables that the scripts ch3_identify and ch3_evaluate write for the small dataset."""
    folder = tmp_path_factory.mktemp("study")
    small_dataset(folder / "small")
    paths = {name: str(folder / f"{name}.csv") for name in (*TABLES, *JUDGED)}
    source = {"header": str(folder / "small" / "dataset.yaml"), "left_out": str(folder / "left_out.csv")}
    pd.DataFrame({"trial": [0], "impact": [1], "reason": "second_hit"}).to_csv(source["left_out"], index=False)
    for script, inputs, outputs in (
        ("ch3_identify", (), TABLES),
        ("ch3_evaluate", ("ensemble", "individual", "split", "topography", "convergence"), JUDGED),
    ):
        job = SimpleNamespace(
            input=SimpleNamespace(**source, **{name: paths[name] for name in inputs}),
            output=SimpleNamespace(**{name: paths[name] for name in outputs}),
            params=SimpleNamespace(settings=SETTINGS, seed=1),
            wildcards=SimpleNamespace(dataset="small"),
            log=[str(folder / f"{script}.log")],
        )
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("__main__.snakemake", job, raising=False)
            patch.delitem(sys.modules, "thesis_lib.thesis.job", raising=False)
            for stream in ("stdout", "stderr"):  # scripts send both to their log
                patch.setattr(sys, stream, getattr(sys, stream))
            runpy.run_path(str(ROOT / f"workflow/scripts/chapter3/{script}.py"))
            sys.stdout.close()
    return {name: pd.read_csv(path) for name, path in paths.items()}


def keys(table: pd.DataFrame) -> set[tuple[int, int]]:
    return set(zip(table["trial"], table["impact"]))


@pytest.mark.slow
def test_errors_are_those_of_held_out_impacts_only(results):
    split = results["split"]
    training, held_out = keys(split[split["train"] == 1]), keys(split[split["train"] == 0])
    assert len(training) > 10 and len(held_out) > 10
    assert not keys(results["errors"]) & training
    assert keys(results["errors"]) == held_out
    # a trial is wholly on one side
    assert not {trial for trial, _ in training} & {trial for trial, _ in held_out}


@pytest.mark.slow
def test_tables_count_what_was_trained_on_and_what_was_judged(results):
    train = results["split"]["train"]
    for name in ("n_train", "n_held_out"):
        (count,) = results["table_3_1"][name].unique()
        assert count == (train == (name == "n_train")).sum()
    assert set(results["ensemble"]["n"]) == {train.sum()}
    assert (results["summary"]["n"] + results["summary"]["n_failed"] == (train == 0).sum()).all()
    assert results["convergence"]["k"].max() <= train.sum()


def test_statements_hold_what_the_ledger_reads(results):
    """One row each, of every statement that a claim about the measured impacts names."""
    from thesis_lib.thesis.ledger.format import read_ledger

    found = results["statements"].fillna({"law": ""})
    assert not found[["statement", "law"]].duplicated().any()
    named = {(str(s), str(law)) for s, law in zip(found["statement"], found["law"])}
    wanted = set()
    for claim in read_ledger(ROOT / "config/claims").claims:
        where = claim.source.where
        if claim.source.file == "chapter3/planar_impact/statements.csv" and "law" in where:
            wanted.add((where["statement"], where["law"]))
    depends_on_the_data = {("mu_zero_offset", "anitescu_potra_newton")}  # only if some impact has μ = 0
    assert len(wanted) > 30 and wanted - depends_on_the_data <= named
