"""Recordings in space as cameras and their programs make them: stamps of arrival, pictures that are repeated."""

import numpy as np
import pandas as pd
import pytest
from tosses import simulate_tosses

from thesis_lib.critique.likelihood.in_space.hits import beside, observe_in_space
from thesis_lib.datasets import dataset_of

BOX = {"shape": {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}, "homogeneous": True, "mass": 0.25}
HEAD = {"schema": 2, "body": BOX, "rate": 240.0, "noise": {"position": 2e-4, "rotation": 3e-3}}


@pytest.fixture(scope="module")
def tossed() -> pd.DataFrame:
    return simulate_tosses(HEAD, 12, np.random.default_rng(4)).trajectories


def observed(table: pd.DataFrame):
    return observe_in_space(dataset_of(HEAD, trajectories=table), episodes=False)


@pytest.mark.slow
def test_nothing_is_changed_where_nothing_is_wrong(tossed):
    assert observed(tossed).found.warnings == ()


@pytest.mark.slow
def test_stamps_of_arrival_give_way_to_those_of_the_pictures(tossed):
    rng, right = np.random.default_rng(0), observed(tossed)
    late = tossed.assign(t=tossed["t"] + np.minimum(rng.exponential(2e-3, len(tossed)), 4e-3))
    mended = observed(late)
    (said,) = mended.found.warnings
    assert said.startswith("The time stamps are those of arrival")
    assert abs(len(mended) - len(right)) <= 2
    hits = {(int(n), int(i)): k for k, (n, i) in enumerate(zip(right.trial, right.impact))}
    both = [(k, hits[n, i]) for k, (n, i) in enumerate(zip(mended.trial, mended.impact)) if (n, i) in hits]
    one, other = np.array(both).T
    off = beside(mended, 0).velocity[:, one] - beside(right, 0).velocity[:, other]
    assert len(both) > 15 and np.median(np.abs(off)) < 0.01  # of 2 m/s


def test_pictures_that_repeat_the_one_before_are_lost_frames(tossed):
    table, rows = tossed.copy(), np.arange(6, len(tossed), 7)
    rows = rows[tossed["trial"].to_numpy()[rows] == tossed["trial"].to_numpy()[rows - 1]]
    pose = [name for name in table if name not in ("trial", "t")]
    table.loc[table.index[rows], pose] = tossed[pose].to_numpy()[rows - 1]
    o = observed(table)
    assert len(o.found.warnings) == 1 and "repeat the one before" in o.found.warnings[0]
    assert len(o) > 10
