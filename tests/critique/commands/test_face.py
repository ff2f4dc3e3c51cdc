"""The face of the library: one call from data to a `Critique`, which answers in short, predicts, draws, and says no."""

import json

import numpy as np
import pandas as pd
import pytest
from bouncing_disk import bouncing
from hidden_effects import E_T
from matplotlib.figure import Figure

from thesis_lib.critique import Critique, TooFew, criticise, fit
from thesis_lib.critique.drops.settings import CritiqueSettings
from thesis_lib.critique.result import OfDrops
from thesis_lib.critique.results.load_model import load_model
from thesis_lib.foundation.errors import UserError

QUICK = {"folds": 2, "finalists": 1, "rivals": 1, "max_effects": 1}
WITHIN = 4.0  # standard errors; by chance once in 16,000


@pytest.fixture(scope="module")
def found(impacts_dataset) -> Critique:
    return criticise(impacts_dataset, settings=CritiqueSettings(**QUICK))


def test_it_shows_itself_in_a_line(found):
    assert repr(found).startswith("<Critique of hidden_impacts: effects (tangential_restitution), held-out error")
    assert len(repr(found)) < 120 and "\n" not in repr(found)


def test_summary_dict_and_folder_say_the_same_in_any_order(found, without_page, tmp_path):
    first = found.summary()
    content = found.save(tmp_path)
    assert content == found.to_dict() == json.loads((tmp_path / "diagnosis.json").read_text())
    assert first == found.summary() and first.startswith("hidden_impacts: effects\n  ")
    assert all(sentence in first for sentence in content["summary"])
    other = OfDrops(found.found, np.random.default_rng(0))
    assert other.to_dict()["verdict"] == content["verdict"] and other.effects == found.effects


def test_it_predicts_as_its_file_does(found, tmp_path):
    states = {"x": [0.0], "y": [0.03], "theta": [0.3], "vx": [0.5], "vy": [-2.0], "omega": [5.0]}
    found.model.save(tmp_path / "model.json")
    expected = load_model(tmp_path / "model.json").predict(pd.DataFrame(states))
    pd.testing.assert_frame_equal(found.predict(states), expected)
    with pytest.raises(UserError, match="lack the column"):
        found.predict({"x": [0.0]})


def test_models_are_compared_afterwards_and_then_stand_in_the_diagnosis(found, monkeypatch):
    table = pd.DataFrame({"model": ["mirtich"], "error": [0.1]})
    asked = []
    monkeypatch.setattr("thesis_lib.critique.engines.compare.compare_models", lambda *args: asked.append(args) or table)
    critique = OfDrops(found.found, np.random.default_rng(0))
    before = critique.to_dict()
    assert critique.compare(["laws"]) is table and asked[0][:2] == (found.found, ["laws"])
    after = critique.to_dict()
    assert after.pop("models") == [{"model": "mirtich", "error": 0.1}] and after == before


def test_it_draws_the_ladder_and_the_map_and_says_what_it_has(found):
    assert isinstance(found.plot(), Figure) and isinstance(found.plot("map"), Figure)
    assert found.plot("candidates")._repr_png_().startswith(b"\x89PNG")  # as a notebook shows it
    with pytest.raises(UserError, match="no picture 'lader'; there are ladder, candidates, map"):
        found.plot("lader")


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


def test_too_few_impacts_are_an_error_of_their_own_where_more_was_asked():
    few = bouncing([0.7] * 3, 0.3, np.random.default_rng(1), bounces=3)[0]
    plain = criticise(few)
    assert repr(plain) == f"<Critique of {few.name}: no verdict>" and "Restitution 0.6993 ±" in plain.summary()
    for options in ({"effects": ["com_offset"]}, {"models": ["laws"]}, {"propose": True}):
        with pytest.raises(TooFew, match="the critique needs 30 in 10") as stopped:
            criticise(few, **options)
        assert len(stopped.value.observations) == 9
    with pytest.raises(UserError, match="there are none of so few impacts"):
        plain.plot()
