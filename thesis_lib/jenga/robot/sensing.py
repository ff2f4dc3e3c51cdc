"""Readings of a push: z_t = s_t + noise, Gaussian and independent from reading to reading.

The camera sees little of a block at the start of a push, so pose noise falls with the advance a (thesis, section
5.5.4): σ_pose(a) = σ_last + (σ_first − σ_last) exp(−a/ℓ).  Force noise is constant, and the arm knows its advance
exactly.  All numbers are own choices (`SensingSettings`).
"""

import numpy as np

from thesis_lib.jenga.robot.samples import STATE
from thesis_lib.jenga.tower.settings import SensingSettings

MM = 1e3


def standard_deviations(advance: np.ndarray, settings: SensingSettings) -> np.ndarray:
    """Standard deviations (..., 7) of `STATE`, mm and N, for advances (...), mm."""
    advance = np.maximum(np.asarray(advance, dtype=float), 0.0)
    falling = (settings.pose_first - settings.pose_last) * np.exp(-advance / (MM * settings.pose_length))
    sigma = np.zeros((*advance.shape, len(STATE)))
    sigma[..., :3] = MM * (settings.pose_last + falling)[..., None]
    sigma[..., 3:5] = settings.force
    sigma[..., STATE.index("tower")] = MM * settings.tower
    return sigma


class Sensor:
    """Adds the noise of camera and force sensor."""

    def __init__(self, settings: SensingSettings, rng: np.random.Generator):
        self.settings, self.rng = settings, rng

    def read(self, state: np.ndarray) -> np.ndarray:
        """A reading z_t of the true state s_t, (7,), mm and N (`samples.STATE`)."""
        sigma = standard_deviations(state[STATE.index("advance")], self.settings)
        return state + sigma * self.rng.standard_normal(len(STATE))
