"""The robust standard deviation is the usual one of normal values, and hardly moved by wild ones."""

import numpy as np
import pytest
from scipy.stats import median_abs_deviation

from thesis_lib.statistics.spread import robust_std


def test_it_is_scipys_of_values_about_zero(rng):
    values = rng.normal(size=(501, 3)) * [1.0, 5.0, 0.01]
    values -= np.median(values, axis=0)
    assert robust_std(values) == pytest.approx(median_abs_deviation(values, scale="normal"))
    assert robust_std(values, axis=None) == pytest.approx(median_abs_deviation(values, axis=None, scale="normal"))


def test_wild_values_hardly_count(rng):
    values = rng.normal(0.0, 2.0, 10_000)
    values[::20] = 1e6
    assert robust_std(values) == pytest.approx(2.0, rel=0.1)
