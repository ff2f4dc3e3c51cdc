"""Mixture of linear regressions (MOR): the hierarchical baseline, whose latent experts may change within a push.

    Δ | x, l = k ~ Normal(W_k x̃, diag v_k),   P(l = k | x) = softmax_k(γ_k x̃),   x̃ = (x, 1)
    E:  r_ik ∝ P(l = k | x_i) p(Δ_i | x_i, k)        M:  W_k by ridge, weights r_k; v_k; γ by ridge multinomial logit

x (n, d) are scaled inputs (state, action, context) and Δ (n, 7) scaled changes.  The gate γ acts on state and action
(own choice).  The number of experts (2 … 11 as in the thesis) maximises the log likelihood of held-out pushes (5-fold).

Belief: b(l) ∝ p(z_{t+1} | …, l) times the gate's prior of the step, times the earlier belief, kept with probability
`stay` as in `learner`.  In the thesis's figure 5-5C l_t has no memory, so this favours the baseline.

Source: thesis, section 5.5.2; Jordan and Jacobs 1994, doi 10.1162/neco.1994.6.2.181 (EM for gated experts).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import log_softmax

from thesis_lib.jenga.learners.learner import Learner, PushPrediction, bayes, mix, windows
from thesis_lib.jenga.learners.mixture import describe
from thesis_lib.jenga.learners.settings import ExpertSettings
from thesis_lib.jenga.robot.samples import PushSamples

SMALLEST_VAR = 1e-3  # of scaled changes: keeps an expert with few samples from fitting them exactly
GATE_STEPS = 5  # Newton-like steps of the gate in an M step: EM needs an increase only


@dataclass(frozen=True)
class Experts:
    """Parameters of the experts: w, W (K, d + 1, 7); var, v (K, 7), of scaled changes; gate, γ (K, d + 1)."""

    w: np.ndarray
    var: np.ndarray
    gate: np.ndarray

    def log_gate(self, x: np.ndarray) -> np.ndarray:
        """log P(l | x) (n, K) of x̃ (n, d + 1)."""
        return log_softmax(x @ self.gate.T, axis=1)

    def log_joint(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """log P(l | x) p(Δ | x, l) (n, K)."""
        square = (y[:, None] - np.einsum("nd,kdo->nko", x, self.w)) ** 2 / self.var
        normal = -0.5 * (square + np.log(2 * np.pi * self.var)).sum(axis=2)
        return self.log_gate(x) + normal

    def log_density(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """log p(Δ | x) (n,)."""
        return np.logaddexp.reduce(self.log_joint(x, y), axis=1)


def with_one(inputs: np.ndarray) -> np.ndarray:
    """x̃ (n, d + 1) of inputs (n, d)."""
    return np.column_stack([inputs, np.ones(len(inputs))])


def em(x: np.ndarray, y: np.ndarray, k: int, settings: ExpertSettings, rng: np.random.Generator) -> Experts:
    """Experts with the highest penalised likelihood over all restarts, for x̃ (n, d + 1) and changes y (n, 7)."""
    best, best_value = None, -np.inf
    for _ in range(settings.restarts):
        # a random linear view of the changes splits the samples better than random labels do
        view = y @ rng.normal(size=y.shape[1]) + 0.3 * rng.normal(size=len(y))
        resp = np.full((len(y), k), 0.1 / k)
        rank = np.argsort(np.argsort(view))
        resp[np.arange(len(y)), rank * k // len(y)] += 0.9
        gate, previous = np.zeros((k, x.shape[1])), -np.inf
        for _ in range(settings.iterations):
            experts = _maximise(x, y, resp, gate, settings.ridge)
            gate = experts.gate
            log_joint = experts.log_joint(x, y)
            top = log_joint.max(axis=1, keepdims=True)
            resp = np.exp(log_joint - top)
            norm = resp.sum(axis=1, keepdims=True)
            resp = resp / norm
            value = float((np.log(norm) + top).sum()) - 0.5 * settings.ridge * ((experts.w**2).sum() + (gate**2).sum())
            if value - previous < 1e-4 * abs(value):
                break
            previous = value
        if value > best_value:
            best, best_value = experts, value
    return best


def cross_validated(
    x: np.ndarray,
    y: np.ndarray,
    push: np.ndarray,
    numbers: Iterable[int],
    settings: ExpertSettings,
    rng: np.random.Generator,
) -> dict[int, np.ndarray]:
    """Log density (n,) of each sample under experts fitted to other pushes, for each number of experts.

    x̃ (n, d + 1), changes y (n, 7); push (n,), equal for the samples of a push, which are consecutive.
    """
    push = np.cumsum(np.diff(push, prepend=push[0]) != 0)  # numbered from 0
    fold = rng.permutation(push.max() + 1)[push] % settings.folds
    once = settings.model_copy(update={"restarts": 1})  # folds already average over starts
    scores = {}
    for k in numbers:
        scores[k] = np.zeros(len(y))
        for f in np.unique(fold):
            train, test = fold != f, fold == f
            if train.any():
                scores[k][test] = em(x[train], y[train], k, once, rng).log_density(x[test], y[test])
    return scores


def _maximise(x: np.ndarray, y: np.ndarray, resp: np.ndarray, gate: np.ndarray, ridge: float) -> Experts:
    """M step of EM."""
    d = x.shape[1]
    gram = np.einsum("nk,nd,ne->kde", resp, x, x) + ridge * np.eye(d)
    w = np.linalg.solve(gram, np.einsum("nk,nd,no->kdo", resp, x, y))
    square = (y[:, None] - np.einsum("nd,kdo->nko", x, w)) ** 2
    # one prior observation of the overall variance (a training change has variance 1)
    var = (np.einsum("nk,nko->ko", resp, square) + 1.0) / (resp.sum(axis=0)[:, None] + 1.0)
    # gate: Böhning's bound on the Hessian, ½ (I − 11ᵀ/K) ⊗ XᵀX, here its diagonal part in the experts
    curvature = np.linalg.inv(0.5 * x.T @ x + ridge * np.eye(d))
    for _ in range(GATE_STEPS):
        slope = (resp - np.exp(log_softmax(x @ gate.T, axis=1))).T @ x - ridge * gate
        gate = gate + slope @ curvature
    return Experts(w, np.maximum(var, SMALLEST_VAR), gate - gate.mean(axis=0))


class Mor(Learner):
    """Mixture of linear regressions; its abstractions are the experts.

    Once fitted: experts; scores, the held-out log likelihood (nats per sample) for each number of experts; look, mean
    features of each expert (`mixture.describe`), weighted by its responsibility for the training samples.
    """

    experts: Experts
    scores: dict[int, float]
    look: dict[str, np.ndarray]

    def fit(self, samples: PushSamples, rng: np.random.Generator) -> "Mor":
        """Choose the number of experts and fit them.  Errors as in `Learner.fit`."""
        config = self.settings.experts
        inputs, y = self.scale(samples)
        x = with_one(inputs)
        numbers = range(config.fewest, config.most + 1)
        scores = cross_validated(x, y, samples.push, numbers, config, rng)
        self.scores = {k: float(score.sum()) / len(y) for k, score in scores.items()}
        best = max(self.scores, key=self.scores.get)
        self.experts = em(x, y, best, config, rng)
        self.shares = self.first = np.exp(self.experts.log_gate(x)).mean(axis=0)
        resp = np.exp(log_softmax(self.experts.log_joint(x, y), axis=1))
        self.look = describe(windows(samples, self.settings.window), resp, self.settings.window.force_scale)
        return self

    def predict(self, state: np.ndarray, action: np.ndarray, context: np.ndarray, belief: np.ndarray) -> PushPrediction:
        """Predict the next reading for each expert; weights combine belief and gate."""
        x = with_one(self.scaling.inputs(state, action, context))
        mean = self.scaling.next_state(state[:, None], np.einsum("nd,kdo->nko", x, self.experts.w))
        var = np.broadcast_to(self.scaling.change**2 * self.experts.var, mean.shape)
        prior = mix(belief, self.settings.belief.stay, self.shares)
        # belief and gate both contain the experts' shares, which must count once
        return PushPrediction(mean, var, bayes(prior / self.shares, self.experts.log_gate(x)))
