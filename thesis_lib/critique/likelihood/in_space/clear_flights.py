"""Motion of a body in space away from hits: clear flights, and samples that the surface may disturb.

The samples of a clear flight are too high to touch the surface, and follow a single free motion at each end.  Between
weak hits a box often rocks on an edge, where each corner touches too weakly to be detected.  Then a force f per unit
mass, constant over a few samples and of the order of gravity, acts at the lowest point r,

    (a, α) = (f, G⁻¹ (r × f)),    f ~ N(0, diag(`WEIGHT` g)²)

It is estimated together with the motion, and its uncertainty widens the covariance of the motion.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.stats import chi2

from thesis_lib.critique.likelihood.in_space.ground import SeenRig
from thesis_lib.critique.likelihood.observations import LONGEST_WAIT
from thesis_lib.datasets.flights.beside_hits import fit_windows, turns_left
from thesis_lib.datasets.flights.lines import SideLines, lines_through
from thesis_lib.datasets.flights.parabolas import Hits
from thesis_lib.datasets.format.samples import ArcSettings, Samples
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.inertia import in_world, mobility
from thesis_lib.mechanics.space import SPACE, cross
from thesis_lib.mechanics.state import State

FEWEST = 4  # least number of samples of a flight
CLEAR = 3.0  # sigmas by which a flying body is above the height of possible contact
SKIPPED = 3  # samples at an end of a flight that may be in contact; beyond them the flight is halved
SUPPORTED = 0.02  # s, in which the force of the surface is assumed constant
LEAST = 3  # least number of samples in this time
WEIGHT = np.array([0.4, 0.4, 1.2])  # relative to gravity, tangential and normal; above 1 because bodies bounce
IMPROBABLE = 1e-6  # probability of a larger χ² of positions and turns of a flight


@dataclass(frozen=True)
class Poses:
    """N measured poses of a body with their noise: one sigma of a position in m and of a component of a turn in rad;
    and the factor (`slack`) by which χ² of a free flight may exceed its limit."""

    samples: Samples
    states: State
    rig: SeenRig
    noise: tuple[float, float]
    slack: float = 1.0

    def side(
        self, row: np.ndarray, count: np.ndarray, way: int, at: np.ndarray, clear: np.ndarray | bool = True
    ) -> tuple[SideLines, np.ndarray]:
        """Motions through `count` (n,) samples from the rows `row` (n,) on (backwards if `way` is −1), relative to the
        instants `at` (n,) in s; and whether the motion is free or, where not `clear` (n,), supported.  Both sides of
        the windows are equal."""
        samples, rig, G = self.samples, self.rig, np.asarray(self.rig.tensor)
        size = np.arange(count.max(initial=2))  # at least two samples, also for windows without motion
        index = np.clip(row[:, None] + way * size, 0, len(samples) - 1)
        used = np.repeat((size < count[:, None])[:, None], 2, axis=1)
        pose, tau = np.moveaxis(self.states.pose[:, index], 0, -1), samples.t[index] - at[:, None]
        fitted = fit_windows(pose, tau, used, G, self.noise)
        state, bend = self.states.select(row), 0.5 * tau[..., None] ** 2
        path = np.concatenate([pose[:, :, :3] - rig.fall(state)[:3].T[:, None] * bend, bend], axis=2)
        straight = lines_through(used * 1.0, tau, path).residual[:, 0] * used[:, 0, :, None]
        left = np.concatenate([straight[..., :3], turns_left(fitted, 0, pose, tau, used, G)], axis=2)
        left, bend = left / np.repeat(self.noise, 3), straight[..., 3]
        off, dof = (left**2).sum(axis=(1, 2)), 6.0 * count - 12.0
        if not np.all(clear):
            fitted, less = self._supported(fitted, state, left, bend, ~np.broadcast_to(clear, len(row)))
            off, dof = off - less, dof - 3.0 * (less > 0.0)
        return fitted, off < self.slack * chi2.isf(IMPROBABLE, np.maximum(dof, 1.0))

    def _supported(
        self, fitted: SideLines, state: State, left: np.ndarray, bend: np.ndarray, rows: np.ndarray
    ) -> tuple[SideLines, np.ndarray]:
        """Windows with a force of the surface in some `rows` (n,), and the decrease of χ² (n,) due to it.

        Args:
            left: (n, W, 6) residuals of positions and turns from free motion, in standard deviations.
            bend: (n, W) residuals of τ²/2 from a line.
        """
        n, r = len(rows), self.rig.lowest(state)
        units = np.repeat(np.eye(3)[..., None], n, axis=2)  # unit forces
        turning = mobility(SPACE, np.asarray(self.rig.tensor), state.attitude)
        by_force = [np.concatenate([f, np.einsum("ijn,jn->in", turning, cross(r, f))]).T for f in units]
        change = np.stack(by_force, axis=2)  # (n, 6, 3): accelerations by forces
        seen = change / np.repeat(self.noise, 3)[:, None]
        pull = np.einsum("nik,nw,nwi->nk", seen, bend, left)
        known = (bend**2).sum(axis=1)[:, None, None] * np.einsum("nik,nil->nkl", seen, seen)
        cov = np.linalg.inv(known + np.diag((WEIGHT * self.rig.gravity) ** -2.0))
        force = np.einsum("nkl,nl->nk", cov, pull) * rows[:, None]
        a, bow = np.einsum("nik,nk->ni", change, force), fitted.bow[:, 0]
        spread = np.einsum("nik,nkl,njl->nij", change, cov * rows[:, None, None], change)
        unknown = np.einsum("nij,na,nb->niajb", spread, bow, bow).reshape(n, 1, 12, 12)
        moved = (SPACE.shift(fitted.value[:, 0].T, -(bow[:, :1] * a).T).T)[:, None]
        fitted = replace(
            fitted,
            value=np.repeat(moved, 2, axis=1),
            slope=fitted.slope - (bow[:, 1:] * a)[:, None],
            cov=fitted.cov + unknown,
        )
        return fitted, 2.0 * (force * pull).sum(axis=1) - np.einsum("nk,nkl,nl->n", force, known, force)


@dataclass(frozen=True)
class BetweenHits:
    """Rows (m, 2) of the first and last sample of each stretch without hits or lost frames, by trial and time; for the
    clear flights at its two ends, the row (m, 2) nearest to the end and the number of samples (m, 2) on the free
    motion, 0 without a flight."""

    stretch: np.ndarray
    flight: np.ndarray
    count: np.ndarray

    @classmethod
    def of(cls, poses: Poses, hits: Hits, low: float, settings: ArcSettings) -> "BetweenHits":
        """Stretches between `hits`; bodies that are three sigmas higher than `low` in m are clear."""
        samples, rig, (place, turn) = poses.samples, poses.rig, poses.noise
        r, number = rig.lowest(poses.states), hits.before(samples.trial, samples.t)
        free = np.ones(len(samples), bool)
        for hit in (number - 1, number):
            free &= np.abs(hits.instants(hit, samples.trial, np.inf) - samples.t) > settings.guard
        ends = (np.diff(samples.run) != 0) | (np.diff(number) != 0)
        clear = free & (rig.gap(poses.states) - low > CLEAR * np.hypot(place, np.hypot(r[0], r[1]) * turn))
        stretch, flights = (_stretches(mask, ends) for mask in (free, clear))
        flights = flights[flights[:, 1] - flights[:, 0] + 1 >= FEWEST]
        edge, count = (
            np.stack(part, axis=1)
            for part in zip(*(_end(poses, flights, side, settings.max_window) for side in (0, 1)))
        )
        at, found = np.zeros_like(stretch), np.zeros_like(stretch)
        of = np.searchsorted(stretch[:, 0], flights[:, 0], side="right") - 1
        for side, order in ((0, slice(None, None, -1)), (1, slice(None))):  # the value set last is nearest to the end
            rows = np.flatnonzero(count[:, side])[order]
            at[of[rows], side], found[of[rows], side] = edge[rows, side], count[rows, side]
        return cls(stretch, at, found)


def _stretches(mask: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """First and last rows (k, 2) where `mask` (N,) is set, cut after the rows in which `ends` (N − 1,) is."""
    last = np.flatnonzero(np.r_[ends | (mask[1:] != mask[:-1]), True][: len(mask)])
    first = np.r_[0, last[:-1] + 1][: len(last)]
    return np.stack([first, last], axis=1)[mask[first]]


def _end(poses: Poses, bounds: np.ndarray, side: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Row (m,) at one end, first (0) or last (1), of flights between the rows `bounds` (m, 2) from which samples follow
    a free motion, and their number; 0 if there are none."""
    length, way = bounds[:, 1] - bounds[:, 0] + 1, 1 - 2 * side
    edge, count = bounds[:, side].copy(), np.zeros(len(bounds), int)
    left = np.arange(len(bounds))
    while most >= FEWEST and len(left):
        for skipped in range(SKIPPED + 1):
            left = left[length[left] - skipped >= FEWEST]
            if not len(left):
                break
            row, size = bounds[left, side] + way * skipped, np.minimum(length[left] - skipped, most)
            good = poses.side(row, size, way, poses.samples.t[row])[1]
            edge[left[good]], count[left[good]] = row[good], size[good]
            left = left[~good]
        most //= 2
    return edge, count


def seen_beside(poses: Poses, hits: pd.DataFrame, low: float, settings: ArcSettings) -> pd.DataFrame:
    """Motion observed before ("pre") and after ("post") each hit: row of the nearest sample, number of samples on the
    motion (0 if none), and whether the motion is a clear flight."""
    samples, trial, t = poses.samples, hits["trial"].to_numpy(), hits["t"].to_numpy()
    between = BetweenHits.of(poses, Hits(trial, t, np.ones(len(t), bool)), low, settings)
    if not len(hits):
        return pd.DataFrame(
            {f"{name}_{side}": [] for side in ("pre", "post") for name in ("row", "n", "clear")}, dtype=int
        )
    most = max(LEAST, round(SUPPORTED / float(np.median(np.diff(samples.t)))) + 1)
    after = samples.position(trial, t)
    bounds = np.r_[0, after, len(samples)]
    table = {}
    for name, end, at in (
        ("pre", 1, np.searchsorted(between.stretch[:, 1], after) - 1),
        ("post", 0, np.searchsorted(between.stretch[:, 0], after)),
    ):
        at = np.clip(at, 0, len(between.stretch) - 1)
        row, length = between.stretch[at, end], np.diff(between.stretch[at], axis=1)[:, 0] + 1
        flight, count = between.flight[at, end], between.count[at, end]
        clear = (count > 0) & (np.abs(samples.t[flight] - t) < LONGEST_WAIT)
        row, count = np.where(clear, flight, row), np.where(clear, count, np.minimum(length, most))
        low_row, high_row = (bounds[:-2], after) if name == "pre" else (after, bounds[2:])
        near = (low_row <= row) & (row < high_row) & (samples.trial[row] == trial)
        near &= (np.abs(samples.t[row] - t) < LONGEST_WAIT) & (count >= LEAST)
        count[~near] = 0
        kinked = np.flatnonzero(near)
        kinked = kinked[~poses.side(row[near], count[near], 1 - 2 * end, samples.t[row[near]], clear[near])[1]]
        count[kinked] = LEAST
        table |= {f"row_{name}": row, f"n_{name}": count, f"clear_{name}": clear}
    return pd.DataFrame(table)


def jump_across(poses: Poses, beside: pd.DataFrame) -> np.ndarray:
    """Change of motion √(|Δv|² + Δωᵀ G Δω) (n,) in m/s, with the believed inertia per mass G; NaN where not
    observed."""
    jump, seen = np.full(len(beside), np.nan), np.flatnonzero((beside[["n_pre", "n_post"]] > 0).all(axis=1))
    states = []
    for name, way in (("pre", -1), ("post", 1)):
        row, count, clear = (beside[f"{column}_{name}"].to_numpy()[seen] for column in ("row", "n", "clear"))
        windows = poses.side(row, count, way, poses.samples.t[row], clear)[0]
        states.append(state_under_gravity(windows, poses.rig))
    G = in_world(np.asarray(poses.rig.tensor), states[0].attitude)
    dv, dw = states[1].velocity - states[0].velocity, states[1].spin - states[0].spin
    jump[seen] = np.sqrt((dv**2).sum(axis=0) + np.einsum("in,ijn,jn->n", dw, G, dw))
    return jump


def jumps(poses: Poses, hits: pd.DataFrame, beside: pd.DataFrame) -> np.ndarray:
    """`jump_across` (n,) each hit; hits with too few samples between them have the jump from before the first to after
    the last."""
    trial, order = hits["trial"].to_numpy(), np.arange(len(hits))
    other = np.flatnonzero(np.diff(trial)) + 1 if len(trial) else order
    ends = np.zeros((2, len(hits)), bool)
    ends[0, [0, *other][: len(hits)]] = ends[1, [*(other - 1), -1][: len(hits)]] = True
    n_pre, n_post = (beside[name].to_numpy() > 0 for name in ("n_pre", "n_post"))
    first = np.maximum.accumulate(np.where(ends[0] | n_pre, order, 0))
    last = np.minimum.accumulate(np.where(ends[1] | n_post, order, len(hits))[::-1])[::-1]
    sides = [beside.filter(like=name).iloc[at].reset_index(drop=True) for name, at in (("pre", first), ("post", last))]
    return jump_across(poses, pd.concat(sides, axis=1))


def state_under_gravity(windows: SideLines, rig: Rig) -> State:
    """States at the instants of the windows, under believed gravity."""
    none = np.zeros(len(windows.value))
    state = State.of(windows.value[:, 0], windows.slope[:, 0], none, none, None, rig.space)
    return under_gravity(state, windows.bow[:, 0], rig)


def under_gravity(lines: State, bow: np.ndarray, rig: Rig) -> State:
    """Poses and motions of `lines` under the believed acceleration; `bow` (n, 2): lines through τ²/2 (`lines.py`)."""
    a, (b_0, b_1) = rig.fall(lines)[:3], bow.T
    return lines.changed(position=lines.position - a * b_0, velocity=lines.velocity - a * b_1)
