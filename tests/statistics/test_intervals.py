"""Intervals hold the truth as often as they say; standard errors of shares are never zero."""

import numpy as np
import pytest
from scipy.stats import binomtest, norm

from thesis_lib.statistics.bootstrap import bootstrap_gain, bootstrap_mean, central_95, resampled
from thesis_lib.statistics.intervals import (
    Z95,
    clustered_mean,
    mean_of,
    median_interval,
    ratio_of_means,
    share_of,
    student_mean,
    wilson,
    wilson_std,
)

REPETITIONS = 400
COVERAGE_ERROR = 0.035  # three standard errors of a share of 95 % in 400 repetitions


def covered(intervals, truth: float) -> float:
    """Share of the repetitions whose interval holds the truth."""
    ends = np.array([next(intervals)[-2:] for _ in range(REPETITIONS)])
    return float(((ends[:, 0] <= truth) & (truth <= ends[:, 1])).mean())


class TestShares:
    @pytest.mark.parametrize(("k", "n"), [(0, 10), (3, 10), (7, 10), (10, 10), (190, 200)])
    def test_wilsons_interval_is_scipys(self, k, n):
        assert wilson(k, n) == pytest.approx(binomtest(k, n).proportion_ci(method="wilson"), abs=1e-12)
        assert pytest.approx(norm.ppf(0.975), abs=1e-15) == Z95

    def test_a_share_of_nothing_is_unknown(self):
        assert np.isnan(wilson(0, 0)).all()
        with pytest.raises(ValueError, match="not NaN"):
            share_of(np.array([np.nan]))

    def test_no_case_at_all_still_has_a_standard_error(self):
        assert wilson_std(0.0, 859) == pytest.approx(0.5 / 860)
        assert wilson_std(1.0, 859) == pytest.approx(0.5 / 860)
        assert share_of(np.zeros(9)) == (0.0, pytest.approx(0.05))

    @pytest.mark.parametrize("share", [0.002, 0.1, 0.5])
    def test_it_is_the_spread_of_repeated_shares(self, rng, share):
        n = 500
        seen = rng.binomial(n, share, 4000) / n
        # mean over repetitions, since each sees another share; at 0.002 a third of the repetitions see none
        mean = np.mean([wilson_std(p, n) for p in seen])
        assert mean == pytest.approx(seen.std(), rel=0.1)

    def test_what_has_no_answer_is_left_out(self):
        assert share_of(np.array([1.0, 0.0, np.nan, np.nan]))[0] == 0.5
        assert mean_of(np.array([1.0, 3.0, np.nan])) == (2.0, pytest.approx(1.0))


class TestMeans:
    def test_students_interval_of_six_values(self, rng):
        assert covered((student_mean(rng.normal(3.0, 2.0, 6)) for _ in iter(int, 1)), 3.0) == pytest.approx(
            0.95, abs=COVERAGE_ERROR
        )
        assert np.isnan(student_mean(np.array([1.0]))[1:]).all()

    def test_the_median_of_skewed_values(self, rng):
        # the exact coverage of these order statistics is 0.965
        drawn = (median_interval(rng.exponential(size=41)) for _ in iter(int, 1))
        assert covered(drawn, np.log(2.0)) == pytest.approx(0.965, abs=COVERAGE_ERROR)
        assert median_interval(np.array([3.0, 1.0, 2.0])) == (1.0, 3.0)

    @pytest.mark.parametrize("method", ["linearised", "bootstrap"])
    def test_values_that_are_alike_within_trials(self, rng, method):
        trial = np.repeat(np.arange(40), 3)

        def interval():
            values = np.repeat(rng.standard_normal(40), 3)  # three impacts of a trial say the same
            if method == "bootstrap":
                return bootstrap_mean(values, trial, 199, rng)
            return clustered_mean(values, trial)[1:]

        low, high = interval()
        assert high - low > 1.3 * 2.0 * Z95 / np.sqrt(120)  # one that counts impacts would be √3 times too narrow
        assert covered((interval() for _ in iter(int, 1)), 0.0) == pytest.approx(0.94, abs=COVERAGE_ERROR)

    def test_a_single_trial_has_no_interval(self):
        assert clustered_mean([2.0, 4.0], [7, 7])[0] == 3.0
        assert np.isnan(clustered_mean([2.0, 4.0], [7, 7])[1:]).all() and np.isnan(clustered_mean([], [])).all()

    def test_ratio_of_means(self, rng):
        made = [ratio_of_means(rng.normal(4.0, 1.0, 100), np.r_[np.nan, rng.normal(2.0, 1.0, 50)]) for _ in range(500)]
        ratio, std = np.array(made).T
        assert ratio.mean() == pytest.approx(2.0, rel=0.02)
        assert std.mean() == pytest.approx(ratio.std(), rel=0.15)
        assert np.isnan(ratio_of_means(np.array([1.0]), np.array([1.0, 2.0]))).all()
        assert np.isnan(ratio_of_means(np.array([1.0, 2.0]), np.zeros(3))).all()
        assert ratio_of_means(np.zeros(3), np.array([1.0, 2.0])) == (0.0, 0.0)


class TestBootstrap:
    def test_a_gain_is_that_of_the_cases_and_its_interval_that_of_the_trials(self, rng):
        gain = rng.normal(1.0, 0.5, 60)  # of trials with two cases each
        value, low, high = bootstrap_gain(gain, 120, 4000, rng)
        assert value == pytest.approx(gain.sum() / 120)
        assert high - low == pytest.approx(2.0 * Z95 * gain.std() * np.sqrt(60) / 120, rel=0.06)

    def test_rows_stay_together(self, rng):
        x = rng.normal(size=80)
        pairs = np.stack([x, x + 0.1 * rng.normal(size=80)], axis=1)
        drawn = resampled(pairs, lambda rows: float(np.corrcoef(rows.T)[0, 1]), 200, rng)
        assert central_95(drawn)[0] > 0.98
