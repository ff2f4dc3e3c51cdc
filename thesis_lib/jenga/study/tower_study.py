"""Tower against thesis: share of movable blocks and its dependence on the threshold; agreement of simulators.

    movable  ⇔  in a straight, centred trial push no other block moves more than the threshold, and the block follows

The threshold was fixed on development towers so that 47 % are movable there; test towers check it, with Student's t
interval over towers.  The first development tower is compared with half the time step, with the reduced tower, and
with real extraction.

Source: thesis, section 5.4.4 (47 %).
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.movable import agreement, fractions, scan
from thesis_lib.jenga.robot.reduced import compare, faithfulness
from thesis_lib.jenga.tower.health import settled_tower
from thesis_lib.jenga.tower.settings import MovableSettings, Setup
from thesis_lib.jenga.tower.tower import REACHABLE, TowerError
from thesis_lib.statistics.intervals import student_mean

SCAN = ["tower", "block", "layer", "side", "force", "moved", "others", "movable"]
THRESHOLDS = (0.5, 0.75, 1.0, 1.5, 2.0)  # mm


def scan_tower(seed: int, scanned: int, setup: Setup, say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """`movable.scan` of `scanned` evenly spread blocks of a tower; no rows if the tower is refused."""
    # a step that is no multiple of three takes middle and side blocks in turn
    blocks = np.unique(np.linspace(0, len(REACHABLE) - 1, scanned).round().astype(int))
    try:
        tower = settled_tower(seed, setup)
    except TowerError as error:
        say(f"refused: {error}")
        return pd.DataFrame(columns=SCAN)
    return scan(tower, setup.movable, REACHABLE[blocks])


def movable_shares(scans: Mapping[str, Sequence[pd.DataFrame]], settings: MovableSettings) -> pd.DataFrame:
    """Rows of set (development, test), tower, threshold_mm, share, without refused towers.

    Raises UserError if every tower of a set was refused.
    """
    for name, tables in scans.items():
        if all(table.empty for table in tables):
            raise UserError(f"all {len(tables)} {name} towers were refused: none stands. See the logs of the scans.")
    parts = [
        fractions(pd.concat([table for table in tables if len(table)]), settings, THRESHOLDS).assign(set=name)
        for name, tables in scans.items()
    ]
    table = pd.concat(parts, ignore_index=True)
    table = table.rename(columns={"threshold": "threshold_mm", "movable": "share"})
    return table[["set", "tower", "threshold_mm", "share"]]


def movable_summary(shares: pd.DataFrame, scans: Mapping[str, Sequence[pd.DataFrame]]) -> pd.DataFrame:
    """Rows of set, threshold_mm, mean, low, high, n (towers), refused (towers that did not stand)."""
    refused = {name: sum(table.empty for table in tables) for name, tables in scans.items()}
    rows = [
        (name, threshold, *student_mean(part["share"].to_numpy()), len(part), refused[name])
        for (name, threshold), part in shares.groupby(["set", "threshold_mm"])
    ]
    return pd.DataFrame(rows, columns=["set", "threshold_mm", "mean", "low", "high", "n", "refused"])


def fidelity(scan_of: pd.DataFrame, setup: Setup, say: Callable[[str], None] = lambda _: None) -> pd.DataFrame:
    """Agreement on the blocks of one scan: comparison, quantity, value, n (blocks)."""
    seed, rows = int(scan_of["tower"].iloc[0]), []
    half = setup.tower.model_copy(update={"timestep": setup.tower.timestep / 2.0})
    finer = settled_tower(seed, setup.model_copy(update={"tower": half}))
    fine = scan(finer, setup.movable, scan_of["block"])
    both = scan_of.merge(fine, on=["tower", "block"], suffixes=("_full", "_reduced"))
    rows += [("half_the_time_step", name, value, len(both)) for name, value in faithfulness(both).items()]
    say("half the time step: done")
    tower = settled_tower(seed, setup)
    reduced = compare(tower, scan_of["block"], setup.movable)
    rows += [("reduced_tower", name, value, len(reduced)) for name, value in faithfulness(reduced).items()]
    say("reduced tower: done")
    real = agreement(settled_tower(seed, setup), scan_of)
    same = (real["movable"] == real["extracted"]).mean()
    rows.append(("real_extraction", "same_label", float(same), len(real)))
    movable = real[real["movable"] == 1]
    rows.append(("real_extraction", "movable_that_come_out", float(movable["extracted"].mean()), len(movable)))
    say("real extraction: done")
    return pd.DataFrame(rows, columns=["comparison", "quantity", "value", "n"])


def settled(setup: Setup, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Poses (54, 7) and sizes (54, 3), m, of a settled tower, for drawing."""
    tower = settled_tower(seed, setup)
    return tower.poses(), tower.sizes
