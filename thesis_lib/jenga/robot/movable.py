"""Hidden label of each block, which the robot has to infer: movable or stuck.

Each block is pushed straight at its centre by a few mm; the tower is restored after each push.  A block is movable if
it follows the finger (x ≥ share · advance: a stuck block may bend the finger alone) and no other block moves by more
than the threshold, fixed so that about 47 % of the blocks of towers 0 to 4 are movable (thesis, section 5.4.4;
movable_summary.csv).
"""

from collections.abc import Callable, Iterable

import numpy as np
import pandas as pd

from thesis_lib.jenga.robot.primitives import Gripper
from thesis_lib.jenga.robot.robot import Robot
from thesis_lib.jenga.robot.samples import F_N, FREE, STUCK, TOWER, X
from thesis_lib.jenga.tower.settings import MovableSettings
from thesis_lib.jenga.tower.tower import REACHABLE, Tower

SCAN = ["tower", "block", "layer", "side", "force", "moved", "others", "movable"]


def trial_push(tower: Tower, block: int, steps: int) -> tuple[float, float, float]:
    """Peak force (N) of a straight centred push, displacement (mm) of the block, and largest of any other block (mm).

    The tower is restored afterwards.  Errors as in `Robot.start`.
    """
    before = tower.save()
    robot = Robot(tower)
    robot.start(block)
    peak = 0.0
    for _ in range(steps):
        robot.push_step(0.0, 0.0)
        peak = max(peak, robot.state()[F_N])
    state = robot.state()
    tower.load(before)
    return peak, float(state[X]), float(state[TOWER])


def is_movable(moved: np.ndarray, others: np.ndarray, settings: MovableSettings) -> np.ndarray:
    """Whether blocks count as movable, from their displacement and the largest of any other block, (n,), mm."""
    enough = settings.follows * settings.steps
    return (np.asarray(moved) >= enough) & (np.asarray(others) <= 1e3 * settings.threshold)


def hidden_label(tower: Tower, block: int, settings: MovableSettings) -> int:
    """Return `FREE` or `STUCK` as found by a trial push; the tower is restored."""
    _, moved, others = trial_push(tower, block, settings.steps)
    return FREE if is_movable(moved, others, settings) else STUCK


def scan(tower: Tower, settings: MovableSettings, blocks: Iterable[int] = tuple(REACHABLE)) -> pd.DataFrame:
    """Table with a row per block pushed: tower, block, layer, side, force (N), moved, others (mm), movable."""
    rows = [
        (tower.seed, block, tower.layer[block], int(tower.is_side(block)), *trial_push(tower, block, settings.steps))
        for block in map(int, blocks)
    ]
    table = pd.DataFrame(rows, columns=SCAN[:-1])
    return table.assign(movable=is_movable(table["moved"], table["others"], settings).astype(int))


def comes_out(
    tower: Tower, block: int, damage: Callable[[float, float], bool], offset: float = 0.0, heading: float = 0.0
) -> bool:
    """Whether repeating one push (m, rad) and gripping extract a block without a fall and without damage.

    damage: decides from the largest displacement (m) and rotation (rad) of any other block.  The tower is restored
    afterwards.  Errors as in `Robot.start`.
    """
    before, iterations, poses = tower.save(), tower.iterations_needed, tower.poses()
    robot, gripper = Robot(tower), Gripper(tower)
    try:
        robot.start(block, offset)
        while not robot.reached_goal():
            robot.push_step(offset, heading)
            harmed = tower.fallen().size or damage(*tower.perturbation(block, poses))
            if harmed or (robot.at_end() and not robot.reached_goal()):
                return False
        robot.retract()
        return gripper.extract(block).success and not damage(*tower.perturbation(block, poses))
    finally:
        if gripper.held is not None:
            gripper.let_go()
        tower.load(before)
        tower.iterations_needed = iterations
