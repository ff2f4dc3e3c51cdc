"""Drops whose impacts follow a given law with given effects: source "law" of the proof.

The midpoint rule integrates flights with the model's acceleration, in quarters of the sampling period.  An impact is
located within its step where the model's gap vanishes; the model resolves it.  The model also maps the true state to
what the camera reports.  So an effect acts at every stage that it declares.
"""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
import pandas as pd

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.critique.drops.model import Model
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import Header
from thesis_lib.datasets.format.impacts import POSE
from thesis_lib.effects.effect import Rig, State

SUBSTEPS = 4  # per sampling period of 4 ms: a drag of 1/s then errs by 1e-7 m per flight
REST = 0.15  # m/s; a slower impact counts as rest, and the record ends


class Releases(Protocol):
    """Distribution of release states, or the measured releases of a dataset."""

    def draw(self, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Poses above the surface (m, m, rad) and velocities (m/s, m/s, rad/s), both (n, 3)."""
        ...


def simulate_law_drops(
    body: Body,
    release: Releases,
    n: int,
    model: Model,
    values: Mapping[str, float],
    *,
    gravity: float = 9.81,
    duration: float = 0.6,
    rate: float = 250.0,
    noise: Noise,
    rng: np.random.Generator,
) -> Dataset:
    """Trajectories of n drops as a camera records them; gravity in m/s², duration in s, rate in Hz."""
    rig = Rig(body.shape, body.radius_of_gyration, gravity, 0.0)
    camera, inner = model.camera_and_body()
    release_rng, noise_rng = rng.spawn(2)
    q, v = release.draw(n, release_rng)
    trial, zero = np.arange(n), np.zeros(n)
    state = State.of(q, v, trial, zero)
    samples = round(duration * rate) + 1
    h = 1.0 / (rate * SUBSTEPS)
    alive = np.ones(n, bool)
    pose = np.full((n, samples, 3), np.nan)
    for k in range(samples):
        measured = camera.to_measured(state, camera.active(values), rig)
        pose[alive, k] = measured.q[alive]
        for _ in range(SUBSTEPS):
            state = _step(inner, values, rig, state, h, alive)
    sigma = [noise.position or 0.0, noise.position or 0.0, noise.angle or 0.0]
    pose = pose + sigma * noise_rng.standard_normal(pose.shape)
    trials, frames = np.nonzero(np.isfinite(pose[:, :, 0]))
    table = pd.DataFrame({"trial": trials, "t": frames / rate} | dict(zip(POSE, pose[trials, frames].T)))
    about = {"schema": 1, "description": "simulated drops", "body": body, "gravity": gravity, "rate": rate}
    return Dataset("drops", Header(**about, noise=noise), table)


def _fly(model: Model, values: Mapping[str, float], rig: Rig, s: State, h: np.ndarray) -> State:
    """Midpoint rule over times h (n,) in s."""
    a = model.acceleration(s, values, rig)
    half = s.flown(a, 0.5 * h)
    return s.flown(model.acceleration(half, values, rig), h)


def _step(model: Model, values: Mapping[str, float], rig: Rig, s: State, h: float, alive: np.ndarray) -> State:
    """One step of h seconds for all drops; `alive` (n,) is cleared for drops that come to rest."""
    n = len(s.x)
    remaining = np.full(n, h)
    for _ in range(3):  # impacts of one body within a millisecond
        end = _fly(model, values, rig, s, remaining)
        hits = alive & (model.gap(end, values, rig) < 0.0) & (remaining > 0.0)
        if not hits.any():
            return end
        low, high = np.zeros(n), remaining.copy()
        for _ in range(40):
            middle = 0.5 * (low + high)
            below = model.gap(_fly(model, values, rig, s, middle), values, rig) < 0.0
            low, high = np.where(below, low, middle), np.where(below, middle, high)
        at = _fly(model, values, rig, s, np.where(hits, low, remaining))
        after = model.predict(at, values, rig)
        moved = {name: np.where(hits, getattr(after, name), getattr(at, name)) for name in ("vx", "vy", "omega")}
        r = rig.shape.contact_point(at.theta)
        approach = at.vy + r[:, 0] * at.omega
        alive &= ~(hits & (approach > -REST))
        s = at.moved(**moved)
        remaining = np.where(hits, remaining - low, 0.0)
    return s
