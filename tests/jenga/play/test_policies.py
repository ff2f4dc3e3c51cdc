"""Rules and exploration by their thresholds; the oracle on a real tower, which it must leave as it was."""

import numpy as np
import pytest
from tower_for_tests import FREE_BLOCK, STUCK_BLOCK, Settled

from thesis_lib.jenga.play.players import Oracle, would_succeed
from thesis_lib.jenga.play.policies import STRAIGHT, AlwaysPush, Exploration, Push, Retract, RulePolicy
from thesis_lib.jenga.play.settings import OracleSettings, RuleSettings, SupervisorSettings
from thesis_lib.jenga.robot.samples import F_N, TOWER, YAW, Y
from thesis_lib.jenga.tower.settings import CollectSettings

CONTEXT = np.array([8.0, 1.0])


def state(**values: float) -> np.ndarray:
    names = {"y": Y, "yaw": YAW, "force": F_N, "tower": TOWER}
    made = np.zeros(7)
    for name, value in values.items():
        made[names[name]] = value
    return made


def begun(policy):
    policy.begin(np.random.default_rng(0))
    policy.start(0, CONTEXT)
    return policy


def test_always_push_never_gives_up():
    policy = begun(AlwaysPush())
    assert policy.act(state(force=10.0, tower=20.0), CONTEXT) == STRAIGHT


def test_the_rule_has_two_thresholds():
    policy = begun(RulePolicy(RuleSettings(force=1.0, tower=2.0)))
    assert policy.act(state(force=0.99, tower=1.99), CONTEXT) == STRAIGHT
    assert policy.act(state(force=1.01), CONTEXT) == Retract("force")
    assert policy.act(state(tower=2.01), CONTEXT) == Retract("tower moves")


def test_exploration_is_random_within_its_range_and_repeats_with_its_stream():
    drawn = []
    for _ in range(2):
        policy = begun(Exploration())
        drawn.append([policy.act(state(), CONTEXT) for _ in range(200)])
    assert drawn[0] == drawn[1]
    pushes = np.array([(push.offset, push.heading) for push in drawn[0]])
    limits = 1e3 * CollectSettings().offset, CollectSettings().heading
    assert (np.abs(pushes) <= limits).all() and (np.abs(pushes).max(axis=0) > 0.8 * np.array(limits)).all()
    changes = (np.diff(pushes, axis=0) != 0).any(axis=1).mean()
    assert changes == pytest.approx(CollectSettings().change, abs=0.1)


@pytest.mark.parametrize("what", ["force", "tower", "stray"])
def test_the_supervisor_makes_mistakes_but_stops_what_goes_wrong(what):
    settings, rule = SupervisorSettings(), RuleSettings()
    policy = begun(Exploration(settings))
    limit = getattr(settings, what)
    name = {"stray": "yaw"}.get(what, what)
    assert isinstance(policy.act(state(**{name: limit - 0.01}), CONTEXT), Push)
    assert isinstance(policy.act(state(**{name: limit + 0.01}), CONTEXT), Retract)
    if what != "stray":
        assert limit > getattr(rule, what)  # tuned to allow mistakes


def test_the_oracle_refuses_a_stuck_block_and_leaves_the_tower_as_it_was():
    tower = Settled.get()
    before = tower.save()
    assert not would_succeed(tower, STUCK_BLOCK, STRAIGHT, damage=1.0)
    after = tower.save()
    np.testing.assert_array_equal(after.state, before.state)
    np.testing.assert_array_equal(after.reference, before.reference)


@pytest.mark.slow
def test_the_oracle_foresees_what_will_happen():
    tower = Settled.get()
    oracle = Oracle(OracleSettings(offsets=(0.0, 4.0)))
    oracle.tower = tower
    oracle.begin(np.random.default_rng(0))
    oracle.start(FREE_BLOCK, CONTEXT)
    assert oracle.act(state(), CONTEXT) == Push(0.0, 0.0)
    before = tower.save()
    assert would_succeed(tower, FREE_BLOCK, STRAIGHT, damage=5.0)
    np.testing.assert_array_equal(tower.save().state, before.state)
    assert not would_succeed(tower, FREE_BLOCK, STRAIGHT, damage=1e-6)  # nothing moves a tower by so little
