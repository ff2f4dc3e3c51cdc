"""Shared by both engines: the contact, the time step, and the motion that they return.

The contact yields like rubber on steel; its numbers are our own choices.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from thesis_lib.simulate.rig.release import Spread

EngineName = Literal["mujoco", "drake"]
TIP_RADIUS = 1e-3  # m, radius of the ball at the end of a spoke; its lowest point is the tip of an upright spoke
LINK_DEPTH = 0.02  # m, depth of the box that represents link 2; its side facing the disk is the line from joint to tip
CONTACT_TIME = Spread(low=2e-3, high=5e-3)  # s, half a period of 1 kg on the contact's spring, drawn at random
DAMPING_RATIO = 0.5  # of MuJoCo's contact; restitution about 0.2
DISSIPATION = 2.0  # s/m, Hunt and Crossley's dissipation in Drake; restitution about 0.4 at 1 m/s
STICTION = 1e-3  # m/s, slip below which Drake's friction is reduced
STEP = 1e-4  # s, time step of the engine; a twentieth of the contact time
CONTROL = 5e-4  # s, interval between updates of forces that an engine cannot model itself


def drawn_stiffness(rng: np.random.Generator) -> float:
    """Draw the contact stiffness in N/m of one recording."""
    return float((np.pi / CONTACT_TIME.quantile(rng.random(1))[0]) ** 2)


@dataclass(frozen=True)
class EngineMotion:
    """Motion simulated by an engine at equal time steps: t (n,) in s, q and v (n, nv)."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray

    @classmethod
    def controlled(cls, q: list[np.ndarray], v: list[np.ndarray]) -> "EngineMotion":
        """Motion from states at intervals of `CONTROL`."""
        return cls(CONTROL * np.arange(len(q)), np.array(q), np.array(v))
