"""Gaussian processes with several outputs: exact, ARD squared-exponential, hyperparameters by marginal likelihood.

Each output is independent, with standardised inputs x and outputs y,

    k(x, x') = s exp(−½ Σ_d (x_d − x'_d)² / l_d²),   K_y = K + σ² W⁻¹,   α = K_y⁻¹ y
    μ* = k*ᵀ α,   var* = s − k*ᵀ K_y⁻¹ k*

GPyTorch supplies kernel, factorisation and prediction cache (exact, float64, all outputs in one batch); predictions use
the covariance with the training data only.  `marginal_likelihood` finds the hyperparameters.

GPU and CPU sum in different orders (both in float64; the GPU draws no random numbers).  With the same hyperparameters
predictions agree within `SAME` of the outputs' spread; after training, whose search stops early, `SAME_TRAINED`.

Sources: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006; Gardner et al. 2018 (GPyTorch),
arXiv 1809.11165.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from thesis_lib.foundation.errors import UserError
from thesis_lib.residual.learners.marginal_likelihood import GaussianProcessSettings, search, starts, weights

if TYPE_CHECKING:
    import torch

SAME = 1e-8
SAME_TRAINED = 1e-4
SETTLED = 0.003  # of all weight: a change below it calls for no other search (with 0.01 errors moved by up to a fifth)
ROWS = 256  # predictions at a time: their covariances with 450 impacts fit the processor's cache


def device_of(settings: GaussianProcessSettings) -> "torch.device":
    """The device that the settings ask for; raises UserError for CUDA without a GPU."""
    import torch

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
        import torch

        X = np.asarray(X, dtype=float)
        if X.ndim != 2 or X.shape[1] != len(self.x_mean):
            raise ValueError(f"inputs must have shape (m, {len(self.x_mean)}), got {X.shape}")
        if not np.isfinite(X).all():
            raise ValueError("inputs must be finite")
        z = (X - self.x_mean) / self.x_scale
        p = self.y.shape[1]
        mean, var = np.empty((len(X), p)), np.full((len(X), p), np.nan)
        with torch.no_grad(), _exact():
            model, weights = self._trained
            for first in range(0, len(X), ROWS):
                rows = slice(first, first + ROWS)
                at = torch.as_tensor(z[rows], device=self.device).expand(p, -1, -1)
                k = model.covar_module(at, model.train_inputs[0]).to_dense()
                mean[rows] = (k @ weights)[:, :, 0].T.cpu().numpy()
                if variance:
                    # k*ᵀ K_y⁻¹ k* as the square of k*ᵀ L⁻ᵀ
                    explained = (k @ self._root).square_().sum(dim=2).cpu().numpy()
                    var[rows] = self.signal - explained.T
        var = np.maximum(var, 0.0) + (self.noise if noise else 0.0)
        return self.y_mean + mean * self.y_scale, var * self.y_scale**2

    @cached_property
    def _trained(self) -> "tuple[Any, torch.Tensor]":
        """GPyTorch's model with its cache for means: K_y⁻¹ y (p, n, 1)."""
        import gpytorch
        import torch

        x = torch.as_tensor(self.x, device=self.device).expand(self.y.shape[1], -1, -1).contiguous()
        y = torch.as_tensor(np.ascontiguousarray(self.y.T), device=self.device)
        noise = torch.as_tensor(np.ascontiguousarray((self.noise / self.weight).T), device=self.device)
        model = _gpytorch_model(x, y, noise)
        model.set_hyperparameters(self.lengthscale, self.signal)
        model.eval()
        with gpytorch.settings.skip_posterior_variances():
            model(x[:, :1])  # makes the cache
        return model, model.prediction_strategy.mean_cache[..., None]

    @cached_property
    def _root(self) -> "torch.Tensor":
        """L⁻ᵀ (p, n, n), GPyTorch's cache for variances: costs as much again, so it is made when they are asked for."""
        return self._trained[0].prediction_strategy.covar_cache

    def begins(self, X: np.ndarray, Y: np.ndarray) -> bool:
        """Whether these data (n, d) and (n, p) are, in their first rows, those it was trained on."""
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
            # from a known answer a drawn start has ended better in 1 of some 1,000 searches, by less than a nat
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


def _exact() -> Any:
    """GPyTorch's settings for exact Cholesky factors of any size, with cached inverse."""
    import contextlib

    import gpytorch

    chosen, stack = gpytorch.settings, contextlib.ExitStack()
    sizes = chosen.max_cholesky_size(1_000_000), chosen.max_root_decomposition_size(1_000_000)
    quiet = chosen.debug(False)  # no warning where inputs are training inputs
    for setting in (chosen.fast_computations(False, False, False), chosen.fast_pred_var(True), quiet, *sizes):
        stack.enter_context(setting)
    return stack


def _gpytorch_model(x: "torch.Tensor", y: "torch.Tensor", noise: "torch.Tensor") -> Any:
    """GPyTorch's exact process for x (p, n, d), y (p, n) and variances of noise (p, n), a batch of outputs."""
    import gpytorch
    import torch

    class Independent(gpytorch.models.ExactGP):
        def __init__(self) -> None:
            batch = torch.Size([len(y)])
            likelihood = gpytorch.likelihoods.FixedNoiseGaussianLikelihood(noise=noise, batch_shape=batch)
            super().__init__(x, y, likelihood)
            self.mean_module = gpytorch.means.ZeroMean(batch_shape=batch)
            kernel = gpytorch.kernels.RBFKernel(ard_num_dims=x.shape[-1], batch_shape=batch)
            self.covar_module = gpytorch.kernels.ScaleKernel(kernel, batch_shape=batch)
            self.to(dtype=torch.float64, device=x.device)

        def forward(self, at: "torch.Tensor") -> Any:
            return gpytorch.distributions.MultivariateNormal(self.mean_module(at), self.covar_module(at))

        def set_hyperparameters(self, lengthscale: np.ndarray, signal: np.ndarray) -> None:
            def tensor(values: np.ndarray) -> torch.Tensor:
                return torch.as_tensor(np.ascontiguousarray(values), device=x.device)

            self.covar_module.base_kernel.lengthscale = tensor(lengthscale[:, None, :])
            self.covar_module.outputscale = tensor(signal)

    return Independent()
