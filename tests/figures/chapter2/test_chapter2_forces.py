"""Figures 2-10 to 2-12 draw the forces they are given, to the scale of those that last, with the impacts apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.thesis.figures.chapter2.forces import figure_2_10, figure_2_11, figure_2_12
from thesis_lib.thesis.identify.wheel.study import WheelStudy, example_forces, motion_by_mass


@pytest.fixture(scope="module")
def forces():
    return example_forces(np.random.default_rng(2), WheelStudy(steps=280), DEFAULT)


@pytest.mark.slow
def test_figure_2_11_holds_forces_and_impulses(forces):
    figure, table = figure_2_11(forces)
    truth = table[table["series"] == "truth"]
    for spoke, pair in enumerate(forces.pairs, start=1):
        drawn = truth[(truth["spoke"] == spoke) & (truth["kind"] != "impulse")].sort_values("t")
        assert drawn["force_or_impulse"].to_numpy() == pytest.approx(forces.truth.c_n[:, pair])
    # momentum of the impacts is not in the part that the axes of forces show
    rolling = truth[truth["kind"] == "rolling"]["force_or_impulse"]
    assert rolling.max() < 15.0 < truth["force_or_impulse"].max()
    assert (truth["kind"] == "impulse").sum() == 2  # the first spoke stands from the start
    assert figure.axes[0].get_ylim()[1] < 20.0


def test_figure_2_10_starts_every_mass_at_the_same_angle():
    settings = WheelStudy(masses=(0.5, 2.0), mass_seconds=0.5)
    _, table = figure_2_10(motion_by_mass(settings, DEFAULT))
    start = table[table["t"] == 0.0]
    assert len(start) == 2 and (start["theta"] == 0.0).all() and (start["omega"] == settings.mass_omega).all()


STEPS = 60


@pytest.fixture
def one():
    """A pair of forces of 10 N with an impact of 400 N, in the attributes that the figure reads."""
    rng = np.random.default_rng(0)
    c_n = np.zeros((STEPS, 2))
    c_n[20:] = 10.0
    c_n[20] = 400.0
    c_t = 0.3 * c_n
    estimate = c_n + 0.1 * rng.standard_normal(c_n.shape)
    fit = SimpleNamespace(c_n=estimate, c_t=c_t, c_n_std=np.full(c_n.shape, 0.1), c_t_std=np.zeros(c_n.shape))
    record = SimpleNamespace(t=0.005 * np.arange(STEPS + 1), c_n=c_n, c_t=c_t)
    return SimpleNamespace(record=record, fit=fit, c={"plain": (2.0 * c_n, c_t)})


def test_table_holds_what_is_given(one):
    _, table = figure_2_12(one)
    assert len(table) == 4 * STEPS
    ground = table[(table["pair"] == "ground") & (table["component"] == "normal")]
    np.testing.assert_array_equal(ground["true"], one.record.c_n[:, 1])
    np.testing.assert_array_equal(ground["estimate"], one.fit.c_n[:, 1])
    np.testing.assert_array_equal(ground["plain"], 2.0 * one.record.c_n[:, 1])


def test_axes_fit_the_lasting_force_and_impacts_are_named(one):
    figure, _ = figure_2_12(one)
    ax = figure.axes[0]
    assert 10.0 < ax.get_ylim()[1] < 20.0
    assert [text.get_text() for text in ax.texts] == ["400"]


def test_a_trajectory_without_contact_can_be_drawn(one):
    for forces in (one.record.c_n, one.record.c_t, one.fit.c_n, one.fit.c_t, *one.c["plain"]):
        forces[:] = 0.0
    figure, _ = figure_2_12(one)
    assert not figure.axes[0].texts
