"""A rig as stated by its owner: the body that is dropped, the surface that it hits, and the measurement noise."""

import math
from typing import Annotated

from pydantic import Field

from thesis_lib.bodies.shapes import Shape
from thesis_lib.foundation.settings import Section

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Relative = Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]


class Uncertainty(Section):
    """Relative standard uncertainties of properties measured on the body itself, not inferred from drops."""

    mass: Relative | None = Field(None, description="of the mass")
    size: Relative | None = Field(None, description="of the lengths of the shape")
    inertia: Relative | None = Field(None, description="of the moment of inertia about the centre of mass")


class Body(Section):
    """The object that is dropped; the origin of its frame is the believed centre of mass."""

    shape: Shape
    mass: Positive | None = Field(None, description="kg; optional, planar impacts need only the radius of gyration")
    radius_of_gyration: Positive = Field(description="m, about the centre of mass")
    homogeneous: bool | None = Field(
        None, description="true for uniform density: inertia and centre of mass then follow from the shape"
    )
    uncertainty: Uncertainty | None = Field(None, description="of properties that are known without drops; optional")

    @property
    def inertia_uncertainty(self) -> float | None:
        """Relative standard uncertainty of k², k the radius of gyration; None if it was not measured.

        k² = I/m if inertia and mass were measured.  For a homogeneous body k² is proportional to the square of its
        size; `inertia` then accounts for an uneven density.
        """
        known = self.uncertainty
        if known is None or (known.inertia is None and not (self.homogeneous and known.size)):
            return None
        other = 2.0 * (known.size or 0.0) if self.homogeneous else known.mass or 0.0
        return math.hypot(known.inertia or 0.0, other)

    def known(self, what: str) -> float | None:
        """Standard uncertainty of "inertia" or "size" (relative) or "centre of mass" (m); None if it is not known."""
        size = None if self.uncertainty is None else self.uncertainty.size
        by_name = {"inertia": self.inertia_uncertainty, "size": size, "centre of mass": self.centre_uncertainty}
        return by_name.get(what)

    @property
    def centre_uncertainty(self) -> float | None:
        """Standard uncertainty of the centre of mass in m, along each axis; None if unknown or not homogeneous."""
        if not self.homogeneous or self.inertia_uncertainty is None:
            return None
        return self.inertia_uncertainty * self.shape.extent


class Surface(Section):
    """A level surface: the half-plane y ≤ height."""

    height: Annotated[float, Field(allow_inf_nan=False)] = Field(0.0, description="m")


class Noise(Section):
    """One-sigma measurement noise, independent for each column."""

    position: Positive | None = Field(None, description="m, each x and y")
    angle: Positive | None = Field(None, description="rad, each theta")
    velocity: Positive | None = Field(None, description="m/s, each vx and vy (impacts.csv only)")
    angular_velocity: Positive | None = Field(None, description="rad/s, each omega (impacts.csv only)")
