"""The low-pass filter that smoothed the samples, estimated from the rounding of corners at impacts.

A filter with impulse response h (of unit area; its mean is the delay, and time is counted from there) changes a path
whose velocity jumps by Δv at τ = 0 by Δv r(τ), and a parabola of acceleration a by a constant:

    r(τ) = ∫ (τ − s)⁺ h(s) ds − τ⁺,      ∫ r dτ = m₂/2,      parabola + a m₂/2,      m₂ = ∫ s² h(s) ds.           (1)

T_r = r(0), by which a corner misses its tip, is the time constant.  For filters with |H| = 1/√2 at ω_c it is

    T_r ω_c = 0.35 (moving average), 0.33 (Gaussian), 0.28 (second-order Butterworth, once or forwards and backwards),
              0.29 (Kalman smoother of constant acceleration)                                                       (2)

so ω_c = 0.31/T_r within an eighth for all of them.  m₂ is σ² for a Gaussian filter and W²/12 for a moving average
of width W; filters with a gain that is flat to second order, as the last two, have m₂ = 0 and do not move a parabola.

A median of neighbours also cuts a tip off, but does not move a monotonic path or a parabola; and if the assumed gravity
is wrong, arcs err along it.  Both affect only the coordinate that falls: if the other coordinates give another m₂,
theirs is used.

During a contact the body sinks in, which no filter imitates, but the corner is rounded as well: a half-sine force of
duration T acts like h, with T_r = T (1/4 − 1/(2π)) and T ≈ 2 τ.  Two filters in series have √(T₁² + T₂²), as for
Gaussian filters; the share of the contact is removed.  Near its tip

    r(τ) + |τ|/2 = T_r + h(0) τ²/2,      h(0) = 1/(2π T_r)    (Gaussian),                                            (3)

which samples an interval apart resolve if it has a solution T_r for their mean τ².
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.flights.lines import windows_around
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.statistics.spread import robust_mean

OF_CUTOFF, SPREAD = 0.31, 0.12  # T_r ω_c, and its relative spread between kinds of filters, (2)
OF_CONTACT = 2.0 * (0.25 - 0.5 / np.pi)  # T_r / τ of a contact
CLEAR = 3.0  # standard errors
FEWEST = 12  # impacts with a sample next to them
ARC = 6  # samples on either side: shorter arcs do not determine the path without the filter


@dataclass(frozen=True)
class LowPass:
    """A filter, by its time constant T_r in s and second moment m₂ in s², (1), with standard errors."""

    time_constant: float
    time_constant_std: float
    second_moment: float
    second_moment_std: float

    @property
    def cutoff(self) -> tuple[float, float]:
        """Cutoff frequency in Hz, at which amplitudes are reduced to 1/√2, and its standard error (2)."""
        value = OF_CUTOFF / (2.0 * np.pi * self.time_constant)
        return value, value * float(np.hypot(SPREAD, self.time_constant_std / self.time_constant))

    @property
    def moves_parabolas(self) -> bool:
        """Whether m₂ is significantly above 0."""
        return self.second_moment > CLEAR * self.second_moment_std

    def content(self) -> dict:
        """Cutoff frequency and time constant, ready for JSON."""
        cutoff, std = self.cutoff
        return {
            "cutoff": {"value": cutoff, "std": std, "unit": "Hz"},
            "time_constant": {"value": self.time_constant, "std": self.time_constant_std, "unit": "s"},
        }

    def text(self) -> str:
        """The filter in words."""
        value, std = self.cutoff
        milliseconds = f"{1e3 * self.time_constant:.2g} ± {1e3 * self.time_constant_std:.1g} ms"
        return f"a low-pass filter of about {value:.2g} Hz (± {std:.1g} Hz; time constant {milliseconds})"


@dataclass(frozen=True)
class Corners:
    """n impacts as corners between two arcs: the samples `at` (n,) before them, their instants `t` (n,) in s, the poses
    `q` (n, 3) there, the velocities before and after, and whether both arcs are `long` (n,) enough."""

    at: np.ndarray
    t: np.ndarray
    q: np.ndarray
    v_pre: np.ndarray
    v_post: np.ndarray
    long: np.ndarray


def low_pass_of(
    corners: Corners,
    samples: Samples,
    sigma: np.ndarray,
    gravity: float,
    guard: float,
    interval: float,
    touch_time: float,
) -> LowPass | None:
    """The filter that rounds corners at impacts more than contacts of τ = `touch_time` do; None if there is none.

    The arcs beside `corners` must have left out the samples within `guard` of an impact; `sigma` (3,) is the noise of
    the coordinates of `samples`, the second of which falls by `gravity` in m/s²; the other times are in s, `interval`
    is the sampling interval.
    """
    windows = windows_around(samples, corners.at, int(np.ceil(guard / interval)) + 2)
    tau = windows.t - (corners.t - windows.t_0)[:, None]
    v = np.where((tau < 0.0)[..., None], corners.v_pre[:, None], corners.v_post[:, None])
    fall = np.array([0.0, -gravity, 0.0])
    path = (corners.q - windows.q_0)[:, None] + v * tau[..., None] + 0.5 * fall * tau[..., None] ** 2
    jump, off = (corners.v_post - corners.v_pre) / sigma, (windows.q - path) / sigma
    r, size = _along(off, jump)
    rows = corners.long & (size > 0.0)
    inside = windows.usable & (np.abs(tau) < guard) & rows[:, None]
    tip = inside & (np.abs(tau) < 0.5 * interval)
    if tip.sum() < FEWEST:
        return None
    above, above_std = robust_mean(r[tip] + 0.5 * np.abs(tau[tip]))
    moment, moment_std = robust_mean(2.0 * interval * np.where(inside, r, 0.0).sum(1)[rows])
    level, size = _along(off[..., [0, 2]], jump[:, [0, 2]])
    turned = rows & (size > 0.0) & (size >= np.median(size[rows]))
    aside, aside_std = robust_mean(2.0 * interval * np.where(inside, level, 0.0).sum(1)[turned])
    if abs(moment - aside) > CLEAR * np.hypot(moment_std, aside_std):
        moment, moment_std = aside, aside_std
    resolved = above**2 - np.mean(tau[tip] ** 2) / np.pi
    if above < 0.0 or resolved < 0.0:
        return None
    both, contact = 0.5 * (above + np.sqrt(resolved)), OF_CONTACT * touch_time
    constant_std = above_std * both / np.sqrt(resolved) if resolved else np.inf
    constant = float(np.sqrt(max(both**2 - contact**2, 0.0)))
    if constant < max(CLEAR * constant_std, contact):
        return None
    found = LowPass(constant, float(constant_std), moment, moment_std)
    # no cutoff above half the sampling rate can be seen
    return found if found.cutoff[0] < 0.5 / interval else None


def _along(off: np.ndarray, jump: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """r(τ) (n, W), the deviations `off` (n, W, c) along the velocity change `jump` (n, c) over its size; and |Δv|²."""
    size = (jump**2).sum(1)
    return np.einsum("nwc,nc->nw", off, jump) / np.where(size, size, 1.0)[:, None], size
