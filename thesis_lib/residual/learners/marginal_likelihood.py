"""Hyperparameters of a Gaussian process by marginal likelihood, with less weight on wild measurements.

    log p(y) = −½ yᵀ α − ½ log |K_y| − ½ n log 2π,     K_y = K + σ² W⁻¹,   α = K_y⁻¹ y
    ∂ log p / ∂ log l_d = ½ Σ_ij G_ij (x_id − x_jd)² / l_d²,   G = (α αᵀ − K_y⁻¹) ∘ K     (R. & W., eq. 5.9)
    w_i = min(1, (`WILD`/|z_i|)²),   z_i² = (α_i/κ_i)² / (1/κ_i − σ²/w_i + σ²),   κ_i = [K_y⁻¹]_ii   (eq. 5.12)

`theta` (d + 2,) holds the logarithms of the lengths l, of the variance s of the function and of the noise, σ²;
`weight` (n,) is w, 1 unless a measurement is wild.

With Σ_ij G_ij (x_id − x_jd)² = 2 Σ_i x_id² (G 1)_i − 2 (Xᵀ G X)_dd the gradient needs one Cholesky factor and one
inverse, without the n × n steps of automatic differentiation.  L-BFGS-B runs from several starts; the first is fixed
(`START`), the others are drawn.  Weak log-normal priors (`PRIOR`) prevent overfitting of a handful of impacts; `prior:
false` is marginal likelihood alone.

One wild impact (a second corner that hits within a frame) can give a Gaussian process short lengths everywhere.  So an
impact more than `WILD` standard deviations from its leave-one-out prediction has its noise raised to match, and the
search continues.  With Gaussian noise this affects one impact in 370.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006.
"""

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from thesis_lib.foundation.settings import Section

if TYPE_CHECKING:
    import torch

# median and spread (of the logarithm) of the priors of l, s, σ²; beyond some fifty impacts they matter little
PRIOR = ((4.0, 1.0), (1.0, 1.5), (0.5, 1.0))
START = (3.0, 0.5, 0.5)  # l, s, σ² of the first start: half of the variance a smooth function, half of it noise
# with less noise, rounding of the factorisation would decide between nearly equal impacts
BOUNDS = {"lengthscale": (0.05, 100.0), "signal": (1e-3, 1e3), "noise": (1e-6, 4.0)}
EQUAL = 1.0  # nats; where nothing can be learned, the first start, which has noise, is kept unless another is better
WILD = 3.0  # standard deviations


class GaussianProcessSettings(Section):
    """How Gaussian processes are trained; all own choices."""

    restarts: int = Field(2, ge=1, description="starts of the search for hyperparameters, the fixed one included")
    prior: bool = Field(True, description="weak log-normal priors: without them ten impacts are learned by heart")
    robust_rounds: int = Field(2, ge=0, description="how often wild impacts get less weight; 0: all count alike")
    iterations: int = Field(100, ge=1, description="most L-BFGS iterations of a start")
    hyperparameter_impacts: int = Field(450, ge=10, description="first impacts that give them; all are conditioned on")
    device: Literal["auto", "cpu", "cuda"] = Field("auto", description="auto: a CUDA GPU if there is one")


def starts(d: int, rng: np.random.Generator, count: int, known: np.ndarray | None) -> np.ndarray:
    """Logarithms of hyperparameters (count, d + 2) where searches start: the known or fixed one, then drawn ones."""
    bounds = log_bounds(d)
    first = np.log([START[0]] * d + [*START[1:]]) if known is None else known
    drawn = rng.uniform(size=(count - 1, d + 2)) * np.log([20.0] * d + [10.0, 500.0])
    return np.vstack([np.clip(first, *bounds.T), drawn + np.log([0.5] * d + [0.3, 1e-3])])


def log_bounds(d: int) -> np.ndarray:
    """Logarithms of the bounds (d + 2, 2) of the hyperparameters."""
    return np.log([BOUNDS["lengthscale"]] * d + [BOUNDS["signal"], BOUNDS["noise"]])


def search(
    x: np.ndarray,
    y: np.ndarray,
    weight: np.ndarray,
    starts: np.ndarray,
    settings: GaussianProcessSettings,
    device: "torch.device",
) -> tuple[np.ndarray, float]:
    """Logarithms of the best hyperparameters (d + 2,) and their log marginal likelihood."""
    import torch
    from scipy.optimize import minimize

    data = tuple(torch.as_tensor(np.ascontiguousarray(a), device=device) for a in (x, y, weight))
    best = None
    for start in starts:
        optimum = minimize(
            objective,
            start,
            (*data, settings.prior),
            jac=True,
            method="L-BFGS-B",
            bounds=log_bounds(x.shape[1]),
            # beyond this the likelihood changes by less than a hundredth of a nat
            options={"maxiter": settings.iterations, "ftol": 1e-4 / max(1, len(x)) ** 0.5, "gtol": 1e-3},
        )
        if best is None or optimum.fun < best.fun - EQUAL:
            best = optimum
    return best.x, -objective(best.x, *data)[0]


def weights(theta: np.ndarray, x: np.ndarray, y: np.ndarray, weight: np.ndarray, device: "torch.device") -> np.ndarray:
    """Weights w (n,) from the distance of each measurement to its leave-one-out prediction; see the module."""
    import torch

    X, Y, W = (torch.as_tensor(np.ascontiguousarray(a), device=device) for a in (x, y, weight))
    t = torch.as_tensor(np.exp(theta), device=device)
    K_y = covariance(t, X)[0]
    K_y.diagonal().add_(t[-1] / W)
    inverse = torch.cholesky_inverse(torch.linalg.cholesky(K_y))
    kappa = inverse.diagonal()
    residual = (inverse @ Y) / kappa
    square = residual**2 / (1.0 / kappa - t[-1] / W + t[-1])
    return torch.clamp(WILD**2 / square, max=1.0).cpu().numpy()


def covariance(t: "torch.Tensor", x: "torch.Tensor") -> "tuple[torch.Tensor, torch.Tensor]":
    """K (n, n) for hyperparameters t (d + 2,), and x divided by the lengths."""
    import torch

    z = x / t[: x.shape[1]]
    square = (z * z).sum(1)
    K = torch.addmm(square[None, :] + square[:, None], z, z.T, alpha=-2.0).clamp_(min=0.0)
    return K.mul_(-0.5).exp_().mul_(t[x.shape[1]]), z


def objective(
    theta: np.ndarray, x: "torch.Tensor", y: "torch.Tensor", weight: "torch.Tensor", prior: bool = False
) -> tuple[float, np.ndarray]:
    """Negative log marginal likelihood (and log prior) and its gradient by the logarithms of (l, s, σ²)."""
    value, gradient = likelihood(theta, x, y, weight)
    if prior:
        median, spread = np.array([PRIOR[0]] * x.shape[1] + [*PRIOR[1:]]).T
        off = (theta - np.log(median)) / spread
        value, gradient = value + 0.5 * float(off @ off), gradient + off / spread
    return value, gradient


def likelihood(
    theta: np.ndarray, x: "torch.Tensor", y: "torch.Tensor", weight: "torch.Tensor"
) -> tuple[float, np.ndarray]:
    """Negative log marginal likelihood and its gradient; see the module's equations."""
    import torch

    t = torch.as_tensor(np.exp(theta), device=x.device)
    n, d = x.shape
    K, z = covariance(t, x)
    K_y, noise = K.clone(), t[d + 1] / weight
    K_y.diagonal().add_(noise)
    L, failed = torch.linalg.cholesky_ex(K_y)
    if int(failed):
        return 1e25, np.zeros(d + 2)
    inverse = torch.cholesky_inverse(L)
    alpha = inverse @ y
    value = 0.5 * (y @ alpha) + L.diagonal().log().sum() + 0.5 * n * np.log(2.0 * np.pi)
    G = inverse.addr_(alpha, alpha, alpha=-1.0)  # negative of G in the equations
    by_noise = 0.5 * (G.diagonal() @ noise)
    G.mul_(K)
    rows = G.sum(1)
    by_length = (z * z).T @ rows - (z * (G @ z)).sum(0)
    gradient = torch.cat([by_length, 0.5 * rows.sum()[None], by_noise[None]])
    return float(value), gradient.cpu().numpy()
