"""Centre of mass in the tracked frame, direction of gravity, and free rotation of a body, from free flights alone.

    p(t) + R(t) c = a + b t + g t²/2        in each flight

is linear in c, g and the a, b of each flight.  Before any flight is known, second derivatives from local parabolas are
used: p̈ + R̈ c = g holds exactly in each window without a contact.  Three windows drawn at random give c and g; the draw
that agrees with most windows finds the flights.

Without a torque the angular momentum L is constant in a flight f:

    L = R G Rᵀ ω = const,    u_f = Σ |L − its mean|² / Σ |L|²

A quaternion with its scalar in another place, or with reversed rotation, also rotates smoothly, but not like a free
body: u, the median over the flights, is then a hundredth to tenths.  For a body with three equal moments, or with a
fixed axis of rotation, flights cannot reveal this.

| on paper | in code   | unit | shape     | axes                                              |
|----------|-----------|------|-----------|---------------------------------------------------|
| p        | `position`| m    | (n, 3)    | recording: origin of the tracked frame            |
| R        | `R`       | 1    | (n, 3, 3) | tracked frame into the recording's                |
| c        | `centre`  | m    | (3,)      | tracked frame: centre of mass                     |
| g        | `gravity` | m/s² | (3,)      | recording                                         |
| G        | `G`       | m²   | (3, 3)    | tracked frame: inertia per mass                   |
| ω        |           | rad/s | (n, 3)   | recording                                         |

Source of the search: Fischler and Bolles, Commun. ACM 24 (1981), doi:10.1145/358669.358692.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.datasets.space.flights import (
    NEAR_G,
    Track,
    find_flights,
    follow,
    inner,
    inner_samples,
    parabolas,
    smoothed_turning,
)
from thesis_lib.datasets.space.motion import Motion, turning
from thesis_lib.foundation.errors import UserError

WINDOW = 0.03  # s, least half-length of a window of the search: the rotation must be visible in it
DRAWS, MOST_WINDOWS, JUDGES = 3000, 1500, 300  # of the search, and windows that judge a draw
FAR = 0.1  # m, one sigma of c in a draw; keeps c near 0 if the body does not rotate
UNSEEN = 1.0  # m, one sigma of c before the fit to the flights
BETTER = 1.3  # typical misfit of windows as stated over that of another reading, above which the other is preferred
FALLS = 0.03  # typical misfit over g below which the stated reading is accepted, even if another fits the noise better
FEWEST = 20  # windows by which readings are compared
ROUNDS = 3  # times that flights are found again with the centre of mass from the last fit
SETTLING, SETTLED = 20, 2e-3  # most times that flights are found about their fall; rad by which it may still turn
ODD = 3.0  # median misfits of a flight, from which on it is left out
# units that lengths in m may really have, and the factors to m
SCALES = {"": 1.0, "mm": 1e-3, "cm": 1e-2, "inches": 0.0254, "millimetres read as centimetres": 0.1}
MANY = 5.0  # times as many flights in another unit, from which on it is preferred
FEW_FLIGHTS, RARELY = 5, 0.25  # flights in all, and for each trial: with more, the units are right
SLOW = 1.0  # rad/s, rms: slower rotation decides nothing
UNSTEADY = 0.005  # u of a free body is far below, from noise alone; a box of 5 : 4 : 3 read wrongly has 0.01 and more
STEADIER = 0.1  # u of another reading over that of the stated one, below which the other is preferred


@dataclass(frozen=True, eq=False)
class FallingBody:
    """Fit of a body to its flights; `covariance` (6, 6) is that of c and g, `path` (n, 3) in m that of the centre."""

    centre: np.ndarray
    gravity: np.ndarray
    covariance: np.ndarray
    flights: list[slice]
    path: np.ndarray


def falling_body(t: np.ndarray, position: np.ndarray, R: np.ndarray, gravity: float) -> FallingBody:
    """Centre of mass and direction of gravity from complete poses at increasing times `t` (n,) in s.

    Args:
        gravity: believed magnitude of gravity in m/s².

    Raises:
        UserError: the recording contains no such free flight.
    """
    found = _Windows.of(t, position, gravity).falling(R)
    if found is None:
        raise UserError(f"there is no free flight: no point of the body ever accelerates by {gravity:g} m/s².")
    c, g, _ = found
    for _ in range(ROUNDS):
        path = position + R @ c
        flights = find_flights(follow(t, path, gravity), gravity * g / np.linalg.norm(g))
        if not flights:
            raise UserError("no free flight is long enough to determine the centre of mass.")
        c, g, covariance, flights = _fitted(t, position, R, flights)
    return FallingBody(c, g, covariance, flights, position + R @ c)


def reading_that_falls(motion: Motion, gravity: float) -> str:
    """Another reading of the motion with which a point of the body falls far better than as stated; "" if none.

    With wrongly read rotations only the tracked point can fall.  If that is close to the centre of mass, it falls as
    well as any reading, and this test decides nothing; torque-free rotation does (`better_reading`).
    """
    windows, off = _Windows.of(motion.t, motion.position, gravity), {}
    tracked = windows.falling(np.broadcast_to(np.eye(3), (len(motion.t), 3, 3)))
    for name, read in {"": lambda: motion.quaternion, **motion.readings}.items():
        found = windows.falling(Rotation.from_quat(read()).as_matrix())
        if found is not None:
            off[name] = np.sort(found[2])
    middle = max((np.count_nonzero(one < NEAR_G * gravity) for one in off.values()), default=0) // 2
    if middle < FEWEST:
        return ""
    best = min(off, key=lambda name: off[name][middle])
    stated = [off[""][middle]] if "" in off else []
    if tracked is not None:  # the search for the centre may have settled on a far one, with which more windows fall
        stated.append(np.sort(tracked[2])[middle])
    return "" if stated and min(stated) < max(BETTER * off[best][middle], FALLS * gravity) else best


@dataclass(frozen=True, eq=False)
class _Windows:
    """Local parabolas around some of the accelerating samples, `at`, through `half` samples on either side."""

    t: np.ndarray
    position: np.ndarray
    gravity: float
    step: float
    half: int
    at: np.ndarray
    y: np.ndarray  # (k, 3) accelerations there

    @classmethod
    def of(cls, t: np.ndarray, position: np.ndarray, gravity: float) -> "_Windows":
        step = float(np.median(np.diff(t)))
        half = max(follow(t, position, gravity).half, int(WINDOW / step))
        a = parabolas(t, position, half, step)[1]
        # most of a long recording is rest or carrying by hand, with little acceleration
        with np.errstate(invalid="ignore"):
            at = np.flatnonzero(np.linalg.norm(a, axis=1) > NEAR_G * gravity)
        if len(at) > MOST_WINDOWS:
            at = np.sort(np.random.default_rng(0).choice(at, MOST_WINDOWS, replace=False))
        return cls(t, position, gravity, step, half, at, a[at])

    def falling(self, R: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """c, g and misfits (k,) in m/s² for the centre with which the windows fall best; None if none does."""
        A = parabolas(self.t, R.reshape(-1, 9), self.half, self.step, self.at)[1][self.at].reshape(-1, 3, 3)
        y, gravity, rng = self.y, self.gravity, np.random.default_rng(0)  # fixed seed: equal data, equal answer
        if len(y) < 3:
            return None
        M = np.concatenate([A, np.broadcast_to(-np.eye(3), A.shape)], axis=2)  # M (c, g) = −y

        def solved(rows: np.ndarray) -> np.ndarray:  # (..., k) -> (..., 6)
            left, right = M[rows].reshape(*rows.shape[:-1], -1, 6), -y[rows].reshape(*rows.shape[:-1], -1, 1)
            turned = left.swapaxes(-1, -2)
            return np.linalg.solve(turned @ left + np.diag([FAR**-2] * 3 + [1e-9] * 3), turned @ right)[..., 0]

        def off(one: np.ndarray, by: int = 1) -> np.ndarray:
            return np.linalg.norm(M[::by] @ one + y[::by], axis=1)

        x = solved(rng.integers(0, len(y), (DRAWS, 3)))
        x = x[np.abs(np.linalg.norm(x[:, 3:], axis=1) - gravity) < NEAR_G * gravity]
        by, far = len(y) // JUDGES + 1, NEAR_G * gravity
        # not the number of windows that fit: a far centre may fit a few more of them, but all of them less closely
        misfits = [np.square(np.minimum(off(one, by), far)).sum() for one in x]
        best = x[int(np.argmin(misfits))] if misfits else np.zeros(6)
        if np.count_nonzero(off(best, by) < far) < 3:
            return None
        for _ in range(10):
            best = solved(np.flatnonzero(off(best) < far))
        return best[:3], best[3:], off(best)


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


def falling(
    t: np.ndarray, position: np.ndarray, gravity: float, scales: Mapping[str, float] = SCALES
) -> tuple[str, np.ndarray, int] | None:
    """Unit of length, direction (3,) and number of the flights that accelerate by `gravity` (m/s²) in any direction.

    Positions (n, 3) at increasing times t (n,) in s; None if there is no such flight.  `scales`: factors by which the
    positions may have to be multiplied, by unit; the unit "" stands for the positions as they are, which are preferred.
    """
    found: dict[str, tuple[str, np.ndarray, int]] = {}
    for unit, scale in scales.items():
        if fall := any_fall(follow(t, scale * position, gravity), gravity):
            found[unit] = unit, fall[0], len(fall[1])
    best = max(found.values(), key=lambda one: one[2], default=None)
    return found[""] if best and "" in found and best[2] < MANY * found[""][2] else best


def settled_fall(track: Track, gravity: np.ndarray) -> tuple[np.ndarray, int] | None:
    """Direction (3,) of the fall and number of the flights, from `gravity` (3,) in m/s², whose direction may be rough.

    Flights are found again about the fall of those before, until its direction settles: about a wrong direction only
    those are found that happen to lie near it.  None if there is no flight.
    """
    size, found = float(np.linalg.norm(gravity)), None
    down = gravity / size
    for _ in range(SETTLING):
        flights = find_flights(track, size * down)
        if not flights:
            break
        fall = np.nanmedian(track.a[inner_samples(flights, track)], axis=0)
        before, down = down, fall / np.linalg.norm(fall)
        found = down, len(flights)
        if np.linalg.norm(down - before) < SETTLED:
            break
    return found


def any_fall(track: Track, gravity: float) -> tuple[np.ndarray, list[slice]] | None:
    """Direction (3,) in which a track accelerates by `gravity` (m/s²), and the flights along it; None without one."""
    size = np.linalg.norm(track.a, axis=1)
    with np.errstate(invalid="ignore"):
        free = track.smooth & (np.abs(size - gravity) < NEAR_G * gravity)
    if not free.any():
        return None
    middle = np.median(track.a[free], axis=0)
    down = middle / max(float(np.linalg.norm(middle)), 1e-9)
    flights = find_flights(track, gravity * down)
    return (down, flights) if flights else None


def too_few_fall(flights: int, trials: int) -> bool:
    """Whether so few flights in so many trials may be chance, as where a unit of length is wrong."""
    return flights <= max(FEW_FLIGHTS, RARELY * trials)


def unsteadiness(motion: Motion, track: Track, flights: Sequence[slice], G: np.ndarray) -> float:
    """Unsteadiness u of the rotation as read; NaN if the body hardly rotates, or no sample has an orientation."""
    turns = turning(motion.quaternion)
    R = Rotation.from_quat(motion.quaternion).as_matrix()
    tensor = R @ G @ R.swapaxes(1, 2)
    middle = 0.5 * (tensor[1:] + tensor[:-1])
    L = smoothed_turning(np.einsum("nij,nj->ni", middle, turns), motion.t, track.half)
    shares = []
    for flight in flights:
        own = L[inner(flight, track)]
        own = own[np.isfinite(own).all(axis=1)]
        if len(own) > 2 and np.mean(np.sum(own**2, axis=1)) > (np.trace(G) / 3.0 * SLOW) ** 2:
            shares.append(float(np.sum((own - own.mean(axis=0)) ** 2) / np.sum(own**2)))
    return float(np.median(shares)) if shares else float("nan")


def better_reading(motion: Motion, track: Track, flights: Sequence[slice], G: np.ndarray) -> str:
    """Another reading with which the body rotates freely, if it does not with the stated one; "" if there is none."""
    stated = unsteadiness(motion, track, flights, G)
    if not stated > UNSTEADY:
        return ""
    others = {}
    for name, read in motion.readings.items():
        other = Motion(motion.body, motion.source, motion.t, motion.position, read())
        others[name] = unsteadiness(other, track, flights, G)
    best = min(others, key=lambda name: np.nan_to_num(others[name], nan=np.inf), default="")
    return best if best and others[best] < STEADIER * stated else ""
