"""What is drawn of the force at impact and of m/I is what the tables hold."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.figures.chapter2.impact import figure_2_15, figure_measured_ratio
from thesis_lib.foundation.errors import UserError
from thesis_lib.identify.impacts.forces import ImpactForces, drop_ellipses, shown_impact, study_impact_forces
from thesis_lib.identify.impacts.measured_ratio import absent


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


def ratio_table():
    rows = [
        ("planar_impact", "as_published", 700.0, 680.0, 720.0, np.nan, 0.4),
        ("planar_impact", "mirrored_rotation+angle_offset", 2680.0, 2650.0, 2710.0, np.nan, 0.05),
        ("planar_dice", "rounded_corners", 2300.0, 2250.0, 2340.0, 1.3, np.nan),
    ]
    table = pd.DataFrame(rows, columns=["dataset", "variant", "ratio", "low", "high", "scale", "velocity_noise"])
    return table.assign(std=10.0, published=2700.0, lower=table["ratio"] - 50, upper=table["ratio"] + 50, status="ok")


def test_a_panel_for_each_set_that_is_there():
    table = pd.concat([ratio_table(), absent("planar_dice")], ignore_index=True)
    figure, drawn = figure_measured_ratio(table)
    assert len(figure.axes) == 2 and len(drawn) == 3
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels == ["as published", "rotation mirrored + angle offset"]


def test_nothing_to_draw_is_said_with_the_remedy():
    with pytest.raises(UserError, match="fetch planar-impact"):
        figure_measured_ratio(absent("planar_impact"))
