"""Errors of the velocity after impact where the spin before it is not measured.

The spin ω before an impact is a nuisance with the prior 0 ± σ_ω.  It is integrated out of the likelihood by its first
two moments: a prediction is the mean over the spins, and the covariance S of a residual holds their scatter S_ω.  An
error in m/s must not count what the spin may have done either.  With R the residual of the velocity,

    R − E[R(ω) | R] = (1 − S_ω S⁻¹) R = S_0 S⁻¹ R,    S = S_0 + S_ω,

is what is left of it once the most probable spin is taken out; where friction is full whatever the spin, all of it is.
"""

import numpy as np

from thesis_lib.critique.likelihood.comparison import Comparison

_LEAST = 1e-18  # (m/s)²


def velocity_left(here: Comparison) -> np.ndarray:
    """Residual (n, d + turns) in m/s, rad/s of the velocity after impact that no unknown spin accounts for."""
    return left_over(here, here.R[:, : here.observations.space.motions])


def left_over(here: Comparison, R: np.ndarray) -> np.ndarray:
    """Residuals R (..., n, d + turns) that an unknown spin does not explain; all of R where the spin is measured."""
    return np.einsum("nij,...nj->...ni", what_is_left(here), R) if here.observations.spin else R


def what_is_left(here: Comparison) -> np.ndarray:
    """Matrices (n, d + turns, d + turns) that leave what no unknown spin accounts for, and nothing of that after."""
    o = here.observations
    d, m = o.space.dimension, o.space.motions
    if not o.spin:
        return np.tile(np.eye(m), (len(o), 1, 1))
    S = here.covariance(o.t_std)[:, :d, :d]
    S_0 = S - here.of_spin[:, :d, :d]
    left = np.zeros((len(o), m, m))
    left[:, :d, :d] = S_0 @ np.linalg.inv(S + _LEAST * np.eye(d))
    return left
