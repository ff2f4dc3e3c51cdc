"""Which hits of a toss are later ones: what touched the surface before may have changed the body, or only moved in it.

Shared by effects; not an effect itself.

| on paper | in code          | unit | shape  | meaning                                                        |
|----------|------------------|------|--------|----------------------------------------------------------------|
| t − t_1  |                  | s    | (n,)   | time since the first touch of the toss, `rig.recorded`         |
"""

import numpy as np

from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State

LATER = 0.03  # s: what touches within it belongs to the first hit


def is_later(state: State, rig: Rig) -> np.ndarray:
    """Whether a hit (n,) is not the first of its toss; false where nobody knows."""
    if rig.recorded is None:
        return np.zeros(len(state), bool)
    return state.t > rig.recorded.first_touch(state.trial) + LATER
