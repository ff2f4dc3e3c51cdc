"""Settings of the critique, and of the datasets that the pipeline criticises."""

from typing import Annotated

from pydantic import Field

from thesis_lib.foundation.settings import Section

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class CritiqueSettings(Section):
    """Settings of the critique; all own choices."""

    held_out_share: float = Field(0.3, gt=0, lt=1, description="share of trials that no choice sees")
    folds: int = Field(5, ge=2, description="K of the K-fold over training trials")
    max_effects: int = Field(4, ge=0, description="effects in one model")
    finalists: int = Field(5, ge=1, description="candidates that are fitted in full at each step")
    rivals: int = Field(3, ge=1, description="laws with which the first effect is tried")
    alpha: float = Field(0.01, gt=0, lt=1, description="level of the null that counts the candidates tried")
    material_share: float = Field(0.05, ge=0, description="least fall of a held-out error, over that error")
    material_floor: float = Field(
        0.25, ge=0, description="least fall of a held-out error, over the noise floor"
    )
    excess_scatter: float = Field(
        1.5,
        gt=1,
        description="median held-out error over that of noise, above which something is left unexplained",
    )
    tell_apart: float = Field(
        3.0, gt=0, description="nats in total below which two effects cannot be told apart"
    )


class CritiqueRun(Section):
    """The critique in the pipeline."""

    datasets: tuple[Name, ...] = Field(
        ("planar_impact", "planar_dice", "drops"),
        description="datasets to criticise; measured ones that are not present are left out, and said so",
    )
    effects: dict[Name, tuple[Name, ...]] = Field(
        {}, description="dataset -> effects to switch on instead of the automatic choice"
    )
    max_trials: Annotated[int, Field(ge=10)] | None = Field(
        None, description="trials used a dataset, the first ones; null: all, as on the command line"
    )
    proof: tuple[str, ...] = Field(
        (
            "law/nothing",
            "law/tangential_restitution",
            "law/com_offset",
            "mechanism/nothing",
            "mechanism/hunt_crossley",
        ),
        description="source/truth of the proof's datasets that the pipeline runs again to check the stored table",
    )
    settings: CritiqueSettings = CritiqueSettings()
