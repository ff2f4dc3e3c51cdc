"""Hyperparameters of a Gaussian process by marginal likelihood, with less weight on outliers (wild measurements).

    log p(y) = −½ yᵀ α − ½ log |K_y| − ½ n log 2π,     K_y = K + σ² W⁻¹,   α = K_y⁻¹ y
    ∂ log p / ∂ log l_d = ½ Σ_ij G_ij (x_id − x_jd)² / l_d²,   G = (α αᵀ − K_y⁻¹) ∘ K     (R. & W., eq. 5.9)
    w_i = min(1, (`WILD`/|z_i|)²),   z_i² = (α_i/κ_i)² / (1/κ_i − σ²/w_i + σ²),   κ_i = [K_y⁻¹]_ii   (eq. 5.12)

`theta` (d + 2,) holds the logarithms of the lengths l, of the variance s of the function and of the noise, σ²;
`weight` (n,) is w, 1 unless a measurement is wild.

With Σ_ij G_ij (x_id − x_jd)² = 2 Σ_i x_id² (G 1)_i − 2 (Xᵀ G X)_dd the gradient needs one Cholesky factor and one
inverse, without the n × n steps of automatic differentiation.  L-BFGS-B runs from several starts; the first is fixed
(`START`), the others are drawn.  Weak log-normal priors (`PRIOR`) prevent overfitting of a handful of impacts; `prior:
false` is marginal likelihood alone.

One wild impact (a second corner that hits within a frame) can give a Gaussian process short lengths everywhere.  So the
noise of an impact more than `WILD` standard deviations from its leave-one-out prediction is raised to match, and the
search continues.  With Gaussian noise this affects one impact in 370.

Source: Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006.
"""

import numpy as np
import torch
from scipy.optimize import minimize

from thesis_lib.learners.covariance import covariance, factor, inverse, inverse_diagonal, solve, symmetric_product
from thesis_lib.learners.settings import GaussianProcessSettings

# median and spread (of the logarithm) of the priors of l, s, σ²; beyond some fifty impacts they matter little
PRIOR = ((4.0, 1.0), (1.0, 1.5), (0.5, 1.0))
START = (3.0, 0.5, 0.5)  # l, s, σ² of the first start: half of the variance a smooth function, half of it noise
# with less noise, rounding in the factorisation would decide between nearly equal impacts
BOUNDS = {"lengthscale": (0.05, 100.0), "signal": (1e-3, 1e3), "noise": (1e-6, 4.0)}
EQUAL = 1.0  # nats; where nothing can be learned, the first start, which has noise, is kept unless another is better
WILD = 3.0  # standard deviations


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
    device: torch.device,
) -> tuple[np.ndarray, float]:
    """Logarithms of the best hyperparameters (d + 2,) and their log marginal likelihood."""
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
    return best.x, -best.fun - (log_prior(best.x)[0] if settings.prior else 0.0)


def weights(theta: np.ndarray, x: np.ndarray, y: np.ndarray, weight: np.ndarray, device: torch.device) -> np.ndarray:
    """Weights w (n,) from the distance of each measurement to its leave-one-out prediction; see the module."""
    X, Y, W = (torch.as_tensor(np.ascontiguousarray(a), device=device) for a in (x, y, weight))
    L = factor(noisy(theta, X, W)[0])
    alpha = solve(L, Y).cpu().numpy()
    kappa, noise = inverse_diagonal(L).cpu().numpy(), np.exp(theta[-1])
    square = (alpha / kappa) ** 2 / (1.0 / kappa - noise / weight + noise)
    return np.minimum(WILD**2 / np.maximum(square, 1e-300), 1.0)


def noisy(theta: np.ndarray, x: torch.Tensor, weight: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """K_y (n, n), x divided by the lengths (n, d), and the variances of the noise, σ² W⁻¹ (n,)."""
    t = np.exp(theta)
    z, noise = x / torch.as_tensor(t[:-2], device=x.device), t[-1] / weight
    K_y = covariance(z, z, t[-2])
    K_y.diagonal().add_(noise)
    return K_y, z, noise


def objective(
    theta: np.ndarray, x: torch.Tensor, y: torch.Tensor, weight: torch.Tensor, prior: bool = False
) -> tuple[float, np.ndarray]:
    """Negative log marginal likelihood (and log prior) and its gradient by the logarithms of (l, s, σ²)."""
    value, gradient = likelihood(theta, x, y, weight)
    if prior:
        of_prior, slope = log_prior(theta)
        value, gradient = value - of_prior, gradient - slope
    return value, gradient


def log_prior(theta: np.ndarray) -> tuple[float, np.ndarray]:
    """Logarithm of the prior at theta (d + 2,), less its constant, and its gradient."""
    median, spread = np.array([PRIOR[0]] * (len(theta) - 2) + [*PRIOR[1:]]).T
    off = (theta - np.log(median)) / spread
    return -0.5 * float(off @ off), -off / spread


def likelihood(theta: np.ndarray, x: torch.Tensor, y: torch.Tensor, weight: torch.Tensor) -> tuple[float, np.ndarray]:
    """Negative log marginal likelihood and its gradient; see the module's equations."""
    K_y, z, noise = noisy(theta, x, weight)
    try:
        L = factor(K_y.clone())
    except np.linalg.LinAlgError:
        return 1e25, np.zeros(len(theta))
    alpha = solve(L, y)
    value = 0.5 * (y @ alpha) + L.diagonal().log().sum() + 0.5 * len(x) * np.log(2.0 * np.pi)
    G = inverse(L).addr_(alpha, alpha, alpha=-1.0)  # negative of G in the equations
    by_noise = 0.5 * (G.diagonal() @ noise)
    K_y.diagonal().sub_(noise)
    G.mul_(K_y)
    sums = symmetric_product(G, torch.cat([z, z.new_ones((len(z), 1))], 1))
    rows = sums[:, -1]
    by_length = (z * z * rows[:, None] - z * sums[:, :-1]).sum(0)
    gradient = torch.cat([by_length, 0.5 * rows.sum()[None], by_noise[None]])
    return float(value), gradient.cpu().numpy()
