"""Least squares within bounds: what steps of finite differences lead to."""

import numpy as np
import pytest
from scipy.optimize import minimize

from thesis_lib.critique.likelihood.levenberg_marquardt import Weighted, levenberg_marquardt

TRUE, STEP = np.array([0.8, -0.3]), np.array([1e-3, 1e-3])
A = np.random.default_rng(0).standard_normal((60, 2))


def plainly(z):
    return Weighted(z @ z, z, np.ones_like(z))


def of_t(z):
    """The cost and the weights of Student's t with 8 degrees of freedom in 6 dimensions."""
    d2 = (z.reshape(-1, 6) ** 2).sum(axis=1)
    return Weighted(14.0 * np.log1p(d2 / 8.0).sum(), z, np.repeat(np.sqrt(14.0 / (8.0 + d2)), 6))


def minimised(residuals, start=(0.0, 0.0), low=-1.0, high=1.0, weighted=plainly, **settings):
    search = levenberg_marquardt(np.array(start), np.full(2, low), np.full(2, high), STEP, **settings)
    points = next(search)
    while True:
        try:
            points = search.send([weighted(residuals(point)) for point in points])
        except StopIteration as end:
            return end.value


def in_jumps(x):
    """A line that is known in steps of 0.03 alone, as is the number of corners that hit."""
    return 0.03 * np.floor(A @ (x - TRUE) / 0.03 + 0.5)


@pytest.mark.parametrize("wider", [(), (200.0, 40.0, 8.0)])
def test_what_is_smooth_is_found_with_narrow_and_wide_differences(wider):
    np.testing.assert_allclose(minimised(lambda x: A @ (x - TRUE), wider=wider), TRUE, atol=1e-6)
    np.testing.assert_allclose(minimised(lambda x: A @ (x - TRUE), high=0.5, wider=wider)[0], 0.5)


def test_wide_differences_lead_over_jumps_that_narrow_ones_take_for_slopes():
    narrow, wide = (minimised(in_jumps, wider=wider) for wider in ((), (200.0, 40.0, 8.0)))
    assert np.abs(wide - TRUE).max() < 0.02 < 0.2 < np.abs(narrow - TRUE).max()


def test_a_step_that_overshoots_is_shortened_until_it_gains():
    """The first step from (1, 1) lands at (-5, 0), at nearly the same cost; a search without damping stays there."""
    found = minimised(lambda x: np.array([np.arctan(5.0 * (x[0] - 0.1)), x[1]]), start=(1.0, 1.0), low=-9.0, high=9.0)
    np.testing.assert_allclose(found, (0.1, 0.0), atol=1e-3)


def test_where_models_err_far_beyond_noise_steps_are_long_enough():
    """Weighted (60, 6) of some 200 standard deviations that no x explains; the twelve steps reach the least cost."""
    rng = np.random.default_rng(3)
    B, missed = rng.standard_normal((60, 6, 2)), 200.0 * rng.standard_normal((60, 6))

    def left(x):
        return (300.0 * (B @ (x - TRUE)) + missed).ravel()

    least = minimize(lambda x: of_t(left(x)).cost, TRUE, tol=1e-10, method="Nelder-Mead").x
    np.testing.assert_allclose(minimised(left, weighted=of_t), least, atol=1e-3)
