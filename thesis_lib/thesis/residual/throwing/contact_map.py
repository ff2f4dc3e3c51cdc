"""The contact map: a model's motion over the duration of a contact, with a learned residual.

Hits of two corners within milliseconds are not an impulse at one point, and the camera cannot separate such hits to
train a correction at each.  Therefore the model simulates everything in the time T after the first touch, and
a process learns its error at the end: in velocity (Δv_x, Δv_y, k Δω: a wrench per unit mass) and pose.  This extends
the thesis's residual.  With the speed s before contact

    (Δx, Δy, k Δθ) = s T f_q(X),   (Δv_x, Δv_y, k Δω) = s f_v(X)
    X = (sin 4θ, cos 4θ, v_x/s, v_y/s, k ω/s, log s, x, sin θ, cos θ)

as impacts are homogeneous of degree 1 in the velocity, the four sides of a square are nearly equal (4θ), the corners
of a real square are not quite (θ), and surfaces vary with x.  Noise is also proportional to s, but fast contacts repeat
better than slow ones, so each range of speeds has its own process.

The remaining errors have heavier tails than a Gaussian.  Their standardised leave-one-out residuals z are assumed to
follow Student's t in d = 6 dimensions with a common number of degrees of freedom ν,

    log p(z) = Σ_j −log a_j − (ν + d)/2 log(1 + Σ_j (z_j/a_j)²/ν) + const          a by EM, ν from a grid

Source of the leave-one-out residuals: Rasmussen and Williams 2006, eq. 5.12; of the EM: Lange, Little and Taylor 1989,
doi:10.1080/01621459.1989.10478852.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from scipy.special import gammaln

from thesis_lib.contact.space import velocity_error
from thesis_lib.learners.covariance import factor, inverse_diagonal, solve
from thesis_lib.learners.gaussian_process import GaussianProcess
from thesis_lib.learners.marginal_likelihood import noisy
from thesis_lib.thesis.residual.throwing.propagation import Distribution, Sampled

FREEDOMS = (2.5, 3.0, 4.0, 6.0, 10.0, 20.0, 50.0, np.inf)
_EM = 30  # iterations; scales change by less than one per cent after ten


@dataclass(frozen=True)
class Regime:
    """Residual at speeds up to `fastest` (m/s): a Gaussian process, or None for the scatter alone.

    `scale` is a (6,) of z or, without a process, of the residual itself.
    """

    fastest: float
    process: GaussianProcess | None
    scale: np.ndarray


@dataclass
class ContactMap(Sampled):
    """Uncertain contact: a model's motion over `duration` (s) after the first touch, and its residual (see the module).

    Contacts slower than `slowest` (m/s) follow the law.
    """

    path: Callable[[np.ndarray, np.ndarray, float], tuple[np.ndarray, np.ndarray]] | None = None
    regimes: tuple[Regime, ...] = ()
    duration: float = 0.012
    slowest: float = 0.12

    def distribution(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray) -> Distribution:
        """Return the state (n, 6) after `duration` and its diagonal covariance, noise included."""
        mean, cov, took = super().distribution(q, v, r, slow)
        fast = np.flatnonzero(v[:, 1] + r[:, 0] * v[:, 2] < -self.slowest)
        if not len(fast):
            return mean, cov, took
        residual, std = self.missed(q[fast], v[fast])
        unit = residual_unit(v[fast], self.body.k_g, self.duration)
        mean[fast] = np.hstack(self.path(q[fast], v[fast], self.duration)) + residual * unit
        if not self.deterministic:
            cov[fast[:, None], np.arange(6), np.arange(6)] = (std * unit) ** 2
        took[fast] = self.duration
        return mean, cov, took

    def missed(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Predict mean and standard deviation (n, 6) of the residual at touches."""
        speed = velocity_error(v, self.body.k_g)
        X = contact_features(q, v, self.body.k_g)
        mean, std = np.zeros((len(q), 6)), np.zeros((len(q), 6))
        # the covariance of Student's t is larger than the square of its scale
        wide = 1.0 if np.isinf(self.freedom) else np.sqrt(self.freedom / (self.freedom - 2.0))
        for regime, rows in zip(self.regimes, split(speed, [regime.fastest for regime in self.regimes])):
            process = regime.process
            if process is None:
                std[rows] = regime.scale * wide
                continue
            if not len(rows):
                continue
            mean[rows], variance = process.predict(X[rows], noise=True, variance=not self.deterministic)
            if not self.deterministic:
                std[rows] = np.sqrt(variance) * regime.scale * wide
        return mean, std


def split(speed: np.ndarray, edges: list[float]) -> list[np.ndarray]:
    """Indices of the speeds (n,) in each range that ends at an edge; the last range has no upper end."""
    which = np.searchsorted(np.array(edges[:-1]), speed)
    return [np.flatnonzero(which == i) for i in range(len(edges))]


def contact_features(q: np.ndarray, v: np.ndarray, k_g: float) -> np.ndarray:
    """Features X (n, 9) of the module's docstring, with the speed s = √(v_x² + v_y² + k² ω²)."""
    speed = velocity_error(v, k_g)
    direction = v * [1.0, 1.0, k_g] / speed[:, None]
    angle = 4.0 * q[:, 2]
    corner = np.sin(q[:, 2]), np.cos(q[:, 2])
    return np.column_stack([np.sin(angle), np.cos(angle), direction, np.log(speed), q[:, 0], *corner])


def residual_unit(v: np.ndarray, k_g: float, duration: float) -> np.ndarray:
    """Change of state (n, 6) for a residual of 1: s T for x, y, k θ and s for v_x, v_y, k ω."""
    unit = np.array([duration, duration, duration / k_g, 1.0, 1.0, 1.0 / k_g])
    return velocity_error(v, k_g)[:, None] * unit


def leave_one_out(process: GaussianProcess) -> np.ndarray:
    """Leave-one-out residuals (n, p) over their standard deviations: α_i/√(K_y⁻¹)_ii (R. & W., eq. 5.12)."""
    z, x = np.empty_like(process.y), torch.as_tensor(process.x)
    theta = np.log(np.column_stack([process.lengthscale, process.signal, process.noise]))
    for i in range(z.shape[1]):
        # residuals of outliers have the same weight as all others
        L = factor(noisy(theta[i], x, torch.ones(len(x), dtype=x.dtype))[0])
        alpha = solve(L, torch.as_tensor(np.ascontiguousarray(process.y[:, i])))
        z[:, i] = (alpha / inverse_diagonal(L).sqrt()).numpy()
    return z


def student(parts: list[np.ndarray]) -> tuple[list[np.ndarray], float]:
    """Fit Student's t: scales (d,) of the rows (n_i, d) of each part, and their common degrees of freedom."""
    best = None
    for freedom in FREEDOMS:
        fits = [_student_scale(z, freedom) for z in parts]
        score = sum(score for _, score in fits)
        if best is None or score > best[0]:
            best = (score, [scale for scale, _ in fits], freedom)
    return best[1], best[2]


def _student_scale(z: np.ndarray, freedom: float) -> tuple[np.ndarray, float]:
    """Scale (d,) of rows (n, d) under Student's t, and their log likelihood."""
    n, d = z.shape
    scale = np.sqrt((z**2).mean(0))
    if np.isinf(freedom):
        scaled = z / scale
        return scale, float(-0.5 * (scaled**2).sum() - n * (np.log(scale).sum() + 0.5 * d * np.log(2.0 * np.pi)))
    for _ in range(_EM):
        weight = (freedom + d) / (freedom + ((z / scale) ** 2).sum(1))
        scale = np.sqrt((weight[:, None] * z**2).mean(0))
    square = ((z / scale) ** 2).sum(1)
    constant = gammaln(0.5 * (freedom + d)) - gammaln(0.5 * freedom) - 0.5 * d * np.log(freedom * np.pi)
    score = n * (constant - np.log(scale).sum()) - 0.5 * (freedom + d) * np.log1p(square / freedom).sum()
    return scale, float(score)
