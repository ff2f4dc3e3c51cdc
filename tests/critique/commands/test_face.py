"""The face of the library: one call from data to a `Critique`, which answers in short, predicts, draws, and says no.

A few bounces give restitution with its standard error, exit code 0 and no verdict.
"""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bouncing_disk import bouncing
from hidden_effects import E_T, injected_impacts
from matplotlib.figure import Figure

from thesis_lib.__main__ import main
from thesis_lib.critique import TooFew, criticise, fit
from thesis_lib.critique.drops.own_restitution import OwnRestitution
from thesis_lib.critique.result import OfDrops
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.write import write_dataset
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.records.catalogue import records

WITHIN = 4.0  # standard errors; by chance once in 16,000
EPSILON = 0.7
FILES = {"impacts.csv", "comparison.csv", "diagnosis.json", "model.json", "report.html"}


def test_summary_dict_and_folder_say_the_same_in_any_order_and_in_a_line(of_impacts, without_page, tmp_path):
    assert repr(of_impacts).startswith("<Critique of hidden_impacts: effects (tangential_restitution), held-out error")
    assert len(repr(of_impacts)) < 120 and "\n" not in repr(of_impacts)
    first = of_impacts.summary()
    content = of_impacts.save(tmp_path)
    assert content == of_impacts.to_dict() == json.loads((tmp_path / "diagnosis.json").read_text())
    assert first == of_impacts.summary() and first.startswith("hidden_impacts: effects\n  ")
    assert all(sentence in first for sentence in content["summary"])


def test_it_predicts_as_its_file_does(of_impacts, tmp_path):
    states = {"x": [0.0], "y": [0.03], "theta": [0.3], "vx": [0.5], "vy": [-2.0], "omega": [5.0]}
    of_impacts.model.save(tmp_path / "model.json")
    expected = load_model(tmp_path / "model.json").predict(pd.DataFrame(states))
    pd.testing.assert_frame_equal(of_impacts.predict(states), expected)
    with pytest.raises(UserError, match="lack the column"):
        of_impacts.predict({"x": [0.0]})


def test_models_are_compared_afterwards_and_then_stand_in_the_diagnosis(of_impacts, monkeypatch):
    table = pd.DataFrame({"model": ["mirtich"], "error": [0.1]})
    asked = []
    monkeypatch.setattr("thesis_lib.critique.engines.compare.compare_models", lambda *args: asked.append(args) or table)
    critique = OfDrops(of_impacts.found, np.random.default_rng(0))
    before = critique.to_dict()
    assert critique.compare(["laws"]) is table and asked[0][:2] == (of_impacts.found, ["laws"])
    after = critique.to_dict()
    assert after.pop("models") == [{"model": "mirtich", "error": 0.1}] and after == before


def test_it_draws_the_ladder_and_the_map_and_says_what_it_has(of_impacts):
    assert isinstance(of_impacts.plot(), Figure) and isinstance(of_impacts.plot("map"), Figure)
    assert of_impacts.plot("candidates")._repr_png_().startswith(b"\x89PNG")  # as a notebook shows it
    with pytest.raises(UserError, match="no figure 'lader'; available are ladder, candidates, map"):
        of_impacts.plot("lader")


def test_one_model_with_named_effects_is_one_call(impacts_dataset):
    model = fit(impacts_dataset, "mirtich", ["tangential_restitution"] * 2)
    e_t = model.parameters["tangential_restitution.e_t"]
    assert abs(e_t.value - E_T) < WITHIN * e_t.std
    assert repr(model) == "<SavedModel of hidden_impacts: mirtich with tangential_restitution>"
    for law, effects, says in (
        ("mirtisch", (), "no law 'mirtisch'; known are"),
        ("mirtich", ("gravity_waves",), "no effect 'gravity_waves'"),
        ("mirtich", ("linear_drag",), "cannot test the effect linear_drag"),
        ("mirtich", ("linear_dragg",), "did you mean 'linear_drag'"),
        ("mirtich", ("later_restitution",), "it is not defined in 2 dimensions"),
    ):
        with pytest.raises(UserError, match=says):
            fit(impacts_dataset, law, effects)


def test_too_few_impacts_are_an_error_of_their_own_where_more_was_asked(tmp_path, monkeypatch, capsys):
    few = bouncing([0.7] * 3, 0.3, np.random.default_rng(1), bounces=3)[0]
    plain = criticise(few)
    assert repr(plain) == f"<Critique of {few.name}: no verdict>" and "Restitution 0.6993 ±" in plain.summary()
    monkeypatch.chdir(tmp_path)
    command = ["critique", str(write_dataset(few, tmp_path / "few")), "-q"]
    for options, asked in (
        ({"effects": ["com_offset"]}, "--effect com_offset"),
        ({"models": ["laws"]}, "--models laws"),
        ({"propose": True}, "--propose term.py"),
    ):
        with pytest.raises(TooFew, match="the critique needs 30 in 10") as stopped:
            criticise(few, **options)
        assert len(stopped.value.observations) == 9
        assert main([*command, *asked.split()]) == 2
        assert "9 usable impacts in 3 trials; the critique needs 30 in 10" in capsys.readouterr().err
    with pytest.raises(UserError, match="there are none for so few impacts"):
        plain.plot()


@pytest.fixture(scope="module")
def videos() -> Dataset:
    """Three videos of three bounces each, of a ball whose spin nobody measured."""
    return bouncing([EPSILON] * 3, 0.3, np.random.default_rng(1), bounces=3, angle=False)[0]


@pytest.fixture(scope="module")
def folder(videos, tmp_path_factory):
    return write_dataset(videos, tmp_path_factory.mktemp("few") / "videos")


def test_restitution_is_told_with_its_error_and_no_verdict(folder, tmp_path, capsys):
    assert main(["datasets", "check", str(folder)]) == 0
    assert "restitution and friction only, no verdict: 9 usable impacts in 3 trials; 30 in" in capsys.readouterr().out
    out = tmp_path / "out"
    assert main(["critique", str(folder), "-q", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith(
        "videos: no verdict\n  Too few impacts for a verdict (9 in 3 trials; 30 in 10 are needed).\n"
    )
    assert "Restitution 0.70" in said and "±" in said and "nan" not in said and "e+" not in said
    content = json.loads((out / "diagnosis.json").read_text())
    found = content["restitution"]
    assert content["verdict"] is None and content["effects"] == []
    assert abs(found["value"] - EPSILON) < WITHIN * found["std"] < 0.01
    assert content["base_model"]["parameters"]["mu"]["std"] is None  # no spin, no friction
    assert {path.name for path in out.iterdir()} == FILES
    assert load_model(out / "model.json").parameters["epsilon"].value == found["value"]
    page = (out / "report.html").read_text()
    assert "No verdict: too few impacts" in page and "nan" not in page.split("</style>")[1].lower()
    assert not content["summary"][0].startswith("The")
    assert records()["verdict"].said(content) == " ".join(content["summary"])


def test_json_batch_and_comparison_bear_no_verdict(folder, tmp_path, capsys):
    assert main(["critique", str(folder), "-q", "--json", "-o", str(tmp_path / "a")]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((tmp_path / "a" / "diagnosis.json").read_text()) and told["verdict"] is None
    assert main(["critique", "--batch", str(folder), "-q", "--jobs", "1", "-o", str(tmp_path / "batch")]) == 0
    assert "1 dataset: 1 too few impacts" in capsys.readouterr().out
    row = pd.read_csv(tmp_path / "batch" / "batch.csv").iloc[0]
    assert row["status"] == "done" and pd.isna(row["verdict"])
    assert "too few impacts" in (tmp_path / "batch" / "index.html").read_text()
    assert main(["critique", str(tmp_path / "a"), str(tmp_path / "batch" / "videos")]) == 0
    assert "none (too few impacts)" in capsys.readouterr().out


def test_the_standard_error_covers_how_far_trials_differ():
    rng = np.random.default_rng(2)
    epsilon = np.clip(EPSILON + 0.05 * rng.standard_normal(5), 0.0, 1.0)
    value, std = criticise(bouncing(epsilon, 0.3, rng, bounces=3)[0]).found.restitution
    assert value == pytest.approx(epsilon.mean(), abs=0.005)
    assert std == pytest.approx(epsilon.std(ddof=1) / np.sqrt(5), rel=0.1)


def test_impacts_without_their_noise_scatter_or_have_no_error():
    dataset = injected_impacts("few", 20, 3, "tangential_restitution", {"tangential_restitution.e_t": 0.0})
    bare = replace(dataset, header=dataset.header.model_copy(update={"noise": None}))
    value, std = criticise(bare).found.restitution
    assert 0.0 < std < 0.05 and 0.0 < value < 1.0
    nan = np.full(1, np.nan)
    assert np.isnan(OwnRestitution(np.zeros(1, int), np.zeros(1), np.full(1, 0.5), nan, 1.0).mean()[1])


def test_one_impact_is_enough_for_a_number_and_none_is_an_error(tmp_path, capsys):
    one = bouncing([EPSILON], 0.3, np.random.default_rng(3))[0]
    value, std = criticise(one).found.restitution
    assert abs(value - EPSILON) < WITHIN * std < 0.01
    falling = replace(one, trajectories=one.trajectories.query("t < 0.15"))
    with pytest.raises(TooFew, match="0 usable impacts"):
        criticise(falling)
