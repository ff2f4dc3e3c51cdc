"""Tails and quantiles against scipy.stats."""

import numpy as np
import pytest
from scipy import stats

from thesis_lib.statistics import tails


@pytest.mark.parametrize("x", [0.0, 0.3, 2.0, 40.0])
@pytest.mark.parametrize("k", [1, 4, 300])
def test_tails_agree(x, k):
    assert tails.normal_tail(x) == pytest.approx(stats.norm.sf(x), rel=1e-12)
    assert tails.chi_square_tail(x, k) == pytest.approx(stats.chi2.sf(x, k), rel=1e-11)
    assert tails.f_tail(x, k, 17) == pytest.approx(stats.f.sf(x, k, 17), rel=1e-11)


def test_quantiles_agree():
    share = np.linspace(0.001, 0.999, 50)
    np.testing.assert_allclose(tails.chi_square_quantile(share, 3), stats.chi2.ppf(share, 3), rtol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 7, 50])
def test_a_binomial_tail_counts_the_case_itself(count):
    assert tails.binomial_tail(count, 50, 0.05) == pytest.approx(stats.binom.sf(count - 1, 50, 0.05), rel=1e-10)


@pytest.mark.parametrize("n", [5, 40, 333])
def test_a_line_and_its_interval_agree(n, rng):
    x = rng.normal(size=n)
    y = 0.4 * x + rng.standard_t(2, size=n)
    slope, _, low, high = stats.theilslopes(y, x)
    assert tails.theil_sen(x, y) == pytest.approx((slope, low, high), rel=1e-12)
