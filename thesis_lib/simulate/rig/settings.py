"""Settings of the simulated datasets."""

from pydantic import Field

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.rig.hidden_causes import ELLIPSE_BODY
from thesis_lib.simulate.rig.release import Release


class SimulatedDrops(Section):
    """Simulated drops of the chapter's ellipse, `data/simulated/drops`."""

    n: int = Field(2000, ge=1, description="number of drops, as measured in the thesis")
    body: Body = Field(ELLIPSE_BODY, description="ellipse of chapter 3; k² = 3.7e-4 m² as in the authors' code")
    mu: float = Field(0.1, ge=0, description="own choice, near table 3.1")
    epsilon: float = Field(0.55, ge=0, le=1, description="own choice, near table 3.1")
    release: Release = Field(Release(), description="initial states, like those of the experiment")
    gravity: float = Field(9.81, gt=0, description="m/s²")
    rate: float = Field(250.0, gt=0, description="Hz, like the motion capture of the thesis")
    dt: float = Field(1e-3, gt=0, description="s, time step; own choice")
    duration: float = Field(0.8, gt=0, description="s per drop; own choice: two to three bounces")
    noise: Noise = Field(Noise(position=3e-4, angle=3e-3), description="one sigma of the motion capture; own choice")
