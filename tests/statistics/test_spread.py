"""The robust standard deviation is the usual one of normal values, and hardly moved by wild ones."""

import numpy as np
import pytest
from scipy.stats import median_abs_deviation

from thesis_lib.statistics.spread import quantile_std, robust_std


def test_it_is_scipys_of_values_about_zero(rng):
    values = rng.normal(size=(501, 3)) * [1.0, 5.0, 0.01]
    values -= np.median(values, axis=0)
    assert robust_std(values) == pytest.approx(median_abs_deviation(values, scale="normal"))
    assert robust_std(values, axis=None) == pytest.approx(median_abs_deviation(values, axis=None, scale="normal"))


def test_an_upper_quantile_sees_a_quarter_of_large_values_and_a_median_does_not():
    values = np.random.default_rng(0).standard_normal(4000)
    assert quantile_std(values, 0.5) == pytest.approx(robust_std(values))
    assert quantile_std(values, 0.9) == pytest.approx(1.0, rel=0.05)
    values[::4] *= 8.0
    assert quantile_std(values, 0.9) > 2.5 and robust_std(values) < 1.4
