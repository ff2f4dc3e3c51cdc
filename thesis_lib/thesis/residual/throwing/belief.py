"""Covariances of states, and beliefs (predictive distributions) over the resting pose of a thrown body.

The belief covers the side f that is down and the position x, by kernels on M particles (the mixture of normal
distributions of eq. 4.16),

    P(f) = (M_f + 1/K)/(M + 1),    p(x | f) = (1 − γ) Σ_{i: f_i = f} N(x | x_i, b²)/M_f + γ N(x | x̄, (5 s)²),
    p(x, f) = P(f) p(x | f)

with K sides, b Silverman's width for the M_f particles (for all, if a side has fewer than five), x̄ and s mean and
standard deviation of all particles.  The added 1/K of a particle and the wide part γ = 0.01 give every outcome a
positive probability; without them a single unexpected outcome would have zero likelihood.  The thesis gives no kernel.

Source of the kernel's width: Silverman, Density Estimation, 1986.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

WIDE = 0.01  # γ
FEW = 5  # least number of particles on a side for its own kernel width
NARROWEST = 1e-4  # m, error of a camera: least width, if all particles agree


def covariance_root(cov: np.ndarray) -> np.ndarray:
    """Root L (n, d, d) with L Lᵀ = cov, also for singular cov (a pose that an impact does not change)."""
    value, vector = np.linalg.eigh(cov)
    return vector * np.sqrt(np.maximum(value, 0.0))[:, None, :]


def through_dynamics(jacobian: np.ndarray, cov: np.ndarray) -> np.ndarray:
    """Covariance A Σ Aᵀ (n, 3, 3) of the velocity from covariance Σ of the impulse, A = M⁻¹ Jᵀ (equation 4.14)."""
    return jacobian @ cov @ np.swapaxes(jacobian, 1, 2)


@dataclass(frozen=True)
class RestBelief:
    """Belief over position and side at rest from equally weighted particles x (m) and face, (M,) each; `sides` is K."""

    x: np.ndarray
    face: np.ndarray
    sides: int

    @cached_property
    def face_probability(self) -> np.ndarray:
        """Probability P(f) of each side, (K,)."""
        count = np.bincount(self.face, minlength=self.sides)
        return (count + 1.0 / self.sides) / (len(self.face) + 1.0)

    @property
    def most_likely_face(self) -> int:
        """Index of the most probable side; the lowest if several are equal."""
        return int(np.argmax(self.face_probability))

    def log_likelihood(self, x: float, face: int) -> tuple[float, float]:
        """Log likelihoods log p(x, f) and log P(f) of an outcome, nats (x in m)."""
        log_face = float(np.log(self.face_probability[face]))
        return log_face + float(np.log(self.density(np.array([x]), face)[0])), log_face

    def density(self, x: np.ndarray, face: int) -> np.ndarray:
        """Density p(x | face) in 1/m at positions (n,)."""
        particles = self.x[self.face == face]
        particles = particles if len(particles) >= FEW else self.x
        spread = max(float(np.std(self.x)), NARROWEST)
        width = max(_silverman(particles), NARROWEST)
        kernels = _normal((x[:, None] - particles) / width).mean(1) / width
        return (1.0 - WIDE) * kernels + WIDE * _normal((x - self.x.mean()) / (5.0 * spread)) / (5.0 * spread)


def _silverman(x: np.ndarray) -> float:
    q = np.subtract(*np.percentile(x, [75, 25])) / 1.349
    std = float(np.std(x))
    return 0.9 * (min(std, q) if q > 0.0 else std) * len(x) ** -0.2


def _normal(z: np.ndarray) -> np.ndarray:
    return np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
