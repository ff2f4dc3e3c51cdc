"""Ends of flights in space: where they begin from a hand or end in the air, and how high the body is at its hits."""

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.datasets.space.flights import Track
from thesis_lib.datasets.space.touches import BETWEEN

HELD = 0.1  # s before the first flight, in which a body counts as held
OFF_SURFACE = 0.2  # extents of the body, by which its lowest point may be off the surface at hits


def releases_and_catches(
    table: pd.DataFrame, t: np.ndarray, track: Track, flights: Sequence[slice], header: SpaceHeader
) -> tuple[dict[int, float], dict[int, float]]:
    """Times of release of trials that begin held, and times at which trials end in the air, by trial and on its clock.

    `t` (n,): times of the samples on a common clock.
    """
    trial, own = table["trial"].to_numpy().tolist(), table["t"].tolist()
    first = {trial[flight.start]: flight.start for flight in reversed(flights)}
    last = {trial[flight.start]: flight.stop - 1 for flight in flights}
    begins = {trial[i]: t[i] for i in reversed(range(len(t)))}
    g = np.array(header.gravity)
    starts = np.array(
        [i for i in first.values() if t[i] - begins[trial[i]] > HELD and not _falls_before(i, t, track, g)], int
    )
    if header.tracked is None or header.surfaces is not None:
        return _by_trial(starts, trial, own), {}
    starts = starts[_off_surface(starts, table, t, track, header)]
    ends, numbers = np.array(list(last.values())), np.array(trial)
    ends = ends[_off_surface(ends, table, t, track, header)]
    # a flight that noise cuts in two ends in the air, but the body comes down later
    later = [np.flatnonzero((numbers == numbers[at]) & (t > t[at])) for at in ends]
    ends = ends[[bool(_off_surface(rows, table, t, track, header).all()) for rows in later]]
    return _by_trial(starts, trial, own), _by_trial(ends, trial, own)


def height_at_hits(
    table: pd.DataFrame, t: np.ndarray, track: Track, flights: Sequence[slice], header: SpaceHeader
) -> tuple[int, float]:
    """Number of hits between two flights, and the median height (m) of the body's lowest point above its surface there.

    The height is 0 if the body is at most of them within its reach of the surface.  `t` as in `releases_and_catches`.
    """
    trial, pause = table["trial"].to_numpy(), BETWEEN * float(np.median(np.diff(t)))
    pairs = [(before.stop - 1, after.start) for before, after in itertools.pairwise(flights)]
    rows = np.array([end for end, start in pairs if trial[end] == trial[start] and t[start] - t[end] < pause], int)
    if not len(rows) or header.tracked is None or header.surfaces is not None:
        return len(rows), 0.0
    height, reach = _height_and_reach(rows, table, t, track, header)
    return len(rows), float(np.median(height)) if np.mean(np.abs(height) > reach) > 0.5 else 0.0


def _falls_before(start: int, t: np.ndarray, track: Track, gravity: np.ndarray) -> bool:
    """Whether the body falls in most of the last `HELD` s before a flight: noise has cut its flight in two."""
    before = track.a[np.searchsorted(t, t[start] - HELD) : start] @ gravity / (gravity @ gravity)
    before = before[np.isfinite(before)]
    return len(before) > 0 and float(np.median(before)) > 0.5


def _by_trial(rows: np.ndarray, trial: Sequence[int], own: Sequence[float]) -> dict[int, float]:
    return {trial[i]: own[i] for i in sorted(rows.tolist())}


def _off_surface(rows: np.ndarray, table: pd.DataFrame, t: np.ndarray, track: Track, header: SpaceHeader) -> np.ndarray:
    """Mask (n,) of samples in which the body is farther off the surface than it moves until the next sample."""
    if not len(rows):
        return np.zeros(0, bool)
    height, reach = _height_and_reach(rows, table, t, track, header)
    return height > reach


def _height_and_reach(
    rows: np.ndarray, table: pd.DataFrame, t: np.ndarray, track: Track, header: SpaceHeader
) -> tuple[np.ndarray, np.ndarray]:
    """Heights (n,) of the lowest point above the surface, and up to which they may be uncertain, both in m."""
    (frame,) = surface_frames(header)
    states = frame.seen(body_states(tracked_states(table.iloc[rows]), header))
    solid, trial = header.body.solid.about(header.body.centre), table["trial"].to_numpy()
    speed = np.array([np.linalg.norm(track.v[min(at, len(t) - 1 - track.half)]) for at in rows])
    after = np.minimum(rows + 1, len(t) - 1)
    lasts = np.where(trial[after] == trial[rows], t[after] - t[rows], 0.0)
    reach = OFF_SURFACE * solid.extent + 2.0 * np.nan_to_num(speed) * np.maximum(lasts, float(np.median(np.diff(t))))
    return states.height + solid.lowest(states.attitude)[2], reach
