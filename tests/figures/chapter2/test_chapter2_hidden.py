"""Figures of the hidden effects of mechanisms: shares add up, forces and residuals drawn are those given."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.figures.critique.mechanisms import figure_residuals
from thesis_lib.thesis.figures.chapter2.hidden import figure_hidden


@pytest.fixture()
def effects():
    """Two mechanisms, three truths, four datasets each; one payload of the arm is taken for rolling resistance."""
    rows = []
    for mechanism in ("arm", "wheel"):
        for truth in ("nothing", "payload", "rolling_resistance"):
            for seed in range(4):
                wrong = (mechanism, truth, seed) == ("arm", "payload", 3)
                first = "" if truth == "nothing" else "rolling_resistance" if wrong else truth
                rows.append((mechanism, truth, first, "effects" if first else "adequate"))
    table = pd.DataFrame(rows, columns=["mechanism", "truth", "first_effect", "verdict"])
    return table.assign(snr_db=60.0)


@pytest.fixture()
def forces():
    t = np.arange(5) * 0.005
    one = pd.DataFrame({"t": t, "pair": "arm", "true": 8.0 + t, "without": 9.0, "with_effects": 8.0 + t})
    return pd.concat([one.assign(component=c) for c in ("normal", "tangential")], ignore_index=True)


def test_shares_of_each_truth_add_up_and_the_mistake_shows(effects, forces):
    _, table = figure_hidden(effects, forces)
    shares = table[table["panel"].isin(["arm", "wheel"])]
    assert shares.groupby(["panel", "truth"])["value"].sum().to_numpy() == pytest.approx(1.0)
    at = shares[(shares["panel"] == "arm") & (shares["truth"] == "payload")].set_index("column")["value"]
    assert at["payload"] == 0.75 and at["rolling_resistance"] == 0.25
    drawn = table[(table["panel"] == "force, normal") & (table["column"] == "true")]
    assert drawn["value"].to_numpy() == pytest.approx(8.0 + np.arange(5) * 0.005)


def test_without_forces_only_the_shares_are_drawn(effects, forces):
    figure, table = figure_hidden(effects, forces.iloc[:0])
    assert len(figure.axes) == 2 and set(table["panel"]) == {"arm", "wheel"}


def test_residuals_and_gains_are_those_given():
    residuals = pd.DataFrame(
        {"window": [0, 1], "coordinate": ["q_1", "q_2"], "before": [-30.0, 12.0], "after": [0.5, 0.0]}
    )
    gains = pd.DataFrame({"candidate": ["payload", "gravity_direction"], "gain": [500.0, 0.0]})
    figure, table = figure_residuals(residuals, gains, 6.0)
    own = table[table["panel"] == "residuals"]
    assert sorted(own["value"]) == [-30.0, 0.0, 0.5, 12.0]
    bars = table[table["panel"] == "gains"].set_index("series")["value"]
    assert bars["payload"] == 500.0 and bars["gravity_direction"] == 0.0
    figure.canvas.draw()
