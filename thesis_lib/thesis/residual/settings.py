"""Settings of chapter 4's study of learned contact models."""

from typing import Annotated

from pydantic import Field

from thesis_lib.contact import SIX_LAWS
from thesis_lib.foundation.settings import Section
from thesis_lib.learners.settings import GaussianProcessSettings
from thesis_lib.thesis.impact_study.settings import LawName


class LearningStudySettings(Section):
    """Settings of the study of figures 4-5 and 4-6."""

    laws: tuple[LawName, ...] = Field(SIX_LAWS, min_length=2, description="laws with which learners are compared")
    base_law: LawName = Field("anitescu_potra_newton", description="law of class 2; in the thesis, Anitescu-Potra")
    sizes: tuple[Annotated[int, Field(ge=5)], ...] = Field(
        (10, 20, 30, 50, 75, 100, 150, 200, 300, 450, 700, 1000),
        min_length=1,
        description="training impacts; sizes beyond the impacts of a split are left out (own choice)",
    )
    splits: Annotated[int, Field(ge=2)] = Field(10, description="random splits of the trials (own choice)")
    held_out_share: float = Field(0.25, gt=0, lt=1, description="share of the trials held out (own choice)")
    density_size: int = Field(450, ge=5, description="training impacts of figure 4-5, as in the thesis")
    max_impacts: int | None = Field(2000, ge=20, description="impacts used of a dataset (own choice)")
    within: float = Field(0.05, gt=0, lt=1, description="relative distance to the last error: converged (own choice)")
    gaussian_process: GaussianProcessSettings = GaussianProcessSettings()
