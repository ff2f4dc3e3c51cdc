"""Tower against thesis: share of movable blocks and its dependence on the threshold.

    movable  ⇔  in a straight, centred trial push no other block moves more than the threshold, and the block follows

Test towers check the share, with Student's t interval over towers.

Source: thesis, section 5.4.4 (47 %).
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.movable import fractions, scan
from thesis_lib.jenga.tower.settings import MovableSettings, Setup
from thesis_lib.jenga.tower.tower import REACHABLE, TowerError, settled_tower
from thesis_lib.statistics.intervals import student_mean

SCAN = ["tower", "block", "layer", "side", "force", "moved", "others", "movable"]
THRESHOLDS = (0.5, 0.75, 1.0, 1.5, 2.0)  # mm


def scan_tower(seed: int, scanned: int, setup: Setup, say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """`movable.scan` of `scanned` evenly spread blocks of a tower; no rows if the tower is refused."""
    blocks = spread(len(REACHABLE), scanned)
    try:
        tower = settled_tower(seed, setup)
    except TowerError as error:
        say(f"refused: {error}")
        return pd.DataFrame(columns=SCAN)
    return scan(tower, setup.movable, REACHABLE[blocks])


def spread(n: int, most: int) -> np.ndarray:
    """At most `most` of the numbers 0 to n − 1, evenly spread.  Of blocks: middle and side blocks in turn."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))


def movable_shares(scans: Mapping[str, Sequence[pd.DataFrame]], settings: MovableSettings) -> pd.DataFrame:
    """Rows of set (development, test), tower, threshold_mm, share; UserError if all towers of a set were refused."""
    for name, tables in scans.items():
        if all(table.empty for table in tables):
            raise UserError(f"all {len(tables)} {name} towers were refused: none stands. See the logs of the scans.")
    parts = [
        fractions(pd.concat([table for table in tables if len(table)]), settings, THRESHOLDS).assign(set=name)
        for name, tables in scans.items()
    ]
    return pd.concat(parts, ignore_index=True)[["set", "tower", "threshold_mm", "share"]]


def movable_summary(shares: pd.DataFrame, scans: Mapping[str, Sequence[pd.DataFrame]]) -> pd.DataFrame:
    """Rows of set, threshold_mm, mean, low, high, n (towers), refused (towers that did not stand)."""
    refused = {name: sum(table.empty for table in tables) for name, tables in scans.items()}
    rows = [
        (name, threshold, *student_mean(part["share"].to_numpy()), len(part), refused[name])
        for (name, threshold), part in shares.groupby(["set", "threshold_mm"])
    ]
    return pd.DataFrame(rows, columns=["set", "threshold_mm", "mean", "low", "high", "n", "refused"])
