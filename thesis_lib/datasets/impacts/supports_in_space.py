"""Where a body in space lies or slides on its surface after it has fallen: rests and slides.

A rest is the first stretch after the last hit of its trial in which place and attitude stay within the noise of their
mean.  Rests on one side scatter by more than the noise of their means (`datasets/impacts/supports.py`); what a turn of
the body's axes, a slope of the table and the place explain of that is no scatter.  A body slides where its attitude and
height stay as they are and its place does not: what rolls turns.
"""

from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.samples import Samples
from thesis_lib.datasets.impacts.supports import FEWEST, LONG, MOVES, WITHIN, scatter, stretches
from thesis_lib.datasets.samples.rests import resting
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

UP = np.array([[0.0], [0.0], [1.0]])
HIGHEST = 1.2  # of the extent: the centre of what lies on the surface is lower; what a hand holds may be higher
STEADY = 4.0  # sigmas of height and turns about their mean, over a whole slide


@dataclass(frozen=True)
class OnTheTable:
    """m stretches on the surface: states, variance (m, c) of what is compared; of slides their acceleration in m/s² and
    how long they last in s (m, 3)."""

    state: State
    variance: np.ndarray
    measured: np.ndarray


def resting_and_sliding(
    states: State, samples: Samples, hits: Hits, symmetry: Symmetry, noise: tuple[float, float]
) -> tuple[OnTheTable | None, OnTheTable | None]:
    """The rests and slides, None of either if there are too few.

    Args:
        states: poses (N,) of the believed body as measured, in the axes of the surface, by trial and time.
        samples: the same samples; their runs count.
        hits: all that were found, at times as in `states`.
        symmetry: of the believed body.
        noise: one sigma of a coordinate in m and of a component of a small turn in rad.
    """
    last = np.searchsorted(states.trial, states.trial, side="right") - 1
    turns = SPACE.turn_between(states.attitude[:, last], states.attitude)
    samples = replace(samples, q=np.concatenate([states.position, turns]).T)
    sigma = np.repeat(noise, 3)
    still, solid = resting(samples, sigma, range(6)), symmetry.solid
    moving = resting(samples, sigma, (2, 3, 4, 5)) & ~still
    rests = _rests(states, samples, still, hits, symmetry, sigma)
    return rests, _slides(states, samples, moving, hits, HIGHEST * solid.extent, sigma)


def _rests(
    states: State, samples: Samples, still: np.ndarray, hits: Hits, symmetry: Symmetry, sigma: np.ndarray
) -> OnTheTable | None:
    first, last = stretches(samples, still)
    last_hit = hits.instants(hits.before(samples.trial[last], samples.t[last]) - 1, samples.trial[last], np.inf)
    after = samples.t[first] > last_hit
    first, last = first[after], last[after]
    _, one = np.unique(samples.trial[first], return_index=True)
    state, count = _means(states, samples, first[one], last[one])
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
    # turns by axes of the body differ by side, those by a slope do not
    axes = np.einsum("mk,cjm->cmkj", of_side, rotation_matrix(state.attitude)[:2]).reshape(2 * len(low), -1)
    level = np.repeat(np.eye(2), len(low), axis=0)
    slant = _left(turn[:2].reshape(-1, 1), np.concatenate([axes, level], axis=1)).reshape(2, -1).T
    sides = of_side.shape[1]
    spread = np.concatenate([scatter(gap, sides + 2), scatter(slant, sides + 1)])
    variance = sigma[[0, 3, 3]] ** 2 / count[:, None] + spread
    return OnTheTable(state, variance, np.zeros((len(state), 0)))


def _left(values: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """What of values (m, 1) least squares of columns (m, p) leave, twice: the second time without what is far off."""
    kept = np.ones(len(values), bool)
    for _ in range(2):
        x = np.linalg.lstsq(columns[kept], values[kept], rcond=1e-9)[0]
        left = values - columns @ x
        kept = (np.abs(left) <= WITHIN * robust_std(left)).all(axis=1)
    return left


def _slides(
    states: State, samples: Samples, moving: np.ndarray, hits: Hits, highest: float, sigma: np.ndarray
) -> OnTheTable | None:
    rows, found = [], []
    for a, b in zip(*stretches(samples, moving)):
        t, q = samples.t[a : b + 1], samples.q[a : b + 1]
        here = samples.trial[a : a + 1]
        if len(t) < LONG or (np.abs(q - q.mean(axis=0)) > STEADY * sigma)[:, 2:].any():
            continue
        if np.isnan(hits.instants(hits.before(here, t[:1]) - 1, here, np.nan)[0]):
            continue  # not yet fallen
        tau = t - t.mean()
        X = np.stack([np.ones_like(tau), tau, 0.5 * tau**2], axis=1)
        inverse = np.linalg.inv(X.T @ X)
        place, v, acceleration = inverse @ X.T @ q[:, :2]
        ends = v + np.outer(tau[[0, -1]], acceleration)
        if ends[0] @ ends[1] <= 0.0 or np.linalg.norm(q[-1, :2] - q[0, :2]) < MOVES * sigma[0]:
            continue  # it stops, or hardly moves
        rows.append((a, b))
        found.append((*place, *v, *acceleration, t[-1] - t[0], inverse[2, 2]))
    if len(rows) < FEWEST:
        return None
    first, last = np.array(rows).T
    place, v, measured, unit = np.split(np.array(found), [2, 4, 7], axis=1)
    state, _ = _means(states, samples, first, last)
    low = np.abs(state.height) < highest
    against = -np.einsum("mc,mc->m", measured[:, :2], v / np.linalg.norm(v, axis=1, keepdims=True))[low]
    if len(against) < FEWEST:
        return None
    noise = sigma[0] ** 2 * unit[low]
    beyond = max(float(robust_std(against - np.median(against)) ** 2 - np.median(noise)), 0.0)
    state = state.changed(
        position=np.concatenate([place.T, state.position[2:]]), velocity=np.concatenate([v.T, 0.0 * v.T[:1]])
    )
    return OnTheTable(state.select(np.flatnonzero(low)), np.repeat(noise + beyond, 2, axis=1), measured[low])


def _means(states: State, samples: Samples, first: np.ndarray, last: np.ndarray) -> tuple[State, np.ndarray]:
    """Mean poses (m,) from the `first` to the `last` rows, at the time since the trial began, and their counts."""
    count = last - first + 1
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(samples.q - samples.q[:1], axis=0)])
    q = (samples.q[:1] + (total[last + 1] - total[first]) / count[:, None]).T
    ends = np.searchsorted(samples.trial, samples.trial[first], side="right") - 1
    attitude = SPACE.attitude_after(states.attitude[:, ends], q[3:])
    t = samples.t[first] - samples.t[np.searchsorted(samples.trial, samples.trial[first])]
    pose = np.concatenate([q[:3], attitude])
    return State(pose, np.zeros((6, len(first))), samples.trial[first], t, None, SPACE), count
