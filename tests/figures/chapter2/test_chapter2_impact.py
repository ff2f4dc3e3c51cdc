"""What is drawn of the force at impact and of m/I is what the tables hold."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.thesis.figures.chapter2.impact import figure_2_15, figure_measured_ratio
from thesis_lib.thesis.identify.impacts.forces import ImpactForces, drop_ellipses, shown_impact, study_impact_forces


@pytest.mark.slow
def test_figure_2_15_holds_one_impulse_in_three_ways():
    settings = ImpactForces(drops=3)
    drops = drop_ellipses(settings, np.random.default_rng(1))
    rows, _ = study_impact_forces(drops, settings)
    row, history = shown_impact(rows, drops, settings)
    figure, table = figure_2_15(row, history, drops.trajectories, rows, settings)
    curves = {name: part for name, part in table[table["panel"] == "b"].groupby("series")}
    area = {name: np.trapezoid(part["force"], part["t"]) for name, part in curves.items()}
    assert area["contact_force"] == pytest.approx(row["true_c_n"], rel=1e-3)
    assert area["estimate"] == pytest.approx(row["c_n"], rel=1e-3)
    assert area["sensor_continuous"] == pytest.approx(row["true_c_n"], rel=0.02)
    assert area["estimate_low"] < area["estimate"] < area["estimate_high"]
    outline = table[table["panel"] == "a"]
    assert outline["t"].max() <= 0.0 and outline["y"].min() > -2e-3
    density = table[(table["panel"] == "c") & (table["series"] == "normal")]
    assert density["density"].sum() * 0.5 == pytest.approx(1.0)
    assert len(figure.axes) == 3


@pytest.mark.parametrize(("scale", "noise", "unit"), [(1.3, np.nan, "sigma"), (np.nan, 0.05, "m/s")])
def test_a_row_for_each_hypothesis_with_its_misfit(scale, noise, unit):
    table = pd.DataFrame({"variant": ["as_published", "mirrored_rotation+angle_offset"], "ratio": [700.0, 2680.0]})
    table = table.assign(low=table["ratio"] - 20, high=table["ratio"] + 20, scale=scale, velocity_noise=noise)
    table = table.assign(std=10.0, published=2700.0, lower=table["ratio"] - 50, upper=table["ratio"] + 50)
    figure, drawn = figure_measured_ratio(table)
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels == ["as published", "rotation mirrored + angle offset"]
    assert set(drawn["misfit_unit"]) == {unit} and drawn["misfit"].eq(np.fmax(scale, noise)).all()
