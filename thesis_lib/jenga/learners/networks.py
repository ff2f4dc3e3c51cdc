"""Neural networks that predict changes of the state: K Bayesian networks with a shared prior, or one plain network.

    w_k ~ Normal(μ_θ, σ_w²/fan-in),   μ_θ ~ Normal(0, σ_θ²/fan-in)                    (equations 5.4, 5.8 and 5.9)
    Δ | x, w_k ~ Normal(g(x; w_k), diag exp h(x; w_k))                                              (equation 5.10)
    loss = −Σ_i Σ_k r_ik log p(Δ_i | x_i, w_k) + β Σ_k KL(q(w_k) ‖ p(w_k | μ_θ)) − β log p(μ_θ),
    q(w_k) = Normal(m_k, diag s_k²)                                                                  (mean field)

x are scaled inputs (`learner.Scaling`), Δ scaled changes of the state, and r the responsibilities of the abstractions;
`mean`, `log_std` and `shared` hold m_k, log s_k and μ_θ; β rises from 0 to 1 over the first steps (annealing).

The thesis gives the hierarchy (v_θ above θ_k, section 5.3.1) but no sizes.  Own choices: tanh layers beside a linear
path from inputs to outputs, so that a few samples are fitted by a line; mean-field normals with local reparametrisation
(Kingma, Salimans and Welling 2015, arXiv 1506.02557).  Predictions average `draws` fixed antithetic draws of the
weights: the mean of their means, and the mean of their variances plus the variance of their means.

The feed-forward network (`Network`) is one model of all pushes, the non-hierarchical baseline.

    Δ | x ~ Normal(g(x; w), diag exp h(x; w)),   w by −log p + ½ λ |w|²/n  (a most probable network, no posterior)

w are its `layers`, each (in + 1, out) with the bias as last row; λ is `weight_decay`, the precision of the weights
times √fan-in.  Architecture, inputs, optimiser and number of steps are those of each HMA network; K = 1, so its belief
is 1.  Source: thesis, section 5.5.2, which gives no sizes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch.optim.adam import adam

from thesis_lib.jenga.learners.learner import Learner, PushPrediction
from thesis_lib.jenga.learners.settings import NetworkSettings
from thesis_lib.jenga.robot.samples import PushSamples

# log variances of scaled outputs: a sixtieth to ten standard deviations of a training change
LOG_VAR = (-8.0, 4.6)
# of q, times the prior's: networks start nearly deterministic and widen where there are no data
START_STD = 0.05
N_OUT = 7

Layers = list[torch.Tensor]


def layer_shapes(n_inputs: int, hidden: tuple[int, ...]) -> list[tuple[int, int]]:
    """(fan-in + 1, units) of the hidden layers, the output and the linear path."""
    sizes = [n_inputs, *hidden]
    shapes = [(a + 1, b) for a, b in pairwise(sizes)]
    return [*shapes, (hidden[-1] + 1, 2 * N_OUT), (n_inputs + 1, 2 * N_OUT)]


def _affine(x: torch.Tensor, w: torch.Tensor) -> torch.Tensor:
    """x (…, n, in) times weights (…, in + 1, out); the last row is the bias."""
    return torch.matmul(x, w[..., :-1, :]).add_(w[..., -1:, :])


def forward(x: torch.Tensor, layers: Layers) -> tuple[torch.Tensor, torch.Tensor]:
    """Mean and log variance (…, n, 7) for weights (…, in + 1, out)."""
    out = outputs_of(x, layers)
    return out[..., :N_OUT], soft_clamp(out[..., N_OUT:])


def outputs_of(x: torch.Tensor, layers: Layers) -> torch.Tensor:
    """Outputs (…, n, 14) before `forward` splits them and limits the log variances."""
    h = x
    for w in layers[:-2]:
        h = _affine(h, w).tanh_()
    return _affine(h, layers[-2]).add_(_affine(x, layers[-1]))


def soft_clamp(log_var: Any, xp: Any = torch) -> Any:
    """Log variance smoothly limited to `LOG_VAR`; `xp` is torch or a library with its tanh."""
    low, high = LOG_VAR
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return middle + half * xp.tanh((log_var - middle) / half)


def _local(x: torch.Tensor, mean: torch.Tensor, std: torch.Tensor, gen: torch.Generator) -> torch.Tensor:
    """Random draw of the layer's activations (local reparametrisation)."""
    var = _affine(x**2, std**2)
    noise = torch.randn(var.shape, generator=gen)
    return _affine(x, mean) + noise * torch.sqrt(var + 1e-12)


@dataclass
class BayesianNetworks:
    """K networks trained together; the last row of each layer's weights is the bias.

    Per layer: mean, log_std (K, in + 1, out); shared (in + 1, out); draws (draws, K, in + 1, out), used in predictions.
    """

    settings: NetworkSettings
    mean: Layers
    log_std: Layers
    shared: Layers
    draws: Layers = field(default_factory=list)

    def redraw(self, gen: torch.Generator) -> None:
        """Draw anew the fixed samples of the weights that predictions use."""
        half = self.settings.draws // 2
        self.draws = []
        for m, s in zip(self.mean, self.log_std):
            noise = torch.randn((half, *m.shape), generator=gen)
            self.draws.append(m + torch.exp(s) * torch.cat([noise, -noise]))

    def at_mean(self) -> "BayesianNetworks":
        """The same networks with predictions from their mean weights alone."""
        return replace(self, draws=[m[None] for m in self.mean])

    def predict(self, inputs: np.ndarray) -> tuple[np.ndarray, Callable[[], np.ndarray]]:
        """Mean (n, K, 7) of scaled changes for inputs (n, d), and a function for their variance (as slow)."""
        with torch.no_grad():
            out = outputs_of(torch.as_tensor(inputs, dtype=torch.float32), self.draws)  # (draws, K, n, 14)
            mean = out[..., :N_OUT]
            average = mean.mean(dim=0)

        def variance() -> np.ndarray:
            var = torch.exp(soft_clamp(out[..., N_OUT:])).mean(dim=0) + ((mean - average) ** 2).mean(dim=0)
            return var.permute(1, 0, 2).double().numpy()

        return average.permute(1, 0, 2).double().numpy(), variance

    def arrays(self) -> list[np.ndarray]:
        """Mean weights of each layer (K, in + 1, out), for use outside torch."""
        return [m.detach().double().numpy() for m in self.mean]


def descend(parameters: Layers, loss: Callable[[float], torch.Tensor], rate: float, steps: int) -> None:
    """Minimise `loss` by `steps` steps of Adam, in place, with a learning rate that falls to a tenth along a cosine.

    `loss` takes the share of the steps done.  The results equal those of torch.optim.Adam, whose import also loads
    torch's compiler and takes a second longer.
    """
    for w in parameters:
        w.requires_grad_(True)
    first, second = ([torch.zeros_like(p) for p in parameters] for _ in range(2))
    state = first, second, [], [torch.zeros(()) for _ in parameters]
    numbers = {"beta1": 0.9, "beta2": 0.99, "eps": 1e-8, "weight_decay": 0.0}
    for step in range(steps):
        share = step / steps
        gradient = list(torch.autograd.grad(loss(share), parameters))
        now = rate * (0.1 + 0.45 * (1 + np.cos(np.pi * share)))
        with torch.no_grad():
            adam(parameters, gradient, *state, amsgrad=False, maximize=False, foreach=False, lr=now, **numbers)


def train(
    inputs: np.ndarray,
    outputs: np.ndarray,
    resp: np.ndarray,
    settings: NetworkSettings,
    seed: int,
    start: BayesianNetworks | None = None,
) -> BayesianNetworks:
    """Train networks that minimise the module's loss.

    inputs: x (n, d).  outputs: Δ (n, 7).  resp: r (n, K).  start: networks from which training continues.
    """
    gen = torch.Generator().manual_seed(seed)
    k, n = resp.shape[1], len(inputs)
    x, y, r = (torch.as_tensor(a, dtype=torch.float32) for a in (inputs, outputs, resp))
    shapes = layer_shapes(x.shape[1], settings.hidden)
    scales = [1.0 / np.sqrt(rows) for rows, _ in shapes]
    if start is None:
        shared = [0.5 * s * torch.randn(shape, generator=gen) for shape, s in zip(shapes, scales)]
        shared[-2] = shared[-2] * 0.1
        shared[-1] = torch.zeros(shapes[-1])
        mean = [w.expand(k, -1, -1).clone() for w in shared]
        log_std = [torch.full_like(m, float(np.log(START_STD * settings.prior_std * s))) for m, s in zip(mean, scales)]
    else:
        shared, mean, log_std = ([w.clone() for w in ws] for ws in (start.shared, start.mean, start.log_std))
    batch = min(settings.batch, n)

    def loss(share: float) -> torch.Tensor:
        rows = slice(None) if batch == n else torch.randint(n, (batch,), generator=gen)
        std = [torch.exp(s) for s in log_std]
        xb = x[rows]
        h = xb
        for m, s in zip(mean[:-2], std[:-2]):
            h = torch.tanh(_local(h, m, s, gen))
        out = _local(h, mean[-2], std[-2], gen) + _local(xb, mean[-1], std[-1], gen)
        log_var = soft_clamp(out[..., N_OUT:])
        error = (y[rows] - out[..., :N_OUT]) ** 2
        nll = 0.5 * (error * torch.exp(-log_var) + log_var).sum(dim=2)  # (K, batch)
        fit = (r[rows].T * nll).sum() * (n / batch)
        anneal = min(1.0, share / settings.warm_up) if settings.warm_up > 0 and start is None else 1.0
        return (fit + anneal * divergence(shared, mean, log_std, scales, settings)) / n

    descend([*shared, *mean, *log_std], loss, settings.rate, settings.iterations)
    nets = BayesianNetworks(settings, *([w.detach() for w in ws] for ws in (mean, log_std, shared)))
    nets.redraw(gen)
    return nets


def divergence(
    shared: Layers, mean: Layers, log_std: Layers, scales: list[float], settings: NetworkSettings
) -> torch.Tensor:
    """KL(q ‖ prior) of all networks − log p of the shared mean, up to a constant."""
    total = torch.zeros(())
    for mu, m, ls, scale in zip(shared, mean, log_std, scales):
        prior = settings.prior_std * scale
        ratio = (torch.exp(2 * ls) + (m - mu) ** 2) / prior**2
        total = total + 0.5 * (ratio - 1.0 - 2 * (ls - float(np.log(prior)))).sum()
        total = total + 0.5 * (mu**2).sum() / (settings.shared_std * scale) ** 2
    return total


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


class Network(Learner):
    """Single feed-forward network (K = 1).  Once fitted: layers (see the module)."""

    layers: Layers

    def fit(self, samples: PushSamples, rng: np.random.Generator) -> "Network":
        """Train by the module's loss.  Errors as in `Learner.fit`."""
        self.shares = self.first = np.ones(1)
        self.layers = train_plain(*self.scale(samples), self.settings.network, int(rng.integers(2**31)))
        return self

    def predict(self, state: np.ndarray, action: np.ndarray, context: np.ndarray, belief: np.ndarray) -> PushPrediction:
        """Predict the next reading (n, 1, 7)."""
        inputs = self.scaling.inputs(state, action, context)
        with torch.no_grad():
            out = outputs_of(torch.as_tensor(inputs, dtype=torch.float32), self.layers)
        mean = self.scaling.next_state(state, out[..., :N_OUT].double().numpy())

        def variance() -> np.ndarray:
            return self.scaling.change**2 * torch.exp(soft_clamp(out[..., N_OUT:])).double().numpy()[:, None]

        return PushPrediction(mean[:, None], variance, belief)
