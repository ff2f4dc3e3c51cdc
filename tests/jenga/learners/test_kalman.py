"""Bank of Kalman filters against the exact posterior of linear models, found without any recursion."""

from dataclasses import dataclass

import numpy as np
import pytest

from thesis_lib.jenga.learners.kalman import KalmanBank, process_variance
from thesis_lib.jenga.learners.learner import SEEN, PushPrediction

NOISE = np.array([0.3, 0.2, 0.25, 0.05, 0.04, 0.01, 0.2]) ** 2
CONTEXT = np.array([8.0, 1.0])


@dataclass
class Linear:
    """s' = A_k s + B_k a + e_k with process noise q_k: a learner that has nothing to learn."""

    a: np.ndarray
    b: np.ndarray
    e: np.ndarray
    q: np.ndarray
    belief: np.ndarray

    @property
    def n_abstractions(self) -> int:
        return len(self.a)

    def predict(self, state, action, context, belief) -> PushPrediction:
        mean = np.einsum("kij,nj->nki", self.a, state) + np.einsum("kij,nj->nki", self.b, action) + self.e
        return PushPrediction(mean, np.broadcast_to(self.q + 2 * NOISE, mean.shape), belief)

    def initial_belief(self, context) -> np.ndarray:
        return np.tile(self.belief, (len(context), 1))


def _linear(k: int, rng: np.random.Generator) -> Linear:
    a = np.eye(7) + 0.1 * rng.normal(size=(k, 7, 7))
    a[:, SEEN, 5] = 0.0  # the pusher's own way is known and tells nothing beyond the action
    a[:, 5] = np.eye(7)[5]
    belief = rng.dirichlet(np.ones(k))
    b = 0.3 * rng.normal(size=(k, 7, 2))
    return Linear(a, b, 0.2 * rng.normal(size=(k, 7)), NOISE * rng.uniform(0.5, 2.0, (k, 7)), belief)


def _exact(model: Linear, readings: np.ndarray, actions: np.ndarray):
    """Belief (K,), mean and covariance of the last state for each k, from one big normal over all states."""
    steps, log_like, means, covs = len(actions), [], [], []
    dims = list(SEEN)
    for a, b, e, q in zip(model.a, model.b, model.e, model.q):
        # s_0 ~ Normal(z_0, Σ_z); all later states are linear in s_0 and the noises
        mean, gain = [readings[0]], [np.hstack([np.eye(7), np.zeros((7, 7 * steps))])]
        for t in range(steps):
            mean.append(a @ mean[-1] + b @ actions[t] + e)
            row = a @ gain[-1]
            row[:, 7 * (t + 1) : 7 * (t + 2)] += np.eye(7)
            gain.append(row)
        base = np.diag(np.concatenate([NOISE, np.tile(q, steps)]))
        cov = np.vstack(gain) @ base @ np.vstack(gain).T
        flat = np.concatenate(mean)
        seen = slice(7, 7 * (steps + 1))
        spread = cov[seen, seen] + np.diag(np.tile(NOISE, steps))
        error = readings[1:].ravel() - flat[seen]
        gain_all = cov[-7:, seen] @ np.linalg.inv(spread)
        means.append(flat[-7:] + gain_all @ error)
        covs.append(cov[-7:, -7:] - gain_all @ cov[seen, -7:])
        use = np.concatenate([np.array(dims) + 7 * t for t in range(steps)])
        part = spread[np.ix_(use, use)]
        log_like.append(
            -0.5 * (error[use] @ np.linalg.solve(part, error[use]) + np.linalg.slogdet(2 * np.pi * part)[1])
        )
    weight = model.belief * np.exp(np.array(log_like) - max(log_like))
    return weight / weight.sum(), np.array(means), np.array(covs)


@pytest.mark.parametrize("seed", range(3))
def test_linear_bank_is_the_exact_posterior(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = _linear(3, rng)
    actions = rng.normal(size=(4, 2))
    readings = np.zeros((5, 7))
    for t in range(4):
        out = model.predict(readings[t : t + 1], actions[t : t + 1], None, model.belief[None])
        readings[t + 1] = out.mean[0, 1] + np.sqrt(out.var[0, 1]) * rng.normal(size=7)
    bank = KalmanBank(model, CONTEXT, NOISE, readings[0])
    for action, reading in zip(actions, readings[1:]):
        bank.step(action, reading)
    belief, mean, cov = _exact(model, readings, actions)
    np.testing.assert_allclose(bank.belief, belief, atol=1e-7)
    np.testing.assert_allclose(bank.mean, mean, atol=1e-7)
    np.testing.assert_allclose(bank.cov, cov, atol=1e-7)
    # of the mixture: squares of the mean over abstractions
    mixed = belief @ mean
    square = np.einsum("k,kij->ij", belief, cov + np.einsum("ki,kj->kij", mean, mean))
    np.testing.assert_allclose(bank.moments()[0], mixed, atol=1e-7)
    np.testing.assert_allclose(bank.moments()[1], square - np.outer(mixed, mixed), atol=1e-6)


def test_process_noise_is_what_readings_leave() -> None:
    var = np.array([1.0, 0.5, 0.1])
    np.testing.assert_allclose(process_variance(var, np.array([0.1, 0.1, 0.1])), [0.8, 0.3, 0.01])
