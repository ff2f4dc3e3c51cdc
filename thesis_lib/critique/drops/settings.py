"""Settings of the critique, and of the datasets that the pipeline criticises."""

from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.foundation.settings import Section

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class OneBody(Section):
    """Limits beyond which drops are of two bodies, or of a motion that is not planar; tried on all simulated causes."""

    shrink: float = Field(
        3.0, gt=1, description="scatter with one body over that with two: splitting an even spread gives 2"
    )
    clear: float = Field(
        9.0, gt=0, description="difference of χ² at which a trial clearly belongs to one body: odds of 90 to 1"
    )
    unclear: float = Field(
        0.15, ge=0, le=1, description="largest share of trials without a clear body: a drift leaves many in between"
    )
    smallest: float = Field(
        0.2, ge=0, le=0.5, description="least share of trials of either body: fewer may be outliers"
    )
    near_noise: float = Field(
        1.5, ge=1, description="scatter over a known noise: with two bodies it must be below this, with one above"
    )
    sideways: float = Field(
        0.4,
        gt=0,
        description="acceleration in flight along the surface or in rotation, one sigma over gravity, beyond which the "
        "motion is not planar: a surface tilted by 0.13 rad gives 0.19",
    )


class TermChoice(Section):
    """Choice of the terms that are candidates if no effect in the library explains the error."""

    fitted: int = Field(
        12, ge=1, description="terms fitted at each start, the best by the regression, beside all single factors"
    )
    simpler: float = Field(
        1.0, ge=0, description="nats that a product must gain over a single factor, which is simpler"
    )
    finalists: int = Field(4, ge=1, description="terms tried with every impact law: a wrong law hides a right term")
    named: float = Field(
        10.0,
        ge=0,
        description="least quick gain in nats of a named effect that is tried beside a term: it must be large to count",
    )


class ElsewhereSettings(Section):
    """Limits beyond which hits away from the surface are more than errors of tracking (`elsewhere`)."""

    sigmas: float = Field(
        20.0,
        gt=0,
        description="distance of a single hit from the surface, in sigmas of noise and of the spread of all hits; "
        "without other objects, the gaps of two of some 7,800 single hits exceed it",
    )
    push: float = Field(
        6.0,
        gt=0,
        description="least velocity change at a hit off the surface, in standard errors; without other objects, none "
        "of 14 such changes in filtered samples exceeds 3",
    )
    trials: int = Field(3, ge=1, description="least number of trials with such a hit")
    share: float = Field(0.02, ge=0, le=1, description="least share of the trials with such a hit")


class CritiqueSettings(SearchSettings):
    """Settings of the critique of drops; all own choices."""

    rivals: int = Field(3, ge=1, description="laws with which the first effect is tried")
    contact_time: bool = Field(True, description="fit the duration of contacts, if there are trajectories")
    episodes: bool = Field(True, description="use hits that follow each other too quickly to see the flight between")
    channels: tuple[Literal["rest", "slide"], ...] = Field(
        (),
        description="in the plane, evidence beside impacts and flights: bodies that lie still (rest), or slide (slide)",
    )
    max_terms: int = Field(2, ge=0, description="most terms proposed if no effect explains the error; 0: none")
    terms: TermChoice = TermChoice()
    excess_scatter: float = Field(
        1.5,
        gt=1,
        description="held-out misfit of a channel over noise (impacts: median error); beyond this times 1 + 2 s, with "
        "its relative standard error s: unexplained",
    )
    one_body: OneBody = OneBody()
    elsewhere: ElsewhereSettings = ElsewhereSettings()
    near_noise: float = Field(
        1.5,
        ge=1,
        description="median error over noise, and mean squares of the other channels, up to which slopes show whether "
        "a candidate is worth a fit: far from the truth they mean little",
    )
    far_from_noise: float = Field(
        5.0,
        ge=1,
        description="median error over noise beyond which, in space, no channel vetoes an effect that raises the total "
        "log score: such a model errs everywhere, and each cause in turn moves errors from one channel to another; "
        "likewise, a channel with a misfit beyond it vetoes nothing",
    )
    buried_excess: float = Field(
        2.0,
        ge=1,
        description="median error over noise beyond which, in space, a fall of this ratio counts as material if the "
        "mean error is less than so many noise floors: a few episodes with large noise dominate both means and hide "
        "the change of all other hits",
    )
    reserve_excess: float = Field(
        1.2,
        ge=1,
        description="median error over noise beyond which contacts that take time are tried: each fit costs as much as "
        "ten fits of an impact law",
    )
    reserve_turn: float = Field(
        0.02, ge=0, description="rad, turn during a contact beyond which contacts that take time are tried"
    )
    reserve_gain: float = Field(
        3.0, ge=0, description="nats, gain of the short-time limit of such a contact beyond which it is tried"
    )
    unpredictable: float = Field(
        0.25,
        gt=0,
        description="spread of the state after an episode by noise before it, over the change of velocity, beyond "
        "which the episode is left out: it cannot test a model",
    )
    contradicts: float = Field(
        4.0,
        gt=0,
        description="standard errors between an effect and the known properties of the body beyond which it is not the "
        "cause: by chance once in 16,000 effects, with two parameters once in 3,000",
    )
    explains: float = Field(
        0.5,
        ge=0,
        le=1,
        description="if structure is left: least share of what exceeds the noise that the model explains, in one of "
        "the errors that an effect lowers; otherwise the effect may only stand in for the cause",
    )


class CritiqueRun(Section):
    """The critique in the pipeline."""

    datasets: tuple[Name, ...] = Field(
        ("planar_impact", "planar_dice", "contactnets_cube", "drops"),
        description="datasets to criticise; measured ones that are absent are left out",
    )
    effects: dict[Name, tuple[Name, ...]] = Field({}, description="dataset -> effects to switch on instead of choosing")
    max_trials: dict[Name, Annotated[int, Field(ge=10)]] = Field(
        {"planar_dice": 150, "contactnets_cube": 120}, description="dataset -> number of first trials used; others: all"
    )
    jobs: dict[Name, Annotated[int, Field(ge=1)]] = Field(
        {"contactnets_cube": 64},
        description="dataset -> processes that share its critique, at most the cores of the run; others: 1",
    )
    proof: tuple[str, ...] = Field(
        ("law/nothing", "law/tangential_restitution", "law/com_offset", "mechanism/nothing", "mechanism/hunt_crossley"),
        description="source/truth of the proof's datasets that the pipeline runs again to check the stored table",
    )
    settings: CritiqueSettings = CritiqueSettings()
