"""Collected samples repeat, come from standing towers only, and carry the right hidden label."""

import numpy as np
import pandas as pd
import pytest
from tower_for_tests import FREE_BLOCK, SEED, STUCK_BLOCK, Settled

from thesis_lib.jenga.robot.movable import hidden_label, is_movable, scan, trial_push
from thesis_lib.jenga.robot.samples import ADVANCE, F_N, FREE, STATE, STUCK, UNKNOWN, PushSamples, as_table
from thesis_lib.jenga.study import collect as collecting
from thesis_lib.jenga.study.collect import REFUSED, collect, explore_tower
from thesis_lib.jenga.study.tower_study import agreement
from thesis_lib.jenga.tower.settings import CollectSettings, MovableSettings, Setup
from thesis_lib.jenga.tower.tower import BLOCKS, TowerError, reduce
from thesis_lib.thesis.figures.chapter5.showcase import figure_5_5a, figure_game

REDUCED = Setup(collect=CollectSettings(reduced=True))


@pytest.fixture(scope="module")
def collected() -> tuple[PushSamples, pd.DataFrame]:
    return explore_tower(SEED, 7, REDUCED, limit=25)


@pytest.mark.slow
def test_a_tower_gives_the_same_samples_again(collected):
    samples, _ = explore_tower(SEED, 7, REDUCED, limit=8)
    pd.testing.assert_frame_equal(as_table(samples), as_table(collected[0].first(8)))
    other, _ = explore_tower(SEED, 8, REDUCED, limit=3)
    assert not np.array_equal(other.state, samples.state[:3])


@pytest.mark.slow
def test_a_limit_of_force_ends_pushes_and_none_changes_nothing(collected):
    no_limit = collected[0]
    limited = Setup(collect=CollectSettings(reduced=True, force_limit=0.5))
    samples, table = explore_tower(SEED, 7, limited, limit=15)
    last = np.append(np.diff(samples.push) != 0, True)
    assert (samples.next_state[~last, F_N] <= 0.5).all()
    ended = table["reason"] == "force"
    assert ended.any() and (no_limit.next_state[:, F_N] > 0.5).any()
    assert "force" not in set(collected[1]["reason"])
    same = int(table["steps"].to_numpy()[: int(np.argmax(ended))].sum())  # until the first push that it ends
    pd.testing.assert_frame_equal(as_table(samples.first(same)), as_table(no_limit.first(same)))


def test_samples_of_a_push_follow_each_other(collected):
    samples, table = collected
    assert len(samples) == 25 and table["steps"].sum() == 25
    same = np.diff(samples.push) == 0
    assert (samples.step[1:][same] == samples.step[:-1][same] + 1).all()
    assert (samples.step[1:][~same] == 0).all()
    # a step advances the arm by cos(heading) mm, known exactly
    gained = samples.next_state[:, ADVANCE] - samples.state[:, ADVANCE]
    assert np.allclose(gained, np.cos(samples.action[:, 1]))
    # what is seen after a step is what is seen before the next, but where contact was made anew
    kept = same & (samples.action[1:, 0] == samples.action[:-1, 0])
    equal = np.isclose(samples.state[1:], samples.next_state[:-1]).all(axis=1)
    assert equal[kept].mean() > 0.5
    assert not equal[same & ~kept].all()


def assert_the_same_but_unlabelled(unlabelled: PushSamples, labelled: PushSamples):
    assert set(labelled.truth) <= {FREE, STUCK} and set(unlabelled.truth) == {UNKNOWN}
    same = [as_table(samples).drop(columns="truth") for samples in (unlabelled, labelled)]
    pd.testing.assert_frame_equal(*same, check_exact=True)


def test_samples_without_the_hidden_label_are_otherwise_the_same(collected):
    samples, table = explore_tower(SEED, 7, REDUCED, limit=8, label=False)
    assert_the_same_but_unlabelled(samples, collected[0].first(8))
    assert set(table["truth"]) == {UNKNOWN}


def test_a_push_that_misses_feels_nothing_and_has_no_label():
    always = Setup(collect=CollectSettings(reduced=True, miss=1.0))
    samples, table = explore_tower(SEED, 7, always, limit=6)
    assert set(samples.truth) == set(table["truth"]) == {UNKNOWN}
    assert np.abs(samples.next_state[:, F_N]).max() < 5 * always.sensing.force
    assert np.abs(samples.next_state[:, 0]).max() < 5e3 * always.sensing.pose_first


@pytest.mark.slow
def test_the_whole_tower_is_played_on():
    samples, table = explore_tower(SEED, 7, limit=6)
    assert len(samples) == 6
    assert table["block"].is_unique
    # here a push finds the tower as the last one left it
    assert_the_same_but_unlabelled(explore_tower(SEED, 7, limit=6, label=False)[0], samples)


def test_a_refused_tower_is_left_out_whole_and_recorded(monkeypatch):
    def sometimes(seed, base_seed, setup, limit, label):
        if seed < REFUSED - 1:
            raise TowerError(f"tower {seed} has toppled")
        n = min(limit, 4)
        zeros, ids = np.zeros((n, len(STATE))), np.arange(n)
        samples = PushSamples(ids, 0 * ids, zeros, zeros[:, :2], zeros, zeros[:, :2], 0 * ids, ids, ids)
        return samples, pd.DataFrame([dict.fromkeys(collecting.ATTEMPT, seed)])

    monkeypatch.setattr(collecting, "explore_tower", sometimes)
    samples, table = collect(6, 0, 0)
    assert len(samples) == 6
    assert table["block"].tolist() == [-1] * (REFUSED - 1) + [REFUSED - 1, REFUSED]
    assert "toppled" in table["reason"][0]
    with pytest.raises(TowerError):  # too many in a row
        collect(6, -1, 0)


def test_a_scan_says_which_blocks_are_movable_and_leaves_nothing_behind():
    tower, settings = Settled.get(), MovableSettings()
    before = tower.save()
    table = scan(tower, settings, [FREE_BLOCK, STUCK_BLOCK])
    assert table["movable"].tolist() == [1, 0]
    assert table["force"][1] > 10 * table["force"][0]
    assert hidden_label(tower, FREE_BLOCK, settings) == FREE
    assert hidden_label(tower, STUCK_BLOCK, settings) == STUCK
    assert np.array_equal(tower.save().state, before.state)


def test_movable_needs_both_to_follow_and_to_leave_the_tower_alone():
    settings = MovableSettings(steps=6, threshold=1e-3, follows=0.5)
    assert is_movable(np.array([6.0, 6.0, 0.1]), np.array([0.1, 1.1, 0.0]), settings).tolist() == [True, False, False]


def test_the_reduced_tower_weighs_the_same_and_fixes_what_it_says():
    tower = Settled.get()
    reduced = reduce(tower, STUCK_BLOCK)
    layer = STUCK_BLOCK // 3
    free = 3 * 3 + 1 + 2  # three layers of blocks, one lump, tip and hand with its two jaws
    assert reduced.model.nbody == 1 + free + 2
    blocks_mass = tower.model.body_mass[1:].sum() - reduced.model.body_mass[1:].sum()
    fixed = tower.settings.density * np.prod(tower.sizes[: 3 * (layer - 1)], axis=1).sum()
    assert blocks_mass == pytest.approx(fixed)
    start = reduced.poses()
    trial_push(reduced, STUCK_BLOCK, 2)
    assert np.array_equal(start[: 3 * (layer - 1)], reduced.poses()[: 3 * (layer - 1)])


@pytest.mark.slow
def test_the_reduced_tower_agrees_with_the_full_one_on_force_and_label():
    blocks = [0, 7, 13, 20, 25, 33, 38, 44]
    tower, settings = Settled.get(), MovableSettings()
    pairs = [[scan(pushed, settings, [block]) for pushed in (tower, reduce(tower, block))] for block in blocks]
    full, reduced = (pd.concat(scans, ignore_index=True) for scans in zip(*pairs))
    found = {name: value for _, name, value, _ in agreement("reduced_tower", full, reduced)}
    assert found["force_correlation"] > 0.98
    assert found["same_label"] >= 0.8


def test_the_tower_is_drawn_with_its_blocks_where_they_are():
    tower = Settled.get()
    poses = tower.poses()
    figure, table = figure_5_5a(poses, tower.sizes)
    polygons = figure.axes[0].collections[0].get_paths()
    assert len(polygons) == 3 * BLOCKS  # three sides of a box are seen
    assert np.allclose(table[["x", "y", "z"]], poses[:, :3])
    poses[5] = np.nan
    strip, _ = figure_game([tower.poses(), poses], tower.sizes, ["before", "after"], [-1, 3])
    assert [len(each.collections[0].get_paths()) for each in strip.axes] == [3 * BLOCKS, 3 * (BLOCKS - 1)]
