"""Spikes of the second derivative: detection of impacts, and of tracking glitches (thesis section 3.4).

An impact is a spike in the second derivative of the pose, gravity removed.  The detector is the matched filter for it.
At every instant between two samples it takes the jump of velocity between lines through w samples on either side,

    T = Σ_i (slope_i^right − slope_i^left)² / var_i,    i = x, y + g t²/2, θ,

which is chi² with 3 degrees of freedom where the body flies freely.  Instants at which T peaks above a threshold are
impacts.  The detector runs from fine w, which separates strong hits, to coarse w, which finds weak ones; each pass
treats the impacts of earlier passes as ends of a trial.

A body at rest on the surface does not fall.  The part of the jump of v_y that such support explains is removed first.
This hides the weakest hits; a last pass searches without this allowance, and keeps hits with ten samples of clean free
fall on either side.

A tracking glitch is masked first: one sample far off the line through its four neighbours, which fit one line among
themselves, so that no jump of velocity remains.

`sigma` (3,) is the noise of each sample of x, y, θ in m, m, rad; the setting `scales` holds the w.
"""

import numpy as np

from thesis_lib.datasets.flights.arcs import fit_arcs
from thesis_lib.datasets.flights.lines import lines_through
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples

_WEAK_SAMPLES = 10  # a flight of 10 samples at 250 Hz is 2 mm high, which noise up to 0.5 mm cannot hide
_FALL = 9.0  # chi² (3 sigmas) by which free fall must beat rest on both sides of a weak hit


def find_glitches(samples: Samples, gravity: float, sigma: np.ndarray, settings: ArcSettings) -> np.ndarray:
    """Mask (N,) of single samples that stand out from the line through four neighbours of the same run."""
    n = len(samples)
    if n < 5:
        return np.zeros(n, bool)
    q = samples.without_gravity(gravity)
    starts = np.flatnonzero(np.r_[True, samples.run[1:] != samples.run[:-1]])
    length = np.diff(np.r_[starts, n])
    first, size = np.repeat(starts, length), np.repeat(length, length)
    # only samples with a large second difference, and the ends of runs, need the full test
    large = np.ones(n, bool)
    second = np.abs(q[2:] - 2.0 * q[1:-1] + q[:-2]) > settings.outlier_sigma * sigma
    large[1:-1] = second.any(1) | (samples.run[2:] != samples.run[:-2])
    here = np.flatnonzero(large & (size >= 5))
    first, size = first[here], size[here]
    start = np.clip(here - 2, first, first + size - 5)
    window = start[:, None] + np.arange(5)
    weight = (window != here[:, None]) * 1.0
    tau = samples.t[window] - samples.t[here, None]

    def stands_out(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Squared deviations (n, c) from the line through the other samples: of the sample, and of the others."""
        line = lines_through(weight[:, None], tau, values)
        residual = line.residual[:, 0] ** 2
        own = ((1.0 - weight)[..., None] * residual).sum(1)
        return own / (1.25 + line.mean**2 / line.spread), (weight[..., None] * residual).sum(1)

    off, others = (squares.sum(1) for squares in stands_out(q[window] / sigma))
    # A kink of velocity nearby gives off ≤ 2 × others at the middle of even steps: five times keeps impacts.
    kink, beside = stands_out(np.maximum(tau[:, :, None] - tau[:, None, 1:4], 0.0))
    most = 2.0 * (kink / np.maximum(beside, 1e-9 * kink + 1e-300)).max(1, initial=0.0)
    inside = (window[:, 0] < here) & (here < window[:, 4])
    glitch = np.zeros(n, bool)
    glitch[here] = off > np.maximum(settings.outlier_sigma**2, np.where(inside, np.maximum(most, 5.0), 5.0) * others)
    return glitch


def detect(
    samples: Samples, header: Header, sigma: np.ndarray, settings: ArcSettings, slowing: float = 0.0, weak: bool = False
) -> np.ndarray:
    """Indices (n,), ascending: an impact happens between sample i and i + 1 of the same trial.

    `slowing` in m/s² is the deceleration by friction with a table, which is not an impact.  `weak`: also hits
    between clean flights that are significant only without the allowance for rest.
    """
    n = len(samples)
    q = samples.without_gravity(header.gravity)
    boundary = np.r_[samples.trial[1:] != samples.trial[:-1], True][:n]  # a segment ends after sample i
    is_hit = np.zeros(n, bool)

    def scores(w: int) -> tuple[np.ndarray, np.ndarray]:
        spoiled = is_hit.copy()  # the two samples beside a hit may lie within the contact
        spoiled[1:] |= is_hit[:-1]
        segment = np.r_[0, np.cumsum(boundary | is_hit)[:-1]][:n]
        return _jump_scores(samples, q, segment, spoiled, w, header, sigma, settings, slowing)

    for w in settings.scales:
        score, free = scores(w)
        # the allowance for support flattens the peak of a weak hit: `score` decides whether it is a hit, `free` where
        is_hit |= _peaks(free, w, settings) & (score > settings.threshold**2)
    at = np.flatnonzero(is_hit)
    if not weak:
        return at
    w = max(settings.scales)
    found = np.flatnonzero(_peaks(scores(w)[1], w, settings))
    both = np.union1d(at, found)
    both = both[np.isin(samples.trial[both], samples.trial[found])]  # only trials with such a hit
    fits = fit_arcs(samples, both, sigma, header, settings)
    flying = (fits.n_side >= _WEAK_SAMPLES) & (fits.fall > _FALL) & (fits.reduced < settings.arc_deviation)
    return np.union1d(at, both[flying.all(1) & fits.converged])


def _peaks(score: np.ndarray, w: int, settings: ArcSettings) -> np.ndarray:
    peak = score > settings.threshold**2
    for shift in range(1, max(2, w)):  # hits w or more samples apart do not mask each other
        peak[shift:] &= score[shift:] > score[:-shift]
        peak[:-shift] &= score[:-shift] >= score[shift:]
    return peak


def _jump_scores(
    samples: Samples,
    q: np.ndarray,
    segment: np.ndarray,
    spoiled: np.ndarray,
    w: int,
    header: Header,
    sigma: np.ndarray,
    settings: ArcSettings,
    slowing: float,
) -> tuple[np.ndarray, np.ndarray]:
    """T (N,) of the instant after each sample, with and without allowance for support; 0 without room for lines."""
    t, n = samples.t, len(samples)
    # accelerations without a jump turn lines the more, the further these are apart
    scatter = 0.0 if samples.air is None else samples.air.scatter
    before = _running_lines(t, q, segment, spoiled, w)
    # the same from the other end: mirrored in time, the window after an instant is one before it
    after = [a[::-1] for a in _running_lines(-t[::-1], q[::-1], -segment[::-1], spoiled[::-1], w)]
    scores = np.zeros((2, n))
    if n < 2:
        return scores[0], scores[1]
    centre_l, slope_l, spread_l = (a[:-1] for a in before)
    centre_r, slope_r, spread_r = (a[1:] for a in after)
    ok = (segment[1:] == segment[:-1]) & (spread_l > 0) & (spread_r > 0)
    variance = 1.0 / np.where(ok, spread_l, 1.0) + 1.0 / np.where(ok, spread_r, 1.0)
    jump = -slope_r - slope_l
    allowance = ((scatter * (-centre_r - centre_l)) ** 2)[:, None] * [1.0, 1.0, 0.0] if scatter else 0.0
    rise = header.gravity * (-centre_r - centre_l)  # of v_y + g t of a body at rest
    if slowing > 0.0:
        along = (slope_l - slope_r)[:, :2]
        along /= np.maximum(np.hypot(*along.T), 1e-12)[:, None]
        lost = np.clip(-(jump[:, :2] * along).sum(1), 0.0, slowing * (-centre_r - centre_l))
        jump[:, :2] += lost[:, None] * along
    for score, allowed in zip(scores, (rise, 0.0)):
        d = jump.copy()
        d[:, 1] = np.where(d[:, 1] > 0, np.maximum(d[:, 1] - allowed, 0.0), d[:, 1])
        size2 = ((d * [1.0, 1.0, header.body.radius_of_gyration]) ** 2).sum(1)
        enough = ok & (size2 > settings.min_jump**2)
        if scatter:
            score[:-1] = np.where(enough, (d**2 / (sigma**2 * variance[:, None] + allowance)).sum(1), 0.0)
        else:
            score[:-1] = np.where(enough, ((d / sigma) ** 2).sum(1) / variance, 0.0)
    return scores[0], scores[1]


def _running_lines(
    t: np.ndarray, q: np.ndarray, segment: np.ndarray, spoiled: np.ndarray, w: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Line through the last w samples up to each sample: mean time (N,), slope (N, 3), Σ(t − mean)² (N,)."""
    n = len(t)
    s0, s1, s2 = np.zeros(n), np.zeros(n), np.zeros(n)
    sq, stq = np.zeros((n, 3)), np.zeros((n, 3))
    for lag in range(min(w, n)):
        now, then = slice(lag, n), slice(0, n - lag)
        use = ((segment[now] == segment[then]) & ~spoiled[then]) * 1.0
        tau = (t[then] - t[now]) * use
        change = (q[then] - q[now]) * use[:, None]
        s0[now] += use
        s1[now] += tau
        s2[now] += tau * tau
        sq[now] += change
        stq[now] += change * tau[:, None]
    count = np.maximum(s0, 1.0)
    spread = np.where(s0 >= 2, s2 - s1**2 / count, 0.0)
    slope = (stq - sq * (s1 / count)[:, None]) / np.where(spread > 0, spread, 1.0)[:, None]
    return t + s1 / count, slope, spread
