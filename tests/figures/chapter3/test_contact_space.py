"""Figures 3-1 to 3-3 draw what the laws compute."""

import numpy as np
import pandas as pd
import pytest
from small_study import BODY

from thesis_lib.contact import LAWS
from thesis_lib.contact.space import admissible
from thesis_lib.thesis.figures.chapter3.contact_space import EXAMPLE, figure_3_1, figure_3_2, figure_3_3, region_outline
from thesis_lib.thesis.impact_study.predictive_range import region

ROUNDING = 1e-9  # relative, of double precision through a few products
AREA = 0.02  # relative: outline and cells approximate the same curved set on different grids


def polygon_area(points):
    x, y = points.T
    return 0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def cell_area(law):
    t, n = (part[:, :, 0] for part in region(law, EXAMPLE.space(BODY)))
    a_t, a_n = t[1:, 1:] - t[:-1, :-1], n[1:, 1:] - n[:-1, :-1]
    b_t, b_n = t[1:, :-1] - t[:-1, 1:], n[1:, :-1] - n[:-1, 1:]
    return 0.5 * np.abs(a_t * b_n - a_n * b_t).sum()


@pytest.mark.parametrize("name", LAWS)
def test_outline_encloses_exactly_what_the_law_reaches(name):
    outline = region_outline(LAWS[name], EXAMPLE.space(BODY))
    assert outline[-1] == pytest.approx(outline[0])
    whole = polygon_area(region_outline(LAWS["wang_mason"], EXAMPLE.space(BODY)))
    assert polygon_area(outline) == pytest.approx(cell_area(LAWS[name]), rel=AREA, abs=1e-6 * whole)


def test_contact_point_is_the_lowest_and_r_leads_to_it():
    _, table = figure_3_1(BODY)
    at = {name: part[["x", "y"]].to_numpy() for name, part in table.groupby("series")}
    assert at["r"][1] == pytest.approx(at["C"][0], abs=1e-12)
    assert at["r"][0] == pytest.approx(at["centre of mass"][0])
    # the outline is a polygon of 180 points: its lowest vertex is above the ellipse by at most a (1 − cos 1°)
    assert at["outline"][:, 1].min() == pytest.approx(0.0, abs=0.035 * (1.0 - np.cos(np.radians(2.0))))
    assert at["C"][0, 0] > at["centre of mass"][0, 0]


def test_ellipse_keeps_the_energy_and_shade_is_admissible():
    _, table = figure_3_2(BODY)
    at = {name: part[["c_t", "c_n"]].to_numpy() for name, part in table.groupby("series")}
    space = EXAMPLE.space(BODY)
    assert space.alpha(*at["energy ellipse"].T) == pytest.approx(1.0, rel=ROUNDING)
    assert admissible(space, *at["admissible set"].T, tolerance=1e-7).all()
    v_t, _ = space.velocity_after(*at["line of sticking"].T)
    _, v_n = space.velocity_after(*at["line of maximum compression"].T)
    assert np.abs([v_t, v_n]).max() < ROUNDING
    assert np.abs(space.velocity_after(*at["centre"].T)).max() < ROUNDING


def test_regions_of_both_variants_and_quoted_shares():
    coverage = pd.DataFrame({"law": ["mirtich"], "share": [0.228]})
    figure, table = figure_3_3(BODY, coverage)
    laws = table[table["panel"] != "all"].groupby("variant")["series"].unique()
    assert set(laws["as_defined"]) == {name for name in LAWS if not LAWS[name].as_published}
    assert {"whittaker_as_published", "wang_mason"} <= set(laws["as_published"])
    labels = [text.get_text() for ax in figure.axes for text in ax.get_legend().get_texts()]
    assert "Mirtich (23 %)" in labels and "Mirtich" in labels
