"""Hits of a body whose quaternions or stamps are written wrongly or late are found along its true path, also behind
pictures that are repeated; models judge what is written."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tosses import simulate_tosses

from thesis_lib.critique.contacts.kinds import bind
from thesis_lib.critique.drops.world import Drops
from thesis_lib.critique.likelihood.in_space.hits import beside, observe_in_space
from thesis_lib.datasets import dataset_of
from thesis_lib.datasets.format.table_forms import QUATERNION
from thesis_lib.effects import EFFECTS

LAW, TRUTH = "anitescu_potra_newton", {"mu": 0.25, "epsilon": 0.5}
TURN = Rotation.from_rotvec([0.4, -1.0, 0.7])
CONTENT = {
    "schema": 2,
    "body": {"shape": {"kind": "box", "half_extents": [0.05, 0.04, 0.03]}, "mass": 0.25, "homogeneous": True},
    "rate": 240.0,
    "noise": {"position": 2e-4, "rotation": 3e-3},
    "tracked": {"position": [0.02, -0.01, 0.03], "quaternion": TURN.as_quat(scalar_first=True).tolist()},
    "gravity": TURN.apply([0.0, 0.0, -9.81]).tolist(),
}
WRITTEN = {  # what stands in the columns of w, x, y, z
    ("misread_rotation", "reading", 2.0): lambda q: q[:, [1, 2, 3, 0]],
    ("misread_rotation", "reading", 3.0): lambda q: q * [1.0, -1.0, 1.0, 1.0],
    ("mirrored_rotation", "mirrored_axis", 2.0): lambda q: q * [1.0, -1.0, 1.0, -1.0],
}


@pytest.fixture(scope="module")
def tossed():
    made = simulate_tosses(CONTENT, 15, np.random.default_rng(3), **TRUTH)
    return dataset_of(CONTENT, trajectories=made.trajectories)


@pytest.fixture(scope="module")
def right(tossed):
    return observe_in_space(tossed)


@pytest.fixture(scope="module", params=WRITTEN, ids=lambda key: f"{key[0]}-{key[2]:g}")
def wrong(request, tossed):
    table = tossed.trajectories
    q = WRITTEN[request.param](table[list(QUATERNION)].to_numpy())
    written = dataset_of(CONTENT, trajectories=table.assign(**dict(zip(QUATERNION, q.T))))
    return *request.param, observe_in_space(written)


def test_what_is_found_does_not_hang_on_how_quaternions_are_written(wrong, right) -> None:
    effect, _, _, found = wrong
    assert not right.written and right.found.warnings == ()
    assert any(effect in sentence for sentence in found.found.warnings)
    assert len(found) == len(right) > 30
    assert len(found.flights) == len(right.flights) > 10
    for one, other in ((found.lines(side), right.lines(side)) for side in (0, 1)):
        np.testing.assert_allclose(found.space.difference(one.pose, other.pose), 0.0, atol=1e-9)
        np.testing.assert_allclose(one.motion, other.motion, atol=1e-7)
    np.testing.assert_allclose(found.cov, right.cov, rtol=1e-6, atol=1e-12)


def test_all_models_believe_what_is_written_but_those_with_the_effect(wrong) -> None:
    effect, parameter, value, found = wrong
    states, world = found.lines(0), Drops(found)
    believed = bind(world.model(LAW), TRUTH, found.rig)
    known = bind(world.model(LAW, (EFFECTS[effect],)), TRUTH | {"tau": 0.0, f"{effect}.{parameter}": value}, found.rig)
    np.testing.assert_allclose(known.to_true(states).pose, states.pose, atol=1e-12)
    np.testing.assert_allclose(known.to_true(states).motion, states.motion, atol=1e-9)
    turned = found.space.turn_between(states.attitude, believed.to_true(states).attitude)
    assert np.median(np.linalg.norm(turned, axis=0)) > 0.5  # rad
    back = believed.to_measured(believed.to_true(states))
    np.testing.assert_allclose(back.position, states.position, atol=1e-12)
    np.testing.assert_allclose(back.spin, states.spin, atol=1e-9)


@pytest.mark.slow
def test_the_effect_explains_what_is_written(wrong) -> None:
    effect, parameter, value, found = wrong
    world = Drops(found.single)
    without, explained = (world.fit(LAW, effects, effort="quick") for effects in ((), (EFFECTS[effect],)))
    assert explained.values[f"{effect}.{parameter}"] == value
    assert explained.score > without.score + 1000.0
    for name, true in TRUTH.items():
        assert explained.values[name] == pytest.approx(true, abs=0.05)


@pytest.fixture(scope="module", params=[(2, "behind"), (-4, "ahead of")], ids=lambda param: param[1])
def late(request, tossed):
    """Frames by which orientations come later than places, in words, and what is found."""
    table = tossed.trajectories
    shifted = table.assign(**table.groupby("trial")[list(QUATERNION)].shift(request.param[0])).dropna()
    return *request.param, observe_in_space(dataset_of(CONTENT, trajectories=shifted))


def test_a_lag_hides_few_hits(late, right) -> None:
    frames, where, found = late
    (lag,) = filter(
        None, (re.search(r"orientations come ([\d.]+) ms (.*?) pos", said) for said in found.found.warnings)
    )
    assert float(lag[1]) == pytest.approx(1e3 * abs(frames) / CONTENT["rate"], rel=0.05) and lag[2] == where
    # samples next to a hit have no orientation, and some trials lose one at their end
    assert len(found.single) > 0.65 * len(right.single)


def test_models_with_a_lag_are_compared_with_the_times_in_the_file(late) -> None:
    frames, _, found = late
    world, seen = Drops(found.single), found.single.lines(0)
    without, explained = (world.fit(LAW, effects, effort="quick") for effects in ((), (EFFECTS["time_lag"],)))
    lag = frames / CONTENT["rate"]
    assert explained.values["time_lag.lag"] == pytest.approx(lag, abs=2e-4)
    assert explained.score > without.score + 300.0
    for name, true in TRUTH.items():
        assert explained.values[name] == pytest.approx(true, abs=0.05)
    # a model without it believes in orientations that are late
    turned = found.space.turn_between(
        bind(without.model, without.values, found.rig).to_true(seen).attitude, seen.attitude
    )
    np.testing.assert_allclose(turned, seen.spin * lag, atol=3e-4 * np.abs(seen.spin).max())


@pytest.mark.slow
def test_stamps_of_arrival_give_way_to_those_of_the_pictures(tossed):
    rng, table = np.random.default_rng(0), tossed.trajectories
    late = table.assign(t=table["t"] + np.minimum(rng.exponential(2e-3, len(table)), 4e-3))
    right, mended = (observe_in_space(dataset_of(CONTENT, trajectories=t), episodes=False) for t in (table, late))
    (said,) = mended.found.warnings
    assert said.startswith("The time stamps are those of arrival")
    assert abs(len(mended) - len(right)) <= 2
    hits = {(int(n), int(i)): k for k, (n, i) in enumerate(zip(right.trial, right.impact))}
    both = [(k, hits[n, i]) for k, (n, i) in enumerate(zip(mended.trial, mended.impact)) if (n, i) in hits]
    one, other = np.array(both).T
    off = beside(mended, 0).velocity[:, one] - beside(right, 0).velocity[:, other]
    assert len(both) > 15 and np.median(np.abs(off)) < 0.01  # of 2 m/s


def test_pictures_that_repeat_the_one_before_are_lost_frames(tossed):
    table = tossed.trajectories.copy()
    trial, pose = table["trial"].to_numpy(), [name for name in table if name not in ("trial", "t")]
    rows = np.arange(6, len(table), 7)
    rows = rows[trial[rows] == trial[rows - 1]]
    table.loc[table.index[rows], pose] = table[pose].to_numpy()[rows - 1]
    o = observe_in_space(dataset_of(CONTENT, trajectories=table), episodes=False)
    assert len(o.found.warnings) == 1 and "repeat the previous one" in o.found.warnings[0]
    assert len(o) > 10
