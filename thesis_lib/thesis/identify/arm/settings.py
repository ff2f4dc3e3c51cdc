"""Settings of the identification of arm and disk."""

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.thesis.identify.arm.parameters import ArmPrior


class ArmFitSettings(Section):
    """How the likelihood of arm and disk is searched."""

    prior: ArmPrior = ArmPrior()
    draws: int = Field(400, ge=1, description="of the prior that are screened in an attempt")
    candidates: int = Field(6, ge=1, description="that go on from the screening")
    segments: tuple[int, ...] = Field((10, 25, 60), description="steps, lengths of the segments in turn")
    growth: int = Field(30, ge=3, description="steps by which the horizon grows; a few contact events each time")
    iterations: int = Field(15, ge=1, description="of a stage at most")
    kicks: int = Field(
        320, ge=2, description="points around the best answer in a round, of which the best `candidates` are fitted"
    )
    rounds: int = Field(6, ge=0, description="of kicks at most; two in a row without gain end them")
    gain: float = Field(2e-3, gt=0, description="of χ², relative: less does not count")
    gate: float = Field(1.1, gt=1, description="largest χ²/n; its standard error is 0.02 for 240 steps")
    attempts: int = Field(2, ge=1, description="from new draws, with another growth, until the gate is passed")


class ArmStudy(Section):
    """Forces and base parameters of arm and disk."""

    trajectories: int = Field(20, ge=1, description="with enough contact; as many as the target's median is over")
    snr_db: float = Field(40.0, description="dB, signal-to-noise ratio of each channel of q and v")
    tolerances: float = Field(
        3.0, ge=0, description="standard deviations within which the plain program takes a gap or a slip as zero"
    )
    fit: ArmFitSettings = ArmFitSettings()
