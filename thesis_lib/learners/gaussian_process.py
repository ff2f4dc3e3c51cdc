"""Gaussian processes with several outputs: exact, ARD squared-exponential, hyperparameters by marginal likelihood.

Each output is independent, with standardised inputs x and outputs y,

    k(x, x') = s exp(−½ Σ_d (x_d − x'_d)² / l_d²),   K_y = K + σ² W⁻¹,   α = K_y⁻¹ y
    μ* = k*ᵀ α,   var* = s − k*ᵀ K_y⁻¹ k*

`marginal_likelihood` finds the hyperparameters, `covariance` computes the matrices (exact, float64).  GPyTorch would go
through MKL: with the common kernels its factor takes 4 times as long and its variance 8 times.  Scikit-learn's process,
used for comparison in the tests and by the critique (`thesis_lib/critique/drops/features.py`), fits one noise σ² for
all measurements, or takes one for each as given, but does not fit σ² beside weights w, and it has no priors.
Its likelihood with gradient takes 5 times as long (450 points of 6 inputs: 36 instead of 7 ms).

GPU and CPU sum in different orders (both in float64; the GPU draws no random numbers).  With the same hyperparameters
predictions agree within `SAME` of the outputs' spread; after training, whose search stops early, `SAME_TRAINED`.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, algorithm 2.1.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from thesis_lib.foundation.errors import UserError
from thesis_lib.learners.covariance import covariance, explained, factor, product, solve
from thesis_lib.learners.marginal_likelihood import noisy, search, starts, weights
from thesis_lib.learners.settings import GaussianProcessSettings

SAME = 1e-8
SAME_TRAINED = 1e-4
SETTLED = 0.003  # of all weight: a smaller change needs no other search (with 0.01, errors changed by up to a fifth)
ROWS = 256  # predictions at a time: their covariances with 450 impacts fit the processor's cache


def device_of(settings: GaussianProcessSettings) -> torch.device:
    """The device that the settings select; raises UserError for CUDA without a GPU."""
    if settings.device == "cuda" and not torch.cuda.is_available():
        raise UserError("device: cuda is set, but no CUDA GPU is usable here; set device: auto or cpu.")
    use_cuda = settings.device != "cpu" and torch.cuda.is_available()
    return torch.device("cuda" if use_cuda else "cpu")


@dataclass(frozen=True)
class GaussianProcess:
    """A trained process: data, standardisation and hyperparameters as NumPy arrays."""

    x: np.ndarray  # x, y: (n, d) and (n, p) standardised training data
    y: np.ndarray
    x_mean: np.ndarray  # x_mean, x_scale, y_mean, y_scale: (d,) and (p,) of the standardisation
    x_scale: np.ndarray
    y_mean: np.ndarray
    y_scale: np.ndarray
    lengthscale: np.ndarray  # l (p, d), in standard deviations of the feature
    signal: np.ndarray  # s (p,), prior variance of the function
    noise: np.ndarray  # σ² (p,)
    weight: np.ndarray  # w (n, p) of each measurement, 1 unless it is wild
    log_likelihood: np.ndarray  # nats (p,), of the impacts that gave hyperparameters
    n_hyper: int  # training points that gave the hyperparameters
    device: str = "cpu"

    def predict(self, X: np.ndarray, *, noise: bool = False, variance: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Mean and variance, each (m, p) in the outputs' units, at X (m, d) in the inputs' units.

        The variance is that of the function, or with `noise` of a new measurement; it is NaN if `variance` is False,
        which saves its cost.  Raises ValueError if X is not (m, d) or not finite.
        """
        X = np.asarray(X, dtype=float)
        if X.ndim != 2 or X.shape[1] != len(self.x_mean):
            raise ValueError(f"inputs must have shape (m, {len(self.x_mean)}), got {X.shape}")
        if not np.isfinite(X).all():
            raise ValueError("inputs must be finite")
        z = (X - self.x_mean) / self.x_scale
        mean, var = np.empty((len(X), self.y.shape[1])), np.full((len(X), self.y.shape[1]), np.nan)
        for first in range(0, len(X), ROWS):
            rows = slice(first, first + ROWS)
            at = torch.as_tensor(z[rows], device=self.device)
            for i, (length, points, L, alpha) in enumerate(self._trained):
                k = covariance(at / length, points, self.signal[i])
                mean[rows, i] = product(k, alpha).cpu().numpy()
                if variance:
                    var[rows, i] = self.signal[i] - explained(L, k).cpu().numpy()
        var = np.maximum(var, 0.0) + (self.noise if noise else 0.0)
        return self.y_mean + mean * self.y_scale, var * self.y_scale**2

    @cached_property
    def _trained(self) -> list[tuple[torch.Tensor, ...]]:
        """For each output lengths (d,), data divided by them (n, d), L (n, n) and α (n,)."""
        theta = np.log(np.column_stack([self.lengthscale, self.signal, self.noise]))
        x, y, weight = (torch.as_tensor(a, device=self.device) for a in (self.x, self.y, self.weight))
        trained = []
        for i in range(y.shape[1]):
            K_y, points, _ = noisy(theta[i], x, weight[:, i])
            L = factor(K_y)
            trained.append((torch.as_tensor(self.lengthscale[i], device=self.device), points, L, solve(L, y[:, i])))
        return trained

    def begins(self, X: np.ndarray, Y: np.ndarray) -> bool:
        """Whether the first rows of these data (n, d) and (n, p) are the training data."""
        own = np.hstack([self.x * self.x_scale + self.x_mean, self.y * self.y_scale + self.y_mean])
        first = np.hstack([X, Y])[: len(own)]
        return own.shape == first.shape and bool(np.allclose(own, first, rtol=1e-9, atol=1e-12))

    def start_for(self, x_scale: np.ndarray, y_scale: np.ndarray) -> np.ndarray:
        """Logarithms of hyperparameters (p, d + 2) for data with another standardisation."""
        length = self.lengthscale * self.x_scale / x_scale
        square = ((self.y_scale / y_scale) ** 2)[:, None]
        return np.log(np.column_stack([length, self.signal[:, None] * square, self.noise[:, None] * square]))


def fit_gaussian_process(
    X: np.ndarray,
    Y: np.ndarray,
    rng: np.random.Generator,
    settings: GaussianProcessSettings | None = None,
    *,
    centred: bool = True,
    start: GaussianProcess | None = None,
) -> GaussianProcess:
    """Train one process for each column of outputs Y (n, p) at inputs X (n, d); `rng` draws all starts but the first.

    The prior mean is that of Y if `centred`, else zero (residuals: without data, the law). The hyperparameters of
    `start`, a process on similar data, are the first start, and are kept if they came from as many impacts as the
    settings allow; where its data are the first rows, so are its weights. Raises ValueError for shapes that disagree,
    fewer than two rows, or values that are not finite.
    """
    X, Y = np.asarray(X, dtype=float), np.asarray(Y, dtype=float)
    if X.ndim != 2 or Y.ndim != 2 or len(X) != len(Y):
        raise ValueError(f"expected X (n, d) and Y (n, p), got {X.shape} and {Y.shape}")
    if len(X) < 2 or not (np.isfinite(X).all() and np.isfinite(Y).all()):
        raise ValueError(f"training needs at least two finite rows, got {len(X)}")
    settings = settings or GaussianProcessSettings()
    device = device_of(settings)
    x_mean, x_scale = X.mean(axis=0), _scale(X, X.mean(axis=0))
    y_mean = Y.mean(axis=0) if centred else np.zeros(Y.shape[1])
    y_scale = _scale(Y, y_mean)
    x, y = (X - x_mean) / x_scale, (Y - y_mean) / y_scale
    known = None if start is None else start.start_for(x_scale, y_scale)
    count, d = min(len(x), settings.hyperparameter_impacts), x.shape[1]
    fixed = start is not None and start.n_hyper >= count
    theta, value, weight = np.empty((y.shape[1], d + 2)), np.empty(y.shape[1]), np.ones_like(y)
    if start is not None and start.begins(X, Y):
        weight[: len(start.weight)] = start.weight
    for i, output in enumerate(y.T):
        if fixed:
            theta[i], value[i] = known[i], start.log_likelihood[i]
        else:
            # beside a known start, a drawn one has ended better in 1 of some 1,000 searches, by less than a nat
            count_of = settings.restarts if known is None else 1
            first = starts(d, rng, count_of, None if known is None else known[i])
            theta[i], value[i] = search(x[:count], output[:count], weight[:count, i], first, settings, device)
        for _ in range(settings.robust_rounds):
            before = weight[:, i].copy()
            weight[:, i] = weights(theta[i], x, output, before, device)
            if np.abs(weight[:, i] - before).sum() <= SETTLED * len(x):
                break
            if not fixed:
                theta[i], value[i] = search(
                    x[:count], output[:count], weight[:count, i], theta[i : i + 1], settings, device
                )
    h = np.exp(theta)
    count = start.n_hyper if fixed else count
    return GaussianProcess(
        x, y, x_mean, x_scale, y_mean, y_scale, h[:, :d], h[:, d], h[:, d + 1], weight, value, count, str(device)
    )


def _scale(values: np.ndarray, about: np.ndarray) -> np.ndarray:
    """Root mean square about a centre; 1 where nothing varies (a disk's inertia is the same at every impact)."""
    scale = np.sqrt(np.mean((values - about) ** 2, axis=0))
    return np.where(scale > 1e-12 * (1e-300 + np.abs(values).max(axis=0)), scale, 1.0)
