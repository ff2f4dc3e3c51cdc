"""Where a body lies or slides on its surface after it has fallen: rests and slides.

A body *rests* where `ROWS` samples in a row stay within the noise of their mean, after a hit, near the believed
surface and near an angle at which it lies.  It *slides* where height and angle stay so, but x does not.  What a hand
holds above the surface is neither.

A rest of many samples is one measurement: rests on one side of a body differ by more than the noise of their means, by
dust, by the camera at another place.  That scatter is estimated without any model, as the spread of most rests about
the median of their side and a line along the surface, as of a camera that is turned; slides scatter about their
median, taken against the motion.  Neighbouring trials share some of it where the camera was moved between sessions.
The variance is then that of batch means, times their size: n rests tell their mean as well as n independent ones do.
Source: batch means with √n rests a batch: Flegal and Jones 2010, doi:10.1214/09-AOS735.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import theilslopes

from thesis_lib.bodies.lying import lying_angle
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.samples.rests import ROWS, resting
from thesis_lib.statistics.spread import quantile_std, robust_std

NEAR = 0.1  # of the body's extent: gap of a body that lies, by wrong size or height of the surface
LEANS = 0.3  # rad from an angle at which it lies; a frame turned further against the body is found by impacts
MOST = 0.8  # share of rests whose size tells the scatter; the others may lie on something
FEWEST = 8  # rests or slides that show their scatter
LONG = 12  # samples of a slide
WITHIN = 3.0  # sigmas of height and angle about their mean, over a whole slide
MOVES = 10.0  # sigmas of x from end to end


@dataclass(frozen=True)
class Supported:
    """m stretches on the surface: trial, t in s, pose q and velocity v (m, 3), and what is measured (m, c) with its
    variance (m, c): of rests height in m and angle in rad, of slides acceleration along the surface in m/s²."""

    trial: np.ndarray
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    measured: np.ndarray
    variance: np.ndarray

    def __len__(self) -> int:
        return len(self.trial)


def find_rests(samples: Samples, hits: Hits, header: Header, sigma: np.ndarray) -> Supported | None:
    """A rest a trial at most, the first after its last hit; None of too few.  `sigma` (3,): noise in m, m, rad."""
    first, last = stretches(samples, resting(samples, sigma, (0, 1, 2)))
    last_hit = hits.instants(hits.before(samples.trial[last], samples.t[last]) - 1, samples.trial[last], np.inf)
    after = samples.t[first] > last_hit
    first, last = first[after], last[after]
    _, one = np.unique(samples.trial[first], return_index=True)
    first, last = first[one], last[one]
    count = last - first + 1
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(samples.q - samples.q[:1], axis=0)])
    q = samples.q[:1] + (total[last + 1] - total[first]) / count[:, None]
    near = _near(header, q)
    first, last, q, count = first[near], last[near], q[near], count[near]
    if len(q) < FEWEST:
        return None
    flat = lying_angle(header.body.shape, q[:, 2])
    side = np.round(np.remainder(flat + LEANS, 2.0 * np.pi), 6)
    sides, of = np.unique(side, return_inverse=True)
    measured = np.stack([q[:, 1], q[:, 2] - flat], axis=1)

    def by_side(values: np.ndarray) -> np.ndarray:
        return values - np.stack([np.median(values[of == k], axis=0) for k in range(len(sides))])[of]

    slope = [theilslopes(column, by_side(q[:, 0]))[0] for column in by_side(measured).T]
    left = by_side(measured - np.outer(q[:, 0], slope))
    variance = sigma[1:] ** 2 / count[:, None] + scatter(left, len(sides) + 1)
    return Supported(samples.trial[first], samples.t[first], q, np.zeros_like(q), measured, variance)


def scatter(left: np.ndarray, parameters: int) -> np.ndarray:
    """Variance (c,) of rests about what `parameters` fitted to each component leave (m, c), in order of the trials.

    Neighbouring rests that err together count as fewer.
    """
    size = int(np.sqrt(len(left)))
    freedom = len(left) / max(len(left) - parameters, 1)
    batches = left[: len(left) // size * size].reshape(-1, size, left.shape[1]).mean(axis=1)
    shared = np.maximum(size * batches.var(axis=0) / np.maximum(left.var(axis=0), np.finfo(float).tiny), 1.0)
    return quantile_std(left, MOST) ** 2 * freedom * shared


def find_slides(samples: Samples, hits: Hits, header: Header, sigma: np.ndarray) -> Supported | None:
    """All slides of at least `LONG` samples, by parabolas through x; None of too few."""
    moving = resting(samples, sigma, (1, 2)) & ~resting(samples, sigma, (0, 1, 2))
    rows = []
    for a, b in zip(*stretches(samples, moving)):
        t, q = samples.t[a : b + 1], samples.q[a : b + 1]
        if len(t) < LONG or (np.abs(q - q.mean(axis=0)) > WITHIN * sigma)[:, 1:].any():
            continue
        here = samples.trial[a : a + 1]
        if np.isnan(hits.instants(hits.before(here, t[:1]) - 1, here, np.nan)[0]):
            continue  # not yet fallen
        tau = t - t.mean()
        X = np.stack([np.ones_like(tau), tau, 0.5 * tau**2], axis=1)
        inverse = np.linalg.inv(X.T @ X)
        x, v, acceleration = inverse @ X.T @ q[:, 0]
        ends = v + acceleration * tau[[0, -1]]
        if ends[0] * ends[1] <= 0.0 or abs(q[-1, 0] - q[0, 0]) < MOVES * sigma[0]:
            continue  # it stops, or hardly moves
        rows.append((samples.trial[a], t.mean(), x, *q[:, 1:].mean(axis=0), v, acceleration, inverse[2, 2]))
    if len(rows) < FEWEST:
        return None
    trial, t, x, y, theta, v, acceleration, variance = np.array(rows).T
    q = np.stack([x, y, theta], axis=1)
    near = _near(header, q)
    if near.sum() < FEWEST:
        return None
    against = -acceleration[near] * np.sign(v[near])
    noise = sigma[0] ** 2 * variance[near]
    beyond = max(float(robust_std(against - np.median(against)) ** 2 - np.median(noise)), 0.0)
    velocity = np.stack([v, 0.0 * v, 0.0 * v], axis=1)[near]
    measured = acceleration[near, None]
    return Supported(trial[near].astype(int), t[near], q[near], velocity, measured, (noise + beyond)[:, None])


def stretches(samples: Samples, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last rows (k,) of the stretches of a run in which `mask` (N,) is set, of at least `ROWS` samples."""
    if not len(samples):
        return np.zeros(0, int), np.zeros(0, int)
    ends = np.r_[(samples.run[1:] != samples.run[:-1]) | (mask[1:] != mask[:-1]), True]
    last = np.flatnonzero(ends)
    first = np.r_[0, last[:-1] + 1]
    kept = mask[first] & (last - first + 1 >= ROWS)
    return first[kept], last[kept]


def _near(header: Header, q: np.ndarray) -> np.ndarray:
    """Mask (m,) of poses (m, 3) of a body that lies on the believed surface."""
    shape = header.body.shape
    flat = lying_angle(shape, q[:, 2])
    gap = shape.gap(q[:, 1], flat, header.surface.height)
    return (np.abs(gap) < NEAR * shape.extent) & (np.abs(q[:, 2] - flat) < LEANS)
