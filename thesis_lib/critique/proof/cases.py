"""Proof on data with a hidden effect: does the critique name what was hidden, and is it silent when nothing was?

Three sources of truth: "law", the effect's own law injected into drops (law_drops); "mechanism", drops with compliant
contact in continuous time in which the effect arises from its cause (simulate/compliant); and "drake", the same of
those causes that Drake's MultibodyPlant can have (simulate/drake_drops).

Sizes raise the base law's error (arc misfit for flight effects, gap for what only the touch shows) to about three times
the noise floor; they were fixed on development seeds (`DEVELOPMENT`), the table uses others (`SEEDS`).  For the
detection curve they are scaled as if misfit and noise added up as squares: to R times the floor by √(R² − 1) / √8.

Each dataset's result is its own small JSON file, so that a long run goes on where it stopped:

    python -m thesis_lib.critique.proof run --seeds 10 [--source law mechanism drake] [--truths NAME ...] [--drops 150]
    python -m thesis_lib.critique.proof table
    python -m thesis_lib.critique.proof size com_offset         # that of an effect, found again
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from thesis_lib.bodies.body import Body, Noise
from thesis_lib.contact import LAWS
from thesis_lib.critique.drops.criticise import Critique, criticise
from thesis_lib.critique.drops.fit import cramer_rao
from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.proof.sizes import EPSILON, LAW, MU, law_size, stored_factor
from thesis_lib.critique.simulation.law_drops import simulate_law_drops
from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.effects import EFFECTS
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import write_json
from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.rig.hidden_causes import CAUSES, PROOF_RELEASE, RIG_NOISE, SQUARE, Mechanisms
from thesis_lib.simulate.stepping.drops import ELLIPSE_BODY

NOTHING = "nothing"
SOURCES = ("law", "mechanism", "drake")
CONFIG = Path(__file__).resolve().parents[3] / "config"
STORE = CONFIG / "proof"
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
    """One dataset of the proof.

    Attributes:
        source: "law", "mechanism" or "drake".
        truth: effect (law) or cause (mechanism, drake), two of them joined by "+", or "nothing".
        seed: of the dataset.
        drops: releases; noise: times the rig's; ratio: misfit over the noise floor, nominal.
    """

    source: str
    truth: str
    seed: int
    drops: int = 150
    noise: float = 1.0
    ratio: float = RATIO

    @property
    def hidden(self) -> tuple[str, ...]:
        """Names of the effects or causes; () where nothing is hidden."""
        return () if self.truth == NOTHING else tuple(self.truth.split("+"))

    @property
    def path(self) -> Path:
        """Where its result is stored, below `STORE`."""
        size = f"ratio{self.ratio:g}_drops{self.drops}_noise{self.noise:g}"
        return Path(self.source) / self.truth / size / f"{self.seed}.json"

    @property
    def expected(self) -> tuple[tuple[str, ...], ...]:
        """For each hidden one the effects that count as right; none: outside the library."""
        return tuple((name,) if self.source == "law" else CAUSES[name].effects for name in self.hidden)

    @property
    def body(self) -> Body:
        """The chapter's ellipse, or a square where corners matter."""
        corners = {"rounded_corners", *(name for name, cause in CAUSES.items() if cause.polygon_only)}
        return SQUARE if corners & set(self.hidden) else ELLIPSE_BODY


def truths(source: str) -> list[str]:
    """All single truths of a source: nothing first."""
    if source == "drake":
        from thesis_lib.simulate.drake.drops import SUPPORTED

        return [NOTHING, *SUPPORTED]
    return [NOTHING, *(EFFECTS if source == "law" else CAUSES)]


def pairs(source: str) -> list[str]:
    """All pairs of a source."""
    if source == "law":
        return ["+".join(CAUSES[name].effects[0] for name in pair) for pair in PAIRS]
    return ["+".join(pair) for pair in PAIRS if set(pair) <= set(truths(source))]


def make(case: Case) -> tuple[Dataset, dict[str, float]]:
    """The dataset, and the true parameters by full name where they have the effects' own meaning."""
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
    drops = simulate(
        case.body, PROOF_RELEASE, case.drops, mechanisms=Mechanisms(**hidden), noise=noise, rng=rng
    )
    return Dataset("proof", drops.header, drops.trajectories), {}


def run(case: Case, store: Path = STORE) -> dict:
    """Criticise one dataset and store what it says; a stored result is not computed again."""
    path = store / case.path
    if path.is_file():
        return json.loads(path.read_text(encoding="utf-8"))
    dataset, true = make(case)
    rng = generator(case.seed, "critique", dataset.digest())
    try:
        found = criticise(dataset, rng=rng)
        result = asdict(case) | _summary(case, found, true)
    except UserError as error:
        result = asdict(case) | {"verdict": "refused", "why": str(error).splitlines()[0][:200]}
    write_json(result, path)
    return result


def _summary(case: Case, found: Critique, true: dict[str, float]) -> dict:
    first, last = found.ladder[0][2], found.ladder[-1][2]
    steps = [[s.effect.name, *s.alternatives] for s in found.discovery.steps]
    return {
        "verdict": found.verdict,
        "law": found.discovery.fitted.model.law.name,
        "steps": steps,
        "right": is_right(case, steps),
        "parameters": _parameters(found, true) if len(case.hidden) == 1 else {},
        "n_impacts": len(found.observations),
        "error": {
            "base": float(first.error.mean()),
            "augmented": float(last.error.mean()),
            "floor": last.floor,
            "flight_base": _root(first.sigmas["flight"]),
            "flight_augmented": _root(last.sigmas["flight"]),
            "touch_base": _root(first.sigmas["touch"]),
            "touch_augmented": _root(last.sigmas["touch"]),
        },
        "remaining_p": found.remaining.p_value,
    }


def is_right(case: Case, steps: Sequence[Sequence[str]]) -> bool:
    """Whether the one hidden effect stands in the group named first, or both of a pair in groups of their own."""
    if len(case.expected) < 2:
        return bool(case.expected and steps and set(steps[0]) & set(case.expected[0]))
    fits = [{i for i, group in enumerate(steps) if set(group) & set(names)} for names in case.expected]
    return all(fits) and len(set.union(*fits)) >= len(fits)


def _parameters(found: Critique, true: dict[str, float]) -> dict[str, dict[str, float]]:
    """Found and true parameters of the hidden effect, with the std of the fit and of the Cramér-Rao bound."""
    fitted = found.discovery.fitted
    wanted = [key for key in true if key in fitted.values and key not in ("mu", "epsilon")]
    wanted = [key for key in wanted if fitted.model.parameters[key].discrete is None]
    if not wanted:
        return {}
    effects = tuple(EFFECTS[name] for name in dict.fromkeys(key.split(".")[0] for key in wanted))
    bound = cramer_rao(Model(LAWS[LAW], effects), true, found.training)
    return {
        key.split(".")[1]: {
            "true": true[key],
            "found": fitted.values[key],
            "std": fitted.std[key],
            "fisher": bound[key],
        }
        for key in wanted
    }


def _root(value: float) -> float | None:
    return float(np.sqrt(value)) if np.isfinite(value) else None
