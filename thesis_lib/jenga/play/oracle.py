"""The oracle: simulates a push on the tower itself before it makes it, and so sets the ceiling.

For each block the tower is saved, a straight push is simulated to the goal and the block extracted, and the tower
restored.  The push is made only if that went without damage.  It is greedy: it judges each block alone, without asking
what the tower will be worth afterwards, so it is a ceiling for policies that push straight and decide block by block,
not for every conceivable one.

The simulated push and the real one are the same to the last bit, for the simulator is deterministic and readings play
no part in it.
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
    """A `Policy` that is given the tower."""

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
    """Whether repeating `push` brings the block out, and the gripper extracts it, with other blocks moved by at most
    `damage` (mm) in all; the tower is as before afterwards."""
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
    except TowerError:  # an imagined collapse too violent to simulate is a collapse
        return False
    finally:
        gripper.forget()
        tower.load(before)
        tower.iterations_needed = iterations
