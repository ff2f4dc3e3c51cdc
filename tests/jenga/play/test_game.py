"""Games on a made tower of stuck, free and fatal blocks follow the thesis's rules; one on a real tower agrees."""

from typing import ClassVar

import numpy as np
import pytest
from tower_for_tests import FREE_BLOCK, SEED, STUCK_BLOCK, Settled

from thesis_lib.foundation.errors import CorruptFileError, UserError
from thesis_lib.jenga.play import game as playing
from thesis_lib.jenga.play.game import block_order, play, read_game, write_game
from thesis_lib.jenga.play.policies import AlwaysPush, RulePolicy
from thesis_lib.jenga.robot.primitives import PrimitiveOutcome
from thesis_lib.jenga.robot.robot import reading
from thesis_lib.jenga.robot.samples import FREE, STUCK
from thesis_lib.jenga.tower.settings import RobotSettings, Setup, TowerSettings
from thesis_lib.jenga.tower.tower import BLOCKS, REACHABLE, TowerError

FREE_KIND, STUCK_KIND, FATAL, LOST, BREAKS, COLLAPSES = range(6)


class MadeTower:
    """What a push does is a block's kind; nothing is simulated."""

    kinds: ClassVar[dict[int, int]] = {}

    def __init__(self, seed):
        self.seed, self.robot_settings = seed, RobotSettings()
        self.layer, self.sizes = np.arange(BLOCKS) // 3, np.ones((BLOCKS, 3))
        self.moved, self.down = 0.0, np.array([], dtype=int)

    def poses(self):
        return np.zeros((BLOCKS, 7))

    def is_side(self, block):
        return block % 3 != 1

    def context(self, block):
        return np.array([17 - block // 3, float(self.is_side(block))])

    def perturbation(self, block, since=None):
        return self.moved, 0.0

    def fallen(self):
        return self.down

    def collapsed(self):
        return bool(self.down.size)

    def toppled(self, block=None):
        return bool((self.down != (-1 if block is None else block)).any())

    def kind(self, block):
        return self.kinds.get(block, STUCK_KIND)


class MadeRobot:
    def __init__(self, tower, sensing, rng):
        self.tower, self.sensing, self.rng = tower, sensing, rng

    def start(self, block):
        self.block, self.steps, self.start_poses, self.tower.moved = block, 0, None, 0.0
        return self._reading()

    def _reading(self):
        kind, state = self.tower.kind(self.block), np.zeros(7)
        stuck = kind == STUCK_KIND
        state[0], state[5] = 0.0 if stuck else self.steps, self.steps
        state[3], state[6] = (0.6 * self.steps, 0.8 * self.steps) if stuck else (0.05, 0.0)
        self.tower.moved = 1e-3 * state[6]
        return reading(state, self.sensing, self.rng)

    def push_step(self, offset, heading):
        before = self._reading()
        self.steps += 1
        if self.steps == 10 and self.tower.kind(self.block) == FATAL:
            self.tower.down = np.array([self.block])
        if self.steps == 10 and self.tower.kind(self.block) in (BREAKS, COLLAPSES):
            if self.tower.kind(self.block) == COLLAPSES:
                self.tower.down = np.arange(9, 12)
            raise TowerError("the contact solver reached its cap")
        return before, self._reading()

    def reached_goal(self):
        return self.tower.kind(self.block) != STUCK_KIND and self.steps >= 33

    def at_end(self):
        return self.steps >= 45

    def retract(self):
        pass


class MadeGripper:
    def __init__(self, tower):
        self.tower, self.held = tower, None

    def extract(self, block):
        if self.tower.kind(block) == LOST:
            return PrimitiveOutcome("lost from the jaws", True)
        self.held = block
        return PrimitiveOutcome("", False)

    def place(self, rng):
        self.held = None
        return PrimitiveOutcome("", False)


@pytest.fixture
def made(monkeypatch):
    def prepare(order: list[int], kinds: dict[int, int]):
        monkeypatch.setattr(MadeTower, "kinds", kinds)
        for name, fake in (("Robot", MadeRobot), ("Gripper", MadeGripper)):
            monkeypatch.setattr(playing, name, fake)
        monkeypatch.setattr(playing, "settled_tower", lambda seed, setup: MadeTower(seed))
        monkeypatch.setattr(playing, "block_order", lambda seed, base_seed: np.array(order))

    return prepare


def test_free_blocks_are_extracted_and_stuck_ones_given_up(made):
    made([4, 5, 6], {4: FREE_KIND, 6: FREE_KIND})
    game = play(0, RulePolicy())
    table = game.table().set_index("block")
    assert (game.extractions, game.placements, game.end) == (2, 2, "all tried")
    assert table["extracted"].tolist() == [1, -1, 1]
    assert table.loc[4, "steps"] == 33 and table.loc[5, "steps"] < 5
    assert table["side"].tolist() == [0, 1, 1] and table["layer"].tolist() == [1, 1, 2]


def test_always_push_does_damage_and_a_damaged_push_is_no_success(made):
    made([5, 8], {})
    (attempt,) = play(0, AlwaysPush(), blocks=1).attempts
    assert (attempt.pushed, attempt.extracted, attempt.steps) == (0, -1, 45)
    assert attempt.damage > 10 and attempt.reason == "longest push"


@pytest.mark.parametrize("kind, end", [(FATAL, "block dropped"), (LOST, "block dropped"), (COLLAPSES, "tower toppled")])
def test_a_fall_ends_the_run_and_what_was_extracted_counts(made, kind, end):
    made([4, 7, 10], {4: FREE_KIND, 7: kind, 10: FREE_KIND})
    game = play(0, RulePolicy())
    assert (game.extractions, game.end, len(game.attempts)) == (1, end, 2)
    assert not game.refused


def test_a_standing_tower_whose_simulation_breaks_down_is_refused(made):
    made([4, 7], {4: FREE_KIND, 7: BREAKS})
    game = play(0, RulePolicy())
    assert game.refused and "cap" in game.error
    for score in ("extractions", "placements"):
        with pytest.raises(UserError, match="refused"):
            getattr(game, score)


def test_a_tower_that_cannot_be_settled_is_refused_and_not_a_score():
    game = play(1, RulePolicy(), Setup(tower=TowerSettings(iterations=2)))
    assert game.refused and not game.attempts and "iterations" in game.error


def test_policies_meet_the_same_blocks_and_noise(made, monkeypatch):
    def readings(policy, seed=0, base_seed=0) -> np.ndarray:
        """Those of the second block, after the first was played, too."""
        seen = []
        monkeypatch.setattr(policy, "observe", lambda state, action, after: seen.append(after))
        assert play(seed, policy, base_seed=base_seed).extractions == 2
        return np.array(seen[33:])

    made([4, 7], {4: FREE_KIND, 7: FREE_KIND})
    first = readings(RulePolicy())
    np.testing.assert_array_equal(readings(AlwaysPush()), first)
    assert (readings(RulePolicy(), base_seed=1) != first).any() and (readings(RulePolicy(), seed=1) != first).any()


def test_the_order_is_a_permutation_fixed_by_the_seeds():
    np.testing.assert_array_equal(np.sort(block_order(3, 0)), REACHABLE)
    np.testing.assert_array_equal(block_order(3, 0), block_order(3, 0))
    assert (block_order(3, 0) != block_order(4, 0)).any() and (block_order(3, 0) != block_order(3, 1)).any()


def test_a_file_gives_the_same_game_again(made, tmp_path):
    made([4, 5], {4: FREE_KIND})
    game = play(0, RulePolicy(), frames=True)
    assert [frame[0] for frame in game.frames] == ["start", "extracted"]
    path = tmp_path / "game.json"
    write_game(game, path)
    assert read_game(path) == game
    text = path.read_bytes()
    write_game(play(0, RulePolicy(), frames=True), path)
    assert path.read_bytes() == text


@pytest.mark.parametrize("text", ["{", '{"schema": 1}', '{"schema": 0, "attempts": []}'])
def test_what_is_not_a_finished_game_is_refused(tmp_path, text):
    path = tmp_path / "game.json"
    path.write_text(text)
    with pytest.raises(CorruptFileError, match="delete it"):
        read_game(path)


@pytest.mark.slow
def test_three_blocks_of_a_real_tower(monkeypatch):
    """Paired with the hidden labels: the free ones come out, the stuck one does not, and the tower stands."""
    tower = Settled.get()
    monkeypatch.setattr(playing, "settled_tower", lambda *_: tower)
    monkeypatch.setattr(playing, "block_order", lambda *_: np.array([STUCK_BLOCK, FREE_BLOCK, 37]))
    game = play(SEED, RulePolicy(), label=True, frames=True)
    table = game.table()
    assert game.end == "all tried" and game.extractions == 2
    assert table["truth"].tolist() == [STUCK, FREE, FREE]
    assert table["extracted"].tolist() == [-1, 1, 1] and (table["damage"] < 10).all()
    poses = np.array(game.frames[-1][2])
    assert poses[FREE_BLOCK, 2] > 0.265 and poses[37, 2] > 0.265  # on top of 18 layers
