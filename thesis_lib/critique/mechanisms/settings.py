"""Settings of the critique of mechanisms and of the study that tests it."""

from pydantic import Field

from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.mechanisms.hidden_forces import HiddenSizes, MechanismKind


class EquationWindowSettings(Section):
    """How the equations of motion are gathered into windows; values chosen for this project."""

    window: int = Field(20, ge=1, description="steps, 0.1 s: shorter windows see mostly noise, longer ones blur causes")
    tapered_window: int = Field(
        40,
        ge=1,
        description="steps of the half-overlapping windows, weighted towards their middle, used for continuous motion",
    )
    min_window: int = Field(5, ge=1, description="steps; shorter windows cost more than they contribute")
    gap_sigmas: float = Field(4.0, gt=0, description="standard deviations of a gap within which a contact is active")
    exact_db: float = Field(80.0, description="dB, noise ascribed to exact states: the accuracy required of the model")


class MechanismSettings(Section):
    """Settings of the critique of mechanisms; the thresholds are the same as for impacts."""

    windows: EquationWindowSettings = EquationWindowSettings()
    thresholds: SearchSettings = SearchSettings()
    resamples: int = Field(999, ge=199, description="draws of the null distributions and of the bootstrap")


class HiddenStudy(Section):
    """Settings of the study with hidden effects; values chosen for this project."""

    sizes: HiddenSizes = HiddenSizes()
    critique: MechanismSettings = MechanismSettings()
    trials: int = Field(16, ge=4, description="trials per dataset; five of them are held out")
    seeds: int = Field(6, ge=1, description="datasets for each truth and noise level; more only take more time")
    snr_db: tuple[float | None, ...] = Field(
        (None, 60.0, 40.0), min_length=1, description="dB, for q and v as in table 2.1; null: exact states"
    )
    forces_of: tuple[MechanismKind, str] = Field(
        ("arm", "viscous_joint_friction"), description="mechanism and truth whose contact forces are drawn"
    )
