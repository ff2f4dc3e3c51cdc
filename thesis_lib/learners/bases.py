"""Bases of a residual: an impact law fitted on the training impacts, or the critique's law with its effects.

A base maps measured impacts to the frame of the contact (`seen`) and velocities back (`measured`), so a learner works
where the physics holds: the base undoes a mirrored rotation, moves the contact point of a rounded corner, or corrects a
wrong inertia.  For a plain law both maps are the identity.

    seen:      q, v, r, k  ──  Model.contact:  to_true, to_contact, contact_point, radius_of_gyration
    measured:  v⁺          ──  from_contact, to_measured at the pose of impact

Effects on coefficients and impulse are part of the prediction.  Effects on the flight (drag) act on the fits of arcs
that give the impacts, and are not applied again.
The critique's parameters were fitted on its own training trials and stay fixed.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.coefficients.cost import target_of
from thesis_lib.coefficients.ensemble import fit_ensemble
from thesis_lib.contact import LAWS
from thesis_lib.critique.results.saved_model import SavedModel
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.mechanics.state import State


@dataclass(frozen=True)
class LawBase:
    """An impact law with the (μ, ε) that minimise the mean velocity error of the training impacts."""

    law: str
    mu: float = np.nan
    epsilon: float = np.nan

    def fit(self, impacts: Impacts) -> "LawBase":
        """The law with (μ, ε) fitted to training impacts."""
        fitted = fit_ensemble(LAWS[self.law], target_of(impacts), "velocity")
        return LawBase(self.law, fitted.mu, fitted.epsilon)

    def predict(self, impacts: Impacts) -> np.ndarray:
        """Velocity after impact, (n, 3); NaN where the law has no solution."""
        body = {"mass": impacts.mass, "k_g": impacts.k_g}
        return LAWS[self.law](impacts.v_pre, impacts.r, **body, mu=self.mu, epsilon=self.epsilon).v_post

    def seen(self, impacts: Impacts) -> Impacts:
        """The impacts in the frame of the contact: themselves."""
        return impacts

    def measured(self, impacts: Impacts, v_post: np.ndarray) -> np.ndarray:
        """Measured velocity (n, 3) from v_post (n, 3) in the frame of the contact: itself."""
        return v_post


@dataclass(frozen=True)
class AugmentedBase:
    """The law and the effects that a critique chose (model.json)."""

    model: SavedModel

    def fit(self, impacts: Impacts) -> "AugmentedBase":
        """Return the base itself: the critique has fitted its parameters."""
        return self

    def predict(self, impacts: Impacts) -> np.ndarray:
        """Measured velocity after impact, (n, 3)."""
        return self.model.dynamics.predict(self._state(impacts), self._offset(impacts)).v

    def seen(self, impacts: Impacts) -> Impacts:
        """Impacts in the frame of the contact: true pose, velocities, contact point and radius of gyration."""
        dynamics = self.model.dynamics
        before, at = dynamics.measured_contact(self._state(impacts), self._offset(impacts))
        after, _ = dynamics.measured_contact(self._state(impacts, impacts.v_post))
        # cov=None: covariances belong to the measured quantities
        k_g = at.mobility**-0.5
        return replace(impacts, q=before.q, v_pre=before.v, v_post=after.v, r=at.r.T, k_g=k_g, cov=None)

    def measured(self, impacts: Impacts, v_post: np.ndarray) -> np.ndarray:
        """Measured velocity (n, 3) from v_post (n, 3) in the frame of the contact; affine in v_post."""
        dynamics = self.model.dynamics
        state, _ = dynamics.measured_contact(self._state(impacts))
        return dynamics.to_measured(dynamics.from_contact(state.with_velocity(v_post))).v

    def _state(self, impacts: Impacts, v: np.ndarray | None = None) -> State:
        t = np.nan_to_num(impacts.t, nan=self.model.rig.reference.t)
        return State.of(impacts.q, impacts.v_pre if v is None else v, impacts.trial.astype(float), t)

    def _offset(self, impacts: Impacts) -> np.ndarray:
        """Measured contact points minus those of the shape, (n, 2) m."""
        shape = self.model.rig.shape
        offset = impacts.r - shape.contact_point(impacts.q[:, 2])
        return np.where(np.abs(offset) > ROUNDED * shape.extent, offset, 0.0)


Base = LawBase | AugmentedBase
ROUNDED = 1e-6  # of the body's size: tables hold nine digits
