"""Initial states of tosses in space, fitted with the model's flight and camera to the frames before the first touch.

    r_k(s) = (pose that the camera reports at t_k minus the measured pose) / σ      s minimises Σ |r_k|²
    cov(s) = (Jᵀ J)⁻¹,   J = ∂r/∂s                                                  σ: residual of such fits

| on paper | in code | unit             | shape       |                                                        |
|----------|---------|------------------|-------------|--------------------------------------------------------|
| s        | `state` |                  | (n,) bodies | measured, at the first frame of the flight             |
| cov(s)   | `cov`   | of both columns  | (n, 12, 12) | for position, rotation (axes of the surface), velocity, spin |
| σ        | `noise` | m, rad           | (2,)        | of one coordinate, of one component of a rotation      |

Gauss-Newton steps start from a parabola and a torque-free rotation (`thesis_lib/datasets/flights/beside_hits.py`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.critique.contacts.kinds import ByImpulse, bind
from thesis_lib.critique.results.saved_in_space import SavedSpaceModel
from thesis_lib.datasets.flights.beside_hits import fit_turning
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.frames import body_states, surface_frames, tracked_states
from thesis_lib.datasets.format.table_forms import POSE_IN_SPACE
from thesis_lib.datasets.space.flights import find_flights, follow
from thesis_lib.effects.whole_tosses import WholeTosses
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.space import SPACE
from thesis_lib.mechanics.state import State

FEWEST = 6  # smallest number of frames of a first flight
LOW = 0.05  # body extents above the surface; below, the body may touch if its size or the height is wrong
AT_ONCE = 3  # number of frames that determine the motion at the stored first frame
STEPS = np.repeat([1e-5, 1e-4, 1e-3, 1e-2], 3)  # m, rad, m/s, rad/s: steps of the finite differences
ROUNDS = 5
USUAL = np.array([3e-4, 3e-3])  # m, rad: initial noise of a fit


@dataclass(frozen=True, eq=False)
class MeasuredTosses:
    """n measured tosses at k frames from the first flight on; the last frame of shorter tosses is repeated.

    Attributes:
        states: poses (k n,) of the believed body in the frame of the surface, frame by frame for all bodies.
        times: (k, n) s since the first frame.
        seen: (k, n) whether the frame was recorded.
        flight: (n,) number of frames of the first flight.
    """

    states: State
    times: np.ndarray
    seen: np.ndarray
    flight: np.ndarray

    @classmethod
    def of(cls, dataset: Dataset, model: SavedSpaceModel, trials: Sequence[int] | np.ndarray) -> "MeasuredTosses":
        """Return the tosses of these trials whose first flight is recorded.

        Raises:
            UserError: no first flight is recorded.
        """
        table = dataset.trajectories
        assert table is not None
        table = table[table["trial"].isin(trials)].dropna(subset=list(POSE_IN_SPACE)).sort_values(["trial", "t"])
        states = surface_frames(model.rig)[0].seen(body_states(tracked_states(table), model.rig))
        rig, rows, flights = model.believed, [], []
        for trial in np.unique(states.trial):
            own = np.flatnonzero(states.trial == trial)
            first, end = _first_flight(states.select(own), rig)
            if end - first >= FEWEST:
                rows.append(own[first:])
                flights.append(end - first)
        if not rows:
            raise UserError(
                f"No first flight of {FEWEST} frames is seen in {dataset.name}: tosses must begin in free flight, more "
                f"than {LOW * rig.shape.extent:.2g} m above the surface."
            )
        most = max(map(len, rows))
        index = np.stack([own[np.minimum(np.arange(most), len(own) - 1)] for own in rows], axis=1)
        seen = np.arange(most)[:, None] < [len(own) for own in rows]
        times = states.t[index] - states.t[index[0]]
        padded = states.select(index.ravel())
        padded = State(padded.pose, np.zeros_like(padded.motion), padded.trial, times.ravel(), None, SPACE)
        return cls(padded, times, seen, np.array(flights))

    def bound(self, model: SavedSpaceModel) -> ByImpulse:
        """Return the dynamics of the model for bodies that rotate as in these tosses."""
        k, n = self.times.shape
        whole = self.states.select(np.arange(k * n).reshape(k, n).T[self.seen.T])
        recorded = WholeTosses.of(whole, np.zeros(0), np.zeros(0))
        return bind(model.model, model.values, replace(model.believed, recorded=recorded))


@dataclass(frozen=True, eq=False)
class Start:
    """Initial states as measured, with their covariance; see the table of this module."""

    state: State
    cov: np.ndarray
    noise: np.ndarray

    def drawn(self, rng: np.random.Generator) -> State:
        """Draw states from the distribution of the initial states."""
        value, axes = np.linalg.eigh(self.cov)
        change = np.einsum(
            "nij,nj->ni", axes * np.sqrt(np.maximum(value, 0.0))[:, None], rng.standard_normal(value.shape)
        )
        return self.state.shifted(change[:, :6], change[:, 6:])


def first_flight(dynamics: ByImpulse, tosses: MeasuredTosses) -> Start:
    """Return the states at the first frames, from all frames of the first flights."""
    return _fit(dynamics, tosses, tosses.flight, None)


def first_frame(dynamics: ByImpulse, tosses: MeasuredTosses) -> Start:
    """Return the stored poses of the first frames, with motion from `AT_ONCE` frames and noise of the first flights."""
    noise = first_flight(dynamics, tosses).noise
    start = _fit(dynamics, tosses, np.full(len(tosses.flight), AT_ONCE), noise)
    return replace(start, state=start.state.with_pose(tosses.states.pose[:, : len(tosses.flight)]))


def _first_flight(states: State, rig) -> tuple[int, int]:
    """Return first frame and end of the first flight of a toss, well above the surface; 0, 0 without such a flight."""
    if len(states) < 10:
        return 0, 0
    down = np.array([0.0, 0.0, -1.0]) if rig.down is None else rig.down
    gap = rig.gap(states)
    low = gap - np.abs(np.diff(gap, append=gap[-1])) < LOW * rig.shape.extent
    for flight in find_flights(follow(states.t, states.position.T, rig.gravity), rig.gravity * down):
        touches = np.flatnonzero(low[flight])
        end = flight.start + int(touches[0]) if len(touches) else flight.stop
        if end - flight.start >= FEWEST:
            return max(flight.start, 0), end
    return 0, 0


def _fit(dynamics: ByImpulse, tosses: MeasuredTosses, frames: np.ndarray, noise: np.ndarray | None) -> Start:
    """Return states from the first `frames` (n,) of each toss; `noise` None: estimated from the residuals."""
    n, W = len(frames), int(frames.max())
    used, times = np.arange(W)[:, None] < frames, tosses.times[:W]
    measured = tosses.states.select(slice(W * n))
    state, known = _begun(dynamics, measured, times, used), noise is not None
    sigma = noise if noise is not None else USUAL
    dof = np.maximum(3.0 * frames - 6.0, 1.0)
    moves = np.repeat(np.vstack([np.zeros(12), np.diag(STEPS)])[:, None], n, axis=1)  # the first is 0
    for _ in range(ROUNDS):
        copies = State.joined([state.shifted(*np.split(step, 2, axis=1)) for step in moves])
        flown = _flown(dynamics, copies, np.tile(times, 13)).pose.reshape(7, W, 13, n)
        of_all = np.broadcast_to(measured.pose.reshape(7, W, 1, n), flown.shape)
        off = SPACE.difference(flown.reshape(7, -1), of_all.reshape(7, -1)).reshape(6, W, 13, n) * used[:, None]
        left = np.sqrt((off[:, :, 0] ** 2).reshape(2, 3, W, n).sum(axis=(1, 2)) / dof)
        if not known:
            sigma = np.maximum(np.median(left, axis=1), 1e-7)
        r = off / np.repeat(sigma, 3)[:, None, None, None]
        J = (r[:, :, 1:] - r[:, :, :1]) / STEPS[:, None]
        normal = np.einsum("cwin,cwjn->nij", J, J)
        change = -np.linalg.solve(normal, np.einsum("cwin,cwn->ni", J, r[:, :, 0])[..., None])[..., 0]
        state = state.shifted(change[:, :6], change[:, 6:])
    return Start(state, np.linalg.inv(normal), np.asarray(sigma))


def _begun(dynamics: ByImpulse, measured: State, times: np.ndarray, used: np.ndarray) -> State:
    """Return starting values: a parabola under gravity, and torque-free rotation as measured."""
    W, n = times.shape
    rig, weight = dynamics.rig, used / used.sum(axis=0)
    attitude = np.moveaxis(measured.attitude.reshape(4, W, n), 0, -1).swapaxes(0, 1)
    q, spin, _ = fit_turning(attitude, times.T, used.T, np.asarray(rig.tensor))
    path = measured.position.reshape(3, W, n) - 0.5 * rig.pull[..., None] * times**2
    off = times - (weight * times).sum(axis=0)
    middle = (weight * path).sum(axis=1)
    v = (weight * off * path).sum(axis=1) / (weight * off * off).sum(axis=0)
    place = middle - v * (weight * times).sum(axis=0)
    return State(np.concatenate([place, q]), np.concatenate([v, spin]), measured.trial[:n], np.zeros(n), None, SPACE)


def _flown(dynamics: ByImpulse, start: State, times: np.ndarray) -> State:
    """Return the states (W n,) that the camera reports in flight from measured states, at times (W, n) in s after."""
    path = [dynamics.to_true(start)]
    for h in np.diff(times, axis=0):
        path.append(dynamics.flown(path[-1], h))
    return dynamics.to_measured(State.joined(path))
