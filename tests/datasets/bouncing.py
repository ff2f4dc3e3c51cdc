"""Exact bouncing flights of a planar body, for tests of detection and arc fits.

Free flight is known in closed form; an impact happens where the gap crosses zero (bisection to rounding), and
changes the velocity instantly by the impulse that gives v_n+ = −ε v_n and v_t+ = ρ v_t at the contact point.
Nothing of thesis_lib is used but the shape and the header.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.header import Header

MAX_HITS, SHORTEST = 12, 0.03  # of a record; s


@dataclass
class Flights:
    """Samples (trial, t, q with noise, exact) and the true impacts, all flat and sorted by trial and time."""

    header: Header
    trial: np.ndarray
    t: np.ndarray
    q: np.ndarray
    exact: np.ndarray
    hit_trial: np.ndarray
    hit_t: np.ndarray
    hit_q: np.ndarray
    hit_pre: np.ndarray
    hit_post: np.ndarray

    def room(self) -> np.ndarray:
        """Samples (n_hits, 2) in the flights before and after each hit."""
        at = np.searchsorted(self.trial * 1e3 + self.t, self.hit_trial * 1e3 + self.hit_t)
        begin, end = (np.searchsorted(self.trial, self.hit_trial, side) for side in ("left", "right"))
        same = np.diff(self.hit_trial) == 0
        begin[1:][same], end[:-1][same] = at[:-1][same], at[1:][same]
        return np.stack([at - begin, end - at], 1)

    def nearest(self, trial: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Index (n,) of the true hit nearest to each instant, and how far off it is in s."""
        off = np.abs((self.hit_trial * 1e3 + self.hit_t)[None] - (trial * 1e3 + t)[:, None])
        return off.argmin(1), off.min(1)

    @property
    def table(self) -> pd.DataFrame:
        """The samples as trajectories: trial, t, x, y, theta."""
        return pd.DataFrame({"trial": self.trial, "t": self.t, **dict(zip(("x", "y", "theta"), self.q.T))})


def ellipse_header(**changes: object) -> Header:
    """Header of the chapter's ellipse, 70 x 50 mm, sampled at 250 Hz; surface at 12 mm so that it matters."""
    body = {"shape": {"kind": "ellipse", "semi_axes": [0.035, 0.025]}, "radius_of_gyration": 0.0192}
    base = {"schema": 1, "body": body, "surface": {"height": 0.012}, "gravity": 9.81, "rate": 250.0}
    return Header.model_validate(base | changes)


def fly(
    header: Header,
    rng: np.random.Generator,
    trials: int,
    samples: int = 150,
    position: float = 3e-4,
    angle: float = 3e-3,
) -> Flights:
    """Drop the body `trials` times from about 0.3 m with random velocity, spin, ε and ρ.

    A record ends before the first flight of `SHORTEST` or less: no rest, no Zeno sequence.
    """
    shape, k2, g, height = (header.body.shape, header.body.radius_of_gyration**2, header.gravity, header.surface.height)
    q = np.stack(
        [rng.uniform(-0.5, 0.5, trials), height + rng.uniform(0.15, 0.4, trials), rng.uniform(-3, 3, trials)], 1
    )
    v = np.stack([rng.uniform(-0.8, 0.8, trials), rng.uniform(-1.5, 0, trials), rng.uniform(-15, 15, trials)], 1)
    epsilon, rho = rng.uniform(0.5, 0.9, trials), rng.uniform(-0.2, 1.0, trials)
    start, end = rng.uniform(0, 4e-3, trials), samples / header.rate  # the clock is not tied to the fall
    grid = np.arange(samples) / header.rate
    poses = np.zeros((trials, samples, 3))
    rows = np.arange(trials)
    hits = []
    stop = np.full(trials, np.inf)  # time at which the record ends: the flights have become too short

    def pose(dt: np.ndarray, i: np.ndarray) -> np.ndarray:
        dt = dt[:, None]
        return q[i] + v[i] * dt - [0, 0.5 * g, 0] * dt**2

    def gap(dt: np.ndarray, i: np.ndarray) -> np.ndarray:
        p = pose(dt, i)
        return shape.gap(p[:, 1], p[:, 2], height)

    time = -start
    alive = np.ones(trials, bool)
    for _ in range(MAX_HITS + 1):
        # fill what lies after this release; later flights overwrite it
        dt = grid - time[:, None]
        ahead = (dt >= 0) & alive[:, None]
        flight = q[:, None] + v[:, None] * dt[..., None]
        flight[..., 1] -= 0.5 * g * dt**2
        poses[ahead] = flight[ahead]
        # first crossing: 0.2 ms steps past the take-off, then bisection
        steps = np.arange(1, 6000) * 2e-4
        low, high, open_ = np.zeros(trials), np.full(trials, np.inf), alive.copy()
        for a in steps:
            if not open_.any():
                break
            i = rows[open_]
            hit = gap(np.full(len(i), a), i) < 0
            high[i[hit]], low[i[hit]] = a, a - 2e-4
            open_[i[hit]] = False
            open_[time + a > end] = False
        alive &= np.isfinite(high)
        i = rows[alive]
        if not len(i):
            break
        a, b = low[i], high[i]
        tired = a < SHORTEST
        stop[i[tired]] = time[i[tired]] + a[tired] - 1e-3
        alive[i[tired]] = False
        i, a, b = i[~tired], a[~tired], b[~tired]
        for _ in range(60):
            middle = 0.5 * (a + b)
            below = gap(middle, i) < 0
            a, b = np.where(below, a, middle), np.where(below, middle, b)
        q_hit = pose(a, i)
        pre = v[i] - np.stack([0 * a, g * a, 0 * a], 1)
        post = bounce(pre, shape.contact_point(q_hit[:, 2]), k2, epsilon[i], rho[i])
        time[i] += a
        q[i], v[i] = q_hit, post
        hits.append((i, time[i].copy(), q_hit, pre, post))
    trial, t, hq, hv, hw = (np.concatenate(c) for c in zip(*hits))
    stop[alive] = np.minimum(stop[alive], time[alive])  # MAX_HITS reached
    recorded = (grid < stop[:, None]).ravel()
    keep = t < grid[-1]
    order = np.lexsort((t, trial))
    order = order[keep[order]]
    exact = poses.reshape(-1, 3)
    noise = rng.normal(size=exact.shape) * [position, position, angle]
    seen, hit = (np.repeat(rows, samples), np.tile(grid, trials), exact + noise, exact), (trial, t, hq, hv, hw)
    return Flights(header, *(column[recorded] for column in seen), *(column[order] for column in hit))


def bounce(v: np.ndarray, r: np.ndarray, k2: float, epsilon: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Velocity (n, 3) after an impulse at r that gives v_n+ = −ε v_n and v_t+ = ρ v_t."""
    zero, one = np.zeros(len(r)), np.ones(len(r))
    jacobian = np.stack([np.stack([one, zero, -r[:, 1]], 1), np.stack([zero, one, r[:, 0]], 1)], 1)
    inverse_mass = np.array([1.0, 1.0, 1.0 / k2])
    v_c = np.einsum("nij,nj->ni", jacobian, v)
    wanted = np.stack([rho, -epsilon], 1) * v_c - v_c
    k = np.einsum("nij,j,nkj->nik", jacobian, inverse_mass, jacobian)
    impulse = np.linalg.solve(k, wanted[..., None])[..., 0]
    return v + np.einsum("nij,ni->nj", jacobian, impulse) * inverse_mass
