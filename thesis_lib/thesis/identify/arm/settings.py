"""Settings of the identification of arm and disk."""

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.thesis.identify.arm.parameters import ArmPrior


class ArmFitSettings(Section):
    """Search for the maximum of the likelihood of arm and disk."""

    prior: ArmPrior = ArmPrior()
    draws: int = Field(400, ge=1, description="draws from the prior that are screened in an attempt")
    candidates: int = Field(6, ge=1, description="candidates kept after the screening")
    segments: tuple[int, ...] = Field((10, 25, 60), description="steps, lengths of the segments in turn")
    growth: int = Field(30, ge=3, description="steps by which the horizon grows; a few contact events each time")
    iterations: int = Field(15, ge=1, description="most iterations of a stage")
    kicks: int = Field(
        320, ge=2, description="points around the best result in a round, of which the best `candidates` are fitted"
    )
    rounds: int = Field(6, ge=0, description="most rounds of kicks; two in a row without gain end them")
    gain: float = Field(2e-3, gt=0, description="relative fall of χ² that counts as a gain")
    gate: float = Field(1.1, gt=1, description="largest χ²/n; its standard error is 0.02 for 240 steps")
    attempts: int = Field(2, ge=1, description="attempts, with new draws and other growth, until the gate passes")


class ArmStudy(Section):
    """Forces and base parameters of arm and disk."""

    trajectories: int = Field(20, ge=1, description="with enough contact, over which the median is taken")
    snr_db: float = Field(40.0, description="dB, signal-to-noise ratio of each channel of q and v")
    tolerances: float = Field(
        3.0, ge=0, description="standard deviations within which the plain program treats a gap or a slip as zero"
    )
    fit: ArmFitSettings = ArmFitSettings()
