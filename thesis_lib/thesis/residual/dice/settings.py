"""Settings of the study of thrown dice: how throws are read, fitted, thrown to rest and compared."""

from pydantic import Field

from thesis_lib.foundation.settings import Section
from thesis_lib.learners.settings import GaussianProcessSettings
from thesis_lib.thesis.residual.throwing.settings import ThrowSettings


class DiceDataSettings(Section):
    """How states are read from recorded throws; all own choices."""

    guard: float = Field(0.002, ge=0, description="s about a hit whose samples belong to no flight")
    fewest: int = Field(6, ge=4, description="samples of a flight that gives a velocity")
    most: int = Field(14, ge=4, description="samples of a flight that are used, those nearest to the contact")
    longest_contact: float = Field(0.03, gt=0, description="s between flights up to which all hits are one contact")
    drag: float = Field(0.35, ge=0, description="1/s; in flight: 0.3 in the dice's first flights, 0.5 later")
    stray: tuple[float, float, float] = Field(
        (0.4, 0.4, 6.0), description="m/s², rad/s²: one sigma beside drag, as arcs find"
    )
    long_flight: int = Field(25, ge=10, description="samples from which a flight tells the drag")
    still: float = Field(0.002, gt=0, description="m (rotation: times k) moved in the last samples, at most, at rest")
    last: int = Field(10, ge=2, description="samples at the end of a throw that give its resting pose")


class DiceFitSettings(Section):
    """The fit of body and contact."""

    evaluations: int = Field(3500, ge=50, description="of the misfit in 19 parameters; with 2500 it is 5 % larger")
    choice_evaluations: int = Field(1000, ge=50, description="the same of each fit that chooses mechanisms")
    contacts: int = Field(400, ge=20, description="training contacts used, drawn at random from those fast enough")
    slowest: float = Field(0.6, ge=0, description="m/s in the kinetic metric, of contacts that count")
    cap: float = Field(1.0, gt=0, description="m/s, e_max")


class DiceStudySettings(Section):
    """The study of thrown dice."""

    throws: int | None = Field(None, ge=40, description="first throws used; null: all")
    parts: int = Field(5, ge=2, description="disjoint parts of the throws: each is held out once, the others train")
    judged: int | None = Field(None, ge=1, description="first parts that are held out; null: all")
    parts_seed: int = Field(20261124, ge=0, description="deals the throws into parts, so that part 0 stays set apart")
    particles: int = Field(
        160, ge=10, description="of each held-out throw's belief; with 40 two draws differed by 2 % of the named faces"
    )
    limit_copies: int = Field(10, ge=2, description="perturbed starts of each held-out throw for the limit")
    bootstrap: int = Field(1000, ge=0, description="replicates over throws for intervals")
    training_contacts: int = Field(2000, ge=20, description="most contacts a process learns: all of the public throws")
    duration: float = Field(0.012, gt=0, description="s, T of the contact map: longer than double hits last")
    slowest: float = Field(0.12, gt=0, description="m/s, g T, as weight alone gives; slower ones are left to the law")
    edges: tuple[float, ...] = Field((1.6,), description="m/s between ranges with own processes; gap 1.5 to 2.2")
    outlier: float = Field(6.0, gt=1, description="median residuals above which a contact does not train; counted")
    slide_grid: tuple[float, ...] = Field(
        (0.08, 0.1, 0.13, 0.16, 0.2, 0.25, 0.32, 0.4, 0.5, 0.7, 1.0, 1.4),
        description="candidates for the friction of sliding and of the slowest contacts, steps of a quarter",
    )
    data: DiceDataSettings = DiceDataSettings()
    fit: DiceFitSettings = DiceFitSettings()
    throw: ThrowSettings = ThrowSettings()
    process: GaussianProcessSettings = Field(
        GaussianProcessSettings(restarts=6),
        description="with 2 starts the search missed how sharply a contact changes with the angle, by 80 nats",
    )
