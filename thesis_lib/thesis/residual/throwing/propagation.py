"""Uncertain contacts (thesis section 4.3.3): a Gaussian over states after contact, and feasible samples from it.

    s⁺ ~ N(m(s), S(s)),   S = A Σ A' in the velocity, 0 in the pose (and in both for the contact map)

Samples that penetrate or gain energy are rejected and redrawn, at most `DRAWS` times; then the feasible outcome of the
law replaces them.  Three uncertain contacts:

    scattered law      c = c_law + c_n ξ,    ξ ~ N(0, Ξ)          Ξ from training residuals, (c_t, c_n, τ)/c_n
    learned impact     c ~ N(c̄, Σ) of a trained model of `learners`   eqs. 4.12 to 4.15
    contact map        the model's motion over a time T + learned residual    double hits as one event (`contact_map`)

Sources: Bauza and Rodriguez, GP-SUM, arXiv 1709.08120; Fazeli, Ajay, Rodriguez, ICRA 2020, arXiv 2009.03994.
"""

from dataclasses import dataclass, field

import numpy as np

from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.learners.features import wrench_map
from thesis_lib.learners.learners import ImpulseLearner
from thesis_lib.thesis.residual.throwing.belief import covariance_root, through_dynamics
from thesis_lib.thesis.residual.throwing.flight import ThrownBody
from thesis_lib.thesis.residual.throwing.throw import LawImpact

DRAWS = 20  # most samples per state
PENETRATION = 1e-3  # m; deeper poses are rejected, shallower poses lifted: contacts indent by a millimetre


# state after contact: mean (n, 6) in m, rad and m/s, rad/s, covariance (n, 6, 6); and duration (n,) in s
Distribution = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass
class Sampled:
    """Base class of uncertain contacts: an `ImpactModel` that draws samples from its distribution."""

    body: ThrownBody
    law: LawImpact  # used for contacts outside the training range, and if no sample is feasible
    deterministic: bool = False  # take the mean instead of a sample
    freedom: float = np.inf  # degrees of freedom of Student's t for samples with the same covariance; ∞: Gaussian

    def __call__(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Draw a feasible sample of the outcome."""
        mean, cov, took = self.distribution(q, v, r, slow)
        out = mean.copy()
        uncertain = np.einsum("nii->n", cov) > 0.0
        root = np.zeros_like(cov)
        root[uncertain] = covariance_root(cov[uncertain])
        pending = np.arange(len(q))
        for _ in range(DRAWS):
            noise = self.noise(len(pending), rng)
            out[pending] = mean[pending] + np.einsum("nij,nj->ni", root[pending], noise)
            good = self.feasible(q[pending], v[pending], r[pending], out[pending], took[pending])
            # outcomes of the law are certain and not redrawn
            pending = pending[~(good | ~uncertain[pending])]
            if not len(pending):
                break
        if len(pending):
            q_law, v_law, _ = self.law(q[pending], v[pending], r[pending], slow[pending])
            out[pending] = np.hstack([q_law, v_law])
            took = took.copy()
            took[pending] = 0.0
        q_new, v_new = out[:, :3], out[:, 3:]
        # lift poses slightly below the surface onto it
        deep = took > 0.0
        if deep.any():
            q_new[deep, 1] += np.maximum(-self.body.gap(q_new[deep]), 0.0)
        return q_new, v_new, took

    def noise(self, n: int, rng: np.random.Generator) -> np.ndarray:
        """Draw samples (n, 6) with mean 0 and covariance 1."""
        normal = rng.standard_normal((n, 6))
        if np.isinf(self.freedom):
            return normal
        return normal * np.sqrt((self.freedom - 2.0) / rng.chisquare(self.freedom, n))[:, None]

    def distribution(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray) -> Distribution:
        """Return the outcome of the law, without scatter."""
        _, after, _ = self.law(q, v, r, slow)
        n = len(q)
        return np.hstack([q, after]), np.zeros((n, 6, 6)), np.zeros(n)

    def feasible(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, after: np.ndarray, took: np.ndarray) -> np.ndarray:
        """Mask (n,) of outcomes that neither penetrate nor gain energy."""
        k_g, g = self.body.k_g, self.body.gravity
        q_new, v_new = after[:, :3], after[:, 3:]
        before = 0.5 * (v[:, 0] ** 2 + v[:, 1] ** 2 + (k_g * v[:, 2]) ** 2) + g * q[:, 1]
        now = 0.5 * (v_new[:, 0] ** 2 + v_new[:, 1] ** 2 + (k_g * v_new[:, 2]) ** 2) + g * q_new[:, 1]
        separates = v_new[:, 1] + r[:, 0] * v_new[:, 2] >= 0.0
        later = took > 0.0
        if later.any():
            separates[later] = self.body.gap(q_new[later]) > -PENETRATION
        return separates & (now <= before) & np.isfinite(after).all(1)


@dataclass
class ScatteredLaw(Sampled):
    """Law whose impulse scatters in proportion to its normal part; `relative` is Ξ (3, 3) in 1, 1, m."""

    relative: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))

    def distribution(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray) -> Distribution:
        """Return the law's outcome with covariance A Ξ A' c_n²; slow contacts are certain."""
        mean, cov, took = super().distribution(q, v, r, slow)
        if self.deterministic:
            return mean, cov, took
        fast = ~slow
        c_n = mean[fast, 4] - v[fast, 1]
        A = wrench_map(r[fast], self.body.k_g)
        cov[np.ix_(fast, [3, 4, 5], [3, 4, 5])] = through_dynamics(A, self.relative * c_n[:, None, None] ** 2)
        return mean, cov, took


@dataclass
class LearnedImpact(Sampled):
    """Trained contact model of `learners`, for contacts faster than `slowest` (m/s)."""

    trained: ImpulseLearner | None = None
    slowest: float = 0.3

    def distribution(self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray) -> Distribution:
        """Return mean impulse and covariance, noise included, mapped through the dynamics."""
        mean, cov, took = super().distribution(q, v, r, slow)
        fast = np.flatnonzero(v[:, 1] + r[:, 0] * v[:, 2] < -self.slowest)
        if not len(fast):
            return mean, cov, took
        zero = np.zeros(len(fast))
        before = Impacts(
            trial=zero, impact=zero, q=q[fast], v_pre=v[fast], v_post=v[fast], r=r[fast], k_g=self.body.k_g
        )
        out = self.trained.predict(before, covariance=not self.deterministic, noise=True)
        known = np.isfinite(out.v_post).all(1)
        rows = fast[known]
        mean[rows, 3:] = (out.v_projected if self.deterministic else out.v_post)[known]
        if not self.deterministic:
            cov[np.ix_(rows, [3, 4, 5], [3, 4, 5])] = through_dynamics(out.jacobian, out.covariance)[known]
        return mean, cov, took
