"""dataset.yaml as typed, checked data (dataset format, schema 1)."""

from typing import Literal

from pydantic import Field

from thesis_lib.bodies.body import Body, Noise, Positive, Surface
from thesis_lib.foundation.settings import Section


class Header(Section):
    """The content of dataset.yaml."""

    schema_: Literal[1] = Field(alias="schema", description="version of this format")
    description: str = ""
    body: Body
    surface: Surface = Surface()
    gravity: Positive = Field(9.81, description="m/s²")
    rate: Positive | None = Field(None, description="Hz, of trajectories")
    noise: Noise | None = Field(None, description="optional: else estimated from the arcs")
