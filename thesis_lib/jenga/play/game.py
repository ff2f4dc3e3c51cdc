"""A game of one policy on one tower, until something falls or every block has been tried.

The nominal execution loop of the thesis (section 5.4.3): take a random block and push it in steps of 1 mm until the
policy retracts, the block is far enough out, or 45 mm are reached; extract it and place it on top.  The run ends when a
block falls off the tower, the tower topples, or all blocks have been tried.

The seed of the tower and `base_seed` fix the tower, the order of blocks, the noise of each block's readings
and the places on top, whatever the policy does.  The policy's random choices come from a separate stream.

Success (thesis, section 5.5.3): a push succeeds if the block reaches the goal and no other block moves by more than
10 mm or turns by more than 15 degrees in that push.  Extraction and placement are judged likewise, separately.  The
score (`Game.extractions`, figure 5-5B) is the number of blocks pushed and extracted with success before the run ends:
a retreat does not end the count, and damage costs the block without ending the run.  An unusable tower gives a
`refused` game, which is counted but has no score.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.foundation.files import read_json, write_json
from thesis_lib.jenga.play.policies import Policy, Retract
from thesis_lib.jenga.robot.movable import hidden_label
from thesis_lib.jenga.robot.primitives import FELL_FROM_TOP, Gripper
from thesis_lib.jenga.robot.robot import Robot
from thesis_lib.jenga.robot.samples import F_N, MM, TOWER, UNKNOWN
from thesis_lib.jenga.tower.settings import Setup
from thesis_lib.jenga.tower.tower import REACHABLE, TowerError, settled_tower

ALL_TRIED, DROPPED, TOPPLED, REFUSED = "all tried", "block dropped", "tower toppled", "refused"
SCHEMA = 1
NOT_TRIED = -1


@dataclass
class Attempt:
    """One block that was tried, and the result.

    layer, side: where it was (0 middle, 1 side).  truth: hidden label (0 free, 1 stuck, -1 unknown).  steps:
    pushes of 1 mm.  peak_force (N), perturbation (mm): largest readings.  damage: true largest displacement (mm) of any
    other block during the push.  pushed, extracted, placed: 1 success, 0 failure, -1 not tried.  reason: why it ended.
    """

    block: int
    layer: int
    side: int
    truth: int = UNKNOWN
    steps: int = 0
    peak_force: float = 0.0
    perturbation: float = 0.0
    damage: float = 0.0
    pushed: int = 0
    extracted: int = NOT_TRIED
    placed: int = NOT_TRIED
    reason: str = ""


@dataclass
class Game:
    """A finished game.

    blocks: number of blocks to be tried.  end: why it ended.  error: why it was refused.  frames: (title, block, poses
    (54, 7)) of the untouched tower and after each extracted block; `sizes` (54, 3), m, belong to them.
    """

    policy: str
    seed: int
    base_seed: int
    blocks: int
    attempts: list[Attempt]
    end: str
    error: str = ""
    frames: list = field(default_factory=list)
    sizes: list = field(default_factory=list)

    @property
    def refused(self) -> bool:
        """Whether the tower was unusable, so that the game has no score."""
        return self.end == REFUSED

    @property
    def extractions(self) -> int:
        """Number of blocks extracted, which is the score; UserError if the game was refused."""
        return self._count(lambda attempt: attempt.pushed == 1 and attempt.extracted == 1)

    @property
    def placements(self) -> int:
        """Number of blocks placed with success.  Errors as in `extractions`."""
        return self._count(lambda attempt: attempt.placed == 1)

    def table(self) -> pd.DataFrame:
        """Table with a row per block tried: policy, tower and the fields of `Attempt`."""
        names = [item.name for item in fields(Attempt)]
        rows = pd.DataFrame([asdict(attempt) for attempt in self.attempts], columns=names)
        return rows.assign(policy=self.policy, tower=self.seed)[["policy", "tower", *names]]

    def _count(self, successful: Callable[[Attempt], bool]) -> int:
        if self.refused:
            raise UserError(
                f"the game of {self.policy} on tower {self.seed} was refused ({self.error}): count it as refused, or "
                "leave the tower out for every policy."
            )
        return sum(map(successful, self.attempts))


class _Play:
    """A game in progress."""

    def __init__(self, seed: int, policy: Policy, setup: Setup, base_seed: int, label: bool):
        self.seed, self.policy, self.setup, self.base_seed, self.label = seed, policy, setup, base_seed, label
        self.tower = settled_tower(seed, setup)
        self.gripper = Gripper(self.tower)
        self.places = _stream(base_seed, seed, "place")
        if policy.SEES_TOWER:
            policy.tower = self.tower
        policy.begin(_stream(base_seed, seed, f"policy {policy.name}"))

    def try_block(self, attempt: Attempt) -> str:
        """Push and, if the block is out, extract and place; return the reason that ends the run, or an empty text."""
        tower, policy, block = self.tower, self.policy, attempt.block
        context = tower.context(block)
        if self.label:
            attempt.truth = hidden_label(tower, block, self.setup.movable)
        policy.start(block, context)
        noise = _stream(self.base_seed, self.seed, f"readings {block}")
        robot = Robot(tower, self.setup.sensing, noise)
        attempt.reason = self._push(robot, attempt, context)
        distance, angle = tower.perturbation(block, robot.start_poses)
        attempt.damage = round(MM * distance, 4)
        if attempt.reason in (DROPPED, TOPPLED):
            return attempt.reason
        robot.retract()
        if attempt.reason != "goal":
            return self._fallen(block)
        attempt.pushed = int(not tower.robot_settings.is_damage(distance, angle))
        return self._extract_and_place(attempt)

    def _push(self, robot: Robot, attempt: Attempt, context: np.ndarray) -> str:
        """Push until there is a reason to stop, and return it."""
        policy, reading = self.policy, robot.start(attempt.block)
        while True:
            action = policy.act(reading, context)
            if isinstance(action, Retract):
                return action.reason
            before, reading = robot.push_step(action.offset / MM, action.heading)
            policy.observe(before, action, reading)
            attempt.steps += 1
            attempt.peak_force = max(attempt.peak_force, round(float(reading[F_N]), 4))
            attempt.perturbation = max(attempt.perturbation, round(float(reading[TOWER]), 4))
            if ended := self._fallen(attempt.block):
                return ended
            if robot.reached_goal():
                return "goal"
            if robot.at_end():
                return "longest push"

    def _extract_and_place(self, attempt: Attempt) -> str:
        outcome = self.gripper.extract(attempt.block)
        attempt.extracted = int(outcome.success)
        attempt.reason = outcome.reason or attempt.reason
        if self.gripper.held is None:
            return (self._fallen(attempt.block) or DROPPED) if outcome.ends_run else ""
        if outcome.ends_run:
            return TOPPLED
        outcome = self.gripper.place(self.places)
        attempt.placed = int(outcome.success)
        attempt.reason = outcome.reason or attempt.reason
        if outcome.ends_run:
            return FELL_FROM_TOP if outcome.reason == FELL_FROM_TOP else TOPPLED
        return self._fallen(attempt.block)

    def _fallen(self, block: int) -> str:
        if self.tower.toppled(block):
            return TOPPLED
        return DROPPED if block in self.tower.fallen() else ""


def play(
    seed: int,
    policy: Policy,
    setup: Setup | None = None,
    base_seed: int = 0,
    *,
    blocks: int = len(REACHABLE),
    label: bool = False,
    frames: bool = False,
) -> Game:
    """Play the tower of `seed`, trying at most `blocks` blocks.

    label: determine the hidden label of each block before it is touched.  frames: keep the poses after each extraction.
    If the tower is unusable, or its simulation breaks down while it stands, the game is refused.
    """
    setup = setup or Setup()
    game = Game(policy.name, seed, base_seed, blocks, [], ALL_TRIED)
    playing = None
    try:
        playing = _Play(seed, policy, setup, base_seed, label)
        tower = playing.tower
        if frames:
            game.sizes = _rounded(tower.sizes)
            game.frames.append(["start", -1, _rounded(tower.poses())])
        for block in block_order(seed, base_seed)[:blocks]:
            block = int(block)
            attempt = Attempt(block, int(tower.layer[block]), int(tower.is_side(block)))
            game.attempts.append(attempt)
            ended = playing.try_block(attempt)
            if frames and (attempt.extracted == 1 or ended):
                game.frames.append([ended or "extracted", block, _rounded(tower.poses())])
            if ended:
                game.end = ended
                break
    except TowerError as error:
        # a tower that collapsed counts as toppled, not as unusable
        if playing is not None and tower.collapsed():
            game.end = TOPPLED
            game.attempts[-1].reason = TOPPLED
        else:
            game.end, game.error = REFUSED, str(error)
    return game


def block_order(seed: int, base_seed: int) -> np.ndarray:
    """Order (45,) in which blocks of the tower are tried, the same for every policy."""
    return _stream(base_seed, seed, "order").permutation(REACHABLE)


def _stream(base_seed: int, seed: int, name: str) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(base_seed, spawn_key=(5, seed, *name.encode())))


def _rounded(values: np.ndarray) -> list:
    """Values rounded to 0.1 µm, finer than any sensor."""
    return np.round(values, 7).tolist()


def write_game(game: Game, path: str | Path) -> None:
    """Write a game to a JSON file, atomically."""
    write_json({"schema": SCHEMA, **asdict(game)}, path)


def read_game(path: str | Path) -> Game:
    """Read a file of `write_game`; UserError if it is missing, CorruptFileError if it does not contain a full game."""
    value = read_json(path)
    try:
        if value.pop("schema") != SCHEMA:
            raise ValueError("the file has another version")
        value["attempts"] = [Attempt(**attempt) for attempt in value["attempts"]]
        return Game(**{item.name: value[item.name] for item in fields(Game)})
    except (KeyError, TypeError, ValueError) as error:
        raise CorruptFileError(f"{path} does not contain a valid game ({error}); delete it and play again.") from error
