"""Errors of the velocity after impact where the spin before it is not measured.

The spin ω before an impact is a nuisance with the prior 0 ± σ_ω.  It is integrated out of the likelihood by its first
two moments: a prediction is the mean over the spins, and the covariance S of a residual holds their scatter S_ω.  An
error in m/s must not count what the spin may have done either.  With R the residual of the velocity,

    R − E[R(ω) | R] = (1 − S_ω S⁻¹) R = S_0 S⁻¹ R,    S = S_0 + S_ω,

is what is left of it once the most probable spin is taken out; where friction is full whatever the spin, all of it is.
"""

from collections.abc import Mapping

import numpy as np

from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.covariance import residual_covariance, spin_covariance
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.likelihood.residuals import impact_residuals

_LEAST = 1e-18  # (m/s)²


def velocity_left(model: Model, values: Mapping[str, float], o: Observations) -> np.ndarray:
    """Residual (n, 3) in m/s, m/s, rad/s of the velocity after impact that no unknown spin accounts for."""
    R = impact_residuals(model, values, o)[:, :3]
    return R if o.rig.has_angle else left_over(model, values, o, R)


def left_over(model: Model, values: Mapping[str, float], o: Observations, R: np.ndarray) -> np.ndarray:
    """What is left of residuals R (..., n, 3)."""
    return np.einsum("nij,...nj->...ni", what_is_left(model, values, o), R)


def what_is_left(model: Model, values: Mapping[str, float], o: Observations) -> np.ndarray:
    """Matrices (n, 3, 3) that leave what no unknown spin accounts for, and nothing of the spin after impact."""
    if o.rig.has_angle:
        return np.tile(np.eye(3), (len(o), 1, 1))
    S = residual_covariance(model, values, o, o.t_std)[:, :2, :2]
    S_0 = S - spin_covariance(model, values, o)[:, :2, :2]
    left = np.zeros((len(o), 3, 3))
    left[:, :2, :2] = S_0 @ np.linalg.inv(S + _LEAST * np.eye(2))
    return left
