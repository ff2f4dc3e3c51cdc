"""Chapter 4's dice and beliefs: the numbers drawn are those given, and every figure can be drawn."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.thesis.figures.chapter4.dice import (
    MODEL_STYLE,
    figure_4_3,
    figure_4_4,
    figure_4_7,
    figure_4_8,
    figure_4_9,
    figure_4_10,
    figure_budget,
    figure_calibration,
)
from thesis_lib.thesis.residual.throwing.calibration import coverage_table, pit_histogram

SQUARE = Polygon(vertices=((0.03, 0.03), (-0.03, 0.03), (-0.03, -0.03), (0.03, -0.03)))


def poses() -> pd.DataFrame:
    t = np.tile(np.arange(0.0, 0.4, 0.004), 2)
    y = 0.05 + 0.1 * np.abs(np.cos(9 * t))
    return pd.DataFrame({"trial": np.repeat([1, 2], 100), "t": t, "x": -0.5 * t, "y": y, "theta": 3 * t})


def samples() -> pd.DataFrame:
    i, (x, turn) = np.repeat(np.arange(3), 80), np.random.default_rng(0).normal(size=(2, 240))
    table = pd.DataFrame({"trial": 1, "contact": i, "t": 0.1 * i, "y": 0.06})
    return table.assign(x=-0.05 * i + 0.002 * (i + 1) * x, theta=0.3 * i + 0.05 * turn)


def errors() -> pd.DataFrame:
    model = np.repeat(list(MODEL_STYLE), 300)
    return pd.DataFrame({"model": model, "error": np.random.default_rng(1).normal(0.1, 0.8, len(model))})


def test_densities_of_errors_hold_all_errors_and_the_legend_their_moments():
    table = errors()
    figure, drawn = figure_4_8(table)
    for model, part in drawn.groupby("model"):
        own = table.loc[table["model"] == model, "error"]
        inside = 1.0 - part["beyond"].iloc[0]
        assert np.trapezoid(part["density"], part["error"]) == pytest.approx(inside, abs=0.01)
        assert part["mean"].iloc[0] == pytest.approx(own.mean())
    legend = figure.axes[0].get_legend().get_texts()
    assert len(legend) == len(MODEL_STYLE)


def test_a_throw_is_drawn_from_its_first_to_its_last_sample():
    table = poses()
    _, drawn = figure_4_7(table, SQUARE, 2)
    own = table[table["trial"] == 2]
    assert drawn["t"].iloc[[0, -1]].tolist() == own["t"].iloc[[0, -1]].tolist()
    assert (drawn["trial"] == 2).all()


def test_hard_and_easy_throws_are_told_apart_about_their_first_contact():
    hits = pd.DataFrame({"trial": [1, 2], "t": [0.1, 0.2]})
    _, drawn = figure_4_9(poses(), hits, SQUARE, easy=1, hard=2)
    assert set(drawn["case"]) == {"hard to predict", "easy to predict"}
    assert drawn.loc[drawn["trial"] == 1, "t"].max() <= 0.16 + 1e-9
    assert (drawn["after_first"] == (drawn["t"] > drawn["trial"].map({1: 0.1, 2: 0.2}))).all()


def test_the_belief_over_a_throw_shows_each_contact():
    _, drawn = figure_4_3(poses(), samples(), SQUARE)
    assert set(drawn["series"]) == {"measured", "belief_0", "belief_1", "belief_2"}


def test_distances_are_in_sides_from_the_start():
    table = samples()
    _, drawn = figure_4_4(table, np.random.default_rng(2).normal(-0.2, 0.05, 200), 0.06)
    std = drawn.groupby("state", sort=False)["std"].first()
    expected = table[table["contact"] == 1]["x"].to_numpy().std() / 0.06
    assert std["after the first contact"] == pytest.approx(expected)
    peak = drawn[drawn["state"] == "at rest"].set_index("distance")["density"].idxmax()
    assert peak == pytest.approx(-0.2 / 0.06, abs=1.0)


def test_resting_beliefs_and_calibration_can_be_drawn():
    rng = np.random.default_rng(3)
    beliefs = pd.DataFrame({"case": np.repeat(["easy", "hard"], 100), "distance": rng.normal(-3, 1, 200)})
    marks = pd.DataFrame({"case": ["easy", "hard"], "law": [-3.0, -1.0], "measured": [-3.1, -4.0]})
    _, drawn = figure_4_10(beliefs, marks)
    assert drawn.groupby("case")["measured"].first().to_dict() == {"easy": -3.1, "hard": -4.0}
    pit = rng.uniform(size=300)
    coverage = coverage_table(pit, np.arange(len(pit)), rng, central=True)
    _, table = figure_calibration(pit_histogram(pit).assign(model="law"), coverage.assign(model="law"))
    assert table.loc[table["panel"] == "pit", "value"].sum() == pytest.approx(1.0)


def test_the_budget_is_drawn_for_each_model_and_contact():
    rows = [(model, k, 1.0 / (k + 1), 0.1, 0.3 + 0.1 * k, 0.03) for model in MODEL_STYLE for k in range(6)]
    rows += [(model, 0, 0.8, 0.05, 0.3, 0.03) for model in ("nearest", "pairs")]
    columns = ["model", "contact", "std", "std_error", "face_right", "face_error"]
    figure, drawn = figure_budget(pd.DataFrame(rows, columns=columns))
    faces, scatter = figure.axes
    assert len(faces.containers) == len(MODEL_STYLE) and drawn["contact"].max() == 5
    assert faces.get_ylim()[1] == 100.0 and scatter.get_ylim()[0] == 0.0
