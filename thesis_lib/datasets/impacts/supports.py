"""Rests and slides of a body on its surface after it has fallen, in the plane and in space.

A body *rests* where `ROWS` samples in a row stay within the noise of their mean, after a hit, near the believed
surface and near an attitude in which it can lie.  It *slides* where height and attitude stay within the noise, but its
position does not; a rolling body turns.  In space, height and attitude may also change at a small, constant rate (axes
of the recording that differ from the table's), and the body may spin about the normal.  A body held by hand is neither.

A rest of many samples is one measurement: rests on one side of a body differ by more than the noise of their means,
through dust or the camera's view of another place.  This scatter is estimated without a model: in the plane as the
spread of most rests about the median of their side and a line along the surface (a turned camera); in space as the
residual from a turn of the body's axes, a slope of the table and the position.  Decelerations of slides scatter about
their median.  Neighbouring trials share scatter if the camera was moved between sessions.  The variance is then that of
batch means times the batch size: n rests determine their mean as well as n independent rests would.
Source: batch means with √n rests a batch: Flegal and Jones 2010, doi:10.1214/09-AOS735.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import theilslopes

from thesis_lib.bodies.solids import UP
from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.samples.pieces import ROWS, resting
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import quantile_std, robust_std

NEAR = 0.1  # of the body's extent: gap of a lying body, for a wrong size or height of the surface
LEANS = 0.3  # rad from an angle at which it lies; larger turns of its frame are found from impacts
HIGHEST = 1.2  # of the extent: the centre of a solid on the surface is lower; a body held by hand may be higher
MOST = 0.8  # share of rests that determine the scatter; the others may lie on something
FEWEST = 8  # rests or slides, to estimate their scatter
LONG = 12  # samples of a slide
WITHIN = 3.0  # sigmas of height and angle about their mean, over a whole slide
STEADY = 4.0  # the same of height and turns in space
MOVES = 10.0  # sigmas between the positions at both ends
# of the speed: rates of height, of two leans and of the turn about the normal, times the extent
SHARES = np.array([0.1, 0.1, 0.1, 0.3])


@dataclass(frozen=True)
class Supported:
    """m rests or slides: states, the variance (m, c) of the quantities to be compared, and, for slides, as `measured`:
    acceleration along the surface in m/s² (m, 1), or in space (m, 2) and then their duration in s."""

    state: State
    variance: np.ndarray
    measured: np.ndarray


def find_rests(samples: Samples, hits: Hits, header: Header, sigma: np.ndarray) -> Supported | None:
    """At most one rest per trial, the first after its last hit; None if too few.  `sigma` (3,): noise in m, m, rad."""
    first, last = _first_rests(samples, resting(samples, sigma, (0, 1, 2)), hits)
    q, count = _means(samples, first, last)
    near = _near(header, q)
    first, q, count = first[near], q[near], count[near]
    if len(q) < FEWEST:
        return None
    flat = header.body.shape.lying(q[:, 2])
    side = np.round(np.remainder(flat + LEANS, 2.0 * np.pi), 6)
    sides, of = np.unique(side, return_inverse=True)
    measured = np.stack([q[:, 1], q[:, 2] - flat], axis=1)

    def by_side(values: np.ndarray) -> np.ndarray:
        return values - np.stack([np.median(values[of == k], axis=0) for k in range(len(sides))])[of]

    slope = [theilslopes(column, by_side(q[:, 0]))[0] for column in by_side(measured).T]
    left = by_side(measured - np.outer(q[:, 0], slope))
    variance = sigma[1:] ** 2 / count[:, None] + _scatter(left, len(sides) + 1)
    return Supported(State.of(q, np.zeros_like(q), samples.trial[first], samples.t[first]), variance, measured)


def find_slides(samples: Samples, hits: Hits, header: Header, sigma: np.ndarray) -> Supported | None:
    """All slides of at least `LONG` samples, by parabolas through x; None if there are too few."""
    moving = resting(samples, sigma, (1, 2)) & ~resting(samples, sigma, (0, 1, 2))
    found = _slides(samples, moving, hits, sigma, 1, WITHIN)
    if found is None:
        return None
    q = np.concatenate([found.place, _means(samples, found.first, found.last)[0][:, 1:]], axis=1)
    near = _near(header, q)
    if near.sum() < FEWEST:
        return None
    velocity = np.pad(found.velocity, ((0, 0), (0, 2)))
    state = State.of(q, velocity, samples.trial[found.first], found.t).select(near)
    return Supported(state, found.variance(near), found.acceleration[near])


def resting_and_sliding(
    states: State, samples: Samples, hits: Hits, symmetry: Symmetry, noise: tuple[float, float]
) -> tuple[Supported | None, Supported | None]:
    """The rests and the slides of a body in space, each None if there are too few.

    Args:
        states: poses (N,) of the believed body as measured, in the axes of the surface, by trial and time.
        samples: the same samples, with their runs.
        hits: all detected hits, at times as in `states`.
        symmetry: of the believed body.
        noise: one sigma of a coordinate in m and of a component of a small turn in rad.
    """
    last = np.searchsorted(states.trial, states.trial, side="right") - 1
    turns = SPACE.turn_between(states.attitude[:, last], states.attitude)
    samples = replace(samples, q=np.concatenate([states.position, turns]).T)
    sigma, highest = np.repeat(noise, 3), HIGHEST * symmetry.solid.extent
    still = resting(samples, sigma, range(6))
    moving = resting(samples, sigma, (2, 3, 4), drifts=True) & ~still
    first, end = _first_rests(samples, still, hits)
    # a body at rest may still hop by less than the noise of single samples: only the latter half is used
    rests = _rests_in_space(states, samples, end - (end - first) // 2, end, symmetry, sigma)
    found = _slides(samples, moving, hits, sigma, 2, STEADY, symmetry.solid.extent)
    if found is None:
        return rests, None
    state, _ = _mean_states(states, samples, found.first, found.last)
    low = np.abs(state.height) < highest
    if low.sum() < FEWEST:
        return rests, None
    position = np.concatenate([found.place.T, state.position[2:]])
    state = state.changed(position=position, velocity=np.pad(found.velocity, ((0, 0), (0, 1))).T)
    span = samples.t[found.last] - samples.t[found.first]
    measured = np.column_stack([found.acceleration, span])
    return rests, Supported(state.select(low), np.repeat(found.variance(low), 2, axis=1), measured[low])


def _rests_in_space(
    states: State, samples: Samples, first: np.ndarray, last: np.ndarray, symmetry: Symmetry, sigma: np.ndarray
) -> Supported | None:
    state, count = _mean_states(states, samples, first, last)
    low = np.flatnonzero(np.abs(state.height) < HIGHEST * symmetry.solid.extent)
    if len(low) < FEWEST:
        return None
    state, count = state.select(low), count[low]
    up = SPACE.turned_back(state.attitude, UP).T
    side = symmetry.nearest_stand(up)[0]
    turn = state.turned(symmetry.leaning(up).T)
    standing = state.changed(attitude=SPACE.attitude_after(state.attitude, -turn))
    of_side = 1.0 * (side[:, None] == np.unique(side))
    gap = standing.height + symmetry.solid.lowest(standing.attitude)[2]
    gap = _left(gap[:, None], np.concatenate([of_side, state.position[:2].T], axis=1))
    # turns due to axes of the body differ by side, turns due to a slope do not
    axes = np.einsum("mk,cjm->cmkj", of_side, rotation_matrix(state.attitude)[:2]).reshape(2 * len(low), -1)
    level = np.repeat(np.eye(2), len(low), axis=0)
    slant = _left(turn[:2].reshape(-1, 1), np.concatenate([axes, level], axis=1)).reshape(2, -1).T
    sides = of_side.shape[1]
    spread = np.concatenate([_scatter(gap, sides + 2), _scatter(slant, sides + 1)])
    variance = sigma[[0, 3, 3]] ** 2 / count[:, None] + spread
    return Supported(state, variance, np.zeros((len(state), 0)))


def _left(values: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Residuals of values (m, 1) after least squares on columns (m, p), twice: the second time without outliers."""
    kept = np.ones(len(values), bool)
    for _ in range(2):
        x = np.linalg.lstsq(columns[kept], values[kept], rcond=1e-9)[0]
        left = values - columns @ x
        kept = (np.abs(left) <= WITHIN * robust_std(left)).all(axis=1)
    return left


def _scatter(left: np.ndarray, parameters: int) -> np.ndarray:
    """Variance (c,) of rests from residuals (m, c), in order of the trials, after `parameters` fitted per component.

    Neighbouring rests with common errors count as fewer.
    """
    size = int(np.sqrt(len(left)))
    freedom = len(left) / max(len(left) - parameters, 1)
    batches = left[: len(left) // size * size].reshape(-1, size, left.shape[1]).mean(axis=1)
    shared = np.maximum(size * batches.var(axis=0) / np.maximum(left.var(axis=0), np.finfo(float).tiny), 1.0)
    return quantile_std(left, MOST) ** 2 * freedom * shared


@dataclass(frozen=True)
class _Slides:
    """k slides: first and last rows, mid-times (k,), place, velocity and acceleration (k, c) in the middle, and the
    variance (k,) of an acceleration by the noise alone."""

    first: np.ndarray
    last: np.ndarray
    t: np.ndarray
    place: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    noise: np.ndarray

    def variance(self, rows: np.ndarray) -> np.ndarray:
        """Variance (m, 1) of the accelerations of the slides in the mask `rows`, with the scatter of decelerations."""
        v, noise = self.velocity[rows], self.noise[rows]
        against = -np.einsum("mc,mc->m", self.acceleration[rows], v / np.linalg.norm(v, axis=1, keepdims=True))
        beyond = max(float(robust_std(against - np.median(against)) ** 2 - np.median(noise)), 0.0)
        return (noise + beyond)[:, None]


def _slides(
    samples: Samples,
    moving: np.ndarray,
    hits: Hits,
    sigma: np.ndarray,
    c: int,
    steady: float,
    extent: float | None = None,
) -> _Slides | None:
    """Slides in the mask `moving` (N,), in which the first `c` components of q change, and the others stay within
    `steady` sigmas, in space (where the body's `extent` is given) of a line; None if too few."""
    found = []
    for a, b in zip(*stretches(samples, moving)):
        if extent is not None:  # the last part of a slide that ends at rest is not used
            far = np.linalg.norm(samples.q[a : b + 1, :c] - samples.q[b, :c], axis=1) > MOVES * sigma[0]
            b = a + int(np.flatnonzero(far)[-1]) if far.any() else a
        t, q, here = samples.t[a : b + 1], samples.q[a : b + 1], samples.trial[a : a + 1]
        if len(t) < LONG:
            continue
        if np.isnan(hits.instants(hits.before(here, t[:1]) - 1, here, np.nan)[0]):
            continue  # not yet fallen
        tau = t - t.mean()
        X = np.stack([np.ones_like(tau), tau, 0.5 * tau**2], axis=1)
        inverse = np.linalg.inv(X.T @ X)
        place, v, acceleration = inverse @ X.T @ q[:, :c]
        rates = np.zeros(q.shape[1]) if extent is None else tau @ (q - q.mean(axis=0)) / (tau @ tau)
        off = np.abs(q - q.mean(axis=0) - np.outer(tau, rates)) > steady * sigma
        if off[:, c : 2 * c + 1].any():
            continue  # height or lean changes
        if extent is not None and (np.abs(rates[2:]) * [1.0, *[extent] * 3] > SHARES * np.linalg.norm(v)).any():
            continue  # it rolls or spins
        ends = v + np.outer(tau[[0, -1]], acceleration)
        if ends[0] @ ends[1] <= 0.0 or np.linalg.norm(q[-1, :c] - q[0, :c]) < MOVES * sigma[0]:
            continue  # it stops, or hardly moves
        found.append((a, b, t.mean(), place, v, acceleration, sigma[0] ** 2 * inverse[2, 2]))
    return _Slides(*map(np.array, zip(*found))) if len(found) >= FEWEST else None


def stretches(samples: Samples, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last rows (k,) of the stretches of a run in which `mask` (N,) is set, of at least `ROWS` samples."""
    if not len(samples):
        return np.zeros(0, int), np.zeros(0, int)
    ends = np.r_[(samples.run[1:] != samples.run[:-1]) | (mask[1:] != mask[:-1]), True]
    last = np.flatnonzero(ends)
    first = np.r_[0, last[:-1] + 1]
    kept = mask[first] & (last - first + 1 >= ROWS)
    return first[kept], last[kept]


def _first_rests(samples: Samples, still: np.ndarray, hits: Hits) -> tuple[np.ndarray, np.ndarray]:
    """First and last rows (k,) of the first stretch of each trial that is `still` (N,) after its last hit."""
    first, last = stretches(samples, still)
    last_hit = hits.instants(hits.before(samples.trial[last], samples.t[last]) - 1, samples.trial[last], np.inf)
    after = samples.t[first] > last_hit
    _, one = np.unique(samples.trial[first[after]], return_index=True)
    return first[after][one], last[after][one]


def _means(samples: Samples, first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means (k, c) of q from the `first` to the `last` rows, and their counts (k,)."""
    count, middle = last - first + 1, samples.q[:1]
    total = np.concatenate([np.zeros_like(middle), np.cumsum(samples.q - middle, axis=0)])
    return middle + (total[last + 1] - total[first]) / count[:, None], count


def _mean_states(states: State, samples: Samples, first: np.ndarray, last: np.ndarray) -> tuple[State, np.ndarray]:
    """Mean poses (k,) from the `first` to the `last` rows, at the time since the trial began, and their counts."""
    q, count = _means(samples, first, last)
    ends = np.searchsorted(samples.trial, samples.trial[first], side="right") - 1
    attitude = SPACE.attitude_after(states.attitude[:, ends], q.T[3:])
    t = samples.t[first] - samples.t[np.searchsorted(samples.trial, samples.trial[first])]
    pose = np.concatenate([q.T[:3], attitude])
    return State(pose, np.zeros((6, len(first))), samples.trial[first], t, None, SPACE), count


def _near(header: Header, q: np.ndarray) -> np.ndarray:
    """Mask (m,) of poses (m, 3) of a body that lies on the believed surface."""
    shape = header.body.shape
    flat = shape.lying(q[:, 2])
    gap = shape.gap(q[:, 1], flat, header.surface.height)
    return (np.abs(gap) < NEAR * shape.extent) & (np.abs(q[:, 2] - flat) < LEANS)
