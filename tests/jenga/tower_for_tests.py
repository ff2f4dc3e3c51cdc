"""One settled tower, shared by the tests of a module and restored for each."""

import numpy as np

from thesis_lib.jenga.robot.robot import Robot, Sensor
from thesis_lib.jenga.tower.settings import SensingSettings
from thesis_lib.jenga.tower.tower import Snapshot, Tower

SEED = 0
FREE_BLOCK, STUCK_BLOCK = 28, 13  # of that tower, found by a scan; the tests say what they show
EXACT = SensingSettings(pose_first=0.0, pose_last=0.0, force=0.0, tower=0.0)


class Settled:
    """Builds the tower once."""

    tower: Tower | None = None
    snapshot: Snapshot | None = None

    @classmethod
    def get(cls) -> Tower:
        if cls.tower is None:
            cls.tower = Tower(SEED).settle()
            cls.snapshot = cls.tower.save()
        cls.tower.load(cls.snapshot)
        cls.tower.iterations_needed = 0
        return cls.tower


def exact_robot(tower: Tower) -> Robot:
    """A robot with perfect senses."""
    return Robot(tower, Sensor(EXACT, np.random.default_rng(0)))
