"""The proof of the comparison: its cases, its store, and what it counts."""

import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.rows import STAMP
from thesis_lib.studies.proof import engines, measured_models
from thesis_lib.studies.proof.cases import BODIES


def row(engine="mujoco", truth="tilt", seed=1, **more):
    found = {"engine": engine, "shape": "square", "truth": truth, "seed": seed, "verdict": "effects", "named": truth}
    numbers = {
        "own": 0.011,
        "other": 0.1,
        "floor": 0.010,
        "ratio_default": 2.0,
        "ratio_before": 1.3,
        "ratio_after": 1.05,
    }
    return found | numbers | {"best": engine, "mu": 0.2, "mu_std": 0.001} | more


def test_a_part_of_the_table_is_mixed_as_the_whole():
    every = engines.cases(5)
    assert len(every) == len(set(every)) == 5 * len(engines.ENGINES) * len(BODIES) * len(engines.TRUTHS)
    first = every[: len(every) // 5]
    assert {(c.engine, c.shape, c.truth) for c in first} == {(c.engine, c.shape, c.truth) for c in every}


def test_shares_count_each_question(tmp_path):
    store = engines.ROWS.at(tmp_path / "engines.csv")
    with pytest.raises(UserError, match="contains no rows"):
        engines.as_markdown(store)
    made = (row(), row(seed=2, best="drake", own=0.02), row("drake", ratio_before=1.02), row(seed=3, ratio_after=1.2))
    store.put(*made)
    lines = engines.as_markdown(store).splitlines()
    assert lines[2] == "| drake | tilt | 1 of 1 | 1 of 1 | 0 of 1 | 1 of 1 | 1 of 1 |"
    assert lines[3] == "| mujoco | tilt | 2 of 3 | 2 of 3 | 0 of 3 | 0 of 3 | 2 of 3 |"
    assert lines[4].startswith("| both | all | 3 of 4 (30 to 95 %) | 3 of 4 ")
    assert lines[5] == "| both | all: median factor between their μ |  |  | 2 | 1.3 | 1.05 |"


@pytest.mark.slow
def test_a_dataset_goes_through_critique_and_comparison_into_a_row(tmp_path, monkeypatch):
    monkeypatch.setattr(engines, "DROPS", 24)
    computed = engines.compute(engines.EngineCase("mujoco", "ellipse", "nothing", 3))
    assert (*computed, *STAMP) == engines.ROWS.columns
    assert computed["best"] == "mujoco" and computed["own"] < 2.0 * computed["floor"] < computed["other"]
    assert abs(computed["mu"] - engines.MU) < 5.0 * computed["mu_std"] and computed["ratio_before"] >= 1.0


@pytest.mark.slow
def test_a_case_is_made_the_same_each_time_and_hides_its_cause():
    one, two, plain = (
        engines.make(engines.EngineCase("mujoco", "ellipse", truth, 1), drops=4)
        for truth in ("com_offset_x", "com_offset_x", "nothing")
    )
    assert one.digest() == two.digest() != plain.digest()
    assert one.header.body == plain.header.body


def test_rows_of_a_measured_set_become_a_table(tmp_path):
    numbers = dict.fromkeys(measured_models.ROUNDED, 0.25)
    planar = numbers | {name: float("nan") for name in numbers if name.startswith(("position", "angle"))}
    one = {"dataset": "die", "trials": 9, "named": "", "effects": "without", "lacks": ""} | planar
    store = measured_models.ROWS.at(tmp_path / "m.csv")
    for model, kind, more in (
        ("drake:default", "friction", {"error": 0.5, "lacks": "wear + com_offset", "noise_floor": float("nan")}),
        ("mirtich", "law", {"error": 0.1, "contact_time": float("nan")}),
    ):
        store.put(one | {"model": model, "kind": kind} | more)
    assert measured_models.as_markdown(store, planar=False).startswith("None is compared yet")
    store.put(one | numbers | {"dataset": "box", "model": "mirtich", "kind": "law", "angle": 1.5})
    lines = measured_models.as_markdown(store, planar=False).splitlines()
    assert len(lines) == 3 and "| tosses: position, % | angle, ° |" in lines[0] and "| 0.250 | 1.50 |" in lines[2]
    lines = measured_models.as_markdown(store).splitlines()
    assert len(lines) == 4
    assert lines[2].startswith("| die, 9 | Mirtich | without | 0.100 (0.250 to 0.250) | 0.250 | 0.250 | 0.250 |  |  |")
    assert "at its defaults, friction fitted | without | 0.500" in lines[3]
    assert "| unknown |" in lines[3] and lines[3].endswith("| 250 ms | wear, displaced centre of mass |")
