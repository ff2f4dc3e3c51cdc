"""The oracle simulates each push on the tower before making it: an upper bound for the other policies.

For each block a straight push to the goal and the extraction are simulated, and the tower is restored.  The push is
made only if no damage was done.  The oracle is greedy: it judges each block alone, whatever the tower is worth
afterwards.  So it bounds policies that push straight and decide block by block, not every conceivable policy.

Simulated and real push agree to the last bit: the simulator is deterministic and does not use readings.
"""

from typing import ClassVar

import numpy as np

from thesis_lib.jenga.play.controller_settings import OracleSettings
from thesis_lib.jenga.play.policies import Action, Push, Retract
from thesis_lib.jenga.robot.movable import silent_robot
from thesis_lib.jenga.robot.primitives import Gripper
from thesis_lib.jenga.robot.sensing import MM
from thesis_lib.jenga.tower.tower import Tower, TowerError


class Oracle:
    """A `Policy` with access to the tower."""

    name = "oracle"
    SEES_TOWER: ClassVar[bool] = True
    tower: Tower

    def __init__(self, settings: OracleSettings | None = None):
        self.settings = settings or OracleSettings()

    def begin(self, rng: np.random.Generator) -> None:
        self.plan: Action = Retract()

    def start(self, block: int, context: np.ndarray) -> None:
        self.plan = Retract("would do damage")
        for offset in self.settings.offsets:
            if would_succeed(self.tower, block, Push(offset), self.settings.damage):
                self.plan = Push(offset)
                return

    def act(self, state: np.ndarray, context: np.ndarray) -> Action:
        return self.plan

    def observe(self, state: np.ndarray, action: Push, next_state: np.ndarray) -> None:
        pass


def would_succeed(tower: Tower, block: int, push: Push, damage: float) -> bool:
    """Whether `push`, repeated, and the gripper extract the block with others moved by at most `damage` (mm).

    The tower is restored afterwards.
    """
    before, poses = tower.save(), tower.poses()
    robot, gripper = silent_robot(tower), Gripper(tower)

    def harmless() -> bool:
        return not tower.fallen().size and MM * tower.perturbation(block, poses)[0] <= damage

    def extracted() -> bool:
        robot.start(block, push.offset / MM)
        while not robot.reached_goal():
            robot.push_step(push.offset / MM, push.heading)
            if not harmless() or (robot.at_end() and not robot.reached_goal()):
                return False
        robot.retract()
        outcome = gripper.extract(block)
        return outcome.success and MM * tower.perturbation(block, poses)[0] <= damage

    iterations = tower.iterations_needed
    try:
        return extracted()
    except TowerError:  # a collapse too violent to simulate is still a collapse
        return False
    finally:
        gripper.forget()
        tower.load(before)
        tower.iterations_needed = iterations
