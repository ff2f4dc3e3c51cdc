"""What is known of a rig: the body that is dropped, the surface that it meets, the noise of its measurements."""

from typing import Annotated

from pydantic import Field

from thesis_lib.bodies.shapes import Shape
from thesis_lib.foundation.settings import Section

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Body(Section):
    """The object that is dropped; the origin of its frame is the believed centre of mass."""

    shape: Shape
    mass: Positive | None = Field(None, description="kg; optional, planar impacts need only the radius of gyration")
    radius_of_gyration: Positive = Field(description="m, about the centre of mass")


class Surface(Section):
    """The half-plane y ≤ height."""

    height: Annotated[float, Field(allow_inf_nan=False)] = Field(0.0, description="m")


class Noise(Section):
    """One-sigma measurement noise, independent for each column."""

    position: Positive | None = Field(None, description="m, each x and y")
    angle: Positive | None = Field(None, description="rad, each theta")
    velocity: Positive | None = Field(None, description="m/s, each vx and vy (impacts.csv only)")
    angular_velocity: Positive | None = Field(None, description="rad/s, each omega (impacts.csv only)")
