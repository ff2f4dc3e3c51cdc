"""The oracle simulates each push on the tower before making it: an upper bound for the other policies.

For each block a straight push to the goal and the extraction are simulated, and the tower is restored.  The push is
made only if no damage was done.  The oracle judges each block alone, whatever the tower is worth afterwards, so it
bounds policies that push straight and decide block by block.  Simulated and real push agree to the last bit.
"""

from typing import ClassVar

import numpy as np

from thesis_lib.jenga.play.policies import Action, Policy, Push, Retract
from thesis_lib.jenga.play.settings import OracleSettings
from thesis_lib.jenga.robot.movable import comes_out
from thesis_lib.jenga.robot.samples import MM
from thesis_lib.jenga.tower.tower import Tower, TowerError


class Oracle(Policy):
    """A `Policy` with access to the tower."""

    name = "oracle"
    SEES_TOWER: ClassVar[bool] = True
    tower: Tower

    def __init__(self, settings: OracleSettings | None = None):
        self.settings = settings or OracleSettings()

    def start(self, block: int, context: np.ndarray) -> None:
        pushes = map(Push, self.settings.offsets)
        good = (push for push in pushes if would_succeed(self.tower, block, push, self.settings.damage))
        self.plan: Action = next(good, Retract("would do damage"))

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        return self.plan


def would_succeed(tower: Tower, block: int, push: Push, damage: float) -> bool:
    """Whether `push`, repeated, and the gripper extract the block with others moved by at most `damage` (mm)."""
    poses = tower.poses()

    def harmless() -> bool:
        return MM * tower.perturbation(block, poses)[0] <= damage

    try:
        return comes_out(tower, block, harmless, push.offset / MM, push.heading)
    except TowerError:  # a collapse too violent to simulate is still a collapse
        return False
