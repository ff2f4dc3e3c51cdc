"""Sets of tosses drawn at random from one seed: body, contact, camera, noise and hidden cause.

`NOTHING_HIDDEN` sets hide nothing, and each cause of `RANGES` is hidden twice: once with our own compliant contact and
once in MuJoCo, if MuJoCo has an element for it.  The camera's axes are rotated at random; "up" may therefore point in
any direction.  The tracked frame is off the centre, rotated at random, and stated.  Smoothed sets state no noise, since
their owner sees only the recorded poses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar, TypeVar

import numpy as np
from pydantic import ValidationError

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.datasets.format.header import SpaceHeader
from thesis_lib.foundation.files import write_text
from thesis_lib.foundation.randomness import generator
from thesis_lib.mechanics.space import of_rotation_vector, rotated
from thesis_lib.simulate.tosses.camera import CameraInSpace, film
from thesis_lib.simulate.tosses.causes import CORNERED, NOT_IN_MUJOCO, RANGES, RANGES_OF_MORE
from thesis_lib.simulate.tosses.world import TossedWorld, TossEngine

SEED = 4600  # seed of all random draws
WORLDS = ("own", "mujoco")
NOTHING = "nothing"
NOTHING_HIDDEN, OF_EACH_CAUSE = 20, 2
SHAPES = ("cube", "box", "sphere")
G = 9.81  # m/s²
BRACKET_FILE = "bracket.obj"
CaseType = TypeVar("CaseType", bound="SpaceCase")
DRAWN = (
    *("shape", "size", "tosses", "rate", "position", "rotation", "contact_time", "mu", "epsilon"),
    *("cone", "impratio", "impedance", "filter", "cutoff", "dropped", "bursts", "irregular", "hidden"),
)


@dataclass(frozen=True)
class SpaceCase:
    """One dataset: its world (simulator), its hidden cause (truth), and its number (seed)."""

    world: str
    truth: str
    seed: int

    proof: ClassVar[str] = "proof in space"
    seed_of_all: ClassVar[int] = SEED

    def __str__(self) -> str:
        return f"{self.world}/{self.truth} {self.seed}"

    @property
    def hidden(self) -> Mapping[str, float]:
        """Sizes by effect and parameter."""
        return self.drawn["hidden"]

    @property
    def drawn(self) -> dict:
        """Values drawn for the set (`DRAWN`), in SI units and rad; `hidden` by effect and parameter."""
        return _drawn(self)


def drawn_number(rng: np.random.Generator, low: float, high: float, log: bool = True) -> float:
    """Draw a number between limits, uniform in its logarithm or in itself, rounded to three digits."""
    value = np.exp(rng.uniform(np.log(low), np.log(high))) if log else rng.uniform(low, high)
    return float(f"{value:.3g}")


def recording(rng: np.random.Generator, shapes: Sequence[str]) -> dict:
    """Draw body, contact, camera and noise; the filter's cutoff and irregular frame times are drawn later."""
    between = partial(drawn_number, rng)
    return {
        "shape": shapes[int(rng.integers(len(shapes)))],
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


@cache
def _drawn(case: SpaceCase) -> dict:
    rng = generator(SEED, case.proof, case.world, case.truth, str(case.seed))
    drawn = recording(rng, SHAPES[:2] if case.truth in CORNERED else SHAPES)
    smoothed = drawn["filter"] != "none"
    drawn["cutoff"] = float(f"{0.2 * drawn['rate']:.3g}") if smoothed else 0.0
    drawn["irregular"] = 0.0 if smoothed else drawn_number(rng, 0.01, 0.2)
    if case.world == "own":
        drawn |= {"cone": "", "impratio": 0.0, "impedance": 0.0}
    return drawn | {"hidden": hidden_size(case.truth, drawn, rng)}


def cases() -> list[SpaceCase]:
    """All datasets, with worlds and truths mixed evenly: any part represents the whole."""
    wanted = {(world, NOTHING): NOTHING_HIDDEN // len(WORLDS) for world in WORLDS}
    for cause in RANGES:
        worlds = [world for world in WORLDS if world == "own" or cause not in NOT_IN_MUJOCO]
        wanted |= {(world, cause): OF_EACH_CAUSE // len(worlds) for world in worlds}
    return spread(wanted, SpaceCase, generator(SEED, "order of the proof in space"))


def spread(wanted: Mapping[tuple[str, str], int], case: type[CaseType], rng: np.random.Generator) -> list[CaseType]:
    """Cases of each world and truth in the `wanted` numbers, in an order in which every part represents the whole."""
    placed = []
    for (world, truth), n in wanted.items():
        shift = rng.uniform()
        placed += [((i + shift) / n, case(world, truth, i)) for i in range(n)]
    return [one for _, one in sorted(placed, key=lambda both: both[0])]


def hidden_size(truth: str, drawn: Mapping, rng: np.random.Generator) -> dict[str, float]:
    """Draw a size of a cause from its range, such that the body is possible; {} for "nothing"."""
    while truth != NOTHING:
        sizes = {**RANGES, **RANGES_OF_MORE}[truth].drawn(rng)
        hidden = {f"{truth}.{name}": value for name, value in sizes.items()}
        try:
            _ = TossedWorld(header_of(drawn, np.array([0.0, 0.0, 1.0]), rng), hidden=hidden).rig
        except ValidationError:  # no body can have such an inertia
            continue
        return hidden
    return {}


def header_of(drawn: Mapping, up: np.ndarray, rng: np.random.Generator) -> SpaceHeader:
    """Dataset header as the owner believes it, with a tracked frame at a random place on the body."""
    shape = _shape(drawn["shape"], 0.04 * drawn["size"])
    off, turn = rng.standard_normal(3), of_rotation_vector(2.0 * rng.standard_normal((3, 1)))[:, 0]
    off *= rng.uniform(0.02, 0.06) / np.linalg.norm(off)
    content = {
        "schema": 2,
        "body": {"shape": shape, "mass": 0.25, "homogeneous": True},
        "tracked": {"position": tuple(off), "quaternion": tuple(turn)},
        "surface": {"point": tuple(rng.uniform(-1.0, 1.0, 3))},
        "gravity": tuple(-G * up),
        "rate": drawn["rate"],
        "noise": {"position": drawn["position"], "rotation": drawn["rotation"]},
    }
    with TemporaryDirectory() as folder:
        write_text(_bracket(), Path(folder) / BRACKET_FILE)
        return SpaceHeader.model_validate(content, context={"folder": folder})


def _shape(name: str, size: float) -> dict:
    """A shape about as large as a cube with half-edges of `size` in m."""
    if name == "sphere":
        return {"kind": "sphere", "radius": size}
    if name == "ellipsoid":
        return {"kind": "ellipsoid", "semi_axes": (0.8 * size, size, 1.4 * size)}
    if name == "cylinder":
        return {"kind": "cylinder", "radius": 0.9 * size, "half_length": 1.25 * size}
    if name == "bracket":
        return {"kind": "mesh", "file": BRACKET_FILE, "scale": size}
    sides = (1.0, 1.0, 1.0) if name == "cube" else (0.5, 1.0, 1.5)
    return {"kind": "box", "half_extents": tuple(size * side for side in sides)}


def _bracket() -> str:
    """An L-shaped bracket as a Wavefront file, in units of the size, with the corner of the L at the origin."""
    outline = ((0.0, 0.0), (2.4, 0.0), (2.4, 0.8), (0.8, 0.8), (0.8, 2.4), (0.0, 2.4))
    ends = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    n = len(outline)
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    triangles = [(c, b, a) for a, b, c in ends] + [tuple(n + k for k in end) for end in ends]
    triangles += [part for a, b, c, d in sides for part in ((a, b, c), (a, c, d))]
    lines = [f"v {x} {y} {z}" for z in (-0.5, 0.5) for x, y in outline]
    return "\n".join(lines + ["f " + " ".join(str(k + 1) for k in one) for one in triangles]) + "\n"


def make(case: SpaceCase, engine: TossEngine) -> Dataset:
    """Simulate the tosses of a case as their owner has them."""
    salt = f"tosses of the {case.proof}", case.world, case.truth, str(case.seed)
    drawn, rng = case.drawn, generator(case.seed_of_all, *salt)
    up = rotated(of_rotation_vector(2.0 * rng.standard_normal((3, 1))), np.array([[0.0], [0.0], [1.0]]))[:, 0]
    contact = {name: drawn[name] for name in ("mu", "epsilon", "contact_time")}
    world = TossedWorld(header_of(drawn, up, rng), hidden=case.hidden, **contact)
    smoothing = {"filter": drawn["filter"], "cutoff": drawn["cutoff"]} if drawn["filter"] != "none" else {}
    lost = {name: drawn.get(name, 0.0) for name in ("dropped", "bursts", "irregular", "flips")}
    camera = CameraInSpace(stamps=2e-5, **lost, **smoothing)
    made = film("proof", world, engine, camera, drawn["tosses"], rng)
    return (
        Dataset(made.name, made.in_space.model_copy(update={"noise": None}), made.trajectories) if smoothing else made
    )
