"""Settings of the critique of mechanisms and of its study."""

from pydantic import Field

from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.foundation.settings import Section
from thesis_lib.simulate.mechanisms.hidden_forces import HiddenSizes, MechanismKind


class EquationWindowSettings(Section):
    """How the equations are gathered; own choices."""

    window: int = Field(20, ge=1, description="steps, 0.1 s: shorter windows see noise, longer ones blur the cause")
    tapered_window: int = Field(
        40,
        ge=1,
        description="steps of windows that weigh their middle most and half overlap, which continuous motion has",
    )
    min_window: int = Field(5, ge=1, description="steps; shorter ones cost more than they tell")
    gap_sigmas: float = Field(4.0, gt=0, description="standard deviations of a gap: within, a contact counts as active")
    exact_db: float = Field(80.0, description="dB, noise ascribed to exact states: the accuracy asked of the model")


class MechanismSettings(Section):
    """Settings of the critique of mechanisms; thresholds are those of impacts."""

    windows: EquationWindowSettings = EquationWindowSettings()
    thresholds: SearchSettings = SearchSettings()
    resamples: int = Field(999, ge=199, description="draws of the null distributions and of the bootstrap")


class HiddenStudy(Section):
    """The study; own choices."""

    sizes: HiddenSizes = HiddenSizes()
    critique: MechanismSettings = MechanismSettings()
    trials: int = Field(16, ge=4, description="trials a dataset; five of them held out")
    seeds: int = Field(6, ge=1, description="datasets of each truth and noise; more need more time only")
    snr_db: tuple[float | None, ...] = Field(
        (None, 60.0, 40.0), min_length=1, description="dB on q and v as in table 2.1; null: exact states"
    )
    forces_of: tuple[MechanismKind, str] = Field(
        ("arm", "viscous_joint_friction"), description="mechanism and truth whose contact forces are drawn"
    )
