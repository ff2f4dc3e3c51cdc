"""What the robot is told of a push: z_t = s_t + noise, Gaussian and independent from reading to reading.

The camera sees little of a block at the start of a push, so the noise of its pose falls with the advance a (thesis,
section 5.5.4): σ_pose(a) = σ_last + (σ_first − σ_last) exp(−a/ℓ).  Forces have constant noise; the arm knows its own
advance exactly.  All numbers are own choices (`SensingSettings`).

| paper | code | unit | shape |
|---|---|---|---|
| s_t | `state` | mm, N (`samples.STATE`) | (7,) |
| z_t | `Sensor.read` | mm, N | (7,) |
"""

import numpy as np

from thesis_lib.jenga.robot.samples import STATE
from thesis_lib.jenga.tower.settings import SensingSettings

MM = 1e3


def standard_deviations(advance: np.ndarray, settings: SensingSettings) -> np.ndarray:
    """One sigma of each entry of `STATE`, mm and N, at these advances (mm); (..., 7)."""
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
        """A noisy reading of a true state, (7,), mm and N."""
        sigma = standard_deviations(state[STATE.index("advance")], self.settings)
        return state + sigma * self.rng.standard_normal(len(STATE))
