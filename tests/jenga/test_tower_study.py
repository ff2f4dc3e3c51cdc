"""Movable shares from scans, and the agreements of simulators on a real tower."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.jenga.settings import MovableSettings, Setup
from thesis_lib.jenga.tower_study import fidelity, movable_shares, movable_summary, scan_tower


def made_scan(tower: int, others: np.ndarray) -> pd.DataFrame:
    n = len(others)
    return pd.DataFrame({"tower": tower, "block": np.arange(n), "moved": 6.0, "others": others})


def test_shares_grow_with_the_threshold_and_are_counted_per_tower():
    scans = {
        "development": [made_scan(0, np.array([0.1, 0.9, 1.8, 3.0]))],
        "test": [
            made_scan(100, np.array([0.1, 0.2, 0.3, 9.0])),
            made_scan(101, np.array([9.0, 9.0, 9.0, 0.1])),
        ],
    }
    table = movable_shares(scans, MovableSettings())
    dev = table[table["set"] == "development"].set_index("threshold_mm")["share"]
    assert dev[0.5] == 0.25 and dev[1.0] == 0.5 and dev[2.0] == 0.75
    mean = movable_summary(table).set_index(["set", "threshold_mm"]).loc[("test", 1.0)]
    assert mean["mean"] == 0.5 and mean["n"] == 2 and mean["low"] < 0.25


@pytest.mark.slow
def test_simulators_agree_on_a_few_blocks():
    setup = Setup()
    scan = scan_tower(0, 3, setup)
    assert len(scan) == 3 and scan["layer"].nunique() == 3
    table = fidelity(scan, setup).set_index(["comparison", "quantity"])["value"]
    assert table[("half_the_time_step", "force_rmse")] < 0.3
    assert table[("reduced_tower", "force_rmse")] < 0.3
    assert set(table.index.get_level_values(0)) == {"half_the_time_step", "reduced_tower", "real_extraction"}
