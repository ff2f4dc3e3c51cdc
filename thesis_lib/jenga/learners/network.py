"""Feed-forward network: one model of all pushes, the non-hierarchical baseline.

    Δ | x ~ Normal(g(x; w), diag exp h(x; w)),   w by −log p + ½ λ |w|²/n  (a most probable network, no posterior)

x (n, d) and Δ (n, 7) are as in `bayesian_network`; w are the `layers`, each (in + 1, out) with the bias as last row;
λ is `weight_decay`, the precision of the weights times √fan-in.

Architecture, inputs, optimiser and number of steps are those of each HMA network; K = 1, so its belief is 1.
Source: thesis, section 5.5.2, which gives no sizes.
"""

from dataclasses import dataclass, field

import numpy as np
import torch

from thesis_lib.jenga.learners.bayesian_network import N_OUT, Descent, Layers, forward, layer_shapes, outputs_of
from thesis_lib.jenga.learners.learner import Learner, PushPrediction
from thesis_lib.jenga.learners.settings import NetworkSettings
from thesis_lib.jenga.robot.samples import PushSamples


def train_plain(inputs: np.ndarray, outputs: np.ndarray, settings: NetworkSettings, seed: int) -> Layers:
    """Most probable weights, per layer (in + 1, out), for inputs (n, d) and outputs (n, 7)."""
    gen = torch.Generator().manual_seed(seed)
    x, y = (torch.as_tensor(a, dtype=torch.float32) for a in (inputs, outputs))
    shapes = layer_shapes(x.shape[1], settings.hidden)
    layers = [0.5 * torch.randn(shape, generator=gen) / np.sqrt(shape[0]) for shape in shapes]
    layers[-2] *= 0.1
    layers[-1] *= 0.0
    layers = [w.requires_grad_(True) for w in layers]
    descent = Descent(layers, settings.rate)
    n = len(x)
    batch = min(settings.batch, n)
    for step in range(settings.iterations):
        rows = slice(None) if batch == n else torch.randint(n, (batch,), generator=gen)
        mean, log_var = forward(x[rows], layers)
        fit = 0.5 * ((y[rows] - mean) ** 2 * torch.exp(-log_var) + log_var).sum(dim=1).mean()
        decay = 0.5 * settings.weight_decay * sum(s[0] * (w**2).sum() for w, s in zip(layers, shapes)) / n
        descent.step(fit + decay, step / settings.iterations)
    return [w.detach() for w in layers]


@dataclass
class Network(Learner):
    """Feed-forward network with K = 1.  Once fitted: layers (see the module)."""

    name: str = "network"

    layers: Layers = field(init=False, repr=False)

    def fit(self, samples: PushSamples, rng: np.random.Generator) -> "Network":
        """Train by the module's loss.  Errors as in `Learner.fit`."""
        self.shares = np.ones(1)
        self.layers = train_plain(*self.scale(samples), self.settings.network, int(rng.integers(2**31)))
        return self

    def predict(self, state: np.ndarray, action: np.ndarray, context: np.ndarray, belief: np.ndarray) -> PushPrediction:
        """Next reading (n, 1, 7)."""
        inputs = self.scaling.inputs(state, action, context)
        with torch.no_grad():
            mean, log_var = forward(torch.as_tensor(inputs, dtype=torch.float32), self.layers)
        var = self.scaling.change**2 * torch.exp(log_var).double().numpy()
        mean = self.scaling.next_state(state, mean.double().numpy())
        return PushPrediction(mean[:, None], var[:, None], belief)

    def means(
        self, state: np.ndarray, action: np.ndarray, context: np.ndarray, belief: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mean and weight of `predict`, to the last bit."""
        inputs = self.scaling.inputs(state, action, context)
        with torch.no_grad():
            mean = outputs_of(torch.as_tensor(inputs, dtype=torch.float32), self.layers)[..., :N_OUT]
        return self.scaling.next_state(state, mean.double().numpy())[:, None], belief
