"""The proof: where results lie, that stored ones are kept, and how they are counted."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thesis_lib.critique import proof
from thesis_lib.critique.proof import DEVELOPMENT, NOTHING, SEEDS, Case, law_size, make, truths
from thesis_lib.critique.proof_table import confusion
from thesis_lib.effects import EFFECTS
from thesis_lib.errors import UserError
from thesis_lib.simulate.mechanisms import CAUSES


def outside_the_library() -> str:
    return next(name for name, cause in CAUSES.items() if not cause.effects)


def test_every_case_has_a_path_of_its_own():
    cases = [
        Case(source, truth, seed, drops, noise)
        for source in ("law", "mechanism")
        for truth in truths(source)
        for seed in (SEEDS, SEEDS + 1)
        for drops in (50, 150)
        for noise in (1.0, 5.0)
    ]
    assert len({case.path for case in cases}) == len(cases)
    assert not any(case.path.is_absolute() for case in cases)
    assert Case("law", "wear", 1003).path == Path("law/wear/drops150_noise1/1003.json")
    assert Case("mechanism", NOTHING, 1000, 50, 5.0).path == Path(
        "mechanism/nothing/drops50_noise5/1000.json"
    )


def test_the_table_uses_no_seed_of_the_tuning():
    assert SEEDS not in DEVELOPMENT and max(DEVELOPMENT) < SEEDS


def test_truths_and_what_counts_as_right():
    assert truths("law")[0] == truths("mechanism")[0] == NOTHING
    assert set(truths("law")[1:]) == set(EFFECTS)
    assert Case("law", NOTHING, 0).expected == ()
    assert Case("law", "wear", 0).expected == ("wear",)
    for cause in CAUSES:
        assert set(Case("mechanism", cause, 0).expected) <= set(EFFECTS)


def test_every_law_has_a_size_within_its_bounds():
    for name, effect in EFFECTS.items():
        size = law_size(name)
        for p in effect.parameters:
            assert p.low <= size[p.name] <= p.high
            assert size[p.name] != p.null, name


def test_a_case_is_made_the_same_each_time():
    case = Case("law", "sensor_drift", 3, drops=12)
    (one, true), (two, _) = make(case), make(case)
    assert one.digest() == two.digest()
    assert true == law_size("sensor_drift")
    other, none = make(Case("law", NOTHING, 3, drops=12))
    assert none == {} and other.digest() != one.digest()
    assert make(Case("law", "sensor_drift", 4, drops=12))[0].digest() != one.digest()


def test_a_stored_result_is_not_computed_again(tmp_path, monkeypatch):
    calls = []

    def refuse(dataset, **kwargs):
        calls.append(dataset)
        raise UserError("too few impacts\nmeasure more")

    monkeypatch.setattr(proof, "criticise", refuse)
    case = Case("law", NOTHING, 5, drops=12)
    first = proof.run(case, tmp_path)
    assert first["verdict"] == "refused" and first["why"] == "too few impacts"
    assert json.loads((tmp_path / case.path).read_text()) == first
    written = (tmp_path / case.path).read_bytes()
    assert proof.run(case, tmp_path) == first
    assert len(calls) == 1 and (tmp_path / case.path).read_bytes() == written
    proof.run(Case("law", NOTHING, 6, drops=12), tmp_path)
    assert len(calls) == 2


@pytest.mark.slow
def test_a_hidden_effect_is_found_and_its_result_holds_what_the_table_needs(tmp_path):
    case = Case("law", "wrong_gravity", 2, drops=50)  # a development seed
    result = proof.run(case, tmp_path)
    assert result["verdict"] == "effects" and result["right"]
    assert result["steps"][0][0] == "wrong_gravity"
    p = (
        result["parameters"]["dg"]
        if "dg" in result["parameters"]
        else next(iter(result["parameters"].values()))
    )
    assert abs(p["found"] - p["true"]) < 4.0 * p["std"]
    assert str(tmp_path) not in (tmp_path / case.path).read_text()
    table = confusion(tmp_path)
    assert len(table) == 1 and table["right"].iloc[0] == 1.0


def store(folder: Path, source: str, truth: str, seed: int, **content) -> None:
    case = Case(source, truth, seed)
    path = folder / case.path
    path.parent.mkdir(parents=True, exist_ok=True)
    fields = {"source": source, "truth": truth, "seed": seed, "drops": 150, "noise": 1.0}
    path.write_text(json.dumps(fields | content))


def error(base: float, augmented: float) -> dict:
    return {"base": base, "augmented": augmented, "floor": 0.01}


@pytest.fixture
def table(tmp_path) -> pd.DataFrame:
    wear = {"error": error(0.1, 0.02), "verdict": "effects"}
    near = {"w": {"true": 0.2, "found": 0.21, "std": 0.01}}
    far = {"w": {"true": 0.2, "found": 0.25, "std": 0.01}}
    store(tmp_path, "law", "wear", 1, right=True, steps=[["wear"]], parameters=near, **wear)
    store(tmp_path, "law", "wear", 2, right=True, steps=[["wrong_size", "wear"]], parameters={}, **wear)
    store(tmp_path, "law", "wear", 3, right=True, steps=[["wear"]], parameters=far, **wear)
    store(
        tmp_path,
        "law",
        "wear",
        4,
        right=False,
        steps=[],
        parameters={},
        verdict="adequate",
        error=error(1, 1),
    )
    for seed, verdict in enumerate(("adequate", "adequate", "effects")):
        store(tmp_path, "law", NOTHING, seed, right=False, steps=[], verdict=verdict, error=error(0.1, 0.1))
    for seed, verdict in enumerate(("unexplained", "adequate")):
        store(tmp_path, "mechanism", outside_the_library(), seed, right=False, steps=[], verdict=verdict)
    store(tmp_path, "mechanism", NOTHING, 9, verdict="refused", why="too few")
    return confusion(tmp_path).set_index(["source", "truth"])


def test_right_is_first_or_in_the_group_named_first(table):
    row = table.loc[("law", "wear")]
    assert row["n"] == 4 and row["right"] == 0.75
    assert row["group_size"] == pytest.approx(4.0 / 3.0)
    assert row["named_first"] == "wear:2;wrong_size:1"
    assert row["verdicts"] == "adequate:1;effects:3"
    assert row["coverage"] == 0.5
    assert row["error_before"] == pytest.approx(0.1) and row["floor"] == pytest.approx(0.01)
    assert row["error_after"] == pytest.approx(0.02)


def test_nothing_hidden_is_right_when_adequate(table):
    assert table.loc[("law", NOTHING), "right"] == pytest.approx(2.0 / 3.0)
    assert np.isnan(table.loc[("law", NOTHING), "coverage"])


def test_outside_the_library_is_right_when_unexplained(table):
    assert table.loc[("mechanism", outside_the_library()), "right"] == 0.5


def test_a_refusal_is_counted_and_not_right(table):
    row = table.loc[("mechanism", NOTHING)]
    assert row["n"] == 1 and row["right"] == 0.0 and row["verdicts"] == "refused:1"


def test_intervals_are_wilson_s(table):
    from scipy.stats import binomtest

    low, high = binomtest(3, 4).proportion_ci(method="wilson")
    row = table.loc[("law", "wear")]
    assert row["right_low"] == pytest.approx(low, abs=1e-4)
    assert row["right_high"] == pytest.approx(high, abs=1e-4)
    assert (table["right_low"] <= table["right"]).all() and (table["right"] <= table["right_high"]).all()
