"""Pushing as a reinforcement-learning environment (gymnasium): an episode is one push of one block.

    R = Σ_t [b1 Δx_t − b2 D1(p_t) − b3 D2(p_t)] + b4 D3
    p = 0.4 · max(d / 20 mm, θ / 30°),   D1 = clip((p − 0.08) / (0.4 − 0.08), 0, 1),   D2 = [p > 0.4 or a fall]

Δx (mm) is the block's progress, d and θ are the largest displacement and rotation of any other block, b1 … b4 are
`RewardSettings`.

The reward is taken from a student's re-implementation, which quotes the paper's supplement; that is not public.
Own choices: D2 is 1 instead of 100, counts once and ends the episode.  D3 = 1 if the block reaches the goal
and no other block is damaged in the push, because extraction is not simulated.  Rewards use the true poses; the policy
sees readings only.  Retracting gives 0.

Each push begins on a freshly settled, reduced tower.  A new tower is drawn from the training seeds after
`pushes_per_tower` pushes and after each fall.

Source: N. Fazeli et al., Science Robotics 4, eaav3123 (2019), doi 10.1126/scirobotics.aav3123 (thesis, section 5.5.2).
"""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from thesis_lib.jenga.play.policies import Action, Push, Retract
from thesis_lib.jenga.play.settings import EpisodeSettings, RewardSettings
from thesis_lib.jenga.robot.robot import Robot
from thesis_lib.jenga.robot.samples import ACTION, CONTEXT, MM, STATE, X
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower import LAYERS, REACHABLE, Snapshot, Tower, TowerError, reduce, settled_tower

# mm, N: scales each reading to about 1 (goal, half a block's width, force limit, longest push, damage); layers, side
TYPICAL = np.array([33.0, 12.0, 12.0, 4.0, 2.0, 45.0, 10.0, LAYERS, 1.0])
SEEN_LIMIT = 5.0  # bound of a scaled reading
REFUSED = 3  # number of unusable towers in a row that indicates faulty settings rather than a faulty tower
REASONS = ("goal", "damaged", "retracted", "longest push", "fell", "tower dragged", "broke down")
GOAL, DAMAGED, RETRACTED, LONGEST, FELL, DRAGGED, BROKEN = range(len(REASONS))


@dataclass(frozen=True)
class Episode:
    """Finished push: tower's seed, block, samples (advances and a retreat), unscaled reward, index into `REASONS`."""

    tower: int
    block: int
    samples: int
    reward: float
    reason: int


def observation(state: np.ndarray, context: np.ndarray) -> np.ndarray:
    """Policy input (9,), float32, from a reading (7,) and context (2,): scaled to about 1, within ±`SEEN_LIMIT`."""
    seen = np.concatenate([state, context]) / TYPICAL
    return np.clip(seen, -SEEN_LIMIT, SEEN_LIMIT).astype(np.float32)


def as_action(action: np.ndarray, settings: EpisodeSettings) -> Action:
    """Push or retreat encoded by an action (3,) in [−1, 1]: contact location, heading, retract."""
    offset, heading, retract = np.clip(np.asarray(action, dtype=float), -1.0, 1.0)
    if retract > settings.retract:
        return Retract()
    return Push(settings.offset * offset, settings.heading * heading)


def perturbation(distance: float, angle: float, settings: RewardSettings) -> float:
    """Perturbation p from the largest displacement (m) and rotation (rad) of any other block."""
    return settings.limit * max(MM * distance / settings.distance, np.degrees(angle) / settings.angle)


def step_reward(progress: float, p: float, fell: bool, settings: RewardSettings) -> float:
    """Reward of one step without the terminal bonus, for progress in mm and p as in `perturbation`."""
    d1 = np.clip((p - settings.start) / (settings.limit - settings.start), 0.0, 1.0)
    d2 = float(fell or p > settings.limit)
    return float(settings.progress * progress - settings.tower * d1 - settings.fall * d2)


class PushEnv(gymnasium.Env):
    """Environment of pushes on random blocks of random training towers; `episodes` lists the finished pushes."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (gymnasium declares it so)

    def __init__(
        self, episode: EpisodeSettings | None = None, reward: RewardSettings | None = None, setup: Setup | None = None
    ):
        self.settings, self.reward = episode or EpisodeSettings(), reward or RewardSettings()
        self.setup = setup or Setup()
        width = len(STATE) + len(CONTEXT)
        self.observation_space = gymnasium.spaces.Box(-SEEN_LIMIT, SEEN_LIMIT, (width,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (len(ACTION) + 1,), np.float32)
        self.episodes: list[Episode] = []
        self._pushes_left = 0

    def build(self, seed: int) -> Tower:
        """Return the settled tower of `seed`."""
        return settled_tower(seed, self.setup)

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        """Start a new push at the centre of a block and return the first reading; a seed restarts all randomness.

        options: {"block": number} selects the block.  TowerError if `REFUSED` towers or pushes in a row are unusable.
        """
        super().reset(seed=seed)
        if seed is not None:
            self._pushes_left = 0
        block = (options or {}).get("block")
        for _ in range(REFUSED - 1):
            try:
                return self._begin(block), {}
            except TowerError:
                self._pushes_left = 0
        return self._begin(block), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Advance by 1 mm, or retreat, which ends the episode."""
        self._samples += 1
        asked = as_action(action, self.settings)
        if isinstance(asked, Retract):
            return self._end(0.0, RETRACTED)
        robot, tower, block = self._robot, self._robot.tower, self._robot.block
        try:
            _, self._reading = robot.push_step(asked.offset / MM, asked.heading)
        except TowerError:
            # breakdowns of the simulation other than a collapse are not the policy's fault
            return self._end(-self.reward.fall, FELL) if tower.collapsed() else self._end(0.0, BROKEN)
        x = robot.state()[X]
        progress, self._x = x - self._x, x
        distance, angle = tower.perturbation(block, robot.start_poses)
        p, fell = perturbation(distance, angle, self.reward), bool(tower.fallen().size)
        reward = step_reward(progress, p, fell, self.reward)
        if fell or p > self.reward.limit:
            return self._end(reward, FELL if fell else DRAGGED)
        if robot.reached_goal():
            if tower.robot_settings.is_damage(distance, angle):
                return self._end(reward, DAMAGED)
            return self._end(reward + self.reward.extraction, GOAL)
        if robot.at_end():
            return self._end(reward, LONGEST)
        self._gained += reward
        return self._observe(), self.reward.scale * reward, False, False, {}

    def _begin(self, block: int | None) -> np.ndarray:
        if self._pushes_left == 0:
            seed = self.settings.first_tower + int(self.np_random.integers(self.settings.towers))
            self._tower = self.build(seed)
            self._settled: Snapshot = self._tower.save()
            self._pushes_left = self.settings.pushes_per_tower
        self._pushes_left -= 1
        block = int(self.np_random.choice(REACHABLE)) if block is None else block
        self._tower.load(self._settled)
        tower = reduce(self._tower, block)
        self._robot = Robot(tower, self.setup.sensing, self.np_random)
        self._reading = self._robot.start(block)
        self._context = tower.context(block)
        self._x, self._gained, self._samples = self._robot.state()[X], 0.0, 0
        return self._observe()

    def _observe(self) -> np.ndarray:
        return observation(self._reading, self._context)

    def _end(self, reward: float, reason: int) -> tuple[np.ndarray, float, bool, bool, dict]:
        """End the episode; if the simulation broke down, it is truncated instead of terminated."""
        if reason in (FELL, DRAGGED, BROKEN):
            self._pushes_left = 0
        tower, block = self._robot.tower.seed, self._robot.block
        self.episodes.append(Episode(tower, block, self._samples, self._gained + reward, reason))
        broken = reason == BROKEN
        return self._observe(), self.reward.scale * reward, not broken, broken, {"reason": REASONS[reason]}
