"""dataset.yaml as typed, checked data (dataset format, schema 1)."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from thesis_lib.bodies.body import Body, Noise, Positive, Surface
from thesis_lib.bodies.walls import MOST, Wall
from thesis_lib.foundation.settings import Section

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Header(Section):
    """The content of dataset.yaml."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    description: str = ""
    body: Body
    surface: Surface = Surface()
    surfaces: Annotated[tuple[Wall, ...], Field(max_length=MOST)] | None = Field(
        None, description="straight walls in place of the surface"
    )
    gravity: NotNegative = Field(9.81, description="m/s²; 0 for a motion over a level table, seen from above")
    rate: Positive | None = Field(None, description="Hz, of trajectories")
    noise: Noise | None = Field(None, description="optional; the arcs decide without it, and where they scatter less")
    spin: Positive | None = Field(
        None, description="rad/s, one sigma of the spin before an impact, where theta is not measured"
    )

    @property
    def stated_sigma(self) -> np.ndarray:
        """Noise (3,) of a sample of x, y, θ in m, m, rad; NaN if none is stated."""
        values = (None, None) if self.noise is None else (self.noise.position, self.noise.angle)
        position, angle = (np.nan if value is None else value for value in values)
        return np.array([position, position, angle])

    @model_validator(mode="after")
    def _surroundings_agree(self) -> "Header":
        require_distinct(self, "wall")
        return self


def require_distinct(header: Any, one: str) -> None:
    """ValueError where a header has surfaces, each `one`, beside its surface, none of them, or two of one name."""
    if header.surfaces is None:
        return
    if not header.surfaces:
        raise ValueError(f"surfaces holds no {one}")
    if "surface" in header.model_fields_set:
        raise ValueError("there are surface and surfaces; give one of them")
    names = [surface.name for surface in header.surfaces]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ValueError(f"surfaces: the name {twice[0]} occurs more than once")
