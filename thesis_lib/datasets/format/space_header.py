"""dataset.yaml of a body in space as typed, checked data (dataset format, schema 2)."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, field_validator, model_serializer, model_validator

from thesis_lib.bodies.body import Positive
from thesis_lib.bodies.shapes import Coordinate
from thesis_lib.bodies.solid_body import FlatSurface, NamedSurface, NoiseInSpace, SolidBody, Tracked, Vector, direction
from thesis_lib.bodies.walls import MOST
from thesis_lib.datasets.format.header import require_distinct
from thesis_lib.foundation.settings import Section

UNKNOWN = "unknown"  # pose of the tracked frame in the body


class SpaceHeader(Section):
    """The content of dataset.yaml, schema 2."""

    schema_: Literal[2] = Field(alias="schema", description="version of this format, for bodies in space")
    description: str = ""
    body: SolidBody
    tracked: Tracked | None = Field(
        Tracked(), description="pose of the tracked frame in that of the shape; default: they are one; or unknown"
    )
    surface: FlatSurface = FlatSurface()
    surfaces: Annotated[tuple[NamedSurface, ...], Field(max_length=MOST)] | None = Field(
        None, description="flat surfaces in place of the surface"
    )
    gravity: tuple[Coordinate, Coordinate, Coordinate] = Field(
        (0.0, 0.0, -9.81), description="m/s², in the axes of the recording; [0, 0, 0] for none"
    )
    rate: Positive | None = Field(None, description="Hz, of trajectories")
    noise: NoiseInSpace | None = Field(None, description="optional")
    spin: Positive | None = Field(
        None, description="rad/s, one sigma of each component of the spin before an impact, where it is not measured"
    )

    @field_validator("tracked", mode="before")
    @classmethod
    def _unknown_is_none(cls, value: object) -> object:
        if value is None:
            raise ValueError("is empty; write the pose, or unknown")
        return None if isinstance(value, str) and value == UNKNOWN else value

    @model_serializer(mode="wrap")
    def _none_is_unknown(self, written: SerializerFunctionWrapHandler) -> dict:
        return written(self) | ({"tracked": UNKNOWN} if self.tracked is None else {})

    @model_validator(mode="after")
    def _surroundings_agree(self) -> "SpaceHeader":
        require_distinct(self, "surface")
        if self.surfaces is None and self.surface.normal is None and not any(self.gravity):
            raise ValueError("without gravity nothing says how the surface lies; give surface.normal")
        return self

    @property
    def planes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Point (3,) in m and unit normal (3,) of each surface, in the axes of the recording."""
        against: Vector = (-self.gravity[0], -self.gravity[1], -self.gravity[2])
        of = self.surfaces or (self.surface,)
        return [(np.array(one.point), direction(one.normal or against)) for one in of]
