"""Bisection of many bodies at once, in either direction."""

import numpy as np

from thesis_lib.mechanics.bisection import bisected


def test_every_interval_is_halved_about_where_its_condition_changes():
    at = np.array([0.1, 0.5, 0.9])
    below, above = bisected(lambda x: x < at, np.zeros(3), np.ones(3), 30)
    assert (
        (below < at).all() and (at <= above).all() and np.ptp(above - below) == 0.0 and (above - below)[0] == 2.0**-30
    )
    upper, lower = bisected(lambda x: x >= 0.3, 1.0, 0.0, 30)
    assert lower < 0.3 <= upper and upper - lower == 2.0**-30
