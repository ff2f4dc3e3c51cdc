"""Drake as an impact model: its own contact, point or hydroelastic; one plant simulates all impacts.

The plant comes from `thesis_lib/simulate/drake/plant.py` and is integrated in continuous time with error control.  ε
and T refer to a central impact at `REFERENCE_SPEED`.  Hydroelastic bodies are ellipses, disks and rectangles: Drake has
no other solid whose pressure field stays in the plane.
"""

from typing import Literal

import numpy as np

from thesis_lib.bodies.body import Body
from thesis_lib.engines.engine import mechanics
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.drake.hunt_crossley import Spring
from thesis_lib.simulate.drake.hunt_crossley import spring as spring_of
from thesis_lib.simulate.rig.hidden_causes import CompliantContact, HiddenCauses

POINTS = 20  # states of a path in one contact time
ACCURACY = 1e-3  # relative, of Drake's error control; a tenth of it changes velocities by 0.1 mm/s
CONTACTS = ("point", "hydroelastic")


class DrakeEngine:
    """n bodies on Drake's surface; see `thesis_lib/engines/engine.py`."""

    def __init__(
        self,
        body: Body,
        n: int,
        *,
        contact: CompliantContact,
        causes: HiddenCauses,
        gravity: float = 9.81,
        surface: Literal["point", "hydroelastic"] = "point",
        spring: Spring | None = None,
    ) -> None:
        """`spring` replaces the spring that follows from ε and T in point contact.

        UserError for causes that no engine models, an unknown surface, or a hydroelastic polygon except a rectangle."""
        try:
            from thesis_lib.simulate.drake.clock import Clock
            from thesis_lib.simulate.drake.modulus import solid
            from thesis_lib.simulate.drake.plant import drop_plant
        except ImportError as error:
            raise UserError(f"Drake cannot be used here ({error}): pip install drake.") from error
        if surface not in CONTACTS:
            raise UserError(f"Drake has no contact {surface!r}; known are {', '.join(CONTACTS)}.")
        self.name = "drake" if surface == "point" else "drake_hydroelastic"
        self.mechanics = mechanics(body, contact, causes, gravity, n)
        T, mass = contact.contact_time, self.mechanics.mass
        self.h = T / POINTS
        if surface == "point":
            made_of = spring or spring_of(contact.epsilon, T, mass)
        else:
            made_of = solid(body, contact.epsilon, T)
        self._clock = Clock(drop_plant(body, contact, causes, gravity, made_of), T, ACCURACY)

    def press(self, rows: np.ndarray, q: np.ndarray, v: np.ndarray, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the paths q, v (m, steps + 1, 3) that start from the states (m, 3) of the centre of mass."""
        paths = np.empty((2, len(rows), steps + 1, 3))
        paths[:, :, 0] = q, v
        for i in range(len(rows)):
            self._clock.start(0.0, q[i], v[i])
            for step in range(1, steps + 1):
                self._clock.simulator.AdvanceTo(step * self.h)
                paths[0, i, step], paths[1, i, step] = self._clock.state()
        return paths[0], paths[1]
