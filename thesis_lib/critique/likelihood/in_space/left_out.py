"""Evidence that a hit is not a single hit between two free flights.

Checks for another hit in the window, unobserved hops where samples are rounded, and balls that only appear to bounce.
"""

import numpy as np
from scipy.stats import chi2

from thesis_lib.datasets.flights.beside_hits import turns_off
from thesis_lib.datasets.flights.lines import SideLines, lines_through
from thesis_lib.mechanics.space import SPACE, rotation_matrix
from thesis_lib.statistics.spread import robust_std

IMPROBABLE = 1e-6  # probability of a larger χ² without another hit in the window
CLEAN = 0.25  # fraction of the hits that usually have no other hit in their window
SLACK = 4.0  # factor on χ², for slow errors, if fewer hits are clean
CLEANEST = 0.05  # least fraction of the hits that have no other hit in their window
CHANCE = 1e-3  # probability of a larger χ² of an equally clean hit
COMMON = (0.1, 1.0, 1.0, 0.3)  # m, m/s², 1/s and 1/m: prior sigmas of errors common to all hits
ODD, ROUNDS = 3.0, 5  # ratio to the misfit of clean hits beyond which a hit is excluded; iterations
DEEP, UNSEEN_HOP = 5.0, 0.25  # robust standard deviations, and fraction of the guard, that indicate an unseen hop
RISE = 0.15  # m/s between hits of a ball; a wrong centre of mass changes speeds by about 0.05 m/s


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
    """χ² (n, 2) of positions and turns against continuous free motion on both sides, and degrees of freedom (n, 2).

    Errors common to all hits (centre of mass, gravity, drag) do not count as misfit.  A gap of the positions along Δv
    is ignored, because it belongs to the instant; turns with the `lag` in s behind positions meet later.
    """
    off, dof = np.zeros((len(tau), 2)), 3.0 * used.sum((1, 2)) - 10.0  # 12 parameters, 2 constraints
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
    """Changes (n, W, 3 · 8) of positions: if the centre of mass is shifted by 1 m (3 body axes), gravity by 1 m/s²
    (3 surface axes), and if drag is 1/s or 1/m; 8 values for each component of a position.

    `slope` (n, 2, 3) in m/s are the velocities on both sides.
    """
    axes = np.moveaxis(rotation_matrix(np.moveaxis(pose[:, :, 3:], -1, 0)), (0, 1), (2, 3))
    falls = 0.5 * (tau**2)[..., None, None] * np.eye(3)
    v = np.where((tau < 0.0)[..., None], slope[:, :1], slope[:, 1:])
    slowed = -0.5 * (tau**2)[..., None] * v
    drags = np.stack([slowed, np.linalg.norm(v, axis=2, keepdims=True) * slowed], axis=3)
    return np.concatenate([axes, falls, drags], axis=3).reshape(*tau.shape, -1)


def _without_common(off: np.ndarray, paths: np.ndarray, dof: np.ndarray) -> np.ndarray:
    """Misfits (n, r) minus the part that a common centre of mass, gravity and drag explain with `paths` (n, r, 8).

    These are not known yet, and would otherwise appear as noise.
    """
    prior, left = np.diag(np.repeat(COMMON, (3, 3, 1, 1)) ** -2.0), off
    for _ in range(ROUNDS):
        size = (left**2).sum(axis=1) / dof
        kept = size <= ODD * np.quantile(size, CLEANEST)
        X, y = paths[kept].reshape(-1, paths.shape[2]), off[kept].ravel()
        left = off - paths @ np.linalg.solve(X.T @ X + prior, X.T @ y)
    return left


def _of_clean(off: np.ndarray, dof: np.ndarray) -> float:
    """Median of χ² per degree of freedom among the hits (n,) that are consistent with the cleanest ones."""
    ratio, limit = off / dof, chi2.isf(CHANCE, dof) / dof
    grown = float(np.quantile(ratio, CLEANEST))
    for _ in range(ROUNDS):
        grown = max(float(np.median(ratio[ratio <= grown * limit])), grown)
    return grown


def has_another_hit(off: np.ndarray, dof: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Whether the samples around hits (n,) deviate from two free flights; factors (2,) by which all squares of
    positions and turns exceed the noise; further factors (2,) allowed in a free flight.

    The arguments are the results of `off_free_motion`.
    """
    if not len(off):
        return np.zeros(0, bool), np.ones(2), np.ones(2)
    # excess noise affects all hits, another hit only some, though many: boxes that land on an edge rattle
    grown = np.array([max(_of_clean(*one), 1.0) for one in zip(off.T, dof.T)])
    # a filter preserves the noise of a line, but with fewer degrees of freedom
    free = np.quantile(off / chi2.ppf(CLEAN, dof), CLEAN, axis=0)
    # slow errors of a camera also exceed the noise, but less than another hit, if hits are rarely clean
    slack = np.clip(np.quantile(off / dof, CLEAN, axis=0) / grown, 1.0, SLACK)
    off, dof = off / (slack * grown), dof * np.minimum(free, 1.0)
    return np.any(off > chi2.isf(IMPROBABLE, dof), axis=1), grown, slack


def hops_unseen(sunk: np.ndarray, speeds: np.ndarray, shape: np.ndarray, guard: float) -> np.ndarray:
    """Mask (n,) of hits that are several hits of a body that hopped within the `guard` in s, where samples are rounded.

    The arcs before the first hit and after the last hit then meet far below the surface.  `sunk` (n,) in m is this
    depth, `speeds` (n, 2) in m/s are the normal speeds of the contact points, before (down) and after (up), and `shape`
    (n, c) are regressors for the depth due to a wrong shape.
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
    """Mask (N,) of the hits of a ball from the first increase of its speed on, in each trial.

    `speeds` (n, 2) are the normal speeds before and after the hits `at` (n,).
    """
    rises = np.zeros(len(trial), int)
    rises[at] = _risen(speeds, trial[at])
    count = np.r_[0, rises.cumsum()]
    return count[1:] > count[np.searchsorted(trial, trial)]


def _risen(speeds: np.ndarray, trial: np.ndarray) -> np.ndarray:
    """Mask (n,) of hits of a ball at which its normal speed (n, 2), before and after a hit, has increased.

    A ball bounces lower and lower, and then rolls.  If the tracked point is not its centre and its turns are misread, a
    rolling ball appears to rise and fall.
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
