"""Settings of the impact study of chapter 3."""

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.foundation.settings import Section

# the law as in the authors' code where that differs from the definition; else the law itself
SIX_AS_PUBLISHED = tuple(f"{name}_as_published" if f"{name}_as_published" in LAWS else name for name in SIX_LAWS)
Share = Annotated[float, Field(gt=0, lt=1)]
Count = Annotated[int, Field(ge=1)]
DatasetName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


def _known_law(name: str) -> str:
    if name not in LAWS:
        raise ValueError(f"there is no law {name!r}; choose one of {', '.join(LAWS)}")
    return name


def _ascending(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError(f"a range must go from a smaller to a larger number; got {ends[0]:g} to {ends[1]:g}")
    return ends


ASCENDING = AfterValidator(_ascending)
Friction = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Restitution = Annotated[float, Field(ge=0, le=1)]
LawName = Annotated[str, AfterValidator(_known_law), Field(json_schema_extra={"enum": list(LAWS)})]


class Convergence(Section):
    """Settings for ensemble parameters against the number of impacts (figure 3-7 b)."""

    laws: tuple[LawName, ...] = Field(SIX_AS_PUBLISHED, min_length=1, description="laws shown; the thesis has one")
    subsets: Count = Field(3, description="random subsets, as in the thesis")
    sizes: tuple[Count, ...] = Field(
        (5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 125, 150, 200, 250, 300, 400, 500, 600, 800),
        min_length=1,
        description="numbers of impacts k; larger numbers use the whole training set",
    )


class Topography(Section):
    """Settings of the cost over (μ, ε) (figure 3-7 a)."""

    law: LawName = Field("whittaker_as_published", description="the thesis shows the Whittaker model")
    n: Count = Field(150, description="impacts in the sum, as in the thesis")
    points: Annotated[int, Field(ge=5)] = Field(41, description="points per side of the grid")
    mu: Annotated[tuple[Friction, Friction], ASCENDING] = Field((0.0, 0.4), description="range of μ; own choice")
    epsilon: Annotated[tuple[Restitution, Restitution], ASCENDING] = Field(
        (0.2, 0.9), description="range of ε; own choice"
    )

    def axes(self) -> tuple[np.ndarray, np.ndarray]:
        """Grid lines in μ and ε, (points,) each."""
        return np.linspace(*self.mu, self.points), np.linspace(*self.epsilon, self.points)


class Chapter3(Section):
    """Settings of the impact study, chapter 3."""

    datasets: tuple[DatasetName, ...] = Field(
        ("planar_impact", "planar_dice", "drops"),
        description="datasets to study; missing measured datasets are left out and reported",
    )
    filter: Literal["keep", "thesis"] = Field(
        "keep", description="keep flagged impacts, or remove them as in the thesis"
    )
    max_impacts: Count | None = Field(
        2000, description="impacts drawn from a dataset, as many as in the thesis; null: all"
    )
    train_share: Share = Field(0.5, description="share of trials for identification; own choice")
    bootstrap: Annotated[int, Field(ge=2)] = Field(200, description="replicates for standard errors")
    convergence: Convergence = Convergence()
    topography: Topography = Topography()
    range_tolerances: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (0.00275, 0.00825, 0.0275),
        min_length=1,
        description="m/s, impulse over mass, of an outcome in range; own choice: the first fits the thesis's numbers",
    )
