"""What is said of a learned model: beliefs along pushes, forces against cone and height, agreement with truth."""

import numpy as np
import pytest

from thesis_lib.jenga.learners.learner import push_groups
from thesis_lib.jenga.study.model_study import agreements, cone_table, filtered, height_table, looks, of_one, summary
from thesis_lib.jenga.tower.settings import Setup

SETUP = Setup()


@pytest.mark.slow
def test_the_belief_of_a_push_starts_at_the_prior_and_knows_no_later_sample(learned, held):
    belief = filtered(learned, held)
    assert belief.sum(axis=1) == pytest.approx(1.0)
    first = [rows[0] for rows in push_groups(held)]
    assert belief[first] == pytest.approx(learned.initial_belief(held.context[first]))
    changed = held.select(np.arange(len(held)))
    rows = push_groups(held)[0]
    changed.next_state[rows[-1]] += 3.0
    assert filtered(learned, changed)[rows] == pytest.approx(belief[rows])


def test_the_cone_is_that_of_the_finger_and_the_noise_of_its_sensor(learned, held):
    table = cone_table(learned, held, SETUP)
    limit = 0.42 * np.maximum(table["f_n"], 0.0) + 2.0 * SETUP.sensing.force
    assert (table["inside"] == (table["f_t"].abs() <= limit)).all()
    assert len(table) == len(held) and set(table["abstraction"]) <= set(learned.names)


def test_the_height_is_that_of_the_blocks_layer(learned, held):
    table = height_table(learned, held, SETUP)
    assert len(table) == len(push_groups(held))
    assert table["height_mm"].to_numpy() == pytest.approx(15.0 * (table["block"] // 3 + 0.5))


def test_numbers_of_figure_5_7_find_a_planted_relation():
    import pandas as pd

    rng = np.random.default_rng(0)
    height = rng.uniform(0.0, 250.0, 80)
    table = pd.DataFrame({"height_mm": height, "f_n": 3.0 - 0.01 * height + 0.3 * rng.normal(size=80)})
    table["f_n_pred"] = rng.normal(size=80)
    cone = pd.DataFrame({"push": np.repeat(np.arange(20), 5), "inside": np.tile([1, 1, 1, 1, 0], 20)})
    found = summary(cone, table, rng).set_index("quantity")
    assert found.loc["inside_cone", "value"] == pytest.approx(0.8) and found.loc["inside_cone", "n"] == 20
    assert found.loc["height_correlation", "high"] < -0.7
    row = found.loc["height_correlation_predicted"]
    assert row["low"] < 0.0 < row["high"]


def test_agreement_and_looks_have_a_row_per_set_and_the_mean(learned, held):
    learners = {(300, 0): learned, (300, 1): learned}
    table = agreements(learners, held, SETUP, np.random.default_rng(3))
    assert sorted(table["set"]) == [-1, 0, 1]
    mean = table.set_index("set").loc[-1]
    assert mean["balanced_accuracy"] == pytest.approx(table["balanced_accuracy"].iloc[0])
    assert mean["balanced_accuracy"] > 0.7
    look = looks(learners, held)
    assert len(look) == 2 * learned.n_abstractions
    assert look["stuck_share"].dropna().between(0.0, 1.0).all()
    # what counts as stuck without truth is stuck more often by truth
    shares = look.groupby("stuck")["stuck_share"].mean()
    assert shares[1] > shares[0] + 0.3
    assert len(of_one(look)) == learned.n_abstractions
