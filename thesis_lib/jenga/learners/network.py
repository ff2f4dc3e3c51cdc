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

from thesis_lib.jenga.learners.bayesian_network import (
    N_OUT,
    Layers,
    descend,
    forward,
    layer_shapes,
    outputs_of,
    soft_clamp,
)
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
    n, batch = len(x), min(settings.batch, len(x))

    def loss(share: float) -> torch.Tensor:
        rows = slice(None) if batch == n else torch.randint(n, (batch,), generator=gen)
        mean, log_var = forward(x[rows], layers)
        fit = 0.5 * ((y[rows] - mean) ** 2 * torch.exp(-log_var) + log_var).sum(dim=1).mean()
        return fit + 0.5 * settings.weight_decay * sum(s[0] * (w**2).sum() for w, s in zip(layers, shapes)) / n

    descend(layers, loss, settings.rate, settings.iterations)
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
            out = outputs_of(torch.as_tensor(inputs, dtype=torch.float32), self.layers)
        mean = self.scaling.next_state(state, out[..., :N_OUT].double().numpy())

        def variance() -> np.ndarray:
            return self.scaling.change**2 * torch.exp(soft_clamp(out[..., N_OUT:])).double().numpy()[:, None]

        return PushPrediction(mean[:, None], variance, belief)
