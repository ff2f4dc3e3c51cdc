"""Episodes in space: sequences of hits between two observed motions (`clear_flights`).

Hits with too few samples between them are combined as in the plane (`datasets/impacts/episodes.py`).  Two hits between
two samples appear as one.  They are detected by the corners: the flight before, extrapolated forwards, touches the
surface with one corner, and the flight after, extrapolated backwards, with another; if two corners are within `LEVEL`,
it may be either.  A body that hits with one corner, another, and the first again leaves later than others.
"""

import numpy as np
import pandas as pd
from scipy.stats import theilslopes

from thesis_lib.critique.likelihood.in_space.clear_flights import Poses, jump_across, state_under_gravity
from thesis_lib.critique.likelihood.in_space.ground import SeenRig
from thesis_lib.critique.likelihood.observations import LATE, LONGEST_WAIT, Observations, single_hits, with_episodes
from thesis_lib.datasets.impacts.episodes import groups_of_hits
from thesis_lib.mechanics.free_motion import flown
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.spread import robust_std

LEVEL = 1e-3  # m between two corners: three standard deviations of the height of an extrapolated corner
LOOK = 1e-4  # s between the poses that are tested for a touch
OUTLASTS, FEWEST = 4.0, 10  # robust standard deviations for longer contacts; least number of hits
EDGE = 1e-6  # s; nearer instants belong to the same sample
HARD = 0.4  # m/s: weaker hits are not assigned a kind of contact
OFF_SURFACE = 0.25  # extents of the body from most hits: a hand, a wall, another body, the table's edge
ELSEWHERE = "off_surface"  # reason for hits that cannot be part of an episode


def add_episodes(
    single: Observations,
    poses: Poses,
    hits: pd.DataFrame,
    windows: pd.DataFrame,
    beside: pd.DataFrame,
    touching: tuple[float, float],
) -> Observations:
    """Single hits and episodes, sorted by trial and time; hits in episodes no longer count as left out.

    Args:
        poses: poses of the centre of mass, in the frame of the surface.
        hits: all detected hits, sorted by trial and time, with trial, impact, t (s) and reason ("" for single hits).
        windows: for the single hits the times `start` of the last sample before and `end` of the first sample after in
            s, and the numbers of samples `n_pre` and `n_post`.
        beside: motion observed beside all hits (`seen_beside`).
        touching: lowest and highest gap in m at which the believed body touches.
    """
    if not len(hits):
        return single
    rig, samples = poses.rig, poses.samples
    alone = pd.DataFrame({"trial": single.trial, "impact": single.impact, "last": single.impact}).join(windows)
    for name, edge in (("pre", "start"), ("post", "end")):
        alone[f"row_{name}"] = samples.position(single.trial, alone[edge].to_numpy() - EDGE)
        alone[f"clear_{name}"] = True
    twice = _hits_twice(poses, alone)
    table = pd.concat([_not_single(poses, hits, beside), alone[twice]], ignore_index=True)
    if not len(table):
        return single
    start, n_pre, clear_pre, end, n_post, clear_post = (
        table[f"{name}_{side}"].to_numpy() for side in ("pre", "post") for name in ("row", "n", "clear")
    )
    before = state_under_gravity(poses.side(start, n_pre, -1, samples.t[start], clear_pre)[0], rig)
    t = samples.t[start] + _touch(rig, before, 1)[0]
    # as in the plane: a hit that a model predicts slightly late must precede the state after
    over = np.minimum(samples.t[end] + LATE, samples.t[end + (n_post - 1) // 2])
    over = np.maximum(over, t + EDGE)
    sides = [poses.side(start, n_pre, -1, t, clear_pre), poses.side(end, n_post, 1, over, clear_post)]
    good = np.all([side[1] for side in sides], axis=0)
    good &= clear_pre | (rig.gap(before) > touching[0])  # at greater depth this motion did not end in the hit
    gap = rig.gap(state_under_gravity(sides[0][0], rig))
    good &= np.abs(gap - np.mean(touching)) < OFF_SURFACE * rig.shape.extent  # a hand, a wall, another body
    names = ("value", "slope", "bow", "cov", "nodes", "weights")
    arrays = {name: np.stack([getattr(side[0], name)[:, 0] for side in sides], axis=1) for name in names}
    trial = table["trial"].to_numpy()
    first = samples.t[np.searchsorted(samples.trial, trial)]
    arrays |= single_hits(len(table), SPACE)
    arrays |= {"trial": trial, "impact": table["impact"].to_numpy(), "t": t - first, "span": over - t}
    arrays["hits"] = (table["last"] - table["impact"] + 1).to_numpy()
    kept = np.flatnonzero(good)
    others = single.rows(np.flatnonzero(~twice))
    return with_episodes(others, {name: array[kept] for name, array in arrays.items()}, table.iloc[kept])


def _not_single(poses: Poses, hits: pd.DataFrame, beside: pd.DataFrame) -> pd.DataFrame:
    """Episodes: trial, first and last hit, and the motion observed before the first and after the last hit."""
    reason, number = hits["reason"].to_numpy(), hits["impact"].to_numpy()
    first, last = groups_of_hits(hits, poses.samples.position(hits["trial"].to_numpy(), hits["t"].to_numpy())).T
    elsewhere = np.cumsum(np.r_[0, reason == ELSEWHERE])
    table = pd.DataFrame({"trial": hits["trial"].to_numpy()[first], "impact": number[first], "last": number[last]})
    for name, at in (("pre", first), ("post", last)):
        for column in (f"row_{name}", f"n_{name}", f"clear_{name}"):
            table[column] = beside[column].to_numpy()[at]
    table = table[(table["n_pre"] > 0) & (table["n_post"] > 0) & (elsewhere[last + 1] == elsewhere[first])]
    clear = (table["clear_pre"] & table["clear_post"]).to_numpy(bool)
    return table[clear | (jump_across(poses, table) > HARD)]


def _hits_twice(poses: Poses, alone: pd.DataFrame) -> np.ndarray:
    """Mask (n,) of apparently single hits that may be several hits."""
    rig, corners, t, rate = poses.rig, [], [], []
    several = np.zeros(len(alone), bool)
    if not len(alone):
        return several
    known = ~several
    for side, way in (("pre", -1), ("post", 1)):
        row, count = (alone[f"{name}_{side}"].to_numpy() for name in ("row", "n"))
        state = state_under_gravity(poses.side(row, count, way, poses.samples.t[row])[0], rig)
        tau, corner, near = _touch(rig, state, -way)
        corners.append(corner)
        several |= near
        known &= tau != 0.0  # unknown instant of touch if the body is below the surface at a sample
        t.append(poses.samples.t[row] + tau)
        rate.append(np.abs(SPACE.velocity_at(state.velocity, state.spin, rig.lowest(state))[2]))
    several |= corners[0] != corners[1]
    rows = np.flatnonzero(~several & (np.min(rate, axis=0) > 0.0))
    known = known[rows]
    if known.sum() > max(FEWEST, 0.5 * len(rows)):
        # a body that is believed too large or too high appears to touch for longer if it is slower
        lasts, slowness = (t[1] - t[0])[rows], 1.0 / rate[0][rows] + 1.0 / rate[1][rows]
        slope, middle, *_ = theilslopes(lasts[known], slowness[known])
        longer = lasts - middle - slope * slowness
        several[rows] = longer > OUTLASTS * robust_std(longer[known])
    return several


def _touch(rig: SeenRig, state: State, way: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times (n,) in s at which believed bodies reach the surface, forwards (`way` 1) or backwards (−1); the corner
    (n,), and whether another corner is near."""
    tau = way * np.arange(0.0, LONGEST_WAIT, LOOK)
    free = flown(state.pose, state.motion, np.asarray(rig.tensor), rig.fall(state)[:3], tau)
    k, n = len(tau), len(state)
    later = state.select(np.tile(np.arange(n), k)).with_pose(free.pose.reshape(7, -1))
    heights = rig.heights(later).reshape(-1, k, n)
    below = heights.min(axis=0) < 0.0
    at = np.where(below.any(axis=0), below.argmax(axis=0), 0)
    there = heights[:, at, np.arange(n)]
    lowest = np.sort(there, axis=0)
    near = lowest[1] - lowest[0] < LEVEL if len(lowest) > 1 else np.zeros(n, bool)
    return tau[at], there.argmin(axis=0), near
