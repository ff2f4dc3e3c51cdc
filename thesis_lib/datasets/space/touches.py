"""Touches of a falling body on its table: hits between two flights, and rests after them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from thesis_lib.bodies.solid_body import SolidBody
from thesis_lib.datasets.space.falling_body import FallingBody
from thesis_lib.datasets.space.flights import parabolas
from thesis_lib.foundation.errors import UserError

BETWEEN = 2.5  # most steps between two flights; with more, there may be another hit between
KICK = 0.3  # m/s, least change of velocity of a hit; its instant is where two parabolas meet
BESIDE = 12  # samples beside a hit from which the rotation is extrapolated to it
STILL = (0.02, 0.2, 1.0)  # m/s, rad/s, m/s²: a body at rest is slower, over ...
LASTING = 0.1  # s
NEAR = 0.1  # extents of the body from the table, within which it rests on it
LATER = 3.0  # s after a flight, within which a body comes to rest on the surface that it hit


@dataclass(frozen=True, eq=False)
class Touches:
    """States of the body at k touches.

    Attributes:
        place: (k, 3) position of the centre of mass in m, axes of the recording.
        attitude: (k) rotations of the tracked frame's axes into those of the recording.
        velocity, spin: (k, 3) in m/s and rad/s just before the touch, 0 at rest.
        rests: (k,) whether the body rests; else it hits.
        step: s between samples, within which a second hit may go unseen.
    """

    place: np.ndarray
    attitude: Rotation
    velocity: np.ndarray
    spin: np.ndarray
    rests: np.ndarray
    step: float


def touches(trial: np.ndarray, t: np.ndarray, position: np.ndarray, turned: Rotation, body: FallingBody) -> Touches:
    """The hits and rests in poses at increasing times `t` (n,) in s, with the flights of `body`.

    Raises:
        UserError: there is neither a hit nor a rest.
    """
    found, step = [], float(np.median(np.diff(t)))
    for before, after in zip(body.flights[:-1], body.flights[1:]):
        end, start = before.stop - 1, after.start
        soon = trial[end] == trial[start] and t[start] - t[end] < BETWEEN * step
        if soon and (hit := _hit(t, turned, body, before, after)):
            found.append((*hit, False))
    for rows in _rests(trial, t, position, turned, body):
        mean = turned[rows].mean()
        found.append((position[rows].mean(0) + mean.apply(body.centre), mean, np.zeros(3), np.zeros(3), True))
    if not found:
        raise UserError("no hit and no rest follows a free flight.")
    place, attitude, velocity, spin, rests = zip(*found)
    states = np.array(place), Rotation.concatenate(attitude), np.array(velocity), np.array(spin), np.array(rests)
    return Touches(*states, step)


def table_height(
    trial: np.ndarray,
    t: np.ndarray,
    position: np.ndarray,
    turned: Rotation,
    body: SolidBody,
    flights: Sequence[slice],
    gravity: np.ndarray,
) -> tuple[float, Touches]:
    """Height of the table in m, opposite `gravity` (3,) in m/s², of a body whose tracked frame is that of its shape.

    It is the median height of the lowest point of the shape at the touches, which are returned, too; where the body
    rests at about this height, at those rests, since hits appear a little too low.

    Raises:
        UserError: there is neither a hit nor a rest.
    """
    path = position + turned.apply(body.centre)
    falls = FallingBody(body.centre, gravity, np.zeros((6, 6)), list(flights), path)
    met, up = touches(trial, t, position, turned, falls), -gravity / np.linalg.norm(gravity)
    lowest = body.solid.about(body.centre).lowest(met.attitude.as_quat(scalar_first=True).T, up[:, None]).T
    height = (met.place + lowest) @ up
    rests = met.rests & (np.abs(height - np.median(height)) < NEAR * body.solid.extent)
    return float(np.median(height[rests] if rests.any() else height)), met


def _hit(t: np.ndarray, turned: Rotation, body: FallingBody, before: slice, after: slice):
    """Place, attitude, velocity and spin at the instant at which the parabolas meet; None if they do not."""
    lines, middle = [], t[before.stop - 1]
    for flight in (before, after):
        rows = slice(flight.start + 1, flight.stop - 1)
        s = t[rows] - middle
        lines.append(np.polynomial.polynomial.polyfit(s, body.path[rows] - 0.5 * s[:, None] ** 2 * body.gravity, 1))
    apart, kick = lines[1] - lines[0]
    size = float(kick @ kick)
    at = -float(apart @ kick) / max(size, KICK**2)
    if size < KICK**2 or not t[before.stop - 3] < middle + at < t[after.start + 2]:
        return None
    ways = []
    for rows in (
        slice(max(before.start, before.stop - 1 - BESIDE), before.stop - 1),
        slice(after.start + 1, min(after.stop, after.start + 1 + BESIDE)),
    ):
        last = turned[rows.stop - 1]
        path = np.polynomial.polynomial.polyfit(t[rows] - middle, (turned[rows] * last.inv()).as_rotvec(), 2)
        ways.append(
            (Rotation.from_rotvec(path[0] + at * path[1] + at**2 * path[2]) * last, path[1] + 2.0 * at * path[2])
        )
    place = np.mean([line[0] + at * line[1] for line in lines], axis=0) + 0.5 * at**2 * body.gravity
    attitude = Rotation.concatenate([way[0] for way in ways]).mean()
    return place, attitude, lines[0][1] + at * body.gravity, ways[0][1]


def _rests(trial: np.ndarray, t: np.ndarray, position: np.ndarray, turned: Rotation, body: FallingBody):
    """The samples of the first rest within `LATER` after a flight, at most one for each flight."""
    step = float(np.median(np.diff(t)))
    half = max(2, int(LASTING / step / 2.0))
    values = np.concatenate([position, turned.as_matrix().reshape(-1, 9)], axis=1)
    v, a, _ = parabolas(t, values, half, step)
    with np.errstate(invalid="ignore"):
        still = np.linalg.norm(v[:, :3], axis=1) < STILL[0]
        still &= np.linalg.norm(v[:, 3:], axis=1) < np.sqrt(2.0) * STILL[1]
        still &= np.linalg.norm(a[:, :3], axis=1) < STILL[2]
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    ends = np.array([flight.stop - 1 for flight in body.flights])
    used = -1
    for first, end in zip(edges[::2], edges[1::2]):
        last = int(np.searchsorted(ends, first)) - 1
        if last > used and trial[ends[last]] == trial[first] and t[first] - t[ends[last]] < LATER:
            used = last
            yield slice(first, end)
