"""Evidence that a hit does not stand alone between two free flights.

Another hit in the window, hops where samples are rounded, and balls that only seem to bounce.
"""

import numpy as np
from scipy.stats import chi2

from thesis_lib.datasets.flights.beside_hits import turns_off
from thesis_lib.datasets.flights.lines import SideLines, lines_through
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.statistics.spread import robust_std

IMPROBABLE = 1e-6  # of χ² without another hit in the window
CLEAN = 0.25  # share of the hits that usually have no other one in their window
SLACK = 4.0  # of χ², for slow errors, where fewer are clean
CLEANEST = 0.05  # share of the hits that have no other one in their window, at least
CHANCE = 1e-3  # of χ² of a hit that is as clean as those
COMMON = (0.1, 1.0, 1.0, 0.3)  # m, m/s², 1/s and 1/m: one sigma of what all hits share before they are seen
ODD, ROUNDS = 3.0, 5  # misfits of a clean hit, from which on one has no say in that; fits of it
DEEP, UNSEEN_HOP = 5.0, 0.25  # robust standard deviations, and share of the guard, by which a body has hopped unseen
RISE = 0.15  # m/s between hits of a ball; a wrong centre of mass moves speeds by some 0.05 m/s


def off_free_motion(
    fitted: SideLines,
    pose: np.ndarray,
    tau: np.ndarray,
    used: np.ndarray,
    G: np.ndarray,
    gravity: float,
    noise: tuple[float, float],
    lag: float,
) -> tuple[np.ndarray, np.ndarray]:
    """χ² (n, 2) by which places and turns miss free motion on both sides and its meeting, and degrees of freedom (n,).

    What all hits share, another centre of mass, gravity or drag, counts as no misfit.  The places may not meet along
    Δv, which the instant takes up, and turns that come `lag` in s behind them meet later.
    """
    off, dof = np.zeros((len(tau), 2)), 3.0 * used.sum((1, 2)) - 10.0  # 12 parameters, 2 of the places meet
    if not len(tau):
        return off, off
    fall = 0.5 * gravity * np.array([0.0, 0.0, 1.0])
    side = used * 1.0
    places = lines_through(side, tau, pose[:, :, :3] + fall * (tau**2)[..., None])
    miss, dv = (part[:, 1] - part[:, 0] for part in (places.value, places.slope))
    along = dv / np.maximum(np.linalg.norm(dv, axis=-1), 1e-9)[:, None]
    place = np.sqrt(fitted.cov[:, :, [0, 2, 4], [0, 2, 4]].sum(axis=1).mean(axis=1))

    def in_sigmas(residual: np.ndarray, miss: np.ndarray) -> np.ndarray:
        inside = (used[..., None] * residual).reshape(len(tau), -1, 3, residual.shape[-1] // 3) / noise[0]
        miss = miss.reshape(len(tau), 3, -1)
        aside = miss - along[:, :, None] * np.einsum("ni,nik->nk", along, miss)[:, None]
        return np.concatenate([inside.reshape(len(tau), -1, miss.shape[2]), aside / place[:, None, None]], axis=1)

    common = lines_through(side, tau, _common_paths(pose, tau, places.slope))
    left = in_sigmas(places.residual, miss)[..., 0]
    left = _without_common(left, in_sigmas(common.residual, common.value[:, 1] - common.value[:, 0]), dof)
    off[:, 0] = (left**2).sum(axis=1)
    for side in (0, 1):
        off[:, 1] += turns_off(fitted, side, pose, tau, used, G) / noise[1] ** 2
    turn, spun = turned(fitted)
    turn += lag * spun
    of_turn = fitted.cov[:, :, 6::2, 6::2].sum(axis=1)
    off[:, 1] += np.einsum("ni,nij,nj->n", turn, np.linalg.inv(of_turn), turn)
    return off, np.stack([dof, dof + 1.0], axis=1)


def _common_paths(pose: np.ndarray, tau: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """How places (n, W, 3 · 8) move that the centre of mass is 1 m elsewhere, by axis of the body, that gravity differs
    by 1 m/s², by axis of the surface, and that drag is 1/s or 1/m; each place has one value for each of these eight.

    `slope` (n, 2, 3) in m/s are the velocities on both sides.
    """
    axes = np.moveaxis(rotation_matrix(np.moveaxis(pose[:, :, 3:], -1, 0)), (0, 1), (2, 3))
    falls = 0.5 * (tau**2)[..., None, None] * np.eye(3)
    v = np.where((tau < 0.0)[..., None], slope[:, :1], slope[:, 1:])
    slowed = -0.5 * (tau**2)[..., None] * v
    drags = np.stack([slowed, np.linalg.norm(v, axis=2, keepdims=True) * slowed], axis=3)
    return np.concatenate([axes, falls, drags], axis=3).reshape(*tau.shape, -1)


def _without_common(off: np.ndarray, paths: np.ndarray, dof: np.ndarray) -> np.ndarray:
    """Misfits (n, r) without what one centre of mass, gravity and drag of all hits explain by `paths` (n, r, 8).

    None of them is known yet, and they would pass for noise.
    """
    prior, left = np.diag(np.repeat(COMMON, (3, 3, 1, 1)) ** -2.0), off
    for _ in range(ROUNDS):
        size = (left**2).sum(axis=1) / dof
        kept = size <= ODD * np.quantile(size, CLEANEST)
        X, y = paths[kept].reshape(-1, paths.shape[2]), off[kept].ravel()
        left = off - paths @ np.linalg.solve(X.T @ X + prior, X.T @ y)
    return left


def _of_clean(off: np.ndarray, dof: np.ndarray) -> float:
    """Median of χ² over degrees of freedom (n,) among the hits that differ from the cleanest ones by chance alone."""
    ratio, limit = off / dof, chi2.isf(CHANCE, dof) / dof
    grown = float(np.quantile(ratio, CLEANEST))
    for _ in range(ROUNDS):
        grown = max(float(np.median(ratio[ratio <= grown * limit])), grown)
    return grown


def has_another_hit(off: np.ndarray, dof: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether the samples beside hits (n,) are not those of two free flights, by how much more than noise (2,) all
    squares of places and turns have grown, and by how much more (2,) they still may in a free flight.

    From what `off_free_motion` returns.
    """
    if not len(off):
        return np.zeros(0, bool), np.ones(2), np.ones(2)
    # noise beyond what is believed shows in all hits, another hit in many: boxes that land on an edge rattle
    grown = np.array([max(_of_clean(*one), 1.0) for one in zip(off.T, dof.T)])
    # a filter leaves as much noise in a line, but in fewer degrees of freedom
    free = np.quantile(off / chi2.ppf(CLEAN, dof), CLEAN, axis=0)
    # slow errors of a camera are more than noise says, too, and less than another hit, where hits are rarely clean
    slack = np.clip(np.quantile(off / dof, CLEAN, axis=0) / grown, 1.0, SLACK)
    off, dof = off / (slack * grown), dof * np.minimum(free, 1.0)
    return np.any(off > chi2.isf(IMPROBABLE, dof), axis=1), grown, slack


def hops_unseen(sunk: np.ndarray, speeds: np.ndarray, shape: np.ndarray, guard: float) -> np.ndarray:
    """Which hits (n,) are several, of a body that has hopped within the `guard` in s, where samples are rounded.

    The arcs before the first hit and after the last one then meet deep below the surface.  `sunk` (n,) in m is how
    deep, `speeds` (n, 2) in m/s are those of the contact points across the surface, before (down) and after (up), and
    `shape` (n, c) are columns by which a wrong shape would sink a body.
    """
    usual = np.ones(len(sunk), bool)
    left = sunk - np.median(sunk) if len(sunk) else sunk
    for _ in range(ROUNDS):
        if usual.sum() <= shape.shape[1]:
            return np.zeros(len(sunk), bool)
        left = sunk - shape @ np.linalg.lstsq(shape[usual], sunk[usual], rcond=None)[0]
        usual = np.abs(left) <= ODD * float(robust_std(left - np.median(left)))
    lasts = left * (1.0 / np.maximum(speeds, 1e-3)).sum(axis=1)
    return (left > DEEP * float(robust_std(left - np.median(left)))) & (lasts > UNSEEN_HOP * guard)


def rolls(speeds: np.ndarray, at: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """Which of the hits (N,) of a ball come from its first rise on in their trial.

    `speeds` (n, 2) are those of the hits `at` (n,) across the surface, before and after.
    """
    rises = np.zeros(len(trial), int)
    rises[at] = _risen(speeds, trial[at])
    count = np.r_[0, rises.cumsum()]
    return count[1:] > count[np.searchsorted(trial, trial)]


def _risen(speeds: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """At which hits (n,) of a ball its speed across the surface (n, 2), before and after a hit, has risen.

    A ball bounces lower and lower, and then it rolls.  Where it is not tracked in its middle and its turns are misread,
    a ball that rolls seems to rise and to fall.
    """
    up = np.zeros(len(speeds), bool)
    for one in np.unique(trial):
        here = np.flatnonzero(trial == one)
        series = speeds[here].ravel()
        rises = series[1:] - np.minimum.accumulate(series)[:-1] > RISE
        up[here] = np.r_[False, rises].reshape(-1, 2).any(axis=1)
    return up


def turned(fitted: SideLines) -> tuple[np.ndarray, np.ndarray]:
    """Turns (n, 3) in rad from the attitudes before hits to those after, and changes (n, 3) of the spin in rad/s."""
    turn = SPACE.turn_between(fitted.value[:, 0, 3:].T, fitted.value[:, 1, 3:].T).T
    return turn, fitted.slope[:, 1, 3:] - fitted.slope[:, 0, 3:]
