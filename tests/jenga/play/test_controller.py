"""The controller against made learners whose physics is known: rollouts, steering, giving up, the ablation."""

import numpy as np
import pytest

from thesis_lib.jenga.learners.abstractions import no_move
from thesis_lib.jenga.learners.learner import PushPrediction, bayes, log_likelihood
from thesis_lib.jenga.learners.settings import BeliefSettings
from thesis_lib.jenga.play.controller import Learned, branch_costs, rollout
from thesis_lib.jenga.play.policies import Push, Retract
from thesis_lib.jenga.play.settings import ControllerSettings
from thesis_lib.jenga.robot.samples import ADVANCE, F_N, TOWER, YAW, X, Y

CONTEXT = np.array([8.0, 1.0])
SETTINGS = ControllerSettings()


class MadeLearner:
    """Abstraction 0: the block goes along and can be steered; 1: the force climbs and the tower is dragged."""

    def __init__(self, first=(0.5, 0.5), drag: float = 0.8, stuck_named: bool = True):
        self.first, self.drag = np.array(first), drag
        if stuck_named:
            self.look = {"move": np.array([1.0, 0.1]), "force": np.array([0.1, 2.0]), "drag": np.array([0.0, drag])}

    @property
    def n_abstractions(self) -> int:
        return 2

    def _next(self, state, action):
        free, stuck = state.copy(), state.copy()
        for one in (free, stuck):
            one[:, ADVANCE] += np.cos(action[:, 1])
        free[:, X] += np.cos(action[:, 1])
        free[:, Y] += 3.0 * np.sin(action[:, 1])
        free[:, YAW] += 0.1 * action[:, 0]
        free[:, F_N] = 0.05
        stuck[:, F_N] += 0.65
        stuck[:, TOWER] += self.drag
        return np.stack([free, stuck], axis=1)

    def predict(self, state, action, context, belief):
        mean = self._next(state, action)
        return PushPrediction(mean, np.full_like(mean, 0.1), belief)

    def initial_belief(self, context):
        return np.tile(self.first, (len(context), 1))

    def update(self, belief, state, action, context, next_state):
        out = self.predict(state, action, context, belief)
        return bayes(belief, log_likelihood(out.mean, out.var, next_state, BeliefSettings()))


def controller(learner=None, **changes) -> Learned:
    policy = Learned(learner or MadeLearner(), SETTINGS.model_copy(update=changes))
    policy.begin(np.random.default_rng(0))
    policy.start(3, CONTEXT)
    return policy


def push_of(kind: int, policy: Learned, steps: int = 30) -> int:
    """Steps until the policy gives up a block of this abstraction; `steps` if it does not."""
    state = np.zeros(7)
    for step in range(steps):
        action = policy.act(state, CONTEXT)
        if isinstance(action, Retract):
            return step
        after = policy.learner._next(state[None], np.array([[action.offset, action.heading]]))[0, kind]
        policy.observe(state, action, after)
        state = after
    return steps


def test_a_rollout_is_the_learner_applied_again_and_again():
    learner, rng = MadeLearner(), np.random.default_rng(1)
    state, sequences = rng.normal(size=7), rng.normal(size=(6, 4, 2)) * [5.0, 0.1]
    states, weights = rollout(learner, state, CONTEXT, np.array([0.3, 0.7]), sequences)
    assert states.shape == (5, 6, 2, 7)
    np.testing.assert_allclose(weights, np.tile([0.3, 0.7], (6, 1)))
    for j in range(6):
        for k in range(2):
            now = state
            for h in range(4):
                now = learner._next(now[None], sequences[j, h][None])[0, k]
            np.testing.assert_allclose(states[-1, j, k], now)


def test_what_is_alike_is_predicted_once_and_all_sequences_get_it():
    class Counting(MadeLearner):
        asked = 0

        def predict(self, state, action, context, belief):
            self.asked += len(state)
            return super().predict(state, action, context, belief)

    learner, state, belief = Counting(), np.arange(7.0), np.array([0.3, 0.7])
    sequences = controller().sequences()
    n, horizon, _ = sequences.shape
    states, weights = rollout(learner, state, CONTEXT, belief, sequences)
    asked = learner.asked
    assert asked < 0.8 * n * (2 * horizon + 1)  # two branches, and their weights
    for j in range(n):
        alone, weight = rollout(learner, state, CONTEXT, belief, sequences[[j]])
        np.testing.assert_array_equal(states[:, [j]], alone)
        np.testing.assert_array_equal(weights[[j]], weight)


def test_costs_of_a_perfect_push_and_of_none():
    states = np.zeros((6, 1, 2, 7))
    states[1:, 0, 0, X] = np.arange(1, 6)  # moves along; the other one not at all
    cost = branch_costs(states, SETTINGS)
    assert cost[0, 0] == 0.0
    assert cost[0, 1] == pytest.approx(SETTINGS.progress)
    dragged = states.copy()
    dragged[1:, ..., TOWER] = np.arange(1, 6)[:, None, None]
    assert (branch_costs(dragged, SETTINGS) >= cost + SETTINGS.growth).all()


def test_a_free_block_is_pushed_on_and_a_stuck_one_given_up_early():
    assert push_of(0, controller()) == 30
    assert 1 <= push_of(1, controller()) <= 5


def test_it_gives_up_at_once_where_every_block_is_known_to_be_stuck():
    doomed = MadeLearner(first=(0.001, 0.999))
    assert push_of(1, controller(doomed, probe=0)) == 0
    assert push_of(1, controller(doomed, probe=2)) == 2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_it_steers_back_to_the_goal_configuration(sign):
    """Figure 5-9: aside of its way it is pushed back, turned it is pushed at the side that turns it back."""
    policy = controller(MadeLearner(first=(0.999, 0.001)))
    aside = np.zeros(7)
    aside[Y] = sign * 6.0
    assert np.sign(policy.act(aside, CONTEXT).heading) == -sign
    turned = np.zeros(7)
    turned[YAW] = sign * 6.0
    assert np.sign(policy.act(turned, CONTEXT).offset) == -sign


def test_it_does_not_steer_without_reason():
    assert controller().act(np.zeros(7), CONTEXT) == Push(0.0, 0.0)


class MadeNetwork(MadeLearner):
    """One prediction: the block goes along until the force has climbed, then it stands and drags nothing."""

    def __init__(self):
        super().__init__(first=(1.0,), drag=0.0, stuck_named=False)

    def predict(self, state, action, context, belief):
        both = self._next(state, action)
        mean = np.where((state[:, F_N] > 1.0)[:, None, None], both[:, 1:], both[:, :1])
        return PushPrediction(mean, np.full_like(mean, 0.01), belief)


@pytest.mark.parametrize("learner", [MadeLearner(drag=0.0), MadeNetwork()], ids=["belief", "prediction"])
def test_the_term_of_no_move_ends_a_push_that_nothing_else_would(learner):
    """With a tower that is not dragged and no price on progress only the belief tells, or the network's prediction."""
    assert push_of(1, controller(learner, progress=0.0, no_move=0.0)) == 30
    assert push_of(1, controller(learner, progress=0.0, no_move=4.0)) < 10
    assert push_of(0, controller(learner, progress=0.0, no_move=4.0)) == 30


def test_a_network_says_by_its_prediction_that_a_block_does_not_move():
    network, state = MadeNetwork(), np.zeros(7)
    belief = network.initial_belief(CONTEXT[None])[0]
    assert no_move(network, belief, state, CONTEXT) < 0.06  # the tower is not seen better
    state[F_N] = 2.0  # it will not move, against a force
    assert no_move(network, belief, state, CONTEXT) == pytest.approx(1.0, abs=1e-3)


def test_a_block_that_takes_the_tower_along_counts_as_one_that_does_not_move():
    class Dragging(MadeNetwork):
        def _next(self, state, action):
            both = super()._next(state, action)
            both[:, :, TOWER] += 0.5
            return both

    network = Dragging()
    assert no_move(network, network.initial_belief(CONTEXT[None])[0], np.zeros(7), CONTEXT) > 0.99


def test_no_move_is_nothing_new_where_it_was_expected():
    policy = controller(MadeLearner(first=(0.0, 1.0)), no_move=100.0)
    push_of(1, policy)
    assert policy.belief[1] > 0.9 and policy.growth(np.zeros(7)) == 0.0


def test_sequences_keep_within_limits_and_hold_the_straight_push():
    policy = controller(sequences=64, horizon=4)
    sequences = policy.sequences()
    assert sequences.shape == (64, 4, 2)
    assert (np.abs(sequences) <= [SETTINGS.offset, SETTINGS.heading]).all()
    assert (sequences == 0.0).all(axis=(1, 2)).any()
    policy.observe(np.zeros(7), Push(3.0, 0.0), np.zeros(7))
    assert (policy.sequences()[0] == [3.0, 0.0]).all()
    assert controller(sequences=3, horizon=1).sequences().shape == (3, 1, 2)


def test_two_plays_of_one_stream_are_the_same():
    state = np.array([1.0, 2.0, -3.0, 0.1, 0.0, 1.5, 0.2])
    first, second = (controller(MadeLearner(first=(0.9, 0.1))) for _ in range(2))
    np.testing.assert_array_equal(first.sequences(), second.sequences())
    assert first.act(state, CONTEXT) == second.act(state, CONTEXT)
