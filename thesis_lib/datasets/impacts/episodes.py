"""Episodes: hits that follow each other too quickly to see the flight between them.

A body that lands on a corner often lands on the next one a few milliseconds later.  Neither hit can be measured alone,
but their joint effect can: the flight before the first and the flight after the last are as long as any.

Hits with fewer than `min_window` samples between them form an episode, and so does a hit whose own samples show that a
second one was too close to be detected (`second_hit` in `quality`).  Samples beside an episode that do not lie on the
flight through the others are skipped, at most `MOST_SKIPPED` per side.  Both flights must be ballistic, as for a single
hit.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from thesis_lib.datasets.flights.arcs import bends
from thesis_lib.datasets.flights.lines import bow, lines_through, ranked
from thesis_lib.datasets.flights.misfits import with_stray
from thesis_lib.datasets.flights.noise import NoiseEstimate
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.samples import ArcSettings, Samples

EPISODE_COLUMNS = ("trial", "impact", "last", "t_first", "t_last", "start", "end", "n_pre", "n_post")
DOUBTFUL = ("second_hit", "not_ballistic", "stays_down")
MIN_FLIGHT = 4  # samples of a flight beside an episode
MOST_SKIPPED = 3  # samples; more is 12 ms at 250 Hz
_NEAR = 7.8  # chi² with 3 dof that one sample in 20 beside an episode exceeds by chance
_CUTS = 2
_CLEAR = 3.0  # sigmas that a flying body is above the surface
_REST = 9.0  # chi² by which rest must beat free fall


@dataclass(frozen=True)
class _Side:
    """Samples on one side of m episodes: times after its edge (m, W) in s, poses (m, W, 3), and 1 where used (m, W)."""

    t: np.ndarray
    q: np.ndarray
    used: np.ndarray

    def nearest(self) -> np.ndarray:
        """Times (m,) in s of the used samples nearest to the episode."""
        return np.where(self.used > 0, np.abs(self.t), np.inf).argmin(1)


def find_episodes(
    samples: Samples,
    hits: pd.DataFrame,
    noise: NoiseEstimate,
    gravity: float,
    clearance: tuple[np.ndarray, np.ndarray],
    settings: ArcSettings,
) -> pd.DataFrame:
    """Episodes in `samples`, a row each with `EPISODE_COLUMNS`: trial, first and last hit with their times in s, times
    `start` and `end` in s of the last sample before and the first after, and the samples of both flights.

    `hits` are all detected hits, sorted by trial and time, with trial, impact, t (s), gap (m) and reason
    ("" = used alone); `clearance` (N,) and (N,) is the gap of the believed body at each sample and its one sigma, in m.
    """
    sigma, stray = noise.used * np.sqrt(noise.colour), noise.stray
    trial, t = (hits[name].to_numpy() for name in ("trial", "t"))
    number, reach = samples.position(trial, t), settings.max_window + MOST_SKIPPED + 1
    index, near = samples.around(number, trial, -reach, reach + 1)
    paths = samples.without_air()
    groups = groups_of_hits(hits, number)
    if not len(groups):
        return pd.DataFrame(columns=EPISODE_COLUMNS)
    first, last = groups.T
    before, after = first - 1, np.minimum(last + 1, len(hits) - 1)
    low = np.where((before >= 0) & (trial[before] == trial[first]), t[before], -np.inf) + settings.guard
    high = np.where((last + 1 < len(hits)) & (trial[after] == trial[first]), t[after], np.inf) - settings.guard
    alone = hits["gap"][hits["reason"] == ""]
    level = float(alone.median()) if len(alone) else 0.0
    sides, good = [], np.ones(len(groups), bool)
    for hit, bound, way in ((first, low, -1), (last, high, 1)):
        side = _flight(samples, paths, index[hit], near[hit], t[hit], bound, way, sigma, gravity, settings)
        side = _straight(side, way, sigma, stray, settings)
        good &= _is_flight(side, sigma, stray, gravity, settings)
        gap, spread = (part[index[hit]] for part in clearance)
        good &= _is_clear(side.used, way, gap, spread, level)
        sides.append(side)
    rows = np.arange(len(groups))
    start, end = (t[hit] + side.t[rows, side.nearest()] for hit, side in zip((first, last), sides))
    impact, counts = hits["impact"].to_numpy(), (side.used.sum(1).astype(int) for side in sides)
    columns = (trial[first], impact[first], impact[last], t[first], t[last], start, end, *counts)
    table = pd.DataFrame(dict(zip(EPISODE_COLUMNS, columns)))
    return table[good].reset_index(drop=True)


def groups_of_hits(hits: pd.DataFrame, number: np.ndarray) -> np.ndarray:
    """First and last row (g, 2) of each run of hits with too few samples between them; hits used alone are excluded.

    `number` (h,): index of the first sample after each hit.
    """
    trial, reason = (hits[name].to_numpy() for name in ("trial", "reason"))
    if not len(hits):
        return np.zeros((0, 2), int)
    close = (trial[1:] == trial[:-1]) & (np.diff(number) < MIN_FLIGHT)
    alone = reason == ""
    close &= ~alone[1:] & ~alone[:-1]
    first = np.flatnonzero(np.r_[True, ~close])
    last = np.r_[first[1:], len(hits)] - 1
    doubtful = np.array([np.isin(reason[i : j + 1], DOUBTFUL).any() for i, j in zip(first, last)], bool)
    return np.stack([first, last], axis=1)[doubtful]


def _flight(
    samples: Samples,
    paths: np.ndarray,
    index: np.ndarray,
    near: np.ndarray,
    edge: np.ndarray,
    bound: np.ndarray,
    way: int,
    sigma: np.ndarray,
    gravity: float,
    settings: ArcSettings,
) -> _Side:
    """Samples from `edge` (m,) towards `bound` (m,), in s; `way` is −1 before an episode and 1 after it.

    `paths` (N, 3) are poses without the effect of the air, `index`, `near` (m, W) as `Samples.around` gives them.
    """
    t = samples.t[index] - edge[:, None]
    inside = near & (way * t > settings.guard)
    inside &= way * (samples.t[index] - bound[:, None]) < 0.0
    # a gap in time ends the flight
    nearest = np.where(inside, np.abs(t), np.inf).argmin(1)
    rows = np.arange(len(edge))
    inside &= samples.run[index] == samples.run[index[rows, nearest]][:, None]
    q = paths[index]
    q[..., 1] += 0.5 * gravity * t * t
    used = inside * 1.0
    used *= ranked(used, way) <= settings.max_window + MOST_SKIPPED
    for _ in range(MOST_SKIPPED):
        used *= 1.0 - end_off_line(used, t, q, sigma, way)
    return _Side(t, q, used * (ranked(used, way) <= settings.max_window))


def end_off_line(used: np.ndarray, t: np.ndarray, q: np.ndarray, sigma: np.ndarray, way: int) -> np.ndarray:
    """1 (m, W) for the first sample used (the last if `way` is −1) if it is off the line through the samples beyond
    the next one; else 0."""
    order = ranked(used, way)
    beside, others = used * (order == 1), used * (order > 2)
    line = lines_through(others[:, None], t, q)
    spread = np.where(line.spread > 0, line.spread, np.inf)
    reach = 1.0 + 1.0 / np.maximum(line.count, 1.0) + (t - line.mean) ** 2 / spread
    off = (line.residual[:, 0] / sigma) ** 2
    return beside * ((off.sum(-1) > _NEAR * reach) & (line.count >= 3))


def _line(side: _Side, sigma: np.ndarray, stray: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For a line through the samples used that allows for stray acceleration: their count (m,), chi² (m, 3), and
    whether the path is bent (m,), as by an undetected hit."""
    line = lines_through(side.used[:, None], side.t, side.q)
    _, ss, _, curvature, norm2 = bow(side.used[:, None], side.t, line)
    count = line.count[:, 0]
    chi2 = with_stray(ss, curvature, norm2, 1.0 / sigma**2, stray)[0][:, 0] / sigma**2
    return count, chi2, bends(chi2.sum(1), count, limit)


def _straight(side: _Side, way: int, sigma: np.ndarray, stray: np.ndarray, settings: ArcSettings) -> _Side:
    """The side, cut to the half beside the episode, and once more, if its path is bent."""
    for _ in range(_CUTS):
        count, _, bent = _line(side, sigma, stray, settings.arc_deviation)
        most = np.where(bent, np.maximum(count // 2 + 1, MIN_FLIGHT), np.inf)
        side = replace(side, used=side.used * (ranked(side.used, way) <= most[:, None]))
    return side


def _is_flight(side: _Side, sigma: np.ndarray, stray: np.ndarray, gravity: float, settings: ArcSettings) -> np.ndarray:
    """Mask (m,) of sides with enough samples that lie on a parabola and fall."""
    resting = side.q.copy()
    resting[..., 1] -= 0.5 * gravity * side.t**2
    count, chi2, bent = _line(side, sigma, stray, settings.arc_deviation)
    rest = _line(replace(side, q=resting), sigma, 0.0 * stray, settings.arc_deviation)[1]
    return (count >= MIN_FLIGHT) & ~bent & (rest[:, 1] - chi2[:, 1] > -_REST)


def clearance_in_plane(samples: Samples, noise: NoiseEstimate, header: Header) -> tuple[np.ndarray, np.ndarray]:
    """Gap (N,) of the believed planar body at each sample, without the effect of the air, and its one sigma."""
    sigma, q = noise.used * np.sqrt(noise.colour), samples.without_air()
    r = header.body.shape.contact_point(q[:, 2])
    return q[:, 1] + r[:, 1] - header.surface.height, np.hypot(sigma[1], r[:, 0] * sigma[2])


def _is_clear(used: np.ndarray, way: int, gap: np.ndarray, sigma: np.ndarray, level: float) -> np.ndarray:
    """Mask (m,) of sides whose body is off the surface at all samples (m, W) except the first and the last.

    A weak hit between few samples bends their path too little to show, but the body must come down for it.  `level`
    in m is the gap at which bodies hit; it is not 0 if surface or size are wrong.
    """
    order = ranked(used, way)
    inner = (used > 0) & (order > 1) & (order < used.sum(1)[:, None])
    return (~inner | (gap - level > _CLEAR * sigma)).all(1)
