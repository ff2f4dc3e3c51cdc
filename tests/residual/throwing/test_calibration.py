"""Calibration of predictions that are right, too wide and too narrow."""

import numpy as np
import pytest

from thesis_lib.thesis.residual.throwing.calibration import (
    coverage_table,
    crps,
    pit_histogram,
    pit_of_gaussian,
    pit_of_samples,
    pit_of_student,
)

N = 2000


def coverage(pit: np.ndarray, central: bool):
    """The table of outcomes that do not depend on each other."""
    return coverage_table(pit, np.arange(len(pit)), np.random.default_rng(0), central=central)


def predictions(factor: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    centre = rng.normal(size=N)
    return centre + rng.normal(size=N), centre[:, None] + factor * rng.normal(size=(N, 200))


def test_right_samples_are_calibrated_and_wrong_ones_are_not():
    rng = np.random.default_rng(0)
    shares = {}
    for factor in (1.0, 0.5, 2.0):
        table = coverage(pit_of_samples(*predictions(factor, rng), rng), True)
        shares[factor] = table.set_index("level")["coverage"]
        assert bool(table["passes"].all()) == (factor == 1.0)
    assert (shares[0.5] < shares[1.0]).all() and (shares[1.0] < shares[2.0]).all()


def test_right_gaussians_are_calibrated_in_three_dimensions():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(N, 3, 3))
    cov = root @ np.swapaxes(root, 1, 2)
    outcome = np.einsum("nij,nj->ni", root, rng.normal(size=(N, 3)))
    table = coverage(pit_of_gaussian(outcome, cov), False)
    assert table["passes"].all()
    narrow = coverage(pit_of_gaussian(outcome, 0.5 * cov), False)
    assert not narrow["passes"].any()


def test_the_interval_over_groups_is_wider_where_outcomes_hang_together():
    rng = np.random.default_rng(2)
    pit = np.repeat(rng.uniform(size=100), 20)
    groups = np.repeat(np.arange(100), 20)
    one = coverage(pit, True)
    many = coverage_table(pit, groups, rng, central=True)
    assert ((many["high"] - many["low"]) > 2 * (one["high"] - one["low"])).all()


def test_crps_of_a_gaussian_is_its_closed_form_and_of_a_point_the_distance():
    from scipy.stats import norm

    rng = np.random.default_rng(3)
    samples = rng.normal(size=(1, 200_000))
    y = 0.7
    exact = y * (2 * norm.cdf(y) - 1) + 2 * norm.pdf(y) - 1 / np.sqrt(np.pi)
    assert crps(np.array([y]), samples)[0] == pytest.approx(exact, abs=5e-3)
    assert crps(np.array([2.0]), np.array([[0.5]]))[0] == pytest.approx(1.5)


def test_pit_is_uniform_where_samples_equal_the_outcome():
    rng = np.random.default_rng(6)
    pit = pit_of_samples(np.zeros(N), np.zeros((N, 50)), rng)
    table = pit_histogram(pit)
    assert ((table["share"] >= table["low"]) & (table["share"] <= table["high"])).mean() >= 0.8
    assert table["share"].sum() == pytest.approx(1.0)


def test_predictions_without_a_value_are_counted():
    table = coverage(np.array([0.5, np.nan, 0.2]), True)
    assert (table["n"] == 2).all() and (table["left_out"] == 1).all()


@pytest.mark.parametrize("freedom", [4.0, np.inf])
def test_right_tails_are_calibrated_and_a_gaussians_are_not(freedom):
    rng = np.random.default_rng(3)
    z = rng.normal(size=(N, 3))
    if np.isfinite(freedom):
        z *= np.sqrt((freedom - 2.0) / rng.chisquare(freedom, N))[:, None]
    assert coverage(pit_of_student(z, freedom), False)["passes"].all()
    other = np.inf if np.isfinite(freedom) else 3.0
    assert not coverage(pit_of_student(z, other), False)["passes"].all()
