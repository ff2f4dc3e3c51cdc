"""dataset.yaml as typed, checked data (dataset format, schema 1 in the plane, 2 in space)."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, field_validator, model_serializer, model_validator

from thesis_lib.bodies.body import Body, Noise, Positive, Surface
from thesis_lib.bodies.shapes import Coordinate
from thesis_lib.bodies.solid_body import FlatSurface, NamedSurface, NoiseInSpace, SolidBody, Tracked, Vector, direction
from thesis_lib.bodies.walls import MOST, Wall
from thesis_lib.foundation.settings import Section

UNKNOWN = "unknown"  # written for `tracked` if its pose in the body is not known
RIM = 0.5  # rim speed over speed before an impact, one sigma, if the spin is neither measured nor stated
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Header(Section):
    """The content of dataset.yaml, schema 1."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    description: str = ""
    body: Body
    surface: Surface = Surface()
    surfaces: Annotated[tuple[Wall, ...], Field(max_length=MOST)] | None = Field(
        None, description="straight walls instead of the surface"
    )
    gravity: NotNegative = Field(9.81, description="m/s²; 0 for a motion over a level table, seen from above")
    rate: Positive | None = Field(None, description="Hz, of trajectories")
    noise: Noise | None = Field(None, description="optional; estimated from the arcs if not stated, or too high")
    spin: Positive | None = Field(
        None, description="rad/s, one sigma of the spin before an impact, if theta is not measured"
    )

    @property
    def stated_sigma(self) -> np.ndarray:
        """Noise (3,) of a sample of x, y, θ in m, m, rad; NaN if none is stated."""
        values = (None, None) if self.noise is None else (self.noise.position, self.noise.angle)
        position, angle = (np.nan if value is None else value for value in values)
        return np.array([position, position, angle])

    @model_validator(mode="after")
    def _surroundings_agree(self) -> "Header":
        _require_distinct(self, "wall")
        return self


class SpaceHeader(Section):
    """The content of dataset.yaml, schema 2."""

    schema_: Literal[2] = Field(alias="schema", description="version of this format, for bodies in space")
    description: str = ""
    body: SolidBody
    tracked: Tracked | None = Field(
        Tracked(), description="pose of the tracked frame in that of the shape, or unknown; default: both coincide"
    )
    surface: FlatSurface = FlatSurface()
    surfaces: Annotated[tuple[NamedSurface, ...], Field(max_length=MOST)] | None = Field(
        None, description="flat surfaces instead of the surface; `critique` takes a set with one surface only"
    )
    gravity: tuple[Coordinate, Coordinate, Coordinate] = Field(
        (0.0, 0.0, -9.81), description="m/s², in the axes of the recording; [0, 0, 0] for none"
    )
    rate: Positive | None = Field(None, description="Hz, of trajectories")
    noise: NoiseInSpace | None = Field(None, description="optional")
    spin: Positive | None = Field(
        None, description="rad/s, one sigma of each component of the spin before an impact, if it is not measured"
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
        _require_distinct(self, "surface")
        if self.surfaces is None and self.surface.normal is None and not any(self.gravity):
            raise ValueError("without gravity the direction of the surface is not defined; give surface.normal")
        return self

    @property
    def planes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Point (3,) in m and unit normal (3,) of each surface, in the axes of the recording."""
        against: Vector = (-self.gravity[0], -self.gravity[1], -self.gravity[2])
        of = self.surfaces or (self.surface,)
        return [(np.array(one.point), direction(one.normal or against)) for one in of]


def unseen_spin(speed: np.ndarray, header: Header | SpaceHeader) -> float:
    """One sigma in rad/s of each component of the spin before impacts at speeds (n,) in m/s, if no angle is measured.

    Friction at an impact gives a disk that slides without spin a rim speed of at most 2/3 of its tangential velocity; a
    release by hand gives about as much.  Unless dataset.yaml states `spin`, the rim speed before an impact is therefore
    taken as 0 ± `RIM` times the median speed.
    """
    if header.spin is not None:
        return header.spin
    shape = header.body.shape if isinstance(header, Header) else header.body.solid
    return RIM * float(np.median(speed)) / shape.extent if len(speed) else 1.0


def _require_distinct(header: Any, one: str) -> None:
    """ValueError if `surfaces` is empty, given beside `surface`, or repeats a name; `one`: word for an element."""
    if header.surfaces is None:
        return
    if not header.surfaces:
        raise ValueError(f"surfaces contains no {one}")
    if "surface" in header.model_fields_set:
        raise ValueError("surface and surfaces are both given; keep one of them")
    names = [surface.name for surface in header.surfaces]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"surfaces: the name {twice[0]} occurs more than once")
