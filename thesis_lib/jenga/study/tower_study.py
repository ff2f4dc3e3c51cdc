"""Checks of the simulated tower: share of movable blocks against the threshold; agreement of simulators.

    movable  ⇔  in a straight, centred trial push no other block moves more than the threshold, and the block follows

The share is checked on test towers, with Student's t interval over towers.  The first development tower is compared
with half the time step and with the reduced tower; blocks of all development towers are compared with real extraction
(pushed straight to the goal and pulled out).

Source: thesis, section 5.4.4 (47 %).
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.movable import SCAN, comes_out, is_movable, scan
from thesis_lib.jenga.tower.settings import MovableSettings, Setup
from thesis_lib.jenga.tower.tower import REACHABLE, TowerError, reduce, settled_tower
from thesis_lib.statistics.intervals import student_mean

THRESHOLDS = (0.5, 0.75, 1.0, 1.5, 2.0)  # mm


def scan_tower(seed: int, scanned: int, setup: Setup, say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Table of `movable.scan` for `scanned` evenly spread blocks of a tower; no rows if the tower is refused."""
    blocks = spread(len(REACHABLE), scanned)
    try:
        tower = settled_tower(seed, setup)
    except TowerError as error:
        say(f"refused: {error}")
        return pd.DataFrame(columns=SCAN)
    return scan(tower, setup.movable, REACHABLE[blocks])


def spread(n: int, most: int) -> np.ndarray:
    """At most `most` of the numbers 0 to n − 1, evenly spread; for blocks, middle and side blocks alternate."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))


def movable_shares(scans: Mapping[str, Sequence[pd.DataFrame]], settings: MovableSettings) -> pd.DataFrame:
    """Table of set (development, test), tower, threshold_mm, share; UserError if all towers of a set were refused."""
    rows = []
    for name, tables in scans.items():
        standing = [table for table in tables if len(table)]
        if not standing:
            raise UserError(f"all {len(tables)} {name} towers were refused; see the logs of the scans.")
        table = pd.concat(standing)
        for threshold in THRESHOLDS:
            varied = settings.model_copy(update={"threshold": 1e-3 * threshold})
            movable = pd.Series(is_movable(table["moved"], table["others"], varied))
            share = movable.groupby(table["tower"].to_numpy()).mean()
            rows += [(name, seed, threshold, value) for seed, value in share.items()]
    return pd.DataFrame(rows, columns=["set", "tower", "threshold_mm", "share"])


def movable_summary(shares: pd.DataFrame, scans: Mapping[str, Sequence[pd.DataFrame]]) -> pd.DataFrame:
    """Table of set, threshold_mm, mean, low, high, n (towers), refused (towers that did not stand)."""
    refused = {name: sum(table.empty for table in tables) for name, tables in scans.items()}
    rows = [
        (name, threshold, *student_mean(part["share"].to_numpy()), len(part), refused[name])
        for (name, threshold), part in shares.groupby(["set", "threshold_mm"])
    ]
    return pd.DataFrame(rows, columns=["set", "threshold_mm", "mean", "low", "high", "n", "refused"])


def fidelity(
    scans: Sequence[pd.DataFrame], setup: Setup, compared: int, say: Callable[[str], None] = lambda _: None
) -> pd.DataFrame:
    """Agreement on `compared` evenly spread blocks of the first, or of all scans: comparison, quantity, value, n."""
    scan_of = scans[0].iloc[spread(len(scans[0]), compared)].reset_index(drop=True)
    seed, rows = int(scan_of["tower"].iloc[0]), []
    half = setup.tower.model_copy(update={"timestep": setup.tower.timestep / 2.0})
    finer = settled_tower(seed, setup.model_copy(update={"tower": half}))
    rows += agreement("half_the_time_step", scan_of, scan(finer, setup.movable, scan_of["block"]))
    say("half the time step: done")
    tower = settled_tower(seed, setup)
    reduced = [scan(reduce(tower, block), setup.movable, [block]) for block in map(int, scan_of["block"])]
    rows += agreement("reduced_tower", scan_of, pd.concat(reduced, ignore_index=True))
    say("reduced tower: done")
    of_all = pd.concat(scans, ignore_index=True)
    parts = []
    for seed, part in of_all.iloc[spread(len(of_all), compared)].groupby("tower"):
        tower = settled_tower(int(seed), setup)
        out = [int(comes_out(tower, block, setup.robot.is_damage)) for block in map(int, part["block"])]
        parts.append(part.assign(extracted=out))
        say(f"real extraction from tower {seed}: done")
    real = pd.concat(parts, ignore_index=True)
    rows.append(("real_extraction", "come_out", float(real["extracted"].mean()), len(real)))
    rows.append(("real_extraction", "same_label", float((real["movable"] == real["extracted"]).mean()), len(real)))
    movable = real[real["movable"] == 1]
    rows.append(("real_extraction", "movable_that_come_out", float(movable["extracted"].mean()), len(movable)))
    return pd.DataFrame(rows, columns=["comparison", "quantity", "value", "n"])


def agreement(comparison: str, full: pd.DataFrame, other: pd.DataFrame) -> list[tuple]:
    """Rows of `fidelity` for two scans of the same blocks: peak forces (RMSE in N), other blocks, labels."""
    force, others = full["force"], other["force"]
    values = {
        "force_correlation": np.corrcoef(force, others)[0, 1],
        "force_rmse": np.sqrt(np.mean((force - others) ** 2)),
        "others_correlation": np.corrcoef(full["others"], other["others"])[0, 1],
        "same_label": (full["movable"] == other["movable"]).mean(),
    }
    return [(comparison, name, float(value), len(full)) for name, value in values.items()]
