"""Mixture of linear regressions: recovery of known experts, and its limits."""

import numpy as np
from pushes_for_tests import make_samples
from scipy.stats import entropy

from thesis_lib.jenga.learners.mor import Mor, em, with_one
from thesis_lib.jenga.learners.settings import ExpertSettings, LearnerSettings

SETTINGS = ExpertSettings()


def _two_lines(n: int, rng: np.random.Generator):
    """Slopes 2 and −1 for x_0 below and above zero, as far as the gate (sharpness 6) tells them apart."""
    x = with_one(rng.uniform(-1, 1, (n, 2)))
    second = rng.random(n) < 1 / (1 + np.exp(-6 * x[:, 0]))
    slope = np.where(second, -1.0, 2.0)
    y = np.zeros((n, 7)) + (slope * x[:, 1] + second)[:, None] + 0.1 * rng.normal(size=(n, 7))
    return x, y, second


def test_two_experts_and_their_gate_are_recovered() -> None:
    rng = np.random.default_rng(0)
    x, y, _ = _two_lines(600, rng)
    experts = em(x, y, 2, SETTINGS, rng)
    order = np.argsort(experts.w[:, 1, 0])
    np.testing.assert_allclose(experts.w[order, 1, 0], [-1.0, 2.0], atol=0.1)
    np.testing.assert_allclose(experts.w[order, 2, 0], [1.0, 0.0], atol=0.1)
    np.testing.assert_allclose(np.sqrt(experts.var), 0.1, atol=0.04)
    grid = np.column_stack([np.linspace(-1, 1, 21), np.zeros(21), np.ones(21)])
    gate = np.exp(experts.log_gate(grid))[:, order[0]]
    np.testing.assert_allclose(gate, 1 / (1 + np.exp(-6 * grid[:, 0])), atol=0.15)


def test_one_expert_is_ridge_regression() -> None:
    rng = np.random.default_rng(1)
    x, y, _ = _two_lines(80, rng)
    experts = em(x, y, 1, SETTINGS, rng)
    ridge = np.linalg.solve(x.T @ x + SETTINGS.ridge * np.eye(3), x.T @ y)
    np.testing.assert_allclose(experts.w[0], ridge, atol=1e-9)


def test_predictions_beat_no_change_and_cover_with_enough_pushes() -> None:
    """1,500 samples; of 300, some 16 pushes, the experts are too sure of other pushes (0.82 for 0.95)."""
    train, _ = make_samples(1500, np.random.default_rng(2))
    config = LearnerSettings(experts=ExpertSettings(most=3, restarts=1, iterations=30))
    fitted = Mor(config).fit(train, np.random.default_rng(3))
    samples, _ = make_samples(600, np.random.default_rng(4))
    belief = fitted.initial_belief(samples.context)
    mean, var = fitted.predict(samples.state, samples.action, samples.context, belief).moments()
    error = samples.next_state - mean
    still = samples.next_state - samples.state
    assert (error[:, [0, 3]] ** 2).mean() < 0.7 * (still[:, [0, 3]] ** 2).mean()
    cover = np.mean(np.abs(error) < 1.96 * np.sqrt(var), axis=0)
    assert ((cover > 0.9) & (cover <= 1.0)).all()


def test_the_best_number_of_experts_is_taken_and_their_belief_gains_from_what_is_seen() -> None:
    config = ExpertSettings(most=4, restarts=1, iterations=30)
    samples, _ = make_samples(300, np.random.default_rng(2))
    fitted = Mor(LearnerSettings(experts=config)).fit(samples, np.random.default_rng(3))
    assert set(fitted.scores) == {2, 3, 4}
    assert fitted.n_abstractions == max(fitted.scores, key=fitted.scores.get)
    samples, _ = make_samples(200, np.random.default_rng(5))
    belief = fitted.initial_belief(samples.context)
    step = (samples.state, samples.action, samples.context)
    after = fitted.update(belief, *step, samples.next_state)
    weight = fitted.predict(*step, belief).weight
    for each in (after, weight):
        np.testing.assert_allclose(each.sum(axis=1), 1.0)
    # it falls on average when a reading is taken in
    assert entropy(after, axis=1).mean() < entropy(weight, axis=1).mean()
