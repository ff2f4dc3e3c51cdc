"""Hierarchical model abstractions (HMA): first the pushes are clustered, then a model is learned for each cluster.

    1. top-down:   c | windows                    (`mixture`: Dirichlet process, merged)
    2. bottom-up:  s_{t+1} | s_t, a_t, c = k      (`networks`, weighted with p(c_i = k | push))
    3. noise:      z_t | s_t ~ Normal(s_t, Σ_z)   (equation 5.6; from the residuals of 2)
    4. belief:     b_{t+1} as in `learner`, where p(z_{t+1} | s_t, a_t, k) is the network's prediction times the window
                   mixture of one step: in full at the first step of a push, when no state yet distinguishes blocks, and
                   to the power `emission_weight` later

Σ_z.  Networks are trained on readings and so predict readings.  The sensor noise in their error is estimated from the
second differences e_t of a push's readings, less the mean change of the abstraction (process noise white, variance q):
Cov(e_t, e_t) = 6 Σ_z + 2q,  Cov(e_t, e_{t+1}) = −4 Σ_z − q,  Cov(e_t, e_{t+2}) = Σ_z,  solved by least squares for
Σ_z, q ≥ 0.  Where a state is read again before the next step, half the variance between both readings is added (from
the median: contact at a new place changes some forces for good).  Immediate effects of an action (f_t) resemble noise
in differences; the upper bound is therefore the networks' error, which contains the full noise of z_{t+1}.

One-shot (ablation; `one_shot`): responsibilities start at random and alternate with the networks, without windows.

Source: thesis, sections 5.3.1 and 5.3.2; own choices in `settings`.
"""

from copy import copy

import numpy as np

from thesis_lib.jenga.learners.learner import (
    LEVELS,
    MIN_SAMPLES,
    SMALLEST,
    Learner,
    PushPrediction,
    bayes,
    log_likelihood,
    mix,
    push_groups,
    step_features,
    windows,
)
from thesis_lib.jenga.learners.mixture import WindowMixture, describe, fit_mixture, names_of, push_posterior
from thesis_lib.jenga.learners.networks import BayesianNetworks, train
from thesis_lib.jenga.robot.samples import ADVANCE, PushSamples

FIRST_STEP = 0.5  # mm of advance below which the state does not yet distinguish blocks
PRIOR_PUSHES = 2.0  # weight of π in the initial belief, in pushes


class Hma(Learner):
    """Hierarchical model abstractions, the learner of the thesis.

    Once fitted: mixture (None in one shot), networks; noise, the diagonal of Σ_z (7,), mm² and N²; resp (n, K), p(c |
    push) of the training samples; look and names of the abstractions, from `mixture.describe` and `mixture.names_of`.
    """

    mixture: WindowMixture | None = None
    networks: BayesianNetworks
    noise: np.ndarray
    resp: np.ndarray
    look: dict[str, np.ndarray]
    names: list[str]

    def fit(self, samples: PushSamples, rng: np.random.Generator) -> "Hma":
        """Run the steps of the module.  Errors as in `Learner.fit`."""
        config = self.settings
        features = windows(samples, config.window)
        inputs, outputs = self.scale(samples)
        seed = int(rng.integers(2**31))
        if config.one_shot:
            self._one_shot(samples, inputs, outputs, seed, rng)
        else:
            self.mixture = fit_mixture(features, samples.push, config.mixture, rng)
            self.resp = self.mixture.resp
            self.networks = train(inputs, outputs, self.resp, config.network, seed)
        self.shares = (self.resp.sum(axis=0) + 1.0) / (len(samples) + self.resp.shape[1])
        self.noise = self._noise(samples)
        # P(c_1): counts over first samples of pushes, with π as a prior worth `PRIOR_PUSHES` pushes
        first = [rows[0] for rows in push_groups(samples)]
        counts = self.resp[first].sum(axis=0) + PRIOR_PUSHES * self.shares
        self.first = counts / counts.sum()
        self.look = describe(features, self.resp, config.window.force_scale)
        self.names = names_of(self.look)
        return self

    def _one_shot(
        self, samples: PushSamples, inputs: np.ndarray, outputs: np.ndarray, seed: int, rng: np.random.Generator
    ) -> None:
        """Alternate between updating responsibilities of whole pushes and networks, from random responsibilities."""
        config, k = self.settings, self.settings.mixture.max_abstractions
        _, push = np.unique(samples.push, return_inverse=True)
        self.resp = rng.dirichlet(np.full(k, 0.5), push.max() + 1)[push]
        short = config.network.model_copy(update={"iterations": max(1, config.network.iterations // config.rounds)})
        nets = None
        for _ in range(config.rounds):
            nets = train(inputs, outputs, self.resp, short, seed, nets)
            mean, var = nets.predict(inputs)
            log_like = log_likelihood(mean, var(), outputs, config.belief)
            shares = (self.resp.sum(axis=0) + 1.0) / (len(inputs) + k)
            self.resp = push_posterior(log_like, samples.push, shares)
        keep = self.resp.sum(axis=0) >= config.mixture.min_weight * len(inputs)
        self.resp = self.resp[:, keep] / self.resp[:, keep].sum(axis=1, keepdims=True)
        self.networks = train(inputs, outputs, self.resp, config.network, seed)

    def _noise(self, samples: PushSamples) -> np.ndarray:
        """Diagonal of Σ_z (7,), mm² and N², from the moments in the module's docstring."""
        from scipy.optimize import nnls

        change = samples.next_state - samples.state
        change = change - self.resp @ (self.resp.T @ change / np.maximum(self.resp.sum(axis=0), 1e-9)[:, None])
        second = np.diff(change, axis=0)
        push = samples.push
        inside = push[1:] == push[:-1]
        if inside.sum() < MIN_SAMPLES // 2:
            return SMALLEST**2
        lags = []
        for lag in range(3):
            both = inside[: len(inside) - lag] & inside[lag:] & (push[: len(push) - 1 - lag] == push[1 + lag :])
            lags.append((second[: len(second) - lag] * second[lag:])[both].mean(axis=0) if both.any() else 0.0)
        pattern = np.array([[6.0, 2.0], [-4.0, -1.0], [1.0, 0.0]])
        shared = np.array([nnls(pattern, lag)[0][0] for lag in np.array(np.broadcast_arrays(*lags)).T])
        again = (samples.state[1:] - samples.next_state[:-1])[inside]
        # 0.6745 has four digits, unlike statistics.spread's: more digits would change every stored game of chapter 5
        reread = 0.5 * (np.median(np.abs(again), axis=0) / 0.6745) ** 2
        mean, _ = self.predict(samples.state, samples.action, samples.context, self.resp).moments()
        most = (np.median(np.abs(samples.next_state - mean), axis=0) / 0.6745) ** 2
        return np.clip(shared + reread, SMALLEST**2, np.maximum(most, SMALLEST**2))

    def predict(self, state: np.ndarray, action: np.ndarray, context: np.ndarray, belief: np.ndarray) -> PushPrediction:
        """Predict the next reading for each abstraction."""
        mean, var = self.networks.predict(self.scaling.inputs(state, action, context))
        weight = mix(belief, self.settings.belief.stay, self.shares)
        mean = self.scaling.next_state(state[:, None], mean)
        return PushPrediction(mean, lambda: self.scaling.change**2 * var(), weight)

    def at_mean(self) -> "Hma":
        """Copy that predicts with the mean weights alone, as `showcase_nuts` does."""
        other = copy(self)
        other.networks = self.networks.at_mean()
        return other

    def update(
        self, belief: np.ndarray, state: np.ndarray, action: np.ndarray, context: np.ndarray, next_state: np.ndarray
    ) -> np.ndarray:
        """Belief (n, K) after the reading `next_state` (n, 7)."""
        config = self.settings
        prediction = self.predict(state, action, context, belief)
        first = state[:, ADVANCE] < FIRST_STEP
        prior = np.where(first[:, None], belief, prediction.weight)
        log_like = log_likelihood(prediction.mean, prediction.var, next_state, config.belief)
        if self.mixture is not None:
            features = step_features(state, next_state, 1.0, config.window.force_scale)
            weight = np.where(first, 1.0, config.belief.emission_weight)
            log_like = log_like + weight[:, None] * self.mixture.log_density(features, LEVELS)
        return bayes(prior, log_like)
