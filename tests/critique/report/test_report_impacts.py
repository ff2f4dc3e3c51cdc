"""The map of single impacts in the report: ellipses, lines, predictions, and which impacts are drawn."""

import json
from dataclasses import replace

import numpy as np
import pytest
from report_pages import scripts

from thesis_lib.contact.space import contact_space
from thesis_lib.critique.drops.questions.class_tests import velocities
from thesis_lib.report.critique import impacts as report_impacts


def impacts_in(html):
    return json.loads(scripts(html)[0][1])["impacts"]


def test_ellipses_and_lines_are_those_of_contact_space(made, html):
    """A point of the ellipse keeps the energy, a step along a line keeps v_t = 0 or v_n = 0."""
    critique, found = made[0], impacts_in(html)
    o, mass = critique.observations.single, critique.source.mass
    where = {(trial, impact): i for i, (trial, impact) in enumerate(zip(o.trial, o.impact))}
    rows = [where[one["trial"], one["impact"]] for one in found]
    assert sorted(rows) == list(range(len(o)))
    v_pre, _, r = (array[rows] for array in velocities(critique.ladder[0][1], o))
    space = contact_space(v_pre, r, mass=1e3 * mass, k_g=o.rig.k_g)  # impulses in mN s

    def column(name):
        return np.array([one[name] for one in found])

    centre, angle = column("centre"), np.radians(column("angle"))
    for turn in (0.0, 0.7, 2.0, 4.0):
        a, b = column("axes").T * np.array([[np.cos(turn)], [np.sin(turn)]])
        c_t = centre[:, 0] + np.cos(angle) * a - np.sin(angle) * b
        c_n = centre[:, 1] + np.sin(angle) * a + np.cos(angle) * b
        assert np.allclose(space.alpha(c_t, c_n), 1.0, atol=0.01)  # numbers have four digits
    speed = np.hypot(space.v_t, space.v_n)
    for line, component in (("sticking", 0), ("compression", 1)):
        along = np.radians(column(line))
        step = column("axes")[:, 1]
        after = space.velocity_after(centre[:, 0] + step * np.cos(along), centre[:, 1] + step * np.sin(along))
        assert np.all(np.abs(after[component]) < 0.01 * speed)


def test_predictions_are_as_far_from_the_measured_impulse_as_their_errors(html):
    """With the effects of the right law the predicted impulse comes near to the measured one."""
    found = impacts_in(html)
    away = {
        name: np.mean([np.hypot(*np.subtract(one[name], one["measured"])) for one in found])
        for name in ("base", "final")
    }
    errors = np.array([one["errors"] for one in found])
    assert np.all(np.diff(errors[:, 0]) >= 0.0)  # the largest last, on top of the others
    assert away["final"] < 0.5 * away["base"] and errors[:, 1].mean() < 0.5 * errors[:, 0].mean()


def test_many_impacts_are_thinned_by_a_rule_and_the_page_stays_small(made, html):
    error = np.random.default_rng(0).exponential(size=5000)
    error[7] = np.nan
    known = np.flatnonzero(np.isfinite(error))
    shown = report_impacts.drawn_impacts(error, known)
    assert len(shown) == len(set(shown)) == report_impacts.MOST
    assert np.all(np.diff(error[shown]) >= 0.0)
    assert error[shown[0]] == np.nanmin(error) and error[shown[-1]] == np.nanmax(error)
    assert np.median(error[shown]) == pytest.approx(np.nanmedian(error), rel=0.02)
    assert sorted(report_impacts.drawn_impacts(error, known[:50])) == sorted(known[:50])
    part = report_impacts.explorer(made[0], made[1])
    pictures_and_text = len(html) - len(part)
    assert pictures_and_text + len(part) / len(impacts_in(html)) * report_impacts.MOST < 6e6


def test_the_finding_about_impacts_is_counted(made):
    errors = {"base": np.array([1.0] * 18 + [4.0, 7.0]), "final": np.array([0.5] * 15 + [2.0] * 5)}
    said = report_impacts._finding(errors, np.arange(20))
    assert "The 10 % of impacts with the largest errors account for 38 % of the sum" in said
    assert "smaller in 85 % of the impacts" in said
    assert "With the effects" not in report_impacts._finding({"base": errors["base"]}, np.arange(20))


def test_impacts_without_a_prediction_are_not_drawn(made):
    critique, regions, *_ = made
    o = critique.observations.single
    broken = replace(o, slope=np.where(np.arange(len(o))[:, None, None] == 3, np.nan, o.slope))
    part = report_impacts.explorer(replace(critique, observations=broken), regions)
    assert len(impacts_in(part)) == len(o) - 1 and "NaN" not in part and "nan" not in part
