"""Densities that keep their mass inside the boundary, and local means."""

import numpy as np
import pytest

from thesis_lib.figures.densities import bandwidth, local_mean, reflected_density

MASS = 0.01  # trapezoid on 400 points and the tail beyond the grid
EDGE = 0.1  # of the true density: sampling scatter of 4000 draws and the kernel's bias at the edge
FINE = np.linspace(0.0, 8.0, 400)


@pytest.fixture(scope="module")
def exponential():
    return np.random.default_rng(1).exponential(size=4000)


def test_reflection_keeps_the_mass_inside(exponential):
    assert np.trapezoid(reflected_density(exponential, FINE, lower=0.0), FINE) == pytest.approx(1.0, abs=MASS)


def test_density_at_the_boundary_is_right(exponential):
    assert reflected_density(exponential, FINE, lower=0.0)[0] == pytest.approx(1.0, abs=EDGE)
    assert reflected_density(exponential, FINE)[0] < 1.0 - EDGE


def test_both_boundaries_and_nan():
    values = np.concatenate([np.random.default_rng(2).uniform(size=2000), [np.nan]])
    grid = np.linspace(-0.2, 1.2, 400)
    density = reflected_density(values, grid, 0.0, 1.0)
    assert np.all(density[(grid < 0.0) | (grid > 1.0)] == 0.0)
    assert np.trapezoid(density, grid) == pytest.approx(1.0, abs=MASS)


def test_equal_values_give_a_narrow_peak_and_none_an_error():
    density = reflected_density(np.full(10, 0.5), np.linspace(0.0, 1.0, 101), 0.0, 1.0)
    assert np.isfinite(density).all() and density.argmax() == 50
    with pytest.raises(ValueError, match="finite"):
        reflected_density(np.array([np.nan]), FINE)


def test_bandwidth_follows_silverman_and_ignores_wild_values():
    values = np.random.default_rng(3).normal(size=5000)
    expected = 0.9 * 5000**-0.2
    assert bandwidth(values) == pytest.approx(expected, rel=0.05)  # sampling scatter of the spread: 1-2 %
    assert bandwidth(np.append(values, 1e6)) == pytest.approx(bandwidth(values), rel=0.01)


def test_local_mean_of_a_plane_and_distance():
    side = np.linspace(0.0, 1.0, 21)
    points = np.stack(np.meshgrid(side, 100.0 * side), axis=-1).reshape(-1, 2)
    values = points[:, 0] + points[:, 1]
    mean, distance = local_mean(points, values, np.array([[0.5, 50.0], [3.0, 50.0]]), 5)
    assert mean[0] == pytest.approx(50.5)  # symmetric neighbours of a plane
    assert distance[0] == pytest.approx(0.0, abs=1e-12)
    assert distance[1] == pytest.approx(2.0 / points[:, 0].std())


def test_local_mean_of_few_points_takes_all():
    mean, _ = local_mean(np.array([[0.0, 0.0], [1.0, 1.0]]), np.array([1.0, 3.0]), np.array([[0.1, 0.1]]), 12)
    assert mean == pytest.approx([2.0])
