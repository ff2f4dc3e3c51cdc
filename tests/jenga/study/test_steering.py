"""Block steering: pairs start alike, the controller acts only after the disturbance, the pair shown is the one said."""

import numpy as np
import pandas as pd
import pytest

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.learner import PushPrediction
from thesis_lib.jenga.play.settings import ShowcaseChoice
from thesis_lib.jenga.robot.samples import YAW, X, Y
from thesis_lib.jenga.study.steering import PUSH, steering_pushes, steering_summary, strayed_most
from thesis_lib.jenga.tower.settings import Setup


class Lever:
    """One abstraction that knows the lever arm: a push off the centre turns the block away from where it pushes."""

    n_abstractions = 1

    def initial_belief(self, context):
        return np.ones((len(context), 1))

    def update(self, belief, state, action, context, next_state):
        return belief

    def predict(self, state, action, context, belief):
        mean = state.copy()
        mean[:, X] += 1.0
        mean[:, YAW] -= 0.05 * action[:, 0]
        mean[:, Y] += 0.5 * np.sin(action[:, 1])
        return PushPrediction(mean[:, None], np.ones_like(mean)[:, None], np.ones((len(state), 1)))


@pytest.mark.slow
def test_a_model_of_the_lever_arm_brings_blocks_back_that_were_pushed_off_their_centre():
    choice = ShowcaseChoice(steered_blocks=1)
    steps, ends = steering_pushes(Lever(), [1], Setup(), choice, np.random.default_rng(11))
    assert len(ends) in (2, 4) and ends["out"].all()
    stray = ends.pivot(index=PUSH, columns="steered", values="stray")
    assert stray[1].mean() < 0.7 * stray[0].mean()
    for _, pair in steps.groupby(PUSH):
        straight, steered = (pair[pair["steered"] == i].reset_index(drop=True) for i in (0, 1))
        disturbed = range(int((steered["controlled"] == 0).sum()))
        assert 1 <= len(disturbed) <= choice.disturbed
        same = ["advance", "x", "y", "yaw", "offset", "heading"]
        pd.testing.assert_frame_equal(straight.loc[disturbed, same], steered.loc[disturbed, same])
        assert (straight.loc[straight["controlled"] == 1, "offset"] == 0).all()
        assert (steered.loc[steered["controlled"] == 1, "offset"] != 0).any()
    found = steering_summary(steps, ends).set_index("quantity")["value"]
    assert found["turned_back"] == 1.0 and found["stray_saved"] > 0.0


def test_the_summary_counts_blocks_and_sides():
    """Two blocks, both edges: three pushes begin on the side that turns the block back, one on the other."""
    steps, ends = [], []
    for block, edge, yaw, offset, saved in ((1, 8, -3, -8, 4), (1, -8, 3, 8, 0), (2, 8, -2, -4, 5), (2, -8, 2, -4, 1)):
        for steered in (0, 1):
            ends.append((1, block, edge, steered, 10 - saved * steered, int(steered or saved != 4)))
            rows = [(1, block, edge, steered, 0, 0.0, edge, 0)]  # the disturbance does not count
            rows += [(1, block, edge, steered, step, yaw, offset * steered, 1) for step in range(1, 6)]
            steps += [*rows, (1, block, edge, steered, 6, 0.0, 12.5, 1)]  # nor do later steps
    names = [*PUSH, "steered"]
    ends = pd.DataFrame(ends, columns=[*names, "stray", "out"])
    found = steering_summary(pd.DataFrame(steps, columns=[*names, "step", "yaw", "offset", "controlled"]), ends)
    found = found.set_index("quantity")
    assert found.loc["stray_saved", ["value", "n"]].tolist() == [2.5, 2]  # mean of blocks that saved 2 and 3
    assert found.loc["stray_saved", "std"] == pytest.approx(0.5)
    assert found.loc["out_saved", ["value", "std", "n"]].tolist() == [
        0.25,
        0.25,
        2,
    ]  # one of four came out only steered
    assert found.loc["turned_back", ["value", "n"]].tolist() == [0.75, 4]
    assert found.loc["edge", "value"] == pytest.approx((8 + 8 + 4 + 4) / 4 / 12.5)


def test_the_pair_shown_is_the_one_whose_straight_push_strayed_most_of_those_that_came_out():
    ends = pd.DataFrame(
        [(1, b, 8.0, s, 30, out, stray) for b, out, stray in ((1, 1, 2.0), (2, 1, 5.0), (3, 0, 9.0)) for s in (0, 1)],
        columns=[*PUSH, "steered", "steps", "out", "stray"],
    )  # fmt: skip
    steps = ends[[*PUSH, "steered"]].assign(step=0)
    assert set(strayed_most(steps, ends)["block"]) == {2}
    with pytest.raises(UserError, match="nothing to show"):
        strayed_most(steps, ends.assign(out=0))
