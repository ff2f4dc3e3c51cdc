"""Standard errors of shares: never zero, and the usual ones away from the ends."""

import numpy as np
import pytest

from thesis_lib.statistics.shares import mean_of, ratio_of_means, share_of, wilson_std


def test_no_case_at_all_still_has_a_standard_error():
    assert wilson_std(0.0, 859) == wilson_std(1.0, 859) == pytest.approx(0.5 / 860)
    assert share_of(np.zeros(9)) == (0.0, pytest.approx(0.05))


def test_away_from_the_ends_it_is_the_usual_one():
    assert wilson_std(0.3, 2000) == pytest.approx(np.sqrt(0.21 / 2000), rel=1e-3)


@pytest.mark.parametrize("share", [0.002, 0.1, 0.5])
def test_it_is_the_spread_of_repeated_shares(rng, share):
    n = 500
    seen = rng.binomial(n, share, 4000) / n
    # mean over repetitions, since each sees another share; at 0.002 a fifth of the repetitions see none
    mean = np.mean([wilson_std(p, n) for p in seen])
    assert mean == pytest.approx(seen.std(), rel=0.1)


def test_what_has_no_answer_is_left_out():
    assert share_of(np.array([1.0, 0.0, np.nan, np.nan]))[0] == 0.5
    with pytest.raises(ValueError, match="no cases"):
        share_of(np.array([np.nan]))
    assert mean_of(np.array([1.0, 3.0, np.nan])) == (2.0, pytest.approx(1.0))


def test_ratio_of_means(rng):
    made = [
        ratio_of_means(rng.normal(4.0, 1.0, 100), np.r_[np.nan, rng.normal(2.0, 1.0, 50)]) for _ in range(500)
    ]
    ratio, std = np.array(made).T
    assert ratio.mean() == pytest.approx(2.0, rel=0.02)
    assert std.mean() == pytest.approx(ratio.std(), rel=0.15)
    assert np.isnan(ratio_of_means(np.array([1.0]), np.array([1.0, 2.0]))).all()
    assert np.isnan(ratio_of_means(np.array([1.0, 2.0]), np.zeros(3))).all()
    assert ratio_of_means(np.zeros(3), np.array([1.0, 2.0])) == (0.0, 0.0)
