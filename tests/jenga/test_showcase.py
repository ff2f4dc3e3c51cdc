"""The pushes that are shown: the steered one that strayed most, frames, and both cases of a real tower."""

import numpy as np
import pytest

from thesis_lib.jenga.game import Attempt, Game, Trajectory
from thesis_lib.jenga.settings import Setup
from thesis_lib.jenga.showcase import PICTURES, frames, straight_pushes


def recorded(strays: dict[int, float], out: set[int]) -> Game:
    """A game in which each block strays by so many mm; those in `out` came out."""
    game = Game("hma", 1, 0, 45, [], "all tried")
    for block, stray in strays.items():
        states = np.zeros((12, 7))
        states[:, 0] = states[:, 5] = np.arange(12)
        states[6:, 1] = stray
        game.attempts.append(Attempt(block, 3, 0, pushed=int(block in out)))
        game.trajectories.append(
            Trajectory(block, [9, 0], states.tolist(), np.zeros((12, 2)).tolist(), states.tolist())
        )
    return game


def test_frames_are_spread_over_the_game_and_begin_with_the_untouched_tower():
    game = recorded({4: 1.0}, {4})
    poses = np.zeros((54, 7))
    game.frames = [["start", -1, poses.tolist()]] + [["extracted", b, poses.tolist()] for b in range(20)]
    game.sizes = np.ones((54, 3)).tolist()
    pictures, sizes, titles, blocks = frames(game)
    assert len(pictures) == PICTURES == len(titles) and sizes.shape == (54, 3)
    assert titles[0] == "start" and blocks[0] == -1 and titles[-1] == "extracted (20 out)"


@pytest.mark.slow
def test_a_stuck_and_an_easy_block_are_found_and_differ():
    pushes = straight_pushes(0, Setup(), 30, np.random.default_rng(0))
    assert set(pushes) == {"stuck", "easy"}
    force = {case: push["readings"][5:, 3].mean() for case, push in pushes.items()}
    assert force["stuck"] > force["easy"]
    for push in pushes.values():
        assert len(push["readings"]) == len(push["actions"]) + 1
