"""A Drake simulator whose state can be set and read, and flights that end at a touch.

Drake advances a flight from sample to sample and logs the state at every step in C++.  The time of the touch, φ_n = 0,
is found by bisection on the cubic Hermite path (exact for a parabola) of the step that ends below the plate.

Source: R. Tedrake and the Drake development team, Drake, https://drake.mit.edu (Simulator, RungeKutta3Integrator).
"""

# Drake's type stubs accept only ndarray[float64], although lists and other arrays work, and lack the types of ports
# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportReturnType=false

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from scipy.interpolate import CubicHermiteSpline

from thesis_lib.mechanics.bisection import bisected
from thesis_lib.simulate.drake.plant import DropPlant

BISECTIONS = 34  # number of halvings of a step: 2e-3 s / 2^34 = 1e-13 s
# gap (s,) in m between body and surface at positions (s, size) and times (s,) in s
Gap = Callable[[np.ndarray, np.ndarray], np.ndarray]


class Clock:
    """A Drake simulator with positions and velocities (size,): x, y, θ (m, rad, per s), then those of a loose mass."""

    def __init__(self, made: DropPlant, step: float, accuracy: float) -> None:
        with quiet():
            self.made, self.simulator = made, Simulator(made.diagram)
        integrator = ResetIntegratorFromFlags(self.simulator, "runge_kutta3", step)
        integrator.set_target_accuracy(accuracy)
        self.root = self.simulator.get_mutable_context()
        self.context = made.plant.GetMyMutableContextFromRoot(self.root)
        self.size = made.plant.num_positions(made.moving)
        self._rest = np.zeros(made.plant.num_multibody_states())

    def start(self, t: float, q: np.ndarray, v: np.ndarray) -> None:
        """Set the time in s and the state (size,) of the moving bodies; everything else is at rest."""
        plant, moving = self.made.plant, self.made.moving
        self.root.SetTime(t)
        plant.SetPositionsAndVelocities(self.context, self._rest)
        plant.SetPositions(self.context, moving, q)
        plant.SetVelocities(self.context, moving, v)
        if self.made.log is not None:
            self.made.log.FindMutableLog(self.root).Clear()
        self.simulator.Initialize()

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (size,)."""
        plant, moving = self.made.plant, self.made.moving
        return plant.GetPositions(self.context, moving), plant.GetVelocities(self.context, moving)

    def path(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (s,), positions and velocities (s, size) of all steps since the start; only for flights."""
        log = self.made.log.FindLog(self.root)  # pyright: ignore[reportOptionalMemberAccess]
        state = log.data().T
        return log.sample_times().copy(), state[:, : self.size].copy(), state[:, self.size :].copy()

    def momentum_and_energy(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, float]:
        """Momentum (2,) in N s and kinetic energy in J of the moving bodies; changes the state."""
        plant, moving = self.made.plant, self.made.moving
        plant.SetPositions(self.context, moving, q)
        plant.SetVelocities(self.context, moving, v)
        total = plant.CalcSpatialMomentumInWorldAboutPoint(self.context, [moving], np.zeros(3))
        return total.translational()[:2], plant.CalcKineticEnergy(self.context)


def fly(
    clock: Clock, gap: Gap, t: float, q: np.ndarray, v: np.ndarray, samples: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Simulate a flight from (t, q, v) to the last of the times `samples` in s, or until the body touches.

    Returns times (s,), positions and velocities (s, size) of its steps, and whether it ended at a touch (just above).
    """
    clock.start(t, q, v)
    for end in samples:
        clock.simulator.AdvanceTo(end)
        if gap(clock.state()[0][None], np.array([end]))[0] < 0.0:
            break
    times, q_path, v_path = clock.path()
    below = np.flatnonzero(gap(q_path, times) < 0.0)
    below = below[below > 0]  # a flight may begin on the surface (within rounding), where a contact ended
    if not len(below):
        return times, q_path, v_path, False
    i = below[0]
    spline = CubicHermiteSpline(*(part[i - 1 : i + 1] for part in (times, q_path, v_path)))
    low, _ = bisected(lambda s: gap(spline(s)[None], np.array([s]))[0] >= 0.0, times[i - 1], times[i], BISECTIONS)
    touch = np.append(times[:i], low), np.vstack([q_path[:i], spline(low)])
    return *touch, np.vstack([v_path[:i], spline(low, 1)]), True


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress Drake's warning that half-spaces cannot touch deformable bodies (there are no deformable bodies)."""
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)
