"""Movable shares from scans, and the agreements of simulators on a real tower."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_table, write_table
from thesis_lib.jenga.study import tower_study
from thesis_lib.jenga.study.tower_study import fidelity, movable_shares, movable_summary, scan_tower
from thesis_lib.jenga.tower.settings import MovableSettings, Setup
from thesis_lib.jenga.tower.tower import TowerError


def made_scan(tower: int, others: np.ndarray) -> pd.DataFrame:
    n = len(others)
    return pd.DataFrame({"tower": tower, "block": np.arange(n), "moved": 6.0, "others": others})


def test_shares_grow_with_the_threshold_and_are_counted_per_tower():
    scans = {
        "development": [made_scan(0, np.array([0.1, 0.9, 1.8, 3.0]))],
        "test": [made_scan(100, np.array([0.1, 0.2, 0.3, 9.0])), made_scan(101, np.array([9.0, 9.0, 9.0, 0.1]))],
    }
    table = movable_shares(scans, MovableSettings())
    dev = table[table["set"] == "development"].set_index("threshold_mm")["share"]
    assert dev[0.5] == 0.25 and dev[1.0] == 0.5 and dev[2.0] == 0.75
    mean = movable_summary(table, scans).set_index(["set", "threshold_mm"]).loc[("test", 1.0)]
    assert mean["mean"] == 0.5 and mean["n"] == 2 and mean["low"] < 0.25 and mean["refused"] == 0


def test_a_refused_tower_is_counted_and_changes_no_share(tmp_path):
    def no_tower(seed, setup):
        raise TowerError(f"tower {seed} does not rest")

    said = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tower_study, "settled_tower", no_tower)
        refused = scan_tower(102, 45, Setup(), say=said.append)
    assert said == ["refused: tower 102 does not rest"]
    write_table(refused, tmp_path / "tower_102.csv")
    refused = read_table(tmp_path / "tower_102.csv", tower_study.SCAN)
    whole = {"test": [made_scan(100, np.array([0.1, 9.0])), made_scan(101, np.array([0.1, 0.2]))]}
    scans = {"test": [whole["test"][0], refused, whole["test"][1]]}
    shares = movable_shares(scans, MovableSettings())
    pd.testing.assert_frame_equal(shares, movable_shares(whole, MovableSettings()))
    assert set(movable_summary(shares, scans)["refused"]) == {1}
    with pytest.raises(UserError, match="all 1 test towers were refused"):
        movable_shares({"test": [refused]}, MovableSettings())


def test_the_tower_of_the_scan_is_not_pushed_again(monkeypatch):
    """Only finer and reduced towers are scanned: what the scan found of the full tower is taken from it."""
    scanned, tower = [], SimpleNamespace(poses=lambda: None)

    def made(pushed, settings, blocks):
        scanned.append(pushed)
        return made_scan_of(list(blocks), 2.0)

    monkeypatch.setattr(tower_study, "settled_tower", lambda seed, setup: "finer" if halved(setup) else tower)
    monkeypatch.setattr(tower_study, "reduce", lambda full, block: f"reduced {block}")
    monkeypatch.setattr(tower_study, "scan", made)
    monkeypatch.setattr(tower_study, "comes_out", lambda tower, block, damage: block == 13)
    scans = [made_scan_of([3, 5, 7], 1.0), made_scan_of([13], 1.0, seed=1)]
    table = fidelity(scans, Setup(), compared=2).set_index(["comparison", "quantity"])["value"]
    assert scanned == ["finer", "reduced 3", "reduced 7"]
    assert table[("reduced_tower", "force_rmse")] == pytest.approx(1.0)
    assert table[("real_extraction", "come_out")] == 0.5  # of blocks 3 and 13, on both towers


def made_scan_of(blocks: list[int], force: float, seed: int = 0) -> pd.DataFrame:
    values = {"force": force + np.array(blocks), "others": 0.1 * np.array(blocks), "movable": 1}
    return pd.DataFrame({"tower": seed, "block": blocks} | values)


def halved(setup: Setup) -> bool:
    return setup.tower.timestep < Setup().tower.timestep


@pytest.mark.slow
def test_simulators_agree_on_a_few_blocks():
    setup = Setup()
    scan = scan_tower(0, 2, setup)
    assert len(scan) == 2 and scan["layer"].nunique() == 2
    table = fidelity([scan], setup, compared=45).set_index(["comparison", "quantity"])["value"]
    assert table[("half_the_time_step", "force_rmse")] < 0.3
    assert table[("reduced_tower", "force_rmse")] < 0.3
    assert set(table.index.get_level_values(0)) == {"half_the_time_step", "reduced_tower", "real_extraction"}
