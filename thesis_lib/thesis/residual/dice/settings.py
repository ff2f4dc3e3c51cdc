"""Settings of the study of thrown dice: reading of the data, fits, simulation to rest, and comparison."""

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.learners.settings import GaussianProcessSettings
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings


class DiceDataSettings(Section):
    """Settings for reading states from recorded throws; all are own choices."""

    guard: float = Field(0.002, ge=0, description="s around a hit whose samples belong to no flight")
    fewest: int = Field(6, ge=4, description="fewest samples of a flight that gives a velocity")
    most: int = Field(14, ge=4, description="most samples of a flight to use, nearest to the contact")
    longest_contact: float = Field(0.03, gt=0, description="s between flights up to which hits are one contact")
    drag: float = Field(0.35, ge=0, description="1/s; in flight: 0.3 in the dice's first flights, 0.5 later")
    stray: tuple[float, float, float] = Field(
        (0.4, 0.4, 6.0), description="m/s², rad/s²: one sigma of acceleration beyond drag, as found from arcs"
    )
    long_flight: int = Field(25, ge=10, description="fewest samples of a flight that is used to fit drag")
    still: float = Field(0.002, gt=0, description="m (rotation: times k), largest motion over the last samples at rest")
    last: int = Field(10, ge=2, description="samples at the end of a throw that give its resting pose")


class DiceFitSettings(Section):
    """Settings for the fit of body and contact."""

    evaluations: int = Field(3500, ge=50, description="of the misfit, 19 parameters; 2500 leave it 5 % larger")
    choice_evaluations: int = Field(1000, ge=50, description="evaluations of each fit that chooses mechanisms")
    contacts: int = Field(400, ge=20, description="training contacts used, drawn at random from the fast ones")
    slowest: float = Field(0.6, ge=0, description="m/s in the kinetic metric, slowest contact used")
    cap: float = Field(1.0, gt=0, description="m/s, e_max, cap of an error")


class DiceStudySettings(Section):
    """Settings of the study of thrown dice."""

    throws: int | None = Field(None, ge=40, description="first throws used; null: all")
    parts: int = Field(5, ge=2, description="disjoint parts of the throws: each is held out once, the others train")
    judged: int | None = Field(None, ge=1, description="first parts that are held out; null: all")
    parts_seed: int = Field(20261124, ge=0, description="assigns the throws to parts, so that part 0 stays set apart")
    particles: int = Field(
        160, ge=10, description="of each held-out throw's belief; with 40, two draws differed in 2 % of the faces"
    )
    limit_copies: int = Field(10, ge=2, description="perturbed starts of each held-out throw for the limit")
    bootstrap: int = Field(1000, ge=0, description="replicates over throws for intervals")
    training_contacts: int = Field(2000, ge=20, description="most contacts a process learns: all published throws")
    duration: float = Field(0.012, gt=0, description="s, T of the contact map: longer than double hits")
    slowest: float = Field(0.12, gt=0, description="m/s, g T, due to weight alone; slower contacts use the law")
    edges: tuple[float, ...] = Field((1.6,), description="m/s between ranges with own processes; gap 1.5 to 2.2")
    outlier: float = Field(6.0, gt=1, description="median residuals above which a contact does not train; counted")
    slide_grid: tuple[float, ...] = Field(
        (0.08, 0.1, 0.13, 0.16, 0.2, 0.25, 0.32, 0.4, 0.5, 0.7, 1.0, 1.4),
        description="candidates for the friction of sliding and of the slowest contacts, in steps of a quarter",
    )
    data: DiceDataSettings = DiceDataSettings()
    fit: DiceFitSettings = DiceFitSettings()
    throw: ThrowSettings = ThrowSettings()
    process: GaussianProcessSettings = Field(
        GaussianProcessSettings(restarts=6),
        description="with 2 starts, the search missed the steep dependence on the angle, by 80 nats",
    )
