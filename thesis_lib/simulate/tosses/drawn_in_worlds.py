"""Sets of tosses in three worlds, drawn from one seed, with no cause, one, a pair, or one outside the library.

The worlds are our own contact, MuJoCo and Drake, with bodies of `SHAPES_IN`.  About every third set has the flaws of
real recordings: it is smoothed by one of `FILTERS`, or a tag's orientation flips in some frames.  Causes are hidden in
worlds that have an element for them, causes outside the library in MuJoCo (`simulate.mujoco.outside`).  Axes, tracked
frame and noise are drawn as in `drawn`.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from thesis_lib.foundation.randomness import generator
from thesis_lib.simulate.tosses.causes import NOT_IN_DRAKE, NOT_IN_MUJOCO, OUTSIDE, RANGES, RANGES_OF_MORE
from thesis_lib.simulate.tosses.drawn import DRAWN, NOTHING, SpaceCase, drawn_number, hidden_size, recording, spread

SEED = 4700  # seed of all random draws
EDGED = ("cube", "box", "bracket")
SHAPES_IN = {"own": EDGED, "mujoco": (*EDGED, "ellipsoid", "cylinder"), "drake": (*EDGED, "ellipsoid", "cylinder")}
MISSING_IN = {"own": (), "mujoco": NOT_IN_MUJOCO, "drake": NOT_IN_DRAKE}
NOTHING_HIDDEN, ONE_CAUSE, PAIRS, FROM_OUTSIDE = 60, 120, 40, 40
DISCRETE = ("mirrored_rotation", "misread_rotation")  # at most one of these in a pair
FILTERS = ("zero_phase_butterworth", "kalman_smoother", "moving_average", "median", "butterworth")
SMOOTHED, FLIPPED = 0.2, 0.2  # shares of the sets
DRAWN_IN_WORLDS = (*DRAWN[:-1], "flips", DRAWN[-1])


@dataclass(frozen=True)
class WorldsCase(SpaceCase):
    """One dataset of the proof in three worlds."""

    proof = "proof in three worlds"
    seed_of_all = SEED

    @property
    def drawn(self) -> dict:
        return _drawn(self)


@cache
def _drawn(case: WorldsCase) -> dict:
    rng = generator(SEED, case.proof, case.world, case.truth, str(case.seed))
    shapes = EDGED if "rounded_corners" in case.truth else SHAPES_IN[case.world]
    drawn = recording(rng, shapes)
    drawn["filter"] = FILTERS[rng.integers(len(FILTERS))] if rng.random() < SMOOTHED else "none"
    smoothed = drawn["filter"] != "none"
    drawn["cutoff"] = drawn_number(rng, 0.15 * drawn["rate"], 0.3 * drawn["rate"]) if smoothed else 0.0
    drawn["irregular"] = 0.0 if smoothed else drawn_number(rng, 0.01, 0.2)
    drawn["flips"] = drawn_number(rng, 3e-3, 3e-2) if rng.random() < FLIPPED else 0.0
    if case.world != "mujoco":
        drawn |= {"cone": "", "impratio": 0.0, "impedance": 0.0}
    hidden: dict[str, float] = {}
    for truth in case.truth.split("+"):
        hidden |= _from_outside(truth, rng) if truth in OUTSIDE else hidden_size(truth, drawn, rng)
    return drawn | {"hidden": hidden}


def _from_outside(truth: str, rng: np.random.Generator) -> dict[str, float]:
    """Draw the parameters of a cause of `OUTSIDE`."""
    return {f"{truth}.{name}": drawn_number(rng, *limits, log=False) for name, limits in OUTSIDE[truth].items()}


def worlds_cases() -> list[WorldsCase]:
    """All datasets, with worlds and truths mixed evenly: any part represents the whole."""
    worlds, wanted = tuple(SHAPES_IN), {}

    def add(world: str, truth: str) -> None:
        wanted[world, truth] = wanted.get((world, truth), 0) + 1

    def in_world(world: str) -> list[str]:
        return [cause for cause in causes if cause not in MISSING_IN[world]]

    causes = [*RANGES, *RANGES_OF_MORE]
    for i in range(NOTHING_HIDDEN):
        add(worlds[i % len(worlds)], NOTHING)
    for i in range(ONE_CAUSE):
        turn, which = divmod(i, len(causes))
        having = [world for world in worlds if causes[which] in in_world(world)]
        add(having[(turn + which) % len(having)], causes[which])
    rng = generator(SEED, "pairs of the proof in three worlds")
    for i in range(PAIRS):
        world, pair = worlds[i % len(worlds)], list(DISCRETE)
        while set(pair) == set(DISCRETE):
            pair = [str(cause) for cause in rng.choice(in_world(world), 2, replace=False)]
        add(world, "+".join(sorted(pair)))
    for i in range(FROM_OUTSIDE):
        add("mujoco", list(OUTSIDE)[i % len(OUTSIDE)])
    return spread(wanted, WorldsCase, generator(SEED, "order of the proof in three worlds"))
