"""Least squares within bounds: what steps of finite differences lead to."""

import numpy as np
import pytest

from thesis_lib.critique.likelihood.levenberg_marquardt import levenberg_marquardt

TRUE, STEP = np.array([0.8, -0.3]), np.array([1e-3, 1e-3])
A = np.random.default_rng(0).standard_normal((60, 2))


def minimised(residuals, start=(0.0, 0.0), low=-1.0, high=1.0, **settings):
    search = levenberg_marquardt(np.array(start), np.full(2, low), np.full(2, high), STEP, **settings)
    points = next(search)
    while True:
        try:
            points = search.send([residuals(point) for point in points])
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
