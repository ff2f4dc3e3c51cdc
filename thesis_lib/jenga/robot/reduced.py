"""The reduced tower: a fast variant in which only three layers can deform.

For a push of a block in layer l, layers below l − 1 are fixed, layers l − 1 to l + 1 are free, and all layers above
form one rigid body of the same mass on its own feet.  Forces agree with the full tower.  Displacements of the tower
agree less well because the upper layers cannot shear.  Collection and look-ahead may use it, counts of extractions not.

Each push starts from the same settled full tower, which it leaves unchanged.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from thesis_lib.jenga.robot.movable import is_movable, trial_push
from thesis_lib.jenga.tower.settings import MovableSettings
from thesis_lib.jenga.tower.tower import BLOCKS, Tower

SHAKEN = 25  # time steps until the contact forces are re-established


def reduce(tower: Tower, block: int) -> Tower:
    """The reduced tower for a push of `block` on the present full tower, with the full tower's reference for falls.

    Raises:
        TowerError: the simulation broke down.
    """
    blocks, layer = np.arange(BLOCKS), tower.layer
    below = frozenset(blocks[layer < layer[block] - 1].tolist())
    above = frozenset(blocks[layer > layer[block] + 1].tolist())
    reduced = Tower(
        tower.seed,
        tower.settings,
        tower.robot_settings,
        sizes=tower.sizes,
        poses=tower.poses(),
        static=below,
        lump=above,
    )
    reduced.layer, reduced.place = tower.layer.copy(), tower.place.copy()
    reduced.step(SHAKEN)
    reduced.reference = tower.reference.copy()
    return reduced


def compare(tower: Tower, blocks: Iterable[int], settings: MovableSettings) -> pd.DataFrame:
    """A trial push on both towers: block, then force (N), moved, others (mm), movable, each _full and _reduced."""
    rows = []
    for block in blocks:
        row = {"tower": tower.seed, "block": int(block)}
        for name, pushed in (("full", tower), ("reduced", reduce(tower, int(block)))):
            force, moved, others = trial_push(pushed, int(block), settings.steps)
            movable = int(is_movable(moved, others, settings))
            row |= {
                f"force_{name}": force,
                f"moved_{name}": moved,
                f"others_{name}": others,
                f"movable_{name}": movable,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def faithfulness(table: pd.DataFrame) -> dict[str, float]:
    """Of a `compare` table: correlation and RMSE (N) of peak force, correlation of `others`, share of equal labels."""
    force, reduced = table["force_full"], table["force_reduced"]
    return {
        "force_correlation": float(np.corrcoef(force, reduced)[0, 1]),
        "force_rmse": float(np.sqrt(np.mean((force - reduced) ** 2))),
        "others_correlation": float(np.corrcoef(table["others_full"], table["others_reduced"])[0, 1]),
        "same_label": float((table["movable_full"] == table["movable_reduced"]).mean()),
    }
