"""Settings of the critique, and of the datasets that the pipeline criticises."""

from typing import Annotated, Literal

from pydantic import Field

from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.foundation.settings import Section

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class OneBody(Section):
    """When drops count as those of two bodies, or of none that moves in a plane; tried on every simulated cause."""

    shrink: float = Field(
        3.0, gt=1, description="scatter with one body over that with two: splitting an even spread gives 2"
    )
    clear: float = Field(
        9.0, gt=0, description="difference of χ² at which a trial clearly belongs to one body: odds of 90 to 1"
    )
    unclear: float = Field(
        0.15, ge=0, le=1, description="largest share of trials without a clear body: what drifts leaves many in between"
    )
    smallest: float = Field(
        0.2, ge=0, le=0.5, description="least share of trials of either body: fewer may be wild ones"
    )
    near_noise: float = Field(
        1.5, ge=1, description="scatter over a known noise: two bodies must stay below it, as one alone may not"
    )
    sideways: float = Field(
        0.4,
        gt=0,
        description="acceleration in flight along the surface or in rotation, one sigma over gravity, beyond which the "
        "motion is not planar: a surface tilted by 0.13 rad gives 0.19",
    )


class TermChoice(Section):
    """Which terms are candidates, where no effect of the library explains."""

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
    """When hits away from the surface are more than errors of tracking (`elsewhere`)."""

    sigmas: float = Field(
        20.0,
        gt=0,
        description="sigmas of noise, and of the spread of all hits, by which a single hit is off the surface; where "
        "nothing else is hit, the gaps of two of some 7,800 single hits are",
    )
    trials: int = Field(3, ge=1, description="fewest trials with such a hit that count")
    share: float = Field(0.02, ge=0, le=1, description="least share of the trials that counts")


class CritiqueSettings(SearchSettings):
    """Settings of the critique of drops; all own choices."""

    rivals: int = Field(3, ge=1, description="laws with which the first effect is tried")
    contact_time: bool = Field(True, description="fit the time that a contact takes, where trajectories show it")
    episodes: bool = Field(True, description="use hits that follow each other too quickly to see the flight between")
    channels: tuple[Literal["rest", "slide"], ...] = Field(
        (), description="evidence beside impacts and flights: of bodies that lie still, of bodies that slide"
    )
    max_terms: int = Field(2, ge=0, description="terms proposed where no effect of the library explains; 0: none tried")
    terms: TermChoice = TermChoice()
    excess_scatter: float = Field(1.5, gt=1, description="median held-out error over noise; beyond: unexplained")
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
        description="median error over noise beyond which, in space, no channel vetoes an effect that raises the log "
        "score of all: a model so far off errs everywhere, and each cause in turn moves some of that from one channel "
        "to another; nor does a channel whose own misfit is beyond it",
    )
    buried_excess: float = Field(
        2.0,
        ge=1,
        description="median error over noise beyond which, in space, a fall of this ratio counts as material where the "
        "mean error is less than so many noise floors: a few episodes in which noise is large make up both means, and "
        "hide what an effect does to all other hits",
    )
    reserve_excess: float = Field(
        1.2,
        ge=1,
        description="median error over noise beyond which contacts that take time are tried: a fit of theirs costs ten "
        "of an impact law",
    )
    reserve_turn: float = Field(
        0.02, ge=0, description="rad, turn during a contact beyond which it is not an impulse, and is tried"
    )
    reserve_gain: float = Field(
        3.0, ge=0, description="nats that the limit of such a contact for short times gains, beyond which it is tried"
    )
    unpredictable: float = Field(
        0.25,
        gt=0,
        description="spread that noise before an episode gives the state after it, over its change of velocity, beyond "
        "which the episode is left out: it says nothing about a model",
    )
    contradicts: float = Field(
        4.0,
        gt=0,
        description="standard errors by which an effect denies what is known of the body, beyond which it is no cause: "
        "by chance once in 16,000 effects, of two parameters once in 3,000",
    )


class CritiqueRun(Section):
    """The critique in the pipeline."""

    datasets: tuple[Name, ...] = Field(
        ("planar_impact", "planar_dice", "contactnets_cube", "drops"),
        description="to criticise; absent measured ones are left out",
    )
    effects: dict[Name, tuple[Name, ...]] = Field({}, description="dataset -> effects to switch on instead of choosing")
    max_trials: dict[Name, Annotated[int, Field(ge=10)]] = Field(
        {"planar_dice": 150, "contactnets_cube": 120}, description="dataset -> first trials used; others: all"
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
