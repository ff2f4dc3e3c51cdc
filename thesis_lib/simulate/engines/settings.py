"""Shared by both engines: the contact, the time step, and the motion that they return."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.release import Spread

EngineName = Literal["mujoco", "drake"]
TIP_RADIUS = 1e-3  # m, of the ball at the end of a spoke, whose lowest point is the tip when the spoke stands upright
LINK_DEPTH = 0.02  # m, of the box that is link 2; its side towards the disk is the line from joint to tip


class EngineContact(Section):
    """Contact that gives, as rubber on steel does; own choices."""

    contact_time: Spread = Field(
        Spread(low=2e-3, high=5e-3), description="s, half a period of 1 kg on the contact's spring, drawn"
    )
    damping_ratio: float = Field(0.5, ge=0, description="1, of MuJoCo's contact; restitution about 0.2")
    dissipation: float = Field(
        2.0, ge=0, description="s/m, of Hunt and Crossley in Drake; restitution about 0.4 at 1 m/s"
    )
    stiction: float = Field(1e-3, gt=0, description="m/s, slip below which Drake's friction is reduced")
    dt: float = Field(1e-4, gt=0, description="s, of the engine; a twentieth of the contact")
    control: float = Field(5e-4, gt=0, description="s, between updates of forces that no engine has itself")

    def draw(self, rng: np.random.Generator) -> "DrawnContact":
        """The contact of one recording."""
        return DrawnContact(self, float((np.pi / self.contact_time.quantile(rng.random(1))[0]) ** 2))


@dataclass(frozen=True)
class DrawnContact:
    """The contact of one recording; `stiffness` in N/m."""

    settings: EngineContact
    stiffness: float


@dataclass(frozen=True)
class EngineMotion:
    """Motion of an engine at equal steps of time: t (n,) in s, q and v (n, nv)."""

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
