"""Agreement of abstractions with hidden truth."""

import numpy as np
import pytest
from pushes_for_tests import make_samples

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.abstractions import abstraction_table, agreement, infer_first_steps, stuck_group
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.settings import LearnerSettings, NetworkSettings

FAST = LearnerSettings(network=NetworkSettings(iterations=500))


@pytest.fixture(scope="module")
def all_kinds() -> Hma:
    return Hma(FAST).fit(make_samples(600, np.random.default_rng(0))[0], np.random.default_rng(1))


@pytest.mark.slow
def test_stuck_and_free_are_told_apart_without_truth(all_kinds: Hma) -> None:
    samples, _ = make_samples(4000, np.random.default_rng(5))
    found = agreement(all_kinds, samples, np.random.default_rng(6))
    assert found["balanced_accuracy"] > 0.85  # 0.92 to 0.96 over training sets; the target is 0.85
    assert found["low"] < found["balanced_accuracy"] < found["high"]
    assert found["n_stuck"] + found["n_free"] == len(infer_first_steps(all_kinds, samples)[0])


def test_wrong_truth_gives_no_agreement(all_kinds: Hma) -> None:
    """What the figure measures can fail: shuffled labels leave a coin's toss."""
    samples, _ = make_samples(1500, np.random.default_rng(5))
    rng = np.random.default_rng(7)
    label = rng.integers(0, 2, samples.push.max() + 1)[samples.push]
    shuffled = type(samples)(**(vars(samples) | {"truth": label}))
    found = agreement(all_kinds, shuffled, rng)
    assert found["low"] < 0.5 < found["high"] and abs(found["rand_index"]) < 0.1


def test_one_kind_of_pushes_has_no_accuracy(all_kinds: Hma) -> None:
    samples, _ = make_samples(100, np.random.default_rng(8), shares=(0, 1, 0, 0, 0))
    with pytest.raises(UserError, match="one kind"):
        agreement(all_kinds, samples, np.random.default_rng(0))
    with pytest.raises(UserError, match="no push has"):
        infer_first_steps(all_kinds, samples, steps=46)


def test_table_says_what_counts_as_stuck(all_kinds: Hma) -> None:
    table = abstraction_table(all_kinds)
    assert len(table) == all_kinds.n_abstractions
    np.testing.assert_array_equal(table["stuck"].astype(bool), stuck_group(all_kinds))
    assert table["share"].sum() == pytest.approx(1.0)
