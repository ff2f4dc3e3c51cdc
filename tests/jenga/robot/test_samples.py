"""Samples keep what was collected and refuse what no standing tower can give."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pushes_for_tests import make_samples

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.robot.samples import (
    ENOUGH,
    F_N,
    RANGE,
    TOWER,
    PushSamples,
    as_table,
    join,
    read_samples,
    write_samples,
)


def _samples(n: int = 12, seed: int = 0) -> PushSamples:
    return make_samples(n, np.random.default_rng(seed), retract=0.3)[0]


def test_a_file_gives_back_what_was_written(tmp_path):
    samples = _samples()
    write_samples(samples, tmp_path / "s.csv")
    pd.testing.assert_frame_equal(as_table(read_samples(tmp_path / "s.csv")), as_table(samples), rtol=1e-8)


@pytest.mark.parametrize("value", [np.nan, np.inf, RANGE["tower"][1] + 0.1])
@pytest.mark.parametrize("which", ["state", "next_state"])
def test_rows_of_a_fallen_tower_are_refused(which, value):
    samples = _samples()
    values = getattr(samples, which).copy()
    values[7, TOWER] = value
    with pytest.raises(UserError, match=r"row 7.*fallen"):
        replace(samples, **{which: values})


def test_a_spoilt_file_is_refused_when_read(tmp_path):
    as_table(_samples()).replace({"n_tower": {_samples().next_state[2, TOWER]: 120.0}}).to_csv(tmp_path / "s.csv")
    with pytest.raises(UserError, match=r"tower = 120"):
        read_samples(tmp_path / "s.csv")


def test_a_data_set_in_which_nothing_resists_is_refused(tmp_path):
    samples = _samples(ENOUGH)
    samples.next_state[:, F_N] = 0.05
    with pytest.raises(UserError, match="exploded or is missing"):
        write_samples(samples, tmp_path / "s.csv")


def test_more_samples_than_there_are_and_arrays_of_unequal_length_are_refused():
    samples = _samples()
    assert np.array_equal(samples.first(5).state, samples.state[:5])
    with pytest.raises(UserError, match="13 samples"):
        samples.first(13)
    with pytest.raises(UserError, match="shape"):
        replace(samples, action=np.zeros((3, 2)))


def test_joined_towers_keep_their_pushes_apart():
    one, two = _samples(8), _samples(4, seed=1)
    assert join([one, two]).push.tolist() == [*one.push, *(two.push + one.push[-1] + 1)]
