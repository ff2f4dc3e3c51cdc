"""Which way do bodies fall?  Accelerations of y in short windows, without knowing where the impacts are.

A window inside one flight is a parabola with ÿ = −g.  A window that spans an impact is not a parabola, and is left out;
a body that rests or is held has ÿ = 0.  If windows have ÿ near +g, and hardly any near −g, y points down.  The window
is as short as the noise allows, so that it fits into the flight of a low bounce.

    ÿ = 2 c₂/Δt²,   var ÿ = 4 σ²/Δt⁴ · 180/(n (n² − 1)(n² − 4))        (parabola c₀ + c₁ i + c₂ i² through n samples)

Δt is the sampling interval, σ the noise of a sample of y.
"""

import numpy as np

from thesis_lib.datasets.format.samples import Samples

PRECISION = 0.1  # one sigma of ÿ/g: rest (0) and flight (1) are then ten sigmas apart
ABOUT_G = (0.5, 2.0)  # |ÿ|/g that passes for a flight: y may be scaled a little wrong, which other checks judge
SMALLEST_WINDOW = 5  # samples; recognising a parabola takes two degrees of freedom
LARGEST_WINDOW = 1000
PARABOLA = 3.0  # reduced chi² of a window that may pass for a parabola
NOISE_FLOOR = 1e-6  # m; simulated poses have no noise, but finitely many digits
CLEARLY = 5.0  # upward falls per downward fall; a true flight has none, small hits give a few


def runs_of(trial: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Integers (N,) that are constant over the rows of a trial without a gap in the times `t` (N,), in s."""
    step = np.diff(t)
    usable = (trial[1:] == trial[:-1]) & (step > 0.0)
    usual = np.median(step[usable]) if usable.any() else np.inf
    return np.r_[0, np.cumsum(~usable | (np.abs(step / usual - 1.0) > 0.5))]


def free_accelerations(samples: Samples, sigma_y: float, precision: float) -> tuple[np.ndarray, int]:
    """ÿ (m,) in m/s² of the windows of n samples that are parabolas, and n: as few as `precision` allows.

    `precision` is one sigma of ÿ in m/s², `sigma_y` that of y in m.
    """
    inside = samples.run[1:] == samples.run[:-1]
    none = np.zeros(0), 1
    if not inside.any():
        return none
    step = float(np.median(np.diff(samples.t)[inside]))
    sigma = max(float(np.nan_to_num(sigma_y)), NOISE_FLOOR)
    sizes = np.arange(SMALLEST_WINDOW, LARGEST_WINDOW + 1, dtype=float)
    error = 2.0 * sigma / step**2 * np.sqrt(180.0 / (sizes * (sizes**2 - 1.0) * (sizes**2 - 4.0)))
    precise = error < precision
    if not precise.any() or len(samples) < sizes[precise][0]:
        return none
    n = int(sizes[precise][0])
    basis, scale = np.linalg.qr(np.vander(np.arange(n) - (n - 1) / 2.0, 3, increasing=True))
    y = samples.q[:, 1] - np.median(samples.q[:, 1])
    c = [np.correlate(y, basis[:, k], "valid") for k in range(3)]
    rest = np.correlate(y * y, np.ones(n), "valid") - c[0] ** 2 - c[1] ** 2 - c[2] ** 2
    flight = (samples.run[n - 1 :] == samples.run[: len(y) - n + 1]) & (rest < PARABOLA * sigma**2 * (n - 3))
    return (2.0 * c[2] / scale[2, 2] / step**2)[flight], n


def flight_windows(samples: Samples, sigma_y: float, gravity: float) -> tuple[int, int, int]:
    """Windows that accelerate by about `gravity` (m/s²) towards larger y, and towards smaller; their samples n.

    `sigma_y` is the noise of y in m.
    """
    accelerations, n = free_accelerations(samples, sigma_y, PRECISION * gravity)
    ratio = accelerations / gravity
    low, high = ABOUT_G
    up, down = (int(np.sum((low < sign * ratio) & (sign * ratio < high))) for sign in (1.0, -1.0))
    return up, down, n
