"""Simulated drops whose impacts follow a given law with given effects: source "law" of the proof.

The midpoint rule integrates flights with the model's acceleration, in quarters of the sampling period.  An impact is
located within its step where the model's gap vanishes; the model resolves this impact.  The model also maps the true
state to the state that the camera reports.  So an effect acts at every stage that it declares.

A contact of finite duration is treated from touch to end by `episodes.contact`.  The model has no path in between; the
record contains the cubic through the poses and velocities at both ends, which penetrates the surface as a body does.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.contacts.kinds import ByImpulse, bind
from thesis_lib.critique.contacts.model import Model
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects.effect import ORIGIN, Reference, Rig
from thesis_lib.mechanics.bisection import bisected
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.rig.record import as_dataset
from thesis_lib.simulate.rig.release import Release

SUBSTEPS = 4  # per sampling period of 4 ms: a drag of 1/s then errs by 1e-7 m per flight
REST = 0.15  # m/s; a slower impact counts as rest, and the record ends
_NOW = 1e-9  # s
Poses = Callable[[Dynamics, np.ndarray, np.ndarray, int, float], np.ndarray]  # as `own_poses`


@dataclass(frozen=True)
class MeasuredReleases:
    """True poses q, with height above the surface, and velocities v (m, 3); drawn in order, then with replacement."""

    q: np.ndarray
    v: np.ndarray

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.q)
        rows = np.r_[np.arange(min(n, count)), rng.integers(count, size=max(n - count, 0))]
        return self.q[rows].copy(), self.v[rows].copy()


def simulate_law_drops(
    body: Body,
    release: Release | MeasuredReleases,
    n: int,
    model: Model,
    values: Mapping[str, float],
    *,
    gravity: float = 9.81,
    duration: float = 0.6,
    rate: float = 250.0,
    noise: Noise,
    rng: np.random.Generator,
    reference: Reference = ORIGIN,
    poses: Poses | None = None,
) -> Dataset:
    """Simulate n drops, numbered from 0, as a camera records them; gravity in m/s², duration in s, rate in Hz.

    Effects are relative to `reference`.  `poses` is the simulator: `own_poses` (default), or another.
    """
    rig = Rig(body.shape, body.radius_of_gyration, gravity, 0.0, reference=reference)
    release_rng, noise_rng = rng.spawn(2)
    q, v = release.draw(n, release_rng)
    pose = (poses or own_poses)(bind(model, values, rig), q, v, round(duration * rate) + 1, rate)
    return Dataset("drops", *as_dataset(pose, "simulated drops", body, gravity, rate, noise, noise_rng))


def own_poses(dynamics: Dynamics, q: np.ndarray, v: np.ndarray, samples: int, rate: float) -> np.ndarray:
    """Return camera poses (n, samples, 3) of drops released at q, v (n, 3) over y = 0; NaN after the end of a drop."""
    camera, inner = camera_and_body(dynamics)
    n = len(q)
    touch = state = State.of(q, v, np.arange(n), np.zeros(n))
    h = 1.0 / (rate * SUBSTEPS)
    alive = np.ones(n, bool)
    pose = np.full((n, samples, 3), np.nan)
    for k in range(samples):
        measured = camera.to_measured(between(touch, state, k / rate))
        pose[alive, k] = measured.q[alive]
        for step in range(1, SUBSTEPS + 1):
            touch, state = _step(inner, touch, state, (k + step / SUBSTEPS) / rate, h, alive)
    return pose


def camera_and_body(dynamics: Dynamics) -> tuple[ByImpulse, ByImpulse]:
    """Return the dynamics with measurement effects only, and with all other effects and the same contact times."""
    camera, body = dynamics.model.camera_and_body()
    body = replace(body, takes_time=dynamics.model.takes_time)
    return bind(camera, dynamics.values, dynamics.rig), bind(body, dynamics.values, dynamics.rig)


def between(touch: State, end: State, t: np.ndarray | float) -> State:
    """Return the states at times t (n,) in s: within a contact on the cubic from touch to end, otherwise `end`."""
    rows = np.flatnonzero(end.t > t + _NOW)
    if not len(rows):
        return end
    return end.put(rows, on_cubic(touch.select(rows), end.select(rows), np.broadcast_to(t, end.t.shape)[rows]))


def on_cubic(touch: State, end: State, t: np.ndarray) -> State:
    """Return the states at times t (n,) in s on the cubic through poses and motions at both ends, in any space.

    With u = (t − t_0)/T and d the change of the pose from q_0 to q_1,

        q(t) = q_0 + u (T v_0 + u (3 d − T (2 v_0 + v_1) + u (T (v_0 + v_1) − 2 d)))
    """
    T, change = end.t - touch.t, end.space.difference(end.pose, touch.pose)
    u, v_0, v_1 = (t - touch.t) / T, T * touch.motion, T * end.motion
    bend, turn = 3.0 * change - 2.0 * v_0 - v_1, v_0 + v_1 - 2.0 * change
    pose = end.space.shift(touch.pose, u * (v_0 + u * (bend + u * turn)))
    return State(pose, (v_0 + u * (2.0 * bend + 3.0 * u * turn)) / T, touch.trial, t, touch.surface, end.space)


def _fly(dynamics: Dynamics, s: State, h: np.ndarray) -> State:
    """Integrate the flight by the midpoint rule over times h (n,) in s."""
    half = s.flown(dynamics.acceleration(s), 0.5 * h)
    return s.flown(dynamics.acceleration(half), h)


def _step(dynamics: ByImpulse, touch: State, s: State, t: float, h: float, alive: np.ndarray) -> tuple[State, State]:
    """Return the last touches, and the states of all drops after one step of h s to t, or at the end of a contact.

    `alive` (n,) is cleared for drops that come to rest.
    """
    remaining = np.full(len(s.x), h)
    if dynamics.model.takes_time:
        remaining = np.where(s.t > t - h + _NOW, np.maximum(t - s.t, 0.0), h)
    for _ in range(3):  # up to three impacts of one body within a millisecond
        end = _fly(dynamics, s, remaining)
        hits = alive & (dynamics.gap(end) < 0.0) & (remaining > 0.0)
        if not hits.any():
            return touch, end
        none = np.zeros(len(s.x))
        low, _ = bisected(lambda h, s=s: dynamics.gap(_fly(dynamics, s, h)) >= 0.0, none, remaining, 40)
        at = _fly(dynamics, s, np.where(hits, low, remaining))
        r = dynamics.rig.shape.contact_point(at.theta)
        approach = at.vy + r[:, 0] * at.omega
        alive &= ~(hits & (approach > -REST))
        if dynamics.model.takes_time:
            rows = np.flatnonzero(hits)
            hit = at.select(rows)
            touch, s = touch.put(rows, hit), at.put(rows, dynamics.off(hit))
            low += s.t - at.t
        else:
            s = at.with_motion(np.where(hits, dynamics.predict(at).motion, at.motion))
        remaining = np.where(hits, np.maximum(remaining - low, 0.0), 0.0)
    return touch, s
