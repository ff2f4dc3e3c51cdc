"""Rimless wheel on a slope: a hub with n spokes whose tips can touch the ground (thesis 2.4, figure 2-8).

The pose q = (x, y, θ) of the hub is in the axes of the slope, gravity is g (sin γ, -cos γ), and downhill is +x; a wheel
that rolls downhill has ω < 0.  Spoke i points along θ + 2π i / n.

Source: T. McGeer, Passive dynamic walking, Int. J. Robotics Research 9 (1990), doi 10.1177/027836499000900206.
"""

import math

import numpy as np

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody

MIN_SPOKES, MAX_SPOKES = 3, 100


class RimlessWheel(PlanarFreeBody):
    """Rimless wheel with a contact pair per spoke.

    `length` in m, hub to tip; mass in kg; inertia in kg m² about the hub, which is the centre of mass; slope in rad.

    Raises:
        UserError: a number is out of its range.
    """

    def __init__(
        self, spokes: int, length: float, mass: float, inertia: float, slope: float, gravity: float = 9.81
    ) -> None:
        if not (MIN_SPOKES <= spokes <= MAX_SPOKES and 0.0 < length < math.inf):
            raise UserError(
                f"A rimless wheel needs {MIN_SPOKES} to {MAX_SPOKES} spokes of positive length; "
                f"got {spokes} of {length} m."
            )
        if not 0.0 <= slope < 0.5 * math.pi:
            raise UserError(f"The slope under a rimless wheel must lie between 0 and π/2; got {slope} rad.")
        angles = 2.0 * np.pi * np.arange(spokes) / spokes
        tips = length * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        super().__init__(Polygon(vertices=tuple(map(tuple, tips.tolist()))), mass, inertia, gravity, slope)
        self.spokes, self.length, self.slope = int(spokes), float(length), float(slope)
        self.pairs = tuple(f"spoke_{i}" for i in range(spokes))

    def standing(self, lean: float, omega: float, spoke: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """State (q, v), (3,) each, in which the wheel rotates with omega about the tip of one spoke on the slope.

        `lean` in rad is the angle of the hub downhill of the tip's normal; `omega` in rad/s is negative downhill.

        Raises:
            UserError: another spoke would be below the slope.
        """
        if abs(lean) > np.pi / self.spokes + 1e-12:
            raise UserError(
                f"A wheel with {self.spokes} spokes stands on one only up to a lean of "
                f"{np.pi / self.spokes:.4f} rad; got {lean}."
            )
        # from the hub, the tip at the origin lies in the direction -π/2 - lean
        theta = -0.5 * np.pi - lean - 2.0 * np.pi * spoke / self.spokes
        x, y = self.length * np.sin(lean), self.length * np.cos(lean)
        return np.array([x, y, theta]), np.array([-omega * y, omega * x, omega])
