"""Models that are fitted directly: rows of one series, the store, and the documents that hold the table."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hidden_effects import recorded

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.simulate.rig.hidden_causes import SQUARE, HiddenCauses
from thesis_lib.studies.proof import direct_fits
from thesis_lib.studies.proof.__main__ import main
from thesis_lib.studies.proof.direct_fits import ROWS, SERIES, Series, rows, tables

ROOT = Path(__file__).resolve().parents[3]
OFFSET = 0.05


@pytest.fixture(scope="module")
def square() -> Dataset:
    """60 drops of a square, the angle of which the camera misreads."""
    return recorded(SQUARE, 60, 0, "square", hidden=HiddenCauses(angle_offset=OFFSET))


@pytest.mark.slow
def test_effects_are_added_and_judged_on_other_trials(monkeypatch, square):
    models = ("mirtich", "mirtich+angle_offset")
    monkeypatch.setitem(SERIES, "square", Series("planar_square", models, episodes=True))
    law, whole = rows("square", square)
    assert set(law) <= set(ROWS.columns) and (law["model"], whole["model"]) == models
    assert law["gain"] == 0.0 < whole["gain"]
    assert whole["error"] < 0.5 * law["error"] and whole["error"] < 1.5 * whole["noise_floor"]
    hits = whole["single"] - whole["error"], whole["error"] - whole["episodes"]
    assert hits[0] * hits[1] > 0.0  # the mean of all lies between those of single hits and of episodes
    assert whole["used"] < whole["detected"]
    found = dict(part.split(" ", 1) for part in whole["parameters"].split("; "))
    value, error = (float(text) for text in found["angle_offset.d_theta"].split(" ± "))
    assert abs(value - OFFSET) < 4.0 * error


def test_drops_of_a_simulator_are_all_fitted_and_judged(monkeypatch, square):
    monkeypatch.setitem(SERIES, "square", Series("mechanism", ("mirtich",)))
    (law,) = rows("square", square)
    assert "learned" not in law and law["single"] == law["error"] and np.isnan(law["episodes"])


def test_rows_are_replaced_and_kept_in_order(tmp_path):
    names, path = list(SERIES), tmp_path / "rows.csv"
    row = dict.fromkeys(ROWS.columns, 1.0) | {"model": "mirtich", "parameters": "mu 0.1 ± 0.01", "flat_hits": 0}
    for name, error in ((names[-1], 0.3), (names[0], 0.2), (names[0], 0.1)):
        ROWS.at(path).put(row | {"drops": name, "error": error})
    assert pd.read_csv(path)["drops"].tolist() == [names[0], names[-1]]
    assert pd.read_csv(path)["error"].tolist() == [0.1, 0.3]
    assert any("| Mirtich | 0.100 |" in table for table in tables(path))


def test_all_series_are_stored():
    stored = pd.read_csv(ROWS.path)
    assert [(row.drops, row.model) for row in stored.itertuples()] == [
        (name, model) for name, series in SERIES.items() for model in series.models
    ]


def test_what_is_fitted_to_whole_tosses_predicts_other_tosses_better():
    hits, tosses = (
        direct_fits.numbers(column).set_index(["drops", "model", "name"])["value"] for column in ("tosses", "refitted")
    )
    wanted = {(name, model) for name, series in SERIES.items() for model in series.to_tosses}
    assert {key[:2] for key in tosses.index} == wanted and wanted
    for key in wanted:
        for number in ("pos_int_percent", "angle_int_deg"):
            assert tosses[(*key, number)] < hits[(*key, number)]


def test_the_command_prints_the_table(capsys):
    assert main(["direct-fits", "table"]) == 0
    assert capsys.readouterr().out == "\n\n".join(tables()) + "\n"


def test_a_bound_is_stored_as_one_and_has_no_standard_error(tmp_path):
    told = {
        "mu": {"value": 0.058, "std": None, "unit": "1", "bound": "lower", "range": [0.0, 2.0]},
        "epsilon": {"value": 0.5, "std": 0.01, "unit": "1"},
    }
    fitted = SimpleNamespace(model=SimpleNamespace(fitted_parameters=told), content=told.__getitem__)
    stored = direct_fits.told_parameters(fitted)
    assert stored == ["mu at least 0.058", "epsilon 0.500 ± 0.010"]
    path = tmp_path / "stored.csv"
    pd.DataFrame([{"drops": "square", "model": "mirtich", "parameters": "; ".join(stored)}]).to_csv(path)
    assert direct_fits.parameters(path)[["name", "value", "std"]].to_numpy().tolist() == [["epsilon", 0.5, 0.01]]
