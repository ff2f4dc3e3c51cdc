"""The datasets of the proof: what is hidden in each, and how it is made.

There are three sources of truth.  "law" injects the effect's own law into drops (law_drops).  "mechanism" simulates
compliant contact in continuous time, in which the effect follows from its cause (simulate/compliant).  "drake" does the
same for the causes that Drake's MultibodyPlant supports (simulate/drake).

Sizes raise the base law's error (for effects in flight the misfit of arcs, for the touch that of gaps) to about three
times the noise floor.  They were fixed on seeds in `DEVELOPMENT`; the table uses `SEEDS` and above.  For the detection
curve the factor √(R² − 1) / √8 scales them to R times the floor, as if squares of misfit and noise added up.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.contact import LAWS
from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.proof.sizes import EPSILON, LAW, MU, law_size, stored_factor
from thesis_lib.critique.simulation.law_drops import simulate_law_drops
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import CAUSES, ELLIPSE_BODY, PROOF_RELEASE, RIG_NOISE, SQUARE, HiddenCauses

NOTHING = "nothing"
SOURCES = ("law", "mechanism", "drake")
RATIO = 3.0  # base law's misfit over the noise floor, at the stored sizes
DEVELOPMENT = range(0, 1000)  # seeds for tuning; never in the table
SEEDS = 1000  # first seed of the table

# two causes at once, from different families; a pair of the source "law" has the effects that describe them
PAIRS = (
    ("hunt_crossley", "tilt"),
    ("com_offset_x", "linear_drag"),
    ("friction_anisotropy", "gravity_error"),
    ("tangential_compliance", "time_lag"),
    ("wear", "plate_velocity"),
    ("inertia_error", "surface_height"),
    ("angle_offset", "restitution_slope"),
    ("rolling_lever", "drift"),
    ("size_error", "quadratic_drag"),
    ("mirrored", "hunt_crossley"),
)


@dataclass(frozen=True)
class Case:
    """One dataset of the proof: `drops` releases with `noise` times the rig's.

    `truth` is an effect (law) or cause (mechanism, drake), two of them joined by "+", or "nothing"; `ratio` is the
    nominal misfit over the noise floor.
    """

    source: str
    truth: str
    seed: int
    drops: int = 150
    noise: float = 1.0
    ratio: float = RATIO

    def __str__(self) -> str:
        size = f"ratio {self.ratio:g}, {self.drops} drops, noise {self.noise:g}"
        return f"{self.source}/{self.truth} {self.seed} ({size})"

    @property
    def hidden(self) -> tuple[str, ...]:
        """Names of the hidden effects or causes."""
        return () if self.truth == NOTHING else tuple(self.truth.split("+"))

    @property
    def kind(self) -> str:
        """One of "single", "pair", "outside" (no effect of the library describes the cause) or "nothing"."""
        if len(self.expected) != 1:
            return "pair" if self.expected else NOTHING
        return "single" if self.expected[0] else "outside"

    @property
    def expected(self) -> tuple[tuple[str, ...], ...]:
        """For each hidden effect or cause the effects that describe it, the best first; () if outside the library.

        KeyError if there is no such effect or cause.
        """
        return tuple((EFFECTS[n].name,) if self.source == "law" else CAUSES[n].effects for n in self.hidden)

    @property
    def body(self) -> Body:
        """The ellipse of the chapter, or a square if corners matter."""
        corners = {"rounded_corners", *(name for name, cause in CAUSES.items() if cause.polygon_only)}
        return SQUARE if corners & set(self.hidden) else ELLIPSE_BODY


def truths(source: str) -> list[str]:
    """All single truths of a source, "nothing" first."""
    if source == "drake":
        from thesis_lib.simulate.drake.drops import SUPPORTED

        return [NOTHING, *SUPPORTED]
    if source == "law":  # impacts of a law are instants
        return [NOTHING, *(name for name, effect in EFFECTS.items() if not effect.needs_contact_time)]
    return [NOTHING, *CAUSES]


def pairs(source: str) -> list[str]:
    """All pairs of a source."""
    if source == "law":
        return ["+".join(CAUSES[name].effects[0] for name in pair) for pair in PAIRS]
    return ["+".join(pair) for pair in PAIRS if set(pair) <= set(truths(source))]


def make(case: Case) -> tuple[Dataset, dict[str, float]]:
    """The dataset, and the true parameters by full name; empty unless the source is "law"."""
    rng = generator(case.seed, "proof", case.source, case.truth)
    noise = Noise(position=case.noise * RIG_NOISE.position, angle=case.noise * RIG_NOISE.angle)  # pyright: ignore[reportOperatorIssue]
    factor = float(np.sqrt(case.ratio**2 - 1.0) / np.sqrt(RATIO**2 - 1.0))
    if case.source == "law":
        true = {"mu": MU, "epsilon": EPSILON}
        for name in case.hidden:
            true |= {f"{name}.{k}": v for k, v in law_size(name, factor * stored_factor(name)).items()}
        model = Model(LAWS[LAW], tuple(EFFECTS[name] for name in case.hidden))
        drops = simulate_law_drops(case.body, PROOF_RELEASE, case.drops, model, true, noise=noise, rng=rng)
        return drops, true
    hidden: dict = {name: True if name == "mirrored" else factor * CAUSES[name].size for name in case.hidden}
    if case.source == "drake":
        from thesis_lib.simulate.drake.drops import simulate_drake_drops as simulate
    else:
        from thesis_lib.simulate.compliant.drops import simulate_compliant_drops as simulate
    drops = simulate(case.body, PROOF_RELEASE, case.drops, hidden=HiddenCauses(**hidden), noise=noise, rng=rng)
    return Dataset("proof", drops.header, drops.trajectories), {}
