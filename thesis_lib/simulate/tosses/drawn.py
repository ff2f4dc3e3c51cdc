"""Sets of tosses drawn from one seed: body, contact, camera, noise and what is hidden.

`NOTHING_HIDDEN` sets hide nothing, and each cause of `RANGES` is hidden twice: once in our own compliant contact and
once in MuJoCo, where it has an element for it.  The camera's axes are turned at random, so that up points anywhere; the
tracked frame lies off the centre, turned at random, and is stated.  What is smoothed states no noise, as its owner sees
only what is written.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from pydantic import ValidationError

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.randomness import generator
from thesis_lib.mechanics.space import of_rotation_vector, rotated
from thesis_lib.simulate.tosses.camera import CameraInSpace, film
from thesis_lib.simulate.tosses.causes import CORNERED, NOT_IN_MUJOCO, RANGES
from thesis_lib.simulate.tosses.world import TossedWorld, TossEngine

SEED = 4600  # of everything that is drawn
WORLDS = ("own", "mujoco")
NOTHING = "nothing"
NOTHING_HIDDEN, OF_EACH_CAUSE = 20, 2
SHAPES = ("cube", "box", "sphere")
G = 9.81  # m/s²
DRAWN = (
    *("shape", "size", "tosses", "rate", "position", "rotation", "contact_time", "mu", "epsilon"),
    *("cone", "impratio", "impedance", "filter", "cutoff", "dropped", "bursts", "irregular", "hidden"),
)


@dataclass(frozen=True)
class SpaceCase:
    """One dataset: its world, what is hidden, and its number."""

    world: str
    truth: str
    seed: int

    def __str__(self) -> str:
        return f"{self.world}/{self.truth} {self.seed}"

    @property
    def hidden(self) -> Mapping[str, float]:
        """Sizes by effect and parameter."""
        return self.drawn["hidden"]

    @property
    def drawn(self) -> dict:
        """Values drawn for the set, `DRAWN`: SI units and rad; `hidden` by effect and parameter."""
        return _drawn(self)


@cache
def _drawn(case: SpaceCase) -> dict:
    rng = generator(SEED, "proof in space", case.world, case.truth, str(case.seed))

    def between(low: float, high: float, log: bool = True) -> float:
        value = np.exp(rng.uniform(np.log(low), np.log(high))) if log else rng.uniform(low, high)
        return float(f"{value:.3g}")

    shape = SHAPES[rng.integers(2 if case.truth in CORNERED else 3)]
    drawn = {
        "shape": shape,
        "size": between(0.9, 1.4, log=False),
        "tosses": int(rng.integers(60, 121)),
        "rate": between(100.0, 500.0),
        "position": between(5e-5, 5e-4),
        "rotation": between(np.radians(0.03), np.radians(0.3)),
        "contact_time": between(3e-4, 3e-3),
        "mu": between(0.15, 0.4, log=False),
        "epsilon": between(0.3, 0.7, log=False),
        "cone": ("elliptic", "pyramidal")[rng.integers(2)],
        "impratio": between(1.0, 100.0),
        "impedance": float(f"{1.0 - between(1e-4, 0.1):.5g}"),
        "filter": (*(8 * ("none",)), "zero_phase_butterworth", "kalman_smoother")[rng.integers(10)],
        "dropped": between(0.005, 0.05),
        "bursts": between(0.02, 0.2),
    }
    smoothed = drawn["filter"] != "none"
    drawn["cutoff"] = float(f"{0.2 * drawn['rate']:.3g}") if smoothed else 0.0
    drawn["irregular"] = 0.0 if smoothed else between(0.01, 0.2)
    if case.world == "own":
        drawn |= {"cone": "", "impratio": 0.0, "impedance": 0.0}
    return drawn | {"hidden": _hidden(case.truth, drawn, rng)}


def cases() -> list[SpaceCase]:
    """All datasets, worlds and truths mixed: a part of them counts as the whole would."""
    wanted = {(world, NOTHING): NOTHING_HIDDEN // len(WORLDS) for world in WORLDS}
    for cause in RANGES:
        worlds = [world for world in WORLDS if world == "own" or cause not in NOT_IN_MUJOCO]
        wanted |= {(world, cause): OF_EACH_CAUSE // len(worlds) for world in worlds}
    placed, rng = [], generator(SEED, "order of the proof in space")
    for (world, truth), n in wanted.items():
        shift = rng.uniform()
        placed += [((i + shift) / n, SpaceCase(world, truth, i)) for i in range(n)]
    return [case for _, case in sorted(placed, key=lambda one: one[0])]


def _hidden(truth: str, drawn: Mapping, rng: np.random.Generator) -> dict[str, float]:
    """A size from the range of the cause that a body can have; {} for nothing."""
    while truth != NOTHING:
        hidden = {f"{truth}.{name}": value for name, value in RANGES[truth].drawn(rng).items()}
        try:
            _ = TossedWorld(_header(drawn, np.array([0.0, 0.0, 1.0]), rng), hidden=hidden).rig
        except ValidationError:  # no body has such an inertia
            continue
        return hidden
    return {}


def _header(drawn: Mapping, up: np.ndarray, rng: np.random.Generator) -> SpaceHeader:
    """Dataset header as the owner believes it, with a tracked frame anywhere on the body."""
    shape: dict = {"kind": "sphere", "radius": 0.04 * drawn["size"]}
    if drawn["shape"] != "sphere":
        sides = (1.0, 1.0, 1.0) if drawn["shape"] == "cube" else (0.5, 1.0, 1.5)
        shape = {"kind": "box", "half_extents": tuple(0.04 * drawn["size"] * side for side in sides)}
    off, turn = rng.standard_normal(3), of_rotation_vector(2.0 * rng.standard_normal((3, 1)))[:, 0]
    off *= rng.uniform(0.02, 0.06) / np.linalg.norm(off)
    return SpaceHeader.model_validate(
        {
            "schema": 2,
            "body": {"shape": shape, "mass": 0.25, "homogeneous": True},
            "tracked": {"position": tuple(off), "quaternion": tuple(turn)},
            "surface": {"point": tuple(rng.uniform(-1.0, 1.0, 3))},
            "gravity": tuple(-G * up),
            "rate": drawn["rate"],
            "noise": {"position": drawn["position"], "rotation": drawn["rotation"]},
        }
    )


def make(case: SpaceCase, engine: TossEngine) -> Dataset:
    """The tosses of a case as its owner has them."""
    drawn, rng = case.drawn, generator(SEED, "tosses of the proof in space", case.world, case.truth, str(case.seed))
    up = rotated(of_rotation_vector(2.0 * rng.standard_normal((3, 1))), np.array([[0.0], [0.0], [1.0]]))[:, 0]
    contact = {name: drawn[name] for name in ("mu", "epsilon", "contact_time")}
    world = TossedWorld(_header(drawn, up, rng), hidden=case.hidden, **contact)
    smoothing = {"filter": drawn["filter"], "cutoff": drawn["cutoff"]} if drawn["filter"] != "none" else {}
    camera = CameraInSpace(
        dropped=drawn["dropped"], bursts=drawn["bursts"], irregular=drawn["irregular"], stamps=2e-5, **smoothing
    )
    made = film("proof", world, engine, camera, drawn["tosses"], rng)
    return (
        Dataset(made.name, made.in_space.model_copy(update={"noise": None}), made.trajectories) if smoothing else made
    )
