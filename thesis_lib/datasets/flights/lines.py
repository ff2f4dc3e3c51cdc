"""Samples of the flights before and after many impacts at once, and the straight lines through them.

The window of an impact is W samples about its detected instant.  Gaps in time, the ends of the trial and neighbouring
hits end a flight; samples within `guard` of an instant may lie in the contact and belong to neither flight.  When a fit
moves the instant t_c, samples change sides.

Of W samples around an impact, `side` (n, 2, W) is 1 for those used before and after it, else 0.  The line of a side
without samples is 0, with spread 0; callers check `count` and `spread`.

A line through a parabola with acceleration a has

    value(0) = q(t_c) + a b_0,    slope = v(t_c) + a b_1,     (b_0, b_1): the line through τ²/2

and for any smooth path f(τ) it has value and slope Σ_k w_k f(τ_k) over a few nodes τ_k, which replace all samples.

| on paper     | in code            | unit          | shape      |                                             |
|--------------|--------------------|---------------|------------|---------------------------------------------|
| value, slope | `value`, `slope`   | m, rad; m/s, rad/s | (n, 2, 3) | of the lines before and after at t_c     |
| b_0, b_1     | `bow`              | s², s         | (n, 2, 2)  | curvature of the line fit, see above        |
| C            | `cov`              | m², m²/s, …   | (n, 2, 3, 2, 2) | covariance of (value, slope), by channel |
| τ_k, w_k     | `nodes`, `weights` | s; 1, 1/s     | (n, 2, K), (n, 2, 2, K) | first, last node: ends of samples |
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.polynomial.legendre import legvander

from thesis_lib.datasets.format.samples import ArcSettings, Samples

_WALK = 3  # samples by which t_c may differ from the detected instant: the error of the detector for weak hits
NODES = 8  # exact to 1e-6 of its size for a path that turns by 2.5 rad in a window of 0.1 s


def rank(side: np.ndarray) -> np.ndarray:
    """Rank 1, 2, … of the used samples (n, 2, W), counted away from the impact on either side."""
    return np.stack([ranked(side[:, 0], -1), ranked(side[:, 1], 1)], 1)


def ranked(used: np.ndarray, way: int) -> np.ndarray:
    """Rank of the used samples of one side (m, W); `way` is −1 before the impact and 1 after it."""
    return np.cumsum(used[:, ::way], axis=1)[:, ::way]


@dataclass(frozen=True)
class Windows:
    """The W samples around each of n impacts, as many before the detected instant as after it."""

    t_0: np.ndarray  # t_0, q_0: (n,) s and (n, 3), middle of the two samples beside the detected instant
    q_0: np.ndarray
    t: np.ndarray  # t, q: (n, W) s and (n, W, 3) relative to these, so that long records lose no digits
    q: np.ndarray
    usable: np.ndarray  # (n, W) whether a sample may belong to a flight
    low: np.ndarray  # low, high: (n,) s, bounds of t_c, relative to t_0
    high: np.ndarray
    same_trial: np.ndarray  # (n − 1,) whether an impact and the next one belong to the same trial

    def moved(self, t: np.ndarray) -> np.ndarray:
        """Number of samples (n,) by which the instants t (n,), relative to t_0, are later than the detected ones."""
        passed = self.usable & (t[:, None] >= self.t)
        before = np.arange(self.t.shape[1]) < self.t.shape[1] // 2
        return (passed & ~before).sum(1) - (self.usable & before & ~passed).sum(1)


def windows_around(samples: Samples, at: np.ndarray, size: int, beyond: int = 1) -> Windows:
    """The `size` + 1 samples on either side of the instants after the samples `at` (n,).

    They include `beyond` samples past neighbouring hits, which may be detected a sample early or late.
    """
    last = len(samples) - 1
    index = at[:, None] + np.arange(-size, size + 2)
    usable = (index >= 0) & (index <= last)
    index = np.clip(index, 0, last)
    # gaps bound each side; if a gap holds the impact itself, the two sides are different runs
    before = index <= at[:, None]
    usable &= samples.run[index] == np.where(before, samples.run[at][:, None], samples.run[at + 1][:, None])
    # a neighbouring hit ends the window; the times of its two samples exclude them later
    hit_before = np.r_[-1, at[:-1] + 1 - beyond] if len(at) else at
    hit_after = np.r_[at[1:] + beyond, last] if len(at) else at
    usable &= (index >= hit_before[:, None]) & (index <= hit_after[:, None])
    t_0 = 0.5 * (samples.t[at] + samples.t[at + 1])
    q_0 = 0.5 * (samples.q[at] + samples.q[at + 1])
    t, q = samples.t[index] - t_0[:, None], samples.q[index] - q_0[:, None, :]
    low, high = (bound - t_0 for bound in _bounds(samples, at))
    return Windows(t_0, q_0, t, q, usable, low, high, samples.trial[at[1:]] == samples.trial[at[:-1]])


def _bounds(samples: Samples, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds (n,) of t_c in s: a few samples either way, within the trial and half-way to the next hit."""
    first = np.searchsorted(samples.trial, samples.trial[at], side="left")
    last = np.searchsorted(samples.trial, samples.trial[at], side="right") - 1
    half_way = at[:-1] + (np.diff(at) + 1) // 2
    low = np.maximum(np.maximum(at - _WALK, first), np.r_[0, half_way][: len(at)])
    high = np.minimum(np.minimum(at + 1 + _WALK, last), np.r_[half_way, len(samples)][: len(at)])
    # never less than the detected interval itself
    return samples.t[np.minimum(low, at)], samples.t[np.maximum(high, at + 1)]


def sides_of(windows: Windows, t: np.ndarray, settings: ArcSettings, size: np.ndarray | None) -> np.ndarray:
    """Samples in the flights before and after impacts at t (n,), in s relative to t_0: (n, 2, W), 0 or 1."""
    tau = windows.t - t[:, None]
    # neighbouring hits bound the flights, too: the body does not fly freely during their contact
    start, end = np.full(len(t), -np.inf), np.full(len(t), np.inf)
    instant, same = t + windows.t_0, windows.same_trial
    start[1:][same] = (instant[:-1] + settings.guard - windows.t_0[1:])[same]
    end[:-1][same] = (instant[1:] - settings.guard - windows.t_0[:-1])[same]
    flying = windows.usable & (windows.t > start[:, None]) & (windows.t < end[:, None])
    side = np.stack([flying & (tau < -settings.guard), flying & (tau > settings.guard)], 1) * 1.0
    return side * (rank(side) <= (settings.max_window if size is None else size[..., None]))


@dataclass(frozen=True)
class Lines:
    """Least-squares lines through C channels on both sides of n impacts."""

    value: np.ndarray  # value, slope: (n, 2, C) at τ = 0, and per s
    slope: np.ndarray
    count: np.ndarray  # count, mean, spread: (n, 2) number, mean time (s) and Σ(τ − mean)² (s²) of the samples used
    mean: np.ndarray
    spread: np.ndarray
    residual: np.ndarray  # (n, 2, W, C) of all samples, used or not


def lines_through(side: np.ndarray, tau: np.ndarray, q: np.ndarray) -> Lines:
    """Lines through q (n, W, C) over tau (n, W) on each side; `side` (n, 2, W) is 1 for the samples used."""
    count = side.sum(2)
    safe = np.maximum(count, 1.0)
    mean = np.einsum("nsw,nw->ns", side, tau) / safe
    centred = (tau[:, None, :] - mean[..., None]) * side
    spread = (centred**2).sum(2)
    level = (side @ q) / safe[..., None]
    slope = (centred @ q) / np.where(spread > 0, spread, 1.0)[..., None]
    value = level - slope * mean[..., None]
    residual = q[:, None] - value[:, :, None] - slope[:, :, None] * tau[:, None, :, None]
    return Lines(value, slope, count, mean, spread, residual)


@dataclass(frozen=True)
class SideLines:
    """Lines fitted on both sides of n impacts; arrays as in `Observations`, by name.

    As in the module's table; in space value (n, 2, 7) is a position and a quaternion, slope (n, 2, 6) in m/s and rad/s.
    `cov` (n, 2, 3, 2, 2), in space (n, 2, 12, 12), is as in `Observations`; NaN with too few samples.
    """

    value: np.ndarray
    slope: np.ndarray
    bow: np.ndarray
    cov: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray

    def with_after(self, others: "SideLines") -> "SideLines":
        """These lines before the impacts, with the lines of `others` after them."""
        pairs = ((getattr(self, field.name), getattr(others, field.name)) for field in fields(self))
        return SideLines(*(np.stack([before[:, 0], after[:, 1]], axis=1) for before, after in pairs))


def side_lines(
    samples: Samples, trial: np.ndarray, t: np.ndarray, edges: np.ndarray, most: np.ndarray, variance: np.ndarray
) -> SideLines:
    """Lines at instants (trial, t), (n,), through at most `most` (n, 2) samples within `edges` (n, 4) of flights.

    `variance` (3,) is the variance of a sample of x, y, θ in m², m², rad².
    """
    width = int(most.max(initial=1)) + 1
    index, inside = samples.around(samples.position(trial, t), trial, -width, width)
    time = samples.t[index]
    tau = time - t[:, None]
    low, last, first, high = edges.T[:, :, None]
    side = np.stack([inside & (time > low) & (time < last), inside & (time > first) & (time < high)], axis=1)
    side = side.astype(float)
    side *= rank(side) <= most[:, :, None]

    lines = lines_through(side, tau, samples.q[index])
    cov = unit_covariance(lines)[:, :, None] * variance[None, None, :, None, None]
    return SideLines(lines.value, lines.slope, bows(side, tau), cov, *nodes_of(side, tau, lines))


def unit_covariance(lines: Lines) -> np.ndarray:
    """Covariance (n, 2, 2, 2) of (value, slope) of lines for unit noise; NaN with too few samples."""
    usable = (lines.count >= 3) & (lines.spread > 0)
    count, spread = (np.where(usable, a, np.nan) for a in (lines.count, lines.spread))
    unit_cov = np.empty((*count.shape, 2, 2))
    unit_cov[..., 0, 0] = 1.0 / count + lines.mean**2 / spread
    unit_cov[..., 1, 1] = 1.0 / spread
    unit_cov[..., 0, 1] = unit_cov[..., 1, 0] = -lines.mean / spread
    return unit_cov


def bows(side: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Curvature (b_0, b_1) (n, 2, 2) of line fits, from the lines through τ²/2."""
    parabola = lines_through(side, tau, 0.5 * tau[..., None] ** 2)
    return np.concatenate([parabola.value, parabola.slope], axis=2)


def bow(side: np.ndarray, tau: np.ndarray, lines: Lines) -> tuple[np.ndarray, ...]:
    """For the samples used: residuals of lines (n, 2, W, 3), their sums of squares (n, 2, 3), b (n, 2, W, 1), the
    best-fitting acceleration (n, 2, 3), and Σ b² (n, 2, 1), 0 with fewer than three samples."""
    residual = lines.residual * side[..., None]
    b = lines_through(side, tau, 0.5 * tau[..., None] ** 2).residual * side[..., None]
    norm2 = np.where((lines.count >= 3)[..., None], (b**2).sum(2), 0.0)
    curvature = (b * residual).sum(2) / np.where(norm2 > 0, norm2, np.inf)
    return residual, (residual**2).sum(2), b, curvature, norm2


def nodes_of(side: np.ndarray, tau: np.ndarray, lines: Lines) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights that replace all samples: exact for polynomials of degree `NODES` − 1."""
    low = np.where(side > 0, tau[:, None], np.inf).min(axis=2, initial=np.inf)
    high = np.where(side > 0, tau[:, None], -np.inf).max(axis=2, initial=-np.inf)
    low, high = (np.where(np.isfinite(a), a, 0.0) for a in (low, high))
    half = np.maximum(0.5 * (high - low), 1e-9)[..., None]
    middle = 0.5 * (low + high)[..., None]
    # weights of the samples in slope and value of the line
    spread = np.where(lines.spread > 0, lines.spread, 1.0)[..., None]
    slope = (tau[:, None] - lines.mean[..., None]) * side / spread
    value = side / np.maximum(lines.count, 1.0)[..., None] - slope * lines.mean[..., None]
    # the same for polynomials, and from these for their values at the nodes
    at = np.where(side > 0, (tau[:, None] - middle) / half, 0.0)
    moments = np.einsum("nskw,nswl->nskl", np.stack([value, slope], axis=2), legvander(at, NODES - 1))
    unit = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    return middle + half * unit, moments @ np.linalg.inv(legvander(unit, NODES - 1))
