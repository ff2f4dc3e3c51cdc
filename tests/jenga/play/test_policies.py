"""Rules and exploration by their thresholds; the oracle on a real tower, which it must leave as it was."""

import numpy as np
import pytest
from tower_for_tests import FREE_BLOCK, STUCK_BLOCK, Settled

from thesis_lib.jenga.play.players import Oracle, would_succeed
from thesis_lib.jenga.play.policies import STRAIGHT, AlwaysPush, Exploration, Push, Retract, RulePolicy
from thesis_lib.jenga.play.settings import OracleSettings, RuleSettings, SupervisorSettings
from thesis_lib.jenga.robot.samples import F_N, TOWER, YAW
from thesis_lib.jenga.tower.settings import CollectSettings

CONTEXT = np.array([8.0, 1.0])


def state(force: float = 0.0, tower: float = 0.0, stray: float = 0.0) -> np.ndarray:
    made = np.zeros(7)
    made[[F_N, TOWER, YAW]] = force, tower, stray
    return made


def begun(policy):
    policy.begin(np.random.default_rng(0))
    policy.start(0, CONTEXT)
    return policy


def test_the_rule_has_two_thresholds_and_always_push_none():
    assert begun(AlwaysPush()).act(state(force=10.0, tower=20.0), CONTEXT) == STRAIGHT
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
    assert isinstance(policy.act(state(**{what: limit - 0.01}), CONTEXT), Push)
    assert isinstance(policy.act(state(**{what: limit + 0.01}), CONTEXT), Retract)
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
@pytest.mark.parametrize("damage, answer", [(5.0, Push(0.0, 0.0)), (1e-6, Retract("would do damage"))])
def test_the_oracle_foresees_what_will_happen(damage, answer):
    tower = Settled.get()
    before = tower.save()
    oracle = Oracle(OracleSettings(offsets=(0.0, 4.0), damage=damage))
    oracle.tower = tower
    oracle.start(FREE_BLOCK, CONTEXT)
    assert oracle.act(state(), CONTEXT) == answer  # any push moves a tower by a nanometre
    np.testing.assert_array_equal(tower.save().state, before.state)
