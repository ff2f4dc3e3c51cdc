"""Where the centre of mass is in the tracked frame, and where gravity points, both from free flights alone.

    p(t) + R(t) c = a + b t + g t²/2        in each flight

is linear in c, g and the a, b of each flight.  Before any flight is known, it holds for second derivatives as local
parabolas give them: p̈ + R̈ c = g, exactly, in each window without a contact.  Three windows drawn at random give c and
g; the draw that most windows agree with finds the flights.

| on paper | in code   | unit | shape     | axes                                              |
|----------|-----------|------|-----------|---------------------------------------------------|
| p        | `position`| m    | (n, 3)    | recording: origin of the tracked frame            |
| R        | `R`       | 1    | (n, 3, 3) | tracked frame into the recording's                |
| c        | `centre`  | m    | (3,)      | tracked frame: centre of mass                     |
| g        | `gravity` | m/s² | (3,)      | recording                                         |

Source of the search: Fischler and Bolles, Commun. ACM 24 (1981), doi:10.1145/358669.358692.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.datasets.space.flights import NEAR_G, find_flights, follow, parabolas
from thesis_lib.foundation.errors import UserError

WINDOW = 0.03  # s, half of a window of the search at least: the rotation must show in it
DRAWS, MOST_WINDOWS = 3000, 1500  # of the search
FAR = 0.1  # m, one sigma of c in a draw; keeps c near 0 where nothing turns
UNSEEN = 1.0  # m, one sigma of c before the flights are seen
ROUNDS = 3  # flights are found again with the centre that they gave
ODD = 3.0  # median misfits of a flight, from which on it is left out


@dataclass(frozen=True, eq=False)
class FallingBody:
    """What the flights of a body say; `covariance` (6, 6) is of c and g, `path` (n, 3) in m that of the centre."""

    centre: np.ndarray
    gravity: np.ndarray
    covariance: np.ndarray
    flights: list[slice]
    path: np.ndarray


def falling_body(t: np.ndarray, position: np.ndarray, R: np.ndarray, gravity: float) -> FallingBody:
    """Centre of mass and direction of gravity from whole poses at rising times `t` (n,) in s.

    Args:
        gravity: its believed size in m/s².

    Raises:
        UserError: nothing in it falls so.
    """
    track = follow(t, position, gravity)
    step = float(np.median(np.diff(t)))
    found = _search(
        t, np.concatenate([position, R.reshape(-1, 9)], axis=1), max(track.half, int(WINDOW / step)), gravity
    )
    if found is None:
        raise UserError(f"no free flight is in it: nowhere does a point of the body accelerate by {gravity:g} m/s².")
    c, g = found
    for _ in range(ROUNDS):
        path = position + R @ c
        flights = find_flights(follow(t, path, gravity), gravity * g / np.linalg.norm(g))
        if not flights:
            raise UserError("no free flight is long enough to say where the centre of mass is.")
        c, g, covariance, flights = _fitted(t, position, R, flights)
    return FallingBody(c, g, covariance, flights, position + R @ c)


def _search(t: np.ndarray, poses: np.ndarray, half: int, gravity: float) -> tuple[np.ndarray, np.ndarray] | None:
    """c and g with which most windows fall; None if none does."""
    a = parabolas(t, poses, half, float(np.median(np.diff(t))))[1]
    # of long recordings most is rest and a hand's carrying, which hardly accelerates
    a = a[np.isfinite(a).all(axis=1) & (np.linalg.norm(a[:, :3], axis=1) > NEAR_G * gravity)]
    rng = np.random.default_rng(0)  # the answer is that of the data
    if len(a) < 3:
        return None
    if len(a) > MOST_WINDOWS:
        a = a[np.sort(rng.choice(len(a), MOST_WINDOWS, replace=False))]
    y, A = a[:, :3], a[:, 3:].reshape(-1, 3, 3)
    M = np.concatenate([A, np.broadcast_to(-np.eye(3), A.shape)], axis=2)  # M (c, g) = −y

    def solved(rows: np.ndarray) -> np.ndarray:  # (..., k) -> (..., 6)
        left, right = M[rows].reshape(*rows.shape[:-1], -1, 6), -y[rows].reshape(*rows.shape[:-1], -1, 1)
        turned = left.swapaxes(-1, -2)
        return np.linalg.solve(turned @ left + np.diag([FAR**-2] * 3 + [1e-9] * 3), turned @ right)[..., 0]

    x = solved(rng.integers(0, len(a), (DRAWS, 3)))
    x = x[np.abs(np.linalg.norm(x[:, 3:], axis=1) - gravity) < NEAR_G * gravity]
    agree = [np.count_nonzero(np.linalg.norm(M @ one + y, axis=1) < NEAR_G * gravity) for one in x]
    if not len(x) or max(agree) < 3:
        return None
    best = x[int(np.argmax(agree))]
    for _ in range(10):
        best = solved(np.flatnonzero(np.linalg.norm(M @ best + y, axis=1) < NEAR_G * gravity))
    return best[:3], best[3:]


def _fitted(t: np.ndarray, position: np.ndarray, R: np.ndarray, flights: list[slice]):
    """c, g, their covariance and the flights that agree, by least squares over all of them."""
    parts = []
    for flight in flights:
        rows = slice(flight.start + 1, flight.stop - 1)  # the sample beside a contact may lie within it
        s = t[rows] - t[rows].mean()
        line = np.linalg.qr(np.stack([np.ones_like(s), s], axis=1))[0]
        values = np.concatenate([position[rows], R[rows].reshape(-1, 9), 0.5 * s[:, None] ** 2], axis=1)
        values = values - line @ (line.T @ values)
        fall = values[:, 12, None, None] * -np.eye(3)
        parts.append((np.concatenate([values[:, 3:12].reshape(-1, 3, 3), fall], axis=2).reshape(-1, 6), values[:, :3]))
    kept = np.arange(len(parts))
    for last in (False, True):
        M = np.concatenate([parts[i][0] for i in kept])
        y = np.concatenate([parts[i][1].ravel() for i in kept])
        free = max(len(y) - 6 - 6 * len(kept), 1)
        x = np.linalg.lstsq(M, -y, rcond=None)[0]
        noise = max(float(np.sqrt(np.sum((M @ x + y) ** 2) / free)), 1e-9)
        weak = np.diag([(noise / UNSEEN) ** 2] * 3 + [0.0] * 3)
        x = np.linalg.solve(M.T @ M + weak, -M.T @ y)
        misfit = np.array([np.sqrt(np.mean((m @ x + p.ravel()) ** 2)) for m, p in parts])
        if not last:
            kept = np.flatnonzero(misfit <= ODD * np.median(misfit))
    return x[:3], x[3:], noise**2 * np.linalg.inv(M.T @ M + weak), [flights[i] for i in kept]
