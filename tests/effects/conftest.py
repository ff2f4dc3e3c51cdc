"""A body without symmetry, and states in which it touches."""

import numpy as np
import pytest
from hand_cases import N

from thesis_lib.effects.effect import Rig
from thesis_lib.extensions.effect_probe import RIGS, random_states
from thesis_lib.mechanics.state import State


@pytest.fixture(scope="module")
def quadrilateral() -> tuple[Rig, State]:
    rig = RIGS["quadrilateral"]
    return rig, random_states(rig, N, np.random.default_rng(21))
