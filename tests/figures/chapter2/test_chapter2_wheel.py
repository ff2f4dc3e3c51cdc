"""The figures of the wheel draw what they are given, with the impacts apart."""

import numpy as np
import pytest

from thesis_lib.simulate.mechanisms.motions import DEFAULT
from thesis_lib.thesis.figures.chapter2.forces import figure_2_10, figure_2_11
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
