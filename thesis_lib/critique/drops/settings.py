"""Settings of the critique, and of the datasets that the pipeline criticises."""

from typing import Annotated

from pydantic import Field

from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.foundation.settings import Section

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class CritiqueSettings(SearchSettings):
    """Settings of the critique of drops; all own choices."""

    rivals: int = Field(3, ge=1, description="laws with which the first effect is tried")
    contact_time: bool = Field(True, description="fit the time that a contact takes, where trajectories show it")
    episodes: bool = Field(True, description="use hits that follow each other too quickly to see the flight between")
    max_terms: int = Field(2, ge=0, description="terms proposed where no effect of the library explains; 0: none tried")
    excess_scatter: float = Field(1.5, gt=1, description="median held-out error over noise; beyond: unexplained")


class CritiqueRun(Section):
    """The critique in the pipeline."""

    datasets: tuple[Name, ...] = Field(
        ("planar_impact", "planar_dice", "drops"), description="to criticise; absent measured ones are left out"
    )
    effects: dict[Name, tuple[Name, ...]] = Field({}, description="dataset -> effects to switch on instead of choosing")
    max_trials: dict[Name, Annotated[int, Field(ge=10)]] = Field(
        {"planar_dice": 150}, description="dataset -> first trials used; others: all"
    )
    proof: tuple[str, ...] = Field(
        ("law/nothing", "law/tangential_restitution", "law/com_offset", "mechanism/nothing", "mechanism/hunt_crossley"),
        description="source/truth of the proof's datasets that the pipeline runs again to check the stored table",
    )
    settings: CritiqueSettings = CritiqueSettings()
