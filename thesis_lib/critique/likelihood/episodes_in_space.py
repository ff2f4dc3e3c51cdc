"""Episodes in space: hits that follow each other too quickly to see the flight between them.

Those with too few samples between them are found as in the plane (`datasets/impacts/episodes.py`).  Two hits between
two samples look like one.  They are found by the corners: the flight before, followed on, touches the surface with one,
and the flight after, followed back, with another one; where two corners are within `LEVEL` then, it may be either.
"""

import numpy as np
import pandas as pd
from scipy.stats import chi2

from thesis_lib.bodies.minkowski import MinkowskiSum
from thesis_lib.critique.contacts.pressing import contact_points
from thesis_lib.critique.likelihood.observations import LATE, LONGEST_WAIT, Observations, with_episodes
from thesis_lib.critique.likelihood.windows import SpaceWindows, fit_windows, turns_off
from thesis_lib.datasets.flights.noise import NoiseEstimate
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.datasets.impacts.episodes import find_episodes
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.free_motion import flown
from thesis_lib.mechanics.state import State

LEVEL = 1e-3  # m between two corners: three standard deviations of their height where a flight is extrapolated
IMPROBABLE = 1e-6  # of χ² of the turns of a flight
LOOK = 1e-4  # s between the poses in which a touch is looked for
EDGE = 1e-6  # s; instants that are nearer are the same sample's


def add_episodes(
    single: Observations,
    samples: Samples,
    states: State,
    hits: pd.DataFrame,
    windows: pd.DataFrame,
    noise: tuple[float, float],
    settings: ArcSettings,
) -> Observations:
    """The single hits and the episodes, by trial and time; what the episodes hold is no longer left out.

    Args:
        samples, states: of all N samples, centre of mass and pose in the frame of the surface.
        hits: all that were detected, as `find_episodes` takes them.
        windows: of the single hits `start`, `end`, `n_pre` and `n_post`, as `find_episodes` returns them.
        noise: one sigma of a position in m, and of each component of a turn in rad.
    """
    rig = single.rig
    r = rig.lowest(states)
    clearance = rig.gap(states), np.hypot(noise[0], np.hypot(r[0], r[1]) * noise[1])
    of_place = np.full(3, noise[0])
    estimate = NoiseEstimate(*noise, of_place, of_place, "differences")
    table = find_episodes(samples, hits, estimate, rig.gravity, clearance, settings)
    alone = pd.DataFrame({"trial": single.trial, "impact": single.impact, "last": single.impact}).join(windows)
    twice = _hits_twice(rig, samples, states, alone, noise)
    table = pd.concat([table, alone[twice]], ignore_index=True)
    if not len(table):
        return single
    trial, start, end = (table[name].to_numpy() for name in ("trial", "start", "end"))
    count = table[["n_pre", "n_post"]].to_numpy()
    before = _side(samples, states, trial, start, count[:, 0], -1, start, rig, noise)
    t = start + _touch(rig, _state(before, rig), 1)[0]
    # as in the plane: a hit that a model makes a little late must not fall behind the state after
    end = np.minimum(end + LATE, samples.t[_number(samples, trial, end) + (count[:, 1] - 1) // 2])
    end = np.maximum(end, t + EDGE)
    sides = [
        _side(samples, states, trial, *edge, at, rig, noise)
        for edge, at in (((start, count[:, 0], -1), t), ((table["end"].to_numpy(), count[:, 1], 1), end))
    ]
    good = np.all([side[1] for side in sides], axis=0)
    names = ("value", "slope", "bow", "cov", "nodes", "weights")
    arrays = {name: np.stack([getattr(side[0], name)[:, 0] for side in sides], axis=1) for name in names}
    first = samples.t[np.searchsorted(samples.trial, trial)]
    n = len(table)
    arrays |= {"trial": trial, "impact": table["impact"].to_numpy(), "t": t - first, "span": end - t}
    arrays |= {"hits": (table["last"] - table["impact"] + 1).to_numpy(), "surface": np.zeros(n, int)}
    arrays |= {"t_std": np.zeros(n), "offset": np.zeros((n, 3))}
    kept = np.flatnonzero(good)
    others = single.rows(np.flatnonzero(~twice))
    return with_episodes(others, {name: array[kept] for name, array in arrays.items()}, table.iloc[kept])


def _hits_twice(
    rig: Rig, samples: Samples, states: State, alone: pd.DataFrame, noise: tuple[float, float]
) -> np.ndarray:
    """Mask (n,) of what looks like single hits, and may be hits of two corners."""
    if contact_points(rig) == 1 or not len(alone):
        return np.zeros(len(alone), bool)
    trial, corners, close = alone["trial"].to_numpy(), [], []
    for edge, count, way in (("start", "n_pre", -1), ("end", "n_post", 1)):
        t = alone[edge].to_numpy()
        fitted = _side(samples, states, trial, t, alone[count].to_numpy(), way, t, rig, noise)
        _, corner, near = _touch(rig, _state(fitted, rig), -way)
        corners.append(corner)
        close.append(near)
    return (corners[0] != corners[1]) | close[0] | close[1]


def _number(samples: Samples, trial: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Number (n,) of the sample at each instant."""
    return samples.position(trial, t - EDGE)


def _side(
    samples: Samples,
    states: State,
    trial: np.ndarray,
    edge: np.ndarray,
    count: np.ndarray,
    way: int,
    at: np.ndarray,
    rig: Rig,
    noise: tuple[float, float],
) -> tuple[SpaceWindows, np.ndarray]:
    """Flights through `count` (n,) samples from the one at `edge` (n,) on, earlier ones if `way` is −1, as seen from
    the instants `at` (n,); and whether their turns are those of a free body.  Both sides of the windows are the same.
    """
    first, size = _number(samples, trial, edge), np.arange(max(int(count.max(initial=0)), 1))
    wanted = first[:, None] + way * size
    index = np.clip(wanted, 0, len(samples) - 1)
    used = (size < count[:, None]) & (wanted == index) & (samples.run[index] == samples.run[first][:, None])
    pose, tau, G = np.moveaxis(states.pose[:, index], 0, -1), samples.t[index] - at[:, None], np.asarray(rig.tensor)
    both = np.stack([used, used], axis=1)
    fitted = fit_windows(pose, tau, both, G, noise)
    limit = chi2.isf(IMPROBABLE, np.maximum(3.0 * used.sum(axis=1) - 6.0, 1.0))
    return fitted, turns_off(fitted, 0, pose, tau, both, G) / noise[1] ** 2 < limit


def _state(fitted: tuple[SpaceWindows, np.ndarray], rig: Rig) -> State:
    """The states at the instants of the windows, under believed gravity."""
    windows, n = fitted[0], len(fitted[0].value)
    state = State.of(windows.value[:, 0], windows.slope[:, 0], np.zeros(n), np.zeros(n), None, rig.space)
    a, (b_0, b_1) = rig.fall(state)[:3], windows.bow[:, 0].T
    return state.changed(position=state.position - a * b_0, velocity=state.velocity - a * b_1)


def _touch(rig: Rig, state: State, way: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """When (n,) in s believed bodies reach the surface, on (`way` 1) or back (−1); the corner (n,), and whether another
    one is near."""
    tau = way * np.arange(0.0, LONGEST_WAIT, LOOK)
    free = flown(state.pose, state.motion, np.asarray(rig.tensor), rig.fall(state)[:3], tau)
    shape: MinkowskiSum = rig.shape.minkowski  # pyright: ignore[reportAttributeAccessIssue]
    k, n = len(tau), len(state)
    heights = shape.heights(free.pose[3:].reshape(4, -1)) + (free.pose[2].ravel() - rig.height)
    heights = heights.reshape(-1, k, n)
    below = heights.min(axis=0) < 0.0
    at = np.where(below.any(axis=0), below.argmax(axis=0), 0)
    there = heights[:, at, np.arange(n)]
    lowest = np.sort(there, axis=0)
    near = lowest[1] - lowest[0] < LEVEL if len(lowest) > 1 else np.zeros(n, bool)
    return tau[at], there.argmin(axis=0), near
