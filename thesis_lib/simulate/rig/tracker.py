"""Recording of poses by a tracker: noise with memory, filters, lost frames, outliers, few digits.

Cameras take `frames` pictures for each pose that is written; the true poses may first pass a first-order filter of time
constant T (`smoothing.low_pass`, applied by the simulator).  Each picture has noise e = σ (f_x, f_y, f_θ) u, where u is
white or, with a correlation time t_c, first-order autoregressive, and may drift slowly (`wander`):

    u_k = ρ u_{k−1} + √(1 − ρ²) w_k,   ρ = exp(−Δt/t_c),   w white                                           (AR(1))

A filter (`smoothing`) smooths the poses, every `frames`-th pose is rounded, and some poses are not written at all.  By
default the poses are written as seen.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from thesis_lib.bodies.body import Noise
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.smoothing import smoothed

FilterName = Literal["none", "moving_average", "median", "butterworth", "zero_phase_butterworth", "kalman_smoother"]


class Tracker(Section):
    """Settings of the recording of poses; the defaults change nothing."""

    frames: int = Field(1, ge=1, le=20, description="pictures for each pose that is written")
    time_constant: float = Field(0.0, ge=0, le=0.05, description="T of a filter T ẏ + y = x before the pictures, s")
    filter: FilterName = Field("none", description="filter that smooths the poses before they are written")
    cutoff: float = Field(40.0, gt=0, allow_inf_nan=False, description="Hz, at which the filter's gain is 1/√2")
    noise_factors: tuple[float, float, float] = Field((1.0, 1.0, 1.0), description="on the noise of x, y, θ")
    correlation_time: float = Field(0.0, ge=0, allow_inf_nan=False, description="of the noise, s; 0: white noise")
    wander: float = Field(0.0, ge=0, allow_inf_nan=False, description="slow part of the noise over the fast part, 1")
    wander_time: float = Field(0.3, gt=0, allow_inf_nan=False, description="correlation time of the slow part, s")
    outliers: float = Field(0.0, ge=0, lt=1, description="share of pictures with a wrong pose")
    outlier_size: float = Field(20.0, ge=0, allow_inf_nan=False, description="one sigma of outliers over the noise's")
    dropped: float = Field(0.0, ge=0, lt=1, description="share of poses that are not written")
    bursts: float = Field(0.0, ge=0, le=1, description="share of trials in which a run of poses is lost")
    burst_length: int = Field(10, ge=1, description="number of poses in such a run")
    position_step: float = Field(0.0, ge=0, allow_inf_nan=False, description="resolution of x and y, m; 0: unlimited")
    angle_step: float = Field(0.0, ge=0, allow_inf_nan=False, description="resolution of θ, rad; 0: unlimited")

    def record(self, poses: np.ndarray, noise: Noise | None, rate: float, rng: np.random.Generator) -> np.ndarray:
        """Poses (n, samples, 3) as written `rate` times a second, NaN where a pose is not written.

        `poses` (n, frames × samples, 3) are the poses in the pictures, in m, rad; NaN after the end of a recording.
        """
        outlier_rng, lost_rng, wander_rng = rng.spawn(3)
        # random numbers are drawn for every channel: a channel without noise does not shift the stream of the others
        position, angle = (noise.position or 0.0, noise.angle or 0.0) if noise else (0.0, 0.0)
        sigma = np.array([position, position, angle]) * self.noise_factors
        step = 1.0 / (rate * self.frames)
        error = _autoregressive(rng.standard_normal(poses.shape), self.correlation_time, step)
        slow = _autoregressive(wander_rng.standard_normal(poses.shape), self.wander_time, step)
        wrong = outlier_rng.random(poses.shape[:2]) < self.outliers
        error += self.wander * slow
        error += self.outlier_size * wrong[..., None] * outlier_rng.standard_normal(poses.shape)
        seen = poses + sigma * error
        if self.filter != "none":
            seen = smoothed(seen, self.filter, self.cutoff, rate * self.frames)
        written = seen[:, :: self.frames].copy()
        for column, digit in enumerate((self.position_step, self.position_step, self.angle_step)):
            if digit:
                written[..., column] = np.round(written[..., column] / digit) * digit
        lost = lost_poses(written.shape[:2], self.dropped, self.bursts, self.burst_length, lost_rng)
        written[lost] = np.nan
        return written


def lost_poses(
    shape: tuple[int, ...], dropped: float, bursts: float, burst_length: int, rng: np.random.Generator
) -> np.ndarray:
    """Mask (n, samples) of poses that are not written; the settings are those of `Tracker`."""
    n, size = shape
    lost = rng.random(shape) < dropped
    start = rng.integers(0, max(size - burst_length, 1), n)[:, None]
    burst = (np.arange(size) >= start) & (np.arange(size) < start + burst_length)
    return lost | (burst & (rng.random(n) < bursts)[:, None])


def _autoregressive(white: np.ndarray, time: float, step: float) -> np.ndarray:
    """AR(1) noise of variance 1 with correlation time `time` (s), from white noise (n, samples, 3)."""
    if time == 0.0:
        return white
    from scipy.signal import lfilter

    rho = np.exp(-step / time)
    fresh = np.sqrt(1.0 - rho**2)
    drive = np.concatenate([white[:, :1], fresh * white[:, 1:]], axis=1)
    return np.asarray(lfilter([1.0], [1.0, -rho], drive, axis=1))
