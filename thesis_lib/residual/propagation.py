"""Uncertain contacts, and beliefs propagated over flights and contacts (modified GP-SUM, thesis section 4.3.3).

One macro step takes the belief from one contact to the next:

    s_i ~ p(s),  i = 1 … m                   of the mixture (each component once: systematic sampling)
    s_i → contact                            deterministic flight in closed form, all samples at once
    p(s⁺) = Σ_i N(s⁺ | m(s_i), S(s_i))/m     the uncertain contact: S = A Σ A' in the velocity, 0 in the pose

Samples of p(s⁺) that penetrate or gain energy are rejected and drawn again from their component, at most `draws`
times; those that still fail take the law's outcome, which is feasible.  Every rejection is counted (`Tally`).  GP-SUM's
weights stay 1/m, because nothing is observed on the way.  Three uncertain contacts:

    scattered law      c = c_law + c_n ξ,    ξ ~ N(0, Ξ)          Ξ from training residuals, (c_t, c_n, τ)/c_n
    learned impact     c ~ N(c̄, Σ) of a trained model of `learners`   eqs. 4.12 to 4.15
    contact map        (q, v)(t_c + T) = law's own path over T + GP residual     double hits as one event

The contact map is an extension of the thesis's residual: two corners that hit within milliseconds are not an impulse
at one point, and a law that is corrected at each hit cannot be trained on hits that the camera cannot tell apart.  So
the law simulates all hits in the time T after the first touch, and the process learns what is missing at its end, in
velocity (Δv_x, Δv_y, k Δω: a wrench per unit mass) and pose.  Impacts are homogeneous of degree 1 in the velocity, so
with the speed s before contact

    (Δx, Δy, k Δθ) = s T f_q(X),   (Δv_x, Δv_y, k Δω) = s f_v(X),   X = (sin 4θ, cos 4θ, v_x/s, v_y/s, k ω/s, log s)

and the noise is in proportion to s, too.  4θ, because the four sides of a square are equal.

| on paper | in code     | unit            | shape       | meaning                                                   |
|----------|-------------|-----------------|-------------|-----------------------------------------------------------|
| s        | `mean`      | m, rad; m/s, rad/s | (n, 6)   | pose and velocity                                         |
| S        | `cov`       | their products  | (n, 6, 6)   | of the state after contact                                |
| Ξ        | `relative`  | 1, 1, m         | (3, 3)      | covariance of the wrench over c_n                         |
| T        | `duration`  | s               |             | of the contact map                                        |

Sources: Bauza and Rodriguez, GP-SUM, arXiv 1709.08120; Fazeli, Ajay, Rodriguez, ICRA 2020, arXiv 2009.03994.
"""

from dataclasses import dataclass, field

import numpy as np

from thesis_lib.contact.space import velocity_error
from thesis_lib.datasets.impacts import Impacts
from thesis_lib.residual.belief import GaussianMixture, covariance_root, through_dynamics
from thesis_lib.residual.dice_settings import ThrowSettings
from thesis_lib.residual.flight import ThrownBody, first_touch, fly
from thesis_lib.residual.gaussian_process import GaussianProcess
from thesis_lib.residual.learners import Trained
from thesis_lib.residual.throw import LawImpact, push, state_at

PENETRATION = (
    1e-3  # m; a pose this deep is rejected, a shallower one is lifted: contacts dent by a millimetre
)


@dataclass
class Tally:
    """Counts of an uncertain contact: samples drawn, rejected, given up to the law, and states out of range."""

    contacts: int = 0
    drawn: int = 0
    rejected: int = 0
    given_up: int = 0
    out_of_range: int = 0

    @property
    def rejection_rate(self) -> float:
        """Share of drawn samples that were not feasible."""
        return self.rejected / self.drawn if self.drawn else 0.0


def draw(
    contact: "Sampled",
    q: np.ndarray,
    v: np.ndarray,
    r: np.ndarray,
    slow: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One feasible sample of the outcome for each of n states: pose, velocity (n, 3) and time (n,)."""
    mean, cov, took = contact.distribution(q, v, r, slow)
    tally = contact.tally
    tally.contacts += len(q)
    fallback = np.array([])
    out = mean.copy()
    uncertain = np.einsum("nii->n", cov) > 0.0
    root = np.zeros_like(cov)
    root[uncertain] = covariance_root(cov[uncertain])
    left = np.arange(len(q))
    for _ in range(contact.draws):
        noise = rng.standard_normal((len(left), 6))
        out[left] = mean[left] + np.einsum("nij,nj->ni", root[left], noise)
        good = contact.feasible(q[left], v[left], r[left], out[left], took[left])
        # the law's own outcomes are not samples
        good |= ~uncertain[left]
        tally.drawn += int(uncertain[left].sum())
        tally.rejected += int((~good).sum())
        left = left[~good]
        if not len(left):
            break
    if len(left):
        tally.given_up += len(left)
        fallback, v_law, _ = contact.law(q[left], v[left], r[left], slow[left], rng)
        out[left] = np.hstack([fallback, v_law])
        took = took.copy()
        took[left] = 0.0
    q_new, v_new = out[:, :3], out[:, 3:]
    return q_new, v_new, took


@dataclass
class Sampled:
    """Base of uncertain contacts: an `ImpactModel` that draws from its distribution.

    Attributes:
        body: thrown.
        law: resolves what the model was not trained for, and takes over where no feasible sample is found.
        draws: samples tried for a state; 0 would be the law.
        deterministic: take the mean instead of a sample.
    """

    body: ThrownBody
    law: LawImpact
    draws: int = 20
    deterministic: bool = False
    tally: Tally = field(default_factory=Tally)

    def __call__(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A feasible sample of the outcome."""
        q_new, v_new, took = draw(self, q, v, r, slow, rng)
        # what is not quite above the surface is lifted onto it
        deep = took > 0.0
        if deep.any():
            q_new[deep, 1] += np.maximum(-self.body.gap(q_new[deep]), 0.0)
        return q_new, v_new, took

    def distribution(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean (n, 6), covariance (n, 6, 6) and time (n,); here the law's, which is certain."""
        _, after, _ = self.law(q, v, r, slow, np.random.default_rng(0))
        return np.hstack([q, after]), np.zeros((len(q), 6, 6)), np.zeros(len(q))

    def feasible(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, after: np.ndarray, took: np.ndarray
    ) -> np.ndarray:
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
    """A law whose impulse scatters in proportion to its normal part; `relative` is Ξ (3, 3)."""

    relative: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))

    def distribution(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The law's outcome, and A Ξ A' c_n²; slow contacts are certain."""
        mean, cov, took = super().distribution(q, v, r, slow)
        fast = ~slow
        c_n = mean[fast, 4] - v[fast, 1]
        A = wrench_map(r[fast], self.body.k_g)
        cov[np.ix_(fast, [3, 4, 5], [3, 4, 5])] = through_dynamics(A, self.relative * c_n[:, None, None] ** 2)
        return mean, cov, took


@dataclass
class LearnedImpact(Sampled):
    """A trained contact model of `learners`, for contacts that approach faster than `slowest` (m/s)."""

    trained: Trained | None = None
    slowest: float = 0.3

    def distribution(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean impulse and its covariance, noise included, through the dynamics."""
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
        self.tally.out_of_range += int((~out.in_range).sum())
        rows = fast[known]
        mean[rows, 3:] = (out.v_projected if self.deterministic else out.v_post)[known]
        if not self.deterministic:
            cov[np.ix_(rows, [3, 4, 5], [3, 4, 5])] = through_dynamics(out.jacobian, out.covariance)[known]
        return mean, cov, took


@dataclass
class ContactMap(Sampled):
    """Law over the time `duration` (s) after the first touch, and a process for what it misses (module's text)."""

    process: GaussianProcess | None = None
    duration: float = 0.012
    slowest: float = 0.3
    settings: ThrowSettings = field(default_factory=ThrowSettings)
    spread: np.ndarray = field(default_factory=lambda: np.ones(6))

    def distribution(
        self, q: np.ndarray, v: np.ndarray, r: np.ndarray, slow: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """State after `duration`, and its covariance (diagonal), noise included."""
        mean, cov, took = super().distribution(q, v, r, slow)
        fast = np.flatnonzero(v[:, 1] + r[:, 0] * v[:, 2] < -self.slowest)
        if not len(fast):
            return mean, cov, took
        path_q, path_v = law_path(self.body, self.law, q[fast], v[fast], self.duration, self.settings)
        X = contact_features(q[fast], v[fast], self.body.k_g)
        residual, variance = self.process.predict(X, noise=True, variance=not self.deterministic)
        out = X - self.process.x_mean
        low, high = self.process.x.min(0) * self.process.x_scale, self.process.x.max(0) * self.process.x_scale
        self.tally.out_of_range += int(((out < low) | (out > high)).any(1).sum())
        unit = residual_unit(v[fast], self.body.k_g, self.duration)
        mean[fast] = np.hstack([path_q, path_v]) + residual * unit
        if not self.deterministic:
            cov[fast[:, None], np.arange(6), np.arange(6)] = variance * (unit * self.spread) ** 2
        took[fast] = self.duration
        return mean, cov, took


def law_path(
    body: ThrownBody, law: LawImpact, q: np.ndarray, v: np.ndarray, duration: float, settings: ThrowSettings
) -> tuple[np.ndarray, np.ndarray]:
    """State `duration` (s) after the touch at pose q and velocity v (n, 3), by the law alone."""
    path_q, path_v, _ = state_at(
        body, q, v, np.full(len(q), duration), law, settings, np.random.default_rng(0)
    )
    # a law that chatters for the whole time leaves the body where it is
    stuck = ~np.isfinite(path_q).all(1)
    path_q[stuck], path_v[stuck] = q[stuck], 0.0
    return path_q, path_v


def contact_features(q: np.ndarray, v: np.ndarray, k_g: float) -> np.ndarray:
    """(sin 4θ, cos 4θ, v_x/s, v_y/s, k ω/s, log s), (n, 6), with the speed s = √(v_x² + v_y² + k² ω²)."""
    speed = velocity_error(v, k_g)
    direction = v * [1.0, 1.0, k_g] / speed[:, None]
    angle = 4.0 * q[:, 2]
    return np.column_stack([np.sin(angle), np.cos(angle), direction, np.log(speed)])


def residual_unit(v: np.ndarray, k_g: float, duration: float) -> np.ndarray:
    """What one unit of the contact map's outputs adds to the state (n, 6): s T of x, y, k θ and s of v_x, v_y, k ω."""
    unit = np.array([duration, duration, duration / k_g, 1.0, 1.0, 1.0 / k_g])
    return velocity_error(v, k_g)[:, None] * unit


def wrench_map(r: np.ndarray, k_g: float) -> np.ndarray:
    """A = M⁻¹ Jᵀ (n, 3, 3) per unit mass: velocity change by (c_t, c_n, τ)."""
    n = len(r)
    return np.stack([push(np.zeros((n, 3)), r, np.tile(unit, (n, 1)), k_g) for unit in np.eye(3)], axis=2)


@dataclass(frozen=True)
class Propagated:
    """Beliefs over pose and velocity (6 dimensions): `beliefs[0]` initial, `beliefs[i]` after the i-th contact."""

    beliefs: list[GaussianMixture]


def propagate(
    body: ThrownBody,
    initial: GaussianMixture,
    contact: Sampled,
    contacts: int,
    count: int,
    rng: np.random.Generator,
    micro: float = ThrowSettings().micro,
) -> Propagated:
    """Propagate a belief over `contacts` macro steps of flight and contact with `count` samples each."""
    beliefs = [initial]
    s = initial.sample(count, rng)
    q, v = s[:, :3], s[:, 3:]
    for _ in range(contacts):
        t, corner = first_touch(body, q, v)
        q, v = fly(body, q, v, t)
        r = body.contact_point(q[:, 2], corner)
        slow = -(v[:, 1] + r[:, 0] * v[:, 2]) < micro
        mean, cov, _ = contact.distribution(q, v, r, slow)
        beliefs.append(GaussianMixture(mean, cov, np.full(count, 1.0 / count)))
        q, v, _ = contact(q, v, r, slow, rng)
    return Propagated(beliefs)
