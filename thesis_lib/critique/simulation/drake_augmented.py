"""An augmented model in a Drake simulation: Drake integrates the flight, the model resolves each impact.

Drake's MultibodyPlant contains the free body (`simulate/drake/plant.py`).  A system evaluates the model at every stage
of the integrator and applies its flight effects as a force f = M (a(q, v) − g).  Drake stops where the model's gap
vanishes, and continues with the velocity that the model predicts:

    M v̇ = M g + f     between touches,        v⁺ = predict(q, v⁻)     where φ_n(q) − gap(q, v⁻) = 0

Here q, v (3,) are the true pose and velocity, and φ_n is the gap of the believed shape in m.  A contact of finite
duration is treated from touch to end as in our own simulator (`law_drops`).  The record contains the state as
measured by the model's camera, with its faults.

Source: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (LeafSystem, MultibodyPlant).
"""

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from thesis_lib.bodies.body import Body
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.simulation.law_drops import REST, between, camera_and_body
from thesis_lib.mechanics.state import State
from thesis_lib.simulate.drake.clock import Clock, fly
from thesis_lib.simulate.drake.plant import drop_plant
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

FLIGHT_STEP = 1e-3  # s
ACCURACY = 1e-6  # relative, of Drake's error control
SAY_EVERY = 10  # drops
MAX_TOUCHES = 50  # of one drop; its impacts become slower than REST, which ends the record, before that


def drake_poses(
    dynamics: Dynamics,
    q: np.ndarray,
    v: np.ndarray,
    samples: int,
    rate: float,
    say: Callable[[str], None] = lambda text: None,
) -> np.ndarray:
    """Return poses as `own_poses` does, from Drake for the flights and from the model for the impacts.

    `say` receives the number of finished drops.
    """
    drops, times = _Drops(dynamics), np.arange(samples) / rate
    poses = np.full((len(q), samples, 3), np.nan)
    for i in range(len(q)):
        drops.run(i, q[i], v[i], times, poses[i])
        if (i + 1) % SAY_EVERY == 0:
            say(f"{i + 1} of {len(q)} drops")
    return poses


class _Air(LeafSystem):
    """Force of the model's flight effects on the plant, M (a − g), as a function of its state."""

    def __init__(self, dynamics: Dynamics, trial: list[int]) -> None:
        super().__init__()
        self._dynamics, self._trial = dynamics, trial
        self._inertia = np.array([1.0, 1.0, dynamics.rig.k_g**2])
        self._state = self.DeclareVectorInputPort("state", 6)
        self.DeclareVectorOutputPort("force", 3, self._force)

    def _force(self, context: Context, out: BasicVector) -> None:
        s = self._state.Eval(context)
        state = _state(s[None, :3], s[None, 3:], np.array([context.get_time()]), self._trial[0])  # pyright: ignore[reportIndexIssue]
        a = self._dynamics.acceleration(state)[0]
        out.SetFromVector(self._inertia * (a + np.array([0.0, self._dynamics.rig.gravity, 0.0])))


class _Drops:
    """Drake's simulator of the free body, with the model that acts on it."""

    def __init__(self, dynamics: Dynamics) -> None:
        # faults of the camera affect only the record
        self.camera, self.inner = camera_and_body(dynamics)
        self.rig = self.inner.rig
        self._trial = [0]
        air = _Air(self.inner, self._trial) if self.inner.model.effects else None
        # planar motion does not depend on the mass
        body = Body(shape=self.rig.shape, radius_of_gyration=self.rig.k_g, mass=1.0)
        plant = drop_plant(body, CompliantContact(), HiddenCauses(), self.rig.gravity, air=air)
        self.clock = Clock(plant, FLIGHT_STEP, ACCURACY)

    def run(self, trial: int, q: np.ndarray, v: np.ndarray, samples: np.ndarray, poses: np.ndarray) -> None:
        """Write one drop as the camera sees it into `poses` (s, 3) at `samples` (s,) in s; NaN after its end."""
        self._trial[0], t = trial, 0.0

        def gap(q: np.ndarray, t: np.ndarray) -> np.ndarray:
            # no effect on the gap depends on velocity in flight here: the gap is a function of the pose
            return self.inner.gap(_state(q, np.zeros_like(q), t, trial))

        for _ in range(MAX_TOUCHES):
            times, q_path, v_path, landed = fly(self.clock, gap, t, q, v, samples[samples > t + 1e-12])
            seen = (samples >= t - 1e-12) & (samples <= times[-1] + 1e-12)
            # Drake stops at every sample, so its log contains all samples
            at = np.abs(times[:, None] - samples[seen]).argmin(axis=0)
            poses[seen] = self._seen(_state(q_path[at], v_path[at], samples[seen], trial))
            if not landed:
                break
            t, q = times[-1], q_path[-1]
            before = _state(q[None], v_path[-1:], times[-1:], trial)
            r_x = self.rig.shape.contact_point(q[2:3])[0, 0]
            if before.vy[0] + r_x * before.omega[0] > -REST:
                break
            if not self.inner.model.takes_time:
                v = self.inner.predict(before).v[0]
                continue
            end = self.inner.off(before)
            within = (samples > t + 1e-12) & (samples < end.t[0] - 1e-12)
            n = np.zeros(within.sum(), int)
            poses[within] = self._seen(between(before.select(n), end.select(n), samples[within]))
            t, q, v = end.t[0], end.q[0], end.v[0]
            if t >= samples[-1]:
                break

    def _seen(self, true: State) -> np.ndarray:
        """Return the poses (n, 3) that the camera reports."""
        return self.camera.to_measured(true).q


def _state(q: np.ndarray, v: np.ndarray, t: np.ndarray, trial: int) -> State:
    return State.of(q, v, np.full(len(t), trial), t)
