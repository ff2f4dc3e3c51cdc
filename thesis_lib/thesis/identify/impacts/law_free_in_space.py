"""Analysis of tosses of a cube without any contact law: fall, centre of mass, size, edges, inertia, and rest poses.

    python -m thesis_lib.studies.proof law-free data/measured/contactnets_cube --store

It requires a cube with the same inertia about every axis (it turns at a constant rate in free flight), even sampling,
and positions with z along the normal of the table.  All results come from straight lines, parabolas and one balance,
which are easy to check:

*Flights* are stretches in which second differences of the position are those of free fall.  The first flights of the
tosses give the acceleration of the fall and the angle of gravity from the normal of the table.  A tracked point off the
centre of mass wobbles: p = p_0 + v t + g t²/2 − R c.

*Rests.*  The last samples of a toss give the height of each face and the rotation of the tracked frame in the body: one
small rotation d changes the measured upward direction on all faces.

*Corners.*  Where flights before and after a hit meet, a box whose edges are rounded by ρ has its centre at
z = ρ + (h − ρ) s, with s = |R_31| + |R_32| + |R_33| and h half the width: the line of z over s gives both.

*Balance.*  One impulse P at the contact point r, relative to the centre of mass, gives m Δv = P and I Δω = r × P under
any law.  The misfit is the least residual over P, √(|Δv − P/m|² + |k Δω − r × P/(m k)|²); ρ, k² = I/m and c are chosen
to minimise it.  Each half of the tosses is tested with the values found from the other half.

| quantity                            | unit | meaning                                                             |
|-------------------------------------|------|---------------------------------------------------------------------|
| fall, fall_stated                   | m/s² | acceleration against the normal, first flights (median); as stated  |
| level_fall, level_fall_mean         | m/s² | acceleration along the table: median size; size of the mean         |
| level_fall_along, _across           | m/s² | its mean in axes of each throw: ahead, and to the left              |
| wobble_x, _y, _z                    | m    | centre of mass from the tracked point, from flights                 |
| rest_height                         | m    | of the tracked point over the table (median)                        |
| frame_x, _y, _z                     | rad  | rotation of the tracked axes against the faces, from rests          |
| corner_half_width, corner_rounding  | m    | half width and rounding, from heights at hits of a corner           |
| balance_rounding, _x, _y, _z        | m    | rounding and centre of mass, from the balance                       |
| balance_inertia                     | 1    | I/m over the stated value, minus 1                                  |
| misfit_stated, misfit_balanced      | m/s  | mean misfit of the balance with the body as stated, and as found    |
| friction                            | 1    | tangential over normal impulse, with the body as found (median)     |
| restitution_slow, _middle, _fast    | 1    | speed of the corner after over before, in thirds of the hits        |
| speed_slow, _middle, _fast          | m/s  | speed at which the corner approaches in these thirds                |
| and the quantities of `on_the_table` |     |                                                                     |
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solids import Box
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.table_forms import POSITION, QUATERNION
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.rows import STAMP, Rows, stamp
from thesis_lib.statistics.spread import median_error
from thesis_lib.thesis.identify.impacts import on_the_table

LOWEST = 0.5  # share of gravity's second difference: free samples deviate by less, samples of a body at rest by more
FIRST = 12  # fewest samples of a first flight
SIDE, LONGEST = 5, 8  # samples beside a hit, at least and at most
LAST, STILL = 8, (3e-4, 0.01)  # samples of a rest; largest motion in m and rad
HARD, APART = 0.4, 0.01  # m/s; m between the lowest corner and the next one
BOUNDED = 0.02  # m/s, misfit above which a hit counts less
EQUAL = 1e-6  # relative tolerance of inertias
ROUNDS = 4  # iterations to find the instant of a hit
GROUPS = 10  # groups of tosses, each left out once
COLUMNS = ("quantity", "value", "std", "unit", "n")
KEY = ("dataset", "trials", "quantity")
ROWS = Rows(Path("law_free.csv"), (*KEY, *COLUMNS[1:], *STAMP), KEY, "python -m thesis_lib.studies.proof law-free", 6)


@dataclass(frozen=True)
class _Toss:
    """One toss: times (n,), positions (n, 3) of the tracked point, attitudes, and its flights as slices."""

    trial: int
    t: np.ndarray
    p: np.ndarray
    q: Rotation
    flights: list[slice]


@dataclass(frozen=True)
class _Hits:
    """n hits on one corner: trial, lever s, height z of the tracked point in m, attitudes (n, 3, 3), the corner (n, 3)
    as signs, velocity and spin before (n, 3) and their changes (n, 3)."""

    trial: np.ndarray
    s: np.ndarray
    z: np.ndarray
    q: np.ndarray
    corner: np.ndarray
    v: np.ndarray
    w: np.ndarray
    dv: np.ndarray
    dw: np.ndarray

    def of(self, rows: np.ndarray) -> "_Hits":
        """Return the hits at `rows`."""
        return _Hits(*(getattr(self, field.name)[rows] for field in fields(self)))


def as_text(dataset: Dataset, store: Path | None = None) -> str:
    """Return the quantities as text, and store them in the table at `store` if given."""
    found = law_free(dataset)
    if store is not None:
        of_all = {"dataset": dataset.name, "trials": len(dataset.trials)} | stamp(__file__)
        ROWS.at(store).put(*(of_all | dict(zip(COLUMNS, row)) for row in found.itertuples(index=False)))
    return found.to_string(index=False, float_format="{:.5g}".format)


def law_free(dataset: Dataset) -> pd.DataFrame:
    """Quantities that tosses of a cube give without a contact law, one per row (`COLUMNS`).

    UserError if there are no trajectories, or the body is not a cube with the same inertia about every axis.
    """
    header = dataset.in_space
    G = header.body.inertia_per_mass
    half = dataset.shape.half_extents if isinstance(dataset.shape, Box) else (0.0, np.inf)
    if np.ptp(half) > 0.0 or np.abs(G / G[0, 0] - np.eye(3)).max() > EQUAL:
        raise UserError(f"{dataset.name}: this analysis needs a cube with the same inertia about every axis.")
    if dataset.trajectories is None:
        raise UserError(f"{dataset.name} has no trajectories, so flights cannot be found.")
    h, k2, g = float(half[0]), float(G[0, 0]), dataset.gravity
    tosses = _tosses(dataset.trajectories, g)
    (falls, along), wobbles = _falls(tosses), _wobbles(tosses)
    rows: list[tuple] = []

    def tell(quantity: str, found: np.ndarray | float, std: np.ndarray | float, unit: str, n: int) -> None:
        for name, value, error in zip(quantity.split(), np.atleast_1d(found), np.atleast_1d(std), strict=True):
            rows.append((name, float(value), float(error), unit, n))

    fall = -np.median(falls[:, 2])
    level = np.hypot(falls[:, 0], falls[:, 1])
    tell("fall", fall, median_error(falls[:, 2]), "m/s²", len(falls))
    tell("fall_stated", g, 0.0, "m/s²", len(falls))
    tell("level_fall", np.median(level), median_error(level), "m/s²", len(falls))
    tell("level_fall_mean", np.hypot(*falls[:, :2].mean(axis=0)), np.hypot(*_of_mean(falls[:, :2])), "m/s²", len(falls))
    tell("level_fall_along level_fall_across", along.mean(axis=0), _of_mean(along), "m/s²", len(along))
    c, std = _jackknifed(lambda kept: _wobbling([wobbles[i] for i in kept], fall), np.arange(len(wobbles)))
    tell("wobble_x wobble_y wobble_z", c, std, "m", len(wobbles))
    rests = _rests(tosses)
    tell("rest_height", np.median(rests["z"]), median_error(rests["z"].to_numpy()), "m", len(rests))
    turn, std = _jackknifed(lambda kept: _turned(rests.iloc[kept]), np.arange(len(rests)))
    tell("frame_x frame_y frame_z", turn, std, "rad", len(rests))
    hits = _hits(tosses, h, k2, fall)
    tell("half_width_stated", h, 0.0, "m", len(hits.s))
    line, std = _jackknifed(lambda kept: _line(hits.of(kept)), np.arange(len(hits.s)))
    tell("corner_half_width corner_rounding", line, std, "m", len(hits.s))
    found, std = _jackknifed(lambda kept: _balanced(hits.of(kept), h, k2), np.arange(len(hits.s)))
    tell("balance_rounding", found[0], std[0], "m", len(hits.s))
    tell("balance_inertia", found[1], std[1], "1", len(hits.s))
    tell("balance_x balance_y balance_z", found[2:], std[2:], "m", len(hits.s))
    stated = _misfit(np.zeros(5), hits, h, k2)
    tell("misfit_stated", stated.mean(), _of_mean(stated), "m/s", len(stated))
    even = hits.trial % 2 == 0
    halves = [(np.flatnonzero(part), np.flatnonzero(~part)) for part in (even, ~even)]
    seen = np.concatenate([_misfit(_balanced(hits.of(a), h, k2), hits.of(b), h, k2) for a, b in halves])
    tell("misfit_balanced", seen.mean(), _of_mean(seen), "m/s", len(seen))
    speed, back, friction = _contact(found, hits, h, k2)
    tell("friction", np.median(friction), median_error(friction), "1", len(friction))
    for name, part in zip(("slow", "middle", "fast"), np.array_split(np.argsort(speed), 3)):
        tell(f"speed_{name}", np.median(speed[part]), median_error(speed[part]), "m/s", len(part))
        tell(f"restitution_{name}", np.median(back[part]), median_error(back[part]), "1", len(part))
    rows += on_the_table.quantities([(toss.t, toss.p, toss.q) for toss in tosses])
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _tosses(table: pd.DataFrame, g: float) -> list[_Toss]:
    found = []
    for trial, rows in table.groupby("trial"):
        t, p = rows["t"].to_numpy(), rows[list(POSITION)].to_numpy()
        w, *xyz = rows[list(QUATERNION)].to_numpy().T
        step = float(np.median(np.diff(t)))
        kink = np.linalg.norm(np.diff(p, 2, axis=0) + [0.0, 0.0, g * step**2], axis=1)
        free = np.r_[False, kink < LOWEST * g * step**2, False]
        edges = np.flatnonzero(np.diff(free.astype(int)))
        # the samples beside the first and the last free sample also belong to the flight
        flights = [slice(int(a), int(b) + 2) for a, b in edges.reshape(-1, 2)]
        found.append(_Toss(int(trial), t, p, Rotation.from_quat(np.stack([*xyz, w], axis=1)), flights))  # pyright: ignore[reportArgumentType]
    return found


def _firsts(tosses: Sequence[_Toss]) -> list[tuple[np.ndarray, np.ndarray, Rotation]]:
    """Times, positions and attitudes of the flights at the beginning of tosses, without their last sample."""
    parts = []
    for toss in tosses:
        flight = toss.flights[0] if toss.flights else slice(0, 0)
        if flight.start == 0 and flight.stop - 1 >= FIRST:
            part = slice(0, flight.stop - 1)
            parts.append((toss.t[part] - toss.t[part].mean(), toss.p[part], toss.q[part]))
    return parts


def _falls(tosses: Sequence[_Toss]) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations (m, 3) in m/s² of first flights, and (m, 2) along and across the level direction of the throw."""
    fits = np.stack([np.linalg.lstsq(np.vander(t, 3), p, rcond=None)[0] for t, p, _ in _firsts(tosses)])
    a, v = 2.0 * fits[:, 0], fits[:, 1, :2]
    ahead = v / np.linalg.norm(v, axis=1, keepdims=True)
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    return a, np.stack([(a[:, :2] * way).sum(axis=1) for way in (ahead, across)], axis=1)


def _wobbles(tosses: Sequence[_Toss]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Residuals of a fit of straight motion per first flight: of −R (3 n, 3), positions (3 n,), and t²/2 upwards."""
    parts = []
    for t, p, q in _firsts(tosses):
        Q, _ = np.linalg.qr(np.vander(t, 2))

        def left(values: np.ndarray, Q: np.ndarray = Q) -> np.ndarray:
            return values - np.tensordot(Q @ Q.T, values, axes=1)

        up = 0.5 * t[:, None] ** 2 * [0.0, 0.0, 1.0]
        parts.append((left(-q.as_matrix()).reshape(-1, 3), left(p).ravel(), left(up).ravel()))
    return parts


def _wobbling(parts: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], fall: float) -> np.ndarray:
    """Centre of mass (3,) in m from the tracked point, from flights that fall along the normal of the table."""
    normal = sum(A.T @ A for A, _, _ in parts)
    return np.linalg.solve(normal, sum(A.T @ (b + fall * up) for A, b, up in parts))


def _rests(tosses: Sequence[_Toss]) -> pd.DataFrame:
    """Tosses that end at rest: height z in m, upward direction (x, y, z) in the tracked frame, and the upper face."""
    rows = []
    for toss in tosses:
        p, q = toss.p[-LAST:], toss.q[-LAST:]
        if np.ptp(p, axis=0).max() < 3.0 * STILL[0] and (q[-1] * q[0].inv()).magnitude() < STILL[1]:
            up = q.inv().apply([0.0, 0.0, 1.0]).mean(axis=0)
            side = np.zeros(3)
            side[np.abs(up).argmax()] = np.sign(up[np.abs(up).argmax()])
            rows.append((toss.trial, p[:, 2].mean(), *up, *side))
    return pd.DataFrame(rows, columns=["trial", "z", "x", "y", "up", "face_x", "face_y", "face_z"])


def _turned(rests: pd.DataFrame) -> np.ndarray:
    """Rotation d (3,) in rad from the body's axes to the tracked axes: up = f − d × f on face f."""
    up, face = rests[["x", "y", "up"]].to_numpy(), rests[["face_x", "face_y", "face_z"]].to_numpy()
    A = np.stack([-np.cross(axis, face) for axis in np.eye(3)], axis=2).reshape(-1, 3)
    return _robust(A, (up - face).ravel())


def _hits(tosses: Sequence[_Toss], h: float, k2: float, fall: float) -> _Hits:
    """Hits on one corner of the cube, between two observed flights."""
    rows = []
    signs = np.stack(np.meshgrid([1.0, -1.0], [1.0, -1.0], [1.0, -1.0], indexing="ij"), axis=-1).reshape(-1, 3)
    for toss in tosses:
        for a, b in zip(toss.flights, toss.flights[1:]):
            first, last = slice(max(a.start, a.stop - LONGEST), a.stop), slice(b.start, min(b.stop, b.start + LONGEST))
            if b.start - a.stop > 1 or min(first.stop - first.start, last.stop - last.start) < SIDE:
                continue
            at = _meeting(toss, first, last, fall)
            q = Rotation.from_rotvec(at["turn"]) * toss.q[first.stop - 2]
            low = q.apply(signs)[:, 2]
            order = np.argsort(low)
            hard = np.sqrt((at["dv"] ** 2).sum() + k2 * (at["dw"] ** 2).sum()) > HARD
            if hard and h * (low[order[1]] - low[order[0]]) > APART:
                motion = [at[name] for name in ("v", "w", "dv", "dw")]
                rows.append((toss.trial, -low[order[0]], at["p"][2], q.as_matrix(), signs[order[0]], *motion))
    return _Hits(*map(np.array, zip(*rows)))


def _meeting(toss: _Toss, first: slice, last: slice, fall: float) -> dict[str, np.ndarray]:
    """Position, rotation from the last sample but one, and changes of velocity and spin where two flights meet."""
    t, lines, dv = 0.5 * (toss.t[first.stop - 1] + toss.t[last.start]), [], np.zeros(3)
    for _ in range(ROUNDS):
        lines = []
        for part in (first, last):
            tau = toss.t[part] - t
            raised = toss.p[part] + 0.5 * fall * np.outer(tau**2, [0.0, 0.0, 1.0])
            lines.append(np.linalg.lstsq(np.vander(tau, 2), raised, rcond=None)[0])
        dv, miss = lines[1][0] - lines[0][0], lines[1][1] - lines[0][1]
        t -= (miss @ dv) / (dv @ dv)
    turns = []
    # the sample next to the hit is left out, because a median of three affects it
    parts = slice(first.start, first.stop - 1), slice(last.start + 1, last.stop)
    for part, middle in zip(parts, (first.stop - 2, last.start + 1)):
        turn = (toss.q[part] * toss.q[middle].inv()).as_rotvec()
        turns.append(np.linalg.lstsq(np.vander(toss.t[part] - t, 2), turn, rcond=None)[0])
    before = {"p": lines[0][1], "v": lines[0][0], "turn": turns[0][1], "w": turns[0][0]}
    return before | {"dv": dv, "dw": turns[1][0] - turns[0][0]}


def _line(hits: _Hits) -> np.ndarray:
    """Half width and rounding (2,) in m from a fit of z = ρ + (h − ρ) s."""
    rho, slope = _robust(np.stack([np.ones_like(hits.s), hits.s], axis=1), hits.z)
    return np.array([slope + rho, rho])


def _explained(found: np.ndarray, hits: _Hits, h: float, k2: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best impulse over m (n, 3) in m/s for ρ, excess of I/m and c in `found` (5,), its residuals (n, 6) in m/s, and
    the lever r (n, 3) in m."""
    rho, excess, c = found[0], found[1], found[2:]
    k = np.sqrt(k2 * (1.0 + excess))
    centre = np.einsum("nij,j->ni", hits.q, c)
    r = np.einsum("nij,nj->ni", hits.q, (h - rho) * hits.corner) - centre - [0.0, 0.0, rho]
    dv = hits.dv + np.cross(hits.dw, centre)
    cross = np.cross(r[:, None], np.eye(3)).swapaxes(1, 2) / k  # r × e_j in column j
    A = np.concatenate([np.broadcast_to(np.eye(3), cross.shape), cross], axis=1)
    y = np.concatenate([dv, k * hits.dw], axis=1)[..., None]
    P = np.linalg.solve(A.swapaxes(1, 2) @ A, A.swapaxes(1, 2) @ y)
    return P[..., 0], (y - A @ P)[..., 0], r


def _misfit(found: np.ndarray, hits: _Hits, h: float, k2: float) -> np.ndarray:
    """Residual (n,) in m/s that no impulse explains."""
    return np.linalg.norm(_explained(found, hits, h, k2)[1], axis=1)


def _contact(found: np.ndarray, hits: _Hits, h: float, k2: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Speed of approach of the corner in m/s, speed of departure over approach, and |P_t|/P_n of each hit (n,)."""
    P, _, r = _explained(found, hits, h, k2)
    lever = r + np.einsum("nij,j->ni", hits.q, found[2:])  # from the tracked point
    before = hits.v + np.cross(hits.w, lever)
    after = hits.v + hits.dv + np.cross(hits.w + hits.dw, lever)
    return -before[:, 2], -after[:, 2] / before[:, 2], np.hypot(P[:, 0], P[:, 1]) / P[:, 2]


def _balanced(hits: _Hits, h: float, k2: float) -> np.ndarray:
    """ρ in m, excess of I/m and c in m (5,) with the least misfit."""
    start, scale = np.zeros(5), np.array([h, 10.0, h, h, h])
    fitted = least_squares(
        lambda x: _misfit(x, hits, h, k2), start, loss="soft_l1", f_scale=BOUNDED, x_scale=scale, diff_step=1e-4
    )
    return fitted.x


def _robust(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Least-squares solution without values beyond three robust standard deviations."""
    kept = np.ones(len(y), bool)
    for _ in range(5):
        x = np.linalg.lstsq(A[kept], y[kept], rcond=None)[0]
        off = np.abs(y - A @ x)
        kept = off < 3.0 * 1.4826 * np.median(off[kept])
    return x


def _jackknifed(of: Callable[[np.ndarray], np.ndarray], rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Result of `of` for all rows, and its jackknife standard error from `GROUPS` groups left out in turn."""
    parts = np.stack([of(rows[rows % GROUPS != i]) for i in range(GROUPS)])
    return of(rows), np.sqrt((GROUPS - 1.0) / GROUPS * ((parts - parts.mean(axis=0)) ** 2).sum(axis=0))


def _of_mean(values: np.ndarray) -> np.ndarray:
    return values.std(axis=0, ddof=1) / np.sqrt(len(values))
