"""The datasets of the proof: the causes hidden in each, and how it is simulated.

The source of a dataset is the law or simulator that makes its drops:

| source             | contact                                             | in                 |
|--------------------|-----------------------------------------------------|--------------------|
| law                | the effect's own law, injected                      | law_drops          |
| mechanism          | hysteretic, in continuous time                      | simulate/compliant |
| drake              | Drake's spring on a pad with the same restitution   | simulate/drake     |
| drake_point        | Drake's spring with Hunt and Crossley's dissipation | simulate/drake     |
| drake_hydroelastic | Drake's pressure field in a soft body               | simulate/drake     |
| mujoco             | MuJoCo's spring, damper and viscous friction        | simulate/mujoco    |
| mujoco_usual       | the same with settings that are common in practice  | simulate/mujoco    |

Only in the source "law" an effect acts by its own law; elsewhere it follows from its physical cause.  In Drake's own
contact models restitution falls with speed and the body yields; naming that with nothing hidden is right (`by_itself`).

In "mujoco_usual" nothing is hidden.  Its seed draws body mass, friction, restitution, solimp and impratio (`USUAL`);
the behaviour of a contact then depends on the mass behind it.

Sizes raise the base law's error (for effects in flight the misfit of arcs, for effects on the touch the misfit of gaps)
to about three times the noise floor.  They were fixed on seeds below `SEEDS`; the table uses `SEEDS` and above.
Sources with contacts of realistic duration have their own sizes, by shape (`find_size`).  For the detection curve the
factor √(R² − 1) / √8 scales the sizes to R times the floor, assuming that squares of misfit and noise add up.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.contact import LAWS
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.simulation.law_drops import simulate_law_drops
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS, effects_in
from thesis_lib.foundation.randomness import generator
from thesis_lib.mechanics.space import PLANE
from thesis_lib.simulate.mujoco.causes import OWN, MujocoCauses
from thesis_lib.simulate.mujoco.causes import SUPPORTED as MUJOCO
from thesis_lib.simulate.rig.hidden_causes import (
    CAUSES,
    ELLIPSE_BODY,
    PROOF_RELEASE,
    RIG_NOISE,
    SQUARE,
    Cause,
    CompliantContact,
    HiddenCauses,
)
from thesis_lib.simulate.rig.record import DropsWithTruth
from thesis_lib.studies.proof.sizes import EPSILON, LAW, MU, cause_size, law_size, stored_factor
from thesis_lib.studies.proof.store import NOTHING

# default contact time in s of each source; 0: impacts are instantaneous
CONTACT_TIMES = {
    "law": 0.0,
    "mechanism": 2e-5,
    "drake": 2e-5,
    "drake_point": 1e-3,
    "drake_hydroelastic": 1e-3,
    "mujoco": 1e-3,
    "mujoco_usual": 1e-3,
}
SOURCES = tuple(CONTACT_TIMES)
RIGID = ("law", "mechanism", "drake")  # sources of the first table of the proof: contacts far shorter than real ones
# contact surface (`DropsInDrake`) of each source in Drake
SURFACES_OF = {"drake": "pad", "drake_point": "point", "drake_hydroelastic": "hydroelastic"}
BODIES = {"ellipse": ELLIPSE_BODY, "square": SQUARE}
OF_SOURCE = -1.0  # as the contact time of a case: use the default of its source
ALL_CAUSES: dict[str, Cause] = CAUSES | OWN
RATIO = 3.0  # base law's misfit over the noise floor, at the stored sizes
SEEDS = 1000  # first seed of the table; seeds below are for tuning
FRESH = 2000  # first seed of the headline table
MUJOCO_STEPS = 60  # time steps in one contact: the instant of touch within a step then moves ε by 1/3 of a per cent
USUAL_STEPS = 200  # ... by a tenth of a per cent
# impedance (solimp) at the touch and at depth, 0.9 and 0.95 by default, and impratio
USUAL = {"impedance": ((0.9, 0.95), (0.9, 0.9), (0.99, 0.99), (0.9999, 0.9999)), "impratio": (1.0, 10.0, 100.0)}
USUAL_MASS, USUAL_FRICTION, USUAL_RESTITUTION = (0.02, 1.0), (0.1, 0.4), (0.3, 0.8)  # kg, 1, 1

# two causes at once, from different families; in the source "law" the effects that describe the two causes are used
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
    """One dataset of the proof: `drops` releases with `noise` times the noise of the rig.

    `truth` is an effect (law) or cause (other sources), two of them joined by "+", or "nothing"; `ratio` is the nominal
    misfit over the noise floor; `shape` is one of `BODIES`, by default the ellipse unless corners matter;
    `contact_time` is in s, by default that of the source.  ValueError if a truth that needs corners is combined with an
    ellipse, or if the source cannot have the contact time (0 for "law", positive for the others).
    """

    source: str
    truth: str
    seed: int
    drops: int = 150
    noise: float = 1.0
    ratio: float = RATIO
    shape: str = ""
    contact_time: float = OF_SOURCE

    def __post_init__(self) -> None:
        cornered = bool(CORNERED & set(self.hidden))
        if not self.shape:
            object.__setattr__(self, "shape", "square" if cornered else "ellipse")
        if self.contact_time == OF_SOURCE:
            object.__setattr__(self, "contact_time", CONTACT_TIMES[self.source])
        if cornered and self.shape == "ellipse":
            raise ValueError(f"{self.truth} needs corners; an ellipse has none")
        if (self.contact_time == 0.0) != (self.source == "law"):
            raise ValueError(f"contacts of the source {self.source} cannot last {self.contact_time:g} s")

    def __str__(self) -> str:
        size = f"ratio {self.ratio:g}, {self.drops} drops, noise {self.noise:g}"
        contact = "" if self.is_usual else f", {self.shape}, {1e3 * self.contact_time:g} ms"
        return f"{self.source}/{self.truth} {self.seed} ({size}{contact})"

    @property
    def is_usual(self) -> bool:
        """Whether shape and contact time are the defaults of this source and truth."""
        usual = replace(self, shape="", contact_time=OF_SOURCE)
        return (self.shape, self.contact_time) == (usual.shape, usual.contact_time)

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
        """Effects that describe each hidden effect or cause, the best first; () for a cause outside the library.

        KeyError if there is no such effect or cause.
        """
        return tuple((EFFECTS[n].name,) if self.source == "law" else ALL_CAUSES[n].effects for n in self.hidden)

    @property
    def by_itself(self) -> tuple[str, ...]:
        """Effects that the contact model of the source has with nothing hidden; naming them is right."""
        if self.source == "drake_point":
            return ("velocity_dependent_restitution", "soft_body")
        if self.source == "drake_hydroelastic":  # a soft body on a hard plate; the contact stiffens with depth
            return ("velocity_dependent_restitution", "soft_body", "velocity_dependent_contact_time")
        return ()

    @property
    def body(self) -> Body:
        """The body of the case's shape; in "mujoco_usual" its mass is drawn at random."""
        body = BODIES[self.shape]
        if self.source != "mujoco_usual":
            return body
        low, high = np.log(USUAL_MASS)
        return body.model_copy(update={"mass": float(np.exp(generator(self.seed, "usual mass").uniform(low, high)))})

    @property
    def contact(self) -> dict[str, Any]:
        """Settings of MuJoCo's contact other than the contact time."""
        if self.source != "mujoco_usual":
            return {"steps": MUJOCO_STEPS}
        rng = generator(self.seed, "usual contact")
        pairs, ratios = USUAL["impedance"], USUAL["impratio"]
        impedance, deep = pairs[rng.integers(len(pairs))]
        return {
            "impedance": impedance,
            "deep_impedance": deep,
            "impratio": ratios[rng.integers(len(ratios))],
            "mu": float(rng.uniform(*USUAL_FRICTION)),
            "epsilon": float(rng.uniform(*USUAL_RESTITUTION)),
            "steps": USUAL_STEPS,
        }

    def size(self, name: str) -> float:
        """Size of the hidden cause `name`, in its unit, at the case's ratio."""
        return self.factor * cause_size(self.source, self.shape, name, ALL_CAUSES[name].size)

    @property
    def sizes(self) -> dict[str, float]:
        """Size of each hidden cause, in its unit; for effects (source law) the factor on their parameters' scales."""
        if self.source == "law":
            return {name: self.factor * stored_factor(name) for name in self.hidden}
        return {name: self.size(name) for name in self.hidden}

    @property
    def factor(self) -> float:
        """Factor on the stored sizes for the case's ratio, assuming that squares of misfit and noise add up."""
        return float(np.sqrt(self.ratio**2 - 1.0) / np.sqrt(RATIO**2 - 1.0))


CORNERED = {"rounded_corners", *(name for name, cause in CAUSES.items() if cause.polygon_only)}


def truths(source: str) -> list[str]:
    """All single truths of a source, "nothing" first."""
    if source in SURFACES_OF:
        from thesis_lib.simulate.drake.drops import SURFACES

        return [NOTHING, *SURFACES[SURFACES_OF[source]]]
    if source == "mujoco":
        return [NOTHING, *MUJOCO]
    if source == "mujoco_usual":
        return [NOTHING]
    if source == "law":  # impacts by a law are instantaneous, and no body slides after them
        left_out = {name for name, e in EFFECTS.items() if e.needs_contact_time or e.channels == ("slide",)}
        return [NOTHING, *(name for name in effects_in(PLANE) if name not in left_out)]
    return [NOTHING, *CAUSES]


def pairs(source: str) -> list[str]:
    """All pairs of hidden effects or causes of a source, joined by "+"."""
    if source == "law":
        return ["+".join(CAUSES[name].effects[0] for name in pair) for pair in PAIRS]
    return ["+".join(pair) for pair in PAIRS if set(pair) <= set(truths(source))]


def make(
    case: Case, sizes: Mapping[str, float] | None = None, rng: np.random.Generator | None = None
) -> tuple[Dataset, dict[str, float]]:
    """Simulate a case; return the dataset and its true parameters by full name (of a cause: that which is its size).

    The hidden `sizes` and the stream `rng` are by default those of the case.
    """
    contact = () if case.is_usual and case.source in RIGID else (case.shape, f"{case.contact_time:g}")
    rng = rng or generator(case.seed, "proof", case.source, case.truth, *contact)
    sizes = case.sizes if sizes is None else sizes
    if case.source == "law":
        true = {"mu": MU, "epsilon": EPSILON}
        for name, factor in sizes.items():
            true |= {f"{name}.{k}": v for k, v in law_size(name, factor).items()}
        model = Model(LAWS[LAW], tuple(EFFECTS[name] for name in sizes))
        drops = simulate_law_drops(case.body, PROOF_RELEASE, case.drops, model, true, noise=_noise(case), rng=rng)
        return drops, true
    drops = simulate(case, sizes, rng)
    causes = {name: ALL_CAUSES[name] for name in sizes}
    true = {f"{cause.effects[0]}.{cause.parameter}": sizes[n] for n, cause in causes.items() if cause.parameter}
    return Dataset("proof", drops.header, drops.trajectories), true


def simulate(case: Case, sizes: Mapping[str, float], rng: np.random.Generator) -> DropsWithTruth:
    """Simulate drops with the source, body, contact time and noise of a case, and hidden causes of given `sizes`."""
    from thesis_lib.simulate.compliant.drops import OwnContact, simulate_compliant_drops

    hidden: dict = {name: True if name == "mirrored" else size for name, size in sizes.items()}
    if case.source.startswith("mujoco"):
        from thesis_lib.simulate.mujoco.contact import MujocoContact
        from thesis_lib.simulate.mujoco.drops import DropsInMujoco

        engine, causes = DropsInMujoco(), MujocoCauses(**hidden)
        contact = MujocoContact(contact_time=case.contact_time, **case.contact)
    else:
        engine, causes = OwnContact(), HiddenCauses(**hidden)
        contact = CompliantContact(contact_time=case.contact_time)
    if case.source in SURFACES_OF:
        from thesis_lib.simulate.drake.drops import DropsInDrake

        engine = DropsInDrake(SURFACES_OF[case.source])
    given: dict = {"engine": engine, "contact": contact, "hidden": causes, "noise": _noise(case)}
    return simulate_compliant_drops(case.body, PROOF_RELEASE, case.drops, rng=rng, **given)


def _noise(case: Case) -> Noise:
    return Noise(position=case.noise * RIG_NOISE.position, angle=case.noise * RIG_NOISE.angle)  # pyright: ignore[reportOperatorIssue]
