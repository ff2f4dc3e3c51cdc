"""Hierarchical model abstractions on made pushes: what is inferred, predicted, sampled, and how noise is found."""

from types import SimpleNamespace

import numpy as np
import pytest
from pushes_for_tests import FAST, FORCE, POSE, START_POSE, TOWER, make_samples, sample_push
from scipy.stats import norm

from thesis_lib.foundation.errors import UserError
from thesis_lib.jenga.learners.hma import Hma
from thesis_lib.jenga.learners.learner import (
    PushPrediction,
    Scaling,
    along_pushes,
    bayes,
    log_likelihood,
    mix,
    push_groups,
)
from thesis_lib.jenga.learners.networks import Network
from thesis_lib.jenga.learners.settings import BeliefSettings, LearnerSettings, NetworkSettings


def test_predictions_cover_the_readings_of_other_pushes(learned: Hma, held) -> None:
    belief = learned.initial_belief(held.context)
    mean, var = learned.predict(held.state, held.action, held.context, belief).moments()
    cover = (np.abs(held.next_state - mean) < 1.96 * np.sqrt(var)).mean(axis=0)
    assert (cover > 0.88).all()  # 0.95 but for the 35 training pushes


@pytest.mark.parametrize("kind", [Hma, Network])
def test_the_pushers_own_way_is_predicted(kind, held, learned: Hma) -> None:
    learner = learned
    if kind is Network:
        learner = Network(FAST).fit(make_samples(600, np.random.default_rng(1))[0], np.random.default_rng(2))
    belief = learner.initial_belief(held.context)
    mean, _ = learner.predict(held.state, held.action, held.context, belief).moments()
    assert np.abs(mean - held.next_state)[:, 5].mean() < 0.01  # of 1 mm; cos(0.2) is 0.98


def test_belief_knows_more_after_each_step(learned: Hma, held) -> None:
    whole = [rows[:6] for rows in push_groups(held) if len(rows) >= 6]
    entropy = []
    for *_, belief in along_pushes(learned, held.select(np.concatenate(whole))):
        np.testing.assert_allclose(belief.sum(axis=1), 1.0)
        entropy.append(-(belief * np.log(np.maximum(belief, 1e-300))).sum(axis=1).mean())
    assert entropy[5] < 0.6 * np.log(learned.n_abstractions)
    assert entropy[5] < entropy[0]


def test_sampled_pushes_do_what_the_abstraction_is_named_for(learned: Hma) -> None:
    actions, context = np.zeros((10, 2)), np.array([10.0, 0.0])
    still = next(k for k, name in enumerate(learned.names) if name.startswith("no move"))
    easy = next(k for k, name in enumerate(learned.names) if name.startswith("easy"))
    last = {}
    for k in (still, easy):
        rng = np.random.default_rng(4)
        last[k] = np.mean([sample_push(learned, rng, actions, context, k)[0][-1] for _ in range(40)], axis=0)
    assert last[still][0] < 5.0 < 7.0 < last[easy][0]  # of 10 mm; no move means less than half
    assert last[still][3] > 4 * max(last[easy][3], 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_noise_of_readings_is_recovered(scale: float) -> None:
    samples, _ = make_samples(1200, np.random.default_rng(6), noise=scale)
    learner = Hma(FAST).fit(samples, np.random.default_rng(7))
    advance = samples.state[:, 5]
    pose = np.sqrt(np.mean((POSE + START_POSE * np.exp(-advance / 5.0)) ** 2))
    expected = scale * np.array([pose, FORCE, TOWER])
    found = np.sqrt(learner.noise[[1, 4, 6]])  # slips of x and force are noise of the process
    ratio = found / expected
    np.testing.assert_allclose(ratio[[0, 2]], 1.0, atol=0.25)
    # an action changes f_t at once, which differences cannot tell from noise: the networks' error bounds it from above
    assert 0.8 < ratio[1] < 2.5


class Blind(Hma):
    """One abstraction whose prediction is as wrong as can be, so that it bounds no noise."""

    def predict(self, state, action, context, belief):
        return PushPrediction(state[:, None] + 1e3, np.ones((len(state), 1, 7)), belief)


@pytest.mark.parametrize("process", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("sensor", [0.5, 1.5])
def test_noise_of_the_sensors_is_told_from_that_of_the_process(sensor: float, process: float) -> None:
    """A random walk of known steps, read with known noise: what is read twice differs by the sensors alone."""
    rng, n = np.random.default_rng(14), 20_000
    true = np.cumsum(process * rng.normal(size=(n + 1, 7)), axis=0)
    read = true + sensor * rng.normal(size=true.shape)
    push = np.arange(n) // 100
    nothing = {"action": np.zeros((n, 2)), "context": np.tile([5.0, 0.0], (n, 1)), "truth": np.zeros(n, int)}
    same = {"tower": np.zeros(n, int), "block": np.zeros(n, int)}
    walk = SimpleNamespace(push=push, state=read[:-1], next_state=read[1:], **nothing, **same)
    learner = Blind(FAST)
    learner.resp = np.ones((n, 1))
    np.testing.assert_allclose(
        learner._noise(walk) / sensor**2, 1.0, atol=0.15 * max(1.0, (process / sensor) ** 2) ** 0.5
    )


def test_one_shot_learning_gives_the_same_interface(held) -> None:
    samples, _ = make_samples(200, np.random.default_rng(8))
    settings = LearnerSettings(one_shot=True, rounds=4, network=NetworkSettings(iterations=120))
    learner = Hma(settings).fit(samples, np.random.default_rng(9))
    assert 1 <= learner.n_abstractions <= settings.mixture.max_abstractions
    test = held.select(np.arange(50))
    belief = learner.initial_belief(test.context)
    after = learner.update(belief, test.state, test.action, test.context, test.next_state)
    np.testing.assert_allclose(after.sum(axis=1), 1.0)


def test_context_can_be_left_out() -> None:
    samples, _ = make_samples(80, np.random.default_rng(10))
    settings = LearnerSettings(context=False, network=NetworkSettings(iterations=20))
    learner = Hma(settings).fit(samples, np.random.default_rng(11))
    belief = learner.initial_belief(samples.context)
    one = learner.predict(samples.state, samples.action, samples.context, belief)
    other = learner.predict(samples.state, samples.action, samples.context + 3.0, belief)
    np.testing.assert_array_equal(one.mean, other.mean)


def test_truth_is_never_used() -> None:
    samples, _ = make_samples(80, np.random.default_rng(12))
    settings = LearnerSettings(network=NetworkSettings(iterations=20))
    flipped = type(samples)(**(vars(samples) | {"truth": 1 - samples.truth}))
    first, second = (Hma(settings).fit(s, np.random.default_rng(0)) for s in (samples, flipped))
    np.testing.assert_array_equal(first.resp, second.resp)
    np.testing.assert_array_equal(first.networks.arrays()[0], second.networks.arrays()[0])


def test_likelihood_without_outliers_is_normal() -> None:
    rng = np.random.default_rng(13)
    mean, var, seen = rng.normal(size=(3, 2, 7)), rng.uniform(0.5, 2, (3, 2, 7)), rng.normal(size=(3, 7))
    dims = [0, 1, 2, 3, 4, 6]
    expected = norm.logpdf(seen[:, None, dims], mean[..., dims], np.sqrt(var[..., dims])).sum(axis=2)
    found = log_likelihood(mean, var, seen, BeliefSettings(outlier_share=0.0))
    np.testing.assert_allclose(found, expected)


def test_likelihood_with_outliers_is_a_density() -> None:
    grid = np.linspace(-60, 60, 24001)
    seen = np.zeros((len(grid), 7))
    seen[:, 3] = grid
    zero, one = np.zeros((1, 1, 7)), np.ones((1, 1, 7))
    density = np.exp(log_likelihood(zero, one, seen, BeliefSettings(outlier_share=0.1)))[:, 0]
    at_zero = np.exp(log_likelihood(zero, one, np.zeros((1, 7)), BeliefSettings(outlier_share=0.1)))[0, 0]
    share = at_zero ** (1 / 6)  # the other five dimensions, each at its mode
    assert np.trapezoid(density, grid) == pytest.approx(share**5, rel=1e-3)


def test_bayes_and_mixing() -> None:
    belief = np.array([[0.5, 0.5]])
    np.testing.assert_allclose(bayes(belief, np.log([[3.0, 1.0]])), [[0.75, 0.25]])
    np.testing.assert_allclose(mix(np.array([[1.0, 0.0]]), 0.9, np.array([0.2, 0.8])), [[0.92, 0.08]])


def test_scaling_is_of_the_training_samples_alone() -> None:
    samples, _ = make_samples(100, np.random.default_rng(14))
    scaling = Scaling.of(samples, 0.1, True)
    scaled = scaling.outputs(samples.state, samples.next_state)
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(scaling.next_state(samples.state, scaled), samples.next_state, atol=1e-12)
    with pytest.raises(UserError, match="at least"):
        Scaling.of(samples.select(np.arange(5)), 0.1, True)
