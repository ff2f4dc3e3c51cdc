"""What is shown: frames of a game, and both cases of pushes of a real tower."""

import numpy as np
import pytest

from thesis_lib.jenga.play.game import Game
from thesis_lib.jenga.study.showcase import PICTURES, frames, straight_pushes
from thesis_lib.jenga.tower.settings import Setup


def test_frames_are_spread_over_the_game_and_begin_with_the_untouched_tower():
    game = Game("hma", 1, 0, 45, [], "all tried")
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
