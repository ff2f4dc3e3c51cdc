"""Learned contact models: data-driven, residual on a law, law with learned parameters, feasible by construction.

    class 1   c ~ GP(X)                     purely data-driven: rigid on X1, X2, X2 polar, full; wrench on X1, X1 + ω
    class 2   c = c_law(μ, ε) + c_res, c_res ~ GP(0, X1)        residual (rigid or wrench), equations 4.12 and 4.13
              (μ, ε) ~ GP(X1), c = c_law(μ(X), ε(X))            law with learned parameters
    beyond    s ~ GP(X), v⁺ = v⁺(s)               every s is a feasible velocity (see `feasible`)
    v⁺ ~ N(v + A c̄, A Σ Aᵀ),  A = M⁻¹ Jᵀ           equations 4.14 and 4.15 (whose factors are printed transposed)

`learner.fit(impacts, rng)` gives a trained model, and `model.predict(impacts)` an `ImpactPrediction` with velocity,
impulse and, for an `ImpulseLearner`, its covariance.  Infeasible predictions are flagged and given with their
projection.

If a law has no solution, the impact is left out of training and its prediction is NaN.  The prior mean of class 1 is
the mean of its outputs; for residuals it is zero.  μ and ε are learned from training impacts that the law can explain
within `RANGE` (from all, if fewer than `FEWEST`), and clipped to 0 ≤ μ ≤ 2 and 0 ≤ ε ≤ 1.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.individual import MU_MAX, fit_individual
from thesis_lib.contact import LAWS
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.learners import feasible as feasibility
from thesis_lib.learners.bases import Base, LawBase
from thesis_lib.learners.features import FeatureSet, features, impulse_of, velocity_after, velocity_map
from thesis_lib.learners.gaussian_process import GaussianProcess, GaussianProcessSettings, fit_gaussian_process

RANGE = 0.02  # m/s in the kinetic metric: largest misfit of the best (μ, ε) at which the law explains an outcome
FEWEST = 5
IDENTITY = LawBase("")  # the frame of a learner without a base


@dataclass(frozen=True)
class ImpactPrediction:
    """Prediction of n impacts."""

    v_post: np.ndarray  # (n, 3) mean velocity after impact as measured, m/s, rad/s; NaN where the base has none
    impulse: np.ndarray  # c̄ (n, 2 or 3), (c_t, c_n) in N s or (c_t, c_n, τ in N m s)
    jacobian: np.ndarray  # A (n, 3, 2 or 3) = ∂v⁺/∂c as measured, 1/kg and 1/(kg m)
    feasible: np.ndarray  # (n,) whether v_post neither penetrates nor gains energy
    v_projected: np.ndarray  # (n, 3) the nearest feasible velocity, v_post itself where that is feasible
    covariance: np.ndarray | None = None  # Σ (n, 2 or 3 square) of the function, with `noise` of an outcome


@dataclass(frozen=True)
class ImpactLearner:
    """A contact model to be learned; `fit` returns a trained copy, which has a `process`.

    `fit` raises ValueError for fewer than two impacts; its search begins at `start`, trained on other impacts.
    `predict` uses quantities before impact only, not the `v_post` of the impacts.
    """

    settings: GaussianProcessSettings = field(default_factory=GaussianProcessSettings, kw_only=True)
    process: GaussianProcess = field(default=None, kw_only=True)  # type: ignore[assignment]

    def fit(self, impacts: Impacts, rng: np.random.Generator, start: "ImpactLearner | None" = None) -> Self:
        """Train on impacts (n ≥ 2)."""
        raise NotImplementedError

    def predict(self, impacts: Impacts) -> ImpactPrediction:
        """Prediction; see `ImpactPrediction`."""
        raise NotImplementedError

    def _trained(self, x: np.ndarray, y: np.ndarray, rng, start, *, centred=True, **known) -> Self:
        """The learner with a process for outputs y (n, p) at features x (n, d) of impacts."""
        first = None if start is None else start.process
        process = fit_gaussian_process(x, y, rng, self.settings, centred=centred, start=first)
        return replace(self, process=process, **known)


@dataclass(frozen=True)
class ImpulseLearner(ImpactLearner):
    """Impulse or wrench by a Gaussian process: data-driven, or a residual on `base` (its prior mean).

    Without `residual`, a base gives only its frame.
    """

    feature_set: FeatureSet
    wrench: bool
    base: Base = IDENTITY
    residual: bool = False

    def fit(self, impacts: Impacts, rng: np.random.Generator, start: ImpactLearner | None = None) -> Self:
        base = self.base.fit(impacts) if self.residual else self.base
        seen = base.seen(impacts)
        target = seen.dv
        if self.residual:
            target = seen.v_post - _seen_prediction(base, impacts)
        y = impulse_of(target, seen, wrench=self.wrench)
        x = features(seen, self.feature_set)
        known = np.isfinite(y).all(axis=1)
        return self._trained(x[known], y[known], rng, start, centred=not self.residual, base=base)

    def predict(self, impacts: Impacts, *, covariance: bool = False, noise: bool = False) -> ImpactPrediction:
        """Prediction, on request with the covariance of the function or, with `noise`, of an outcome."""
        seen = self.base.seen(impacts)
        x = features(seen, self.feature_set)
        impulse, variance = self.process.predict(x, noise=noise, variance=covariance)
        if self.residual:
            prior = _seen_prediction(self.base, impacts)
            # keep the part of the law's v⁺ that no impulse through the contact point gives
            v_seen = prior + velocity_after(impulse, seen) - seen.v_pre
            impulse = impulse + impulse_of(prior - seen.v_pre, seen, wrench=self.wrench)
        else:
            v_seen = velocity_after(impulse, seen)
        S = variance[:, :, None] * np.eye(variance.shape[1]) if covariance else None
        return _prediction(self.base, impacts, seen, v_seen, impulse, S)


@dataclass(frozen=True)
class ParameterLearner(ImpactLearner):
    """A law whose μ and ε are learned functions of the state (the thesis's "rigid par" model)."""

    law: str
    feature_set: FeatureSet = "X1"

    def fit(self, impacts: Impacts, rng: np.random.Generator, start: ImpactLearner | None = None) -> Self:
        """Train on the individual parameters of impacts (n ≥ 2)."""
        target = target_of(impacts)
        individual = fit_individual(LAWS[self.law], target, "velocity")
        misfit = np.sqrt(np.maximum(individual.error**2 - target.unreachable**2, 0.0))
        solved = np.isfinite(individual.error)
        known = solved & (misfit <= RANGE)
        known = known if known.sum() >= FEWEST else solved
        x, y = features(impacts, self.feature_set)[known], np.stack([individual.mu, individual.epsilon], axis=1)[known]
        return self._trained(x, y, rng, start)

    def predict(self, impacts: Impacts) -> ImpactPrediction:
        """Prediction of the law with the mean of its parameters."""
        parameters, _ = self.process.predict(features(impacts, self.feature_set), variance=False)
        mu, epsilon = np.clip(parameters, 0.0, [MU_MAX, 1.0]).T
        body = {"mass": impacts.mass, "k_g": impacts.k_g}
        out = LAWS[self.law](impacts.v_pre, impacts.r, **body, mu=mu, epsilon=epsilon)
        return _prediction(IDENTITY, impacts, impacts, out.v_post, out.impulse, None)


@dataclass(frozen=True)
class FeasibleLearner(ImpactLearner):
    """Coordinates of the feasible set by a Gaussian process: the mean and every sample are feasible."""

    feature_set: FeatureSet
    wrench: bool

    def fit(self, impacts: Impacts, rng: np.random.Generator, start: ImpactLearner | None = None) -> Self:
        # replace an outcome that no point impulse reaches by the nearest one that it reaches
        v = velocity_after(impulse_of(impacts.dv, impacts, wrench=self.wrench), impacts)
        s = feasibility.to_latent(impacts.v_pre, v, impacts.r, impacts.k_g, wrench=self.wrench)
        return self._trained(features(impacts, self.feature_set), s, rng, start)

    def predict(self, impacts: Impacts) -> ImpactPrediction:
        """Prediction at the mean coordinates."""
        s, _ = self.process.predict(features(impacts, self.feature_set), variance=False)
        v_post = feasibility.from_latent(impacts.v_pre, s, impacts.r, impacts.k_g)
        impulse = impulse_of(v_post - impacts.v_pre, impacts, wrench=self.wrench)
        return _prediction(IDENTITY, impacts, impacts, v_post, impulse, None)


@dataclass(frozen=True)
class LawLearner(ImpactLearner):
    """A base alone, without uncertainty, for comparison; it has no process."""

    base: Base

    def fit(self, impacts: Impacts, rng: np.random.Generator, start: ImpactLearner | None = None) -> Self:
        """Fit the base's parameters; `rng` and `start` are not used."""
        return replace(self, base=self.base.fit(impacts))

    def predict(self, impacts: Impacts) -> ImpactPrediction:
        """Prediction; as a wrench, since effects may add a couple."""
        seen = self.base.seen(impacts)
        v_seen = _seen_prediction(self.base, impacts)
        impulse = impulse_of(v_seen - seen.v_pre, seen, wrench=True)
        return _prediction(self.base, impacts, seen, v_seen, impulse, None)


def _seen_prediction(base: Base, impacts: Impacts) -> np.ndarray:
    """The base's velocity after impact (n, 3) in the frame of the contact."""
    return base.seen(replace(impacts, v_post=base.predict(impacts))).v_post


def _prediction(
    base: Base, impacts: Impacts, seen: Impacts, v_seen: np.ndarray, impulse: np.ndarray, covariance: np.ndarray | None
) -> ImpactPrediction:
    wrench = impulse.shape[1] == 3
    A = velocity_map(seen, wrench=wrench)
    v_post = base.measured(impacts, v_seen)
    # `measured` is affine in the velocity, so unit impulses give its slope
    jacobian = np.stack([base.measured(impacts, v_seen + A[:, :, i]) - v_post for i in range(A.shape[2])], axis=2)
    inside = feasibility.feasible(seen.v_pre, v_seen, seen.r, seen.k_g)
    near = feasibility.project(seen.v_pre, v_seen, seen.r, seen.k_g, wrench=wrench)
    projected = np.where(inside[:, None], v_post, base.measured(impacts, near))
    return ImpactPrediction(v_post, impulse, jacobian, inside, projected, covariance)


def learners(law: str, settings: GaussianProcessSettings | None = None) -> dict[str, ImpactLearner]:
    """All learned contact models of chapter 4 by name; `law` is the base of class 2."""
    gp = settings or GaussianProcessSettings()
    base = LawBase(law)
    return {
        "rigid_x1": ImpulseLearner("X1", False, settings=gp),
        "rigid_x2": ImpulseLearner("X2", False, settings=gp),
        "rigid_x2_polar": ImpulseLearner("X2_polar", False, settings=gp),
        "wrench_x1": ImpulseLearner("X1", True, settings=gp),
        "wrench_x1_omega": ImpulseLearner("X1_omega", True, settings=gp),
        "residual_rigid": ImpulseLearner("X1", False, base, True, settings=gp),
        "residual_wrench": ImpulseLearner("X1", True, base, True, settings=gp),
        "law_parameters": ParameterLearner(law, settings=gp),
        "feasible_rigid": FeasibleLearner("X1", False, settings=gp),
        "feasible_wrench": FeasibleLearner("X1_omega", True, settings=gp),
        "rigid_full": ImpulseLearner("full", False, settings=gp),
    }
