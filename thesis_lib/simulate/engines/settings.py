"""Shared by both engines: the contact, the time step, and the motion that they return.

The contact gives, as rubber on steel does; its numbers are own choices.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from thesis_lib.simulate.rig.release import Spread

EngineName = Literal["mujoco", "drake"]
TIP_RADIUS = 1e-3  # m, of the ball at the end of a spoke, whose lowest point is the tip when the spoke stands upright
LINK_DEPTH = 0.02  # m, of the box that is link 2; its side towards the disk is the line from joint to tip
CONTACT_TIME = Spread(low=2e-3, high=5e-3)  # s, half a period of 1 kg on the contact's spring, drawn
DAMPING_RATIO = 0.5  # of MuJoCo's contact; restitution about 0.2
DISSIPATION = 2.0  # s/m, of Hunt and Crossley in Drake; restitution about 0.4 at 1 m/s
STICTION = 1e-3  # m/s, slip below which Drake's friction is reduced
STEP = 1e-4  # s, of the engine; a twentieth of the contact
CONTROL = 5e-4  # s, between updates of forces that no engine has itself


def drawn_stiffness(rng: np.random.Generator) -> float:
    """Stiffness in N/m of the contact of one recording."""
    return float((np.pi / CONTACT_TIME.quantile(rng.random(1))[0]) ** 2)


@dataclass(frozen=True)
class EngineMotion:
    """Motion of an engine at equal steps of time: t (n,) in s, q and v (n, nv)."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray

    @classmethod
    def controlled(cls, q: list[np.ndarray], v: list[np.ndarray]) -> "EngineMotion":
        """That through states `CONTROL` apart."""
        return cls(CONTROL * np.arange(len(q)), np.array(q), np.array(v))
