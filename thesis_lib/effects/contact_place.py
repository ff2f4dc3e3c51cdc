"""Where a contact is: its place along the surface, and its place on the body.

A property of the surface belongs to the place that is touched, x + r_x, not to that of the body origin: at a corner
they are up to half a diagonal apart.  It is counted from the reference, x_0, which lies where the drops fall.

| on paper | in code | unit | shape | meaning                                                                        |
|----------|---------|------|-------|--------------------------------------------------------------------------------|
| x_c      |         | m    | (n,)  | contact point along the surface, from x_0                                      |
| x_0      | `rig.reference.x` | m |  | place in the numbers of the dataset                                            |
| β        |         | rad  | (n,)  | polar angle of the contact point about the body origin, in the axes of the body |
"""

import numpy as np

from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State


def along_surface(state: State, rig: Rig) -> np.ndarray:
    """x_c (n,) in m of the believed shape at its pose."""
    return state.x - rig.reference.x + rig.lowest(state)[0]


def around_body(state: State, rig: Rig) -> np.ndarray:
    """β (n,) in rad of the believed shape at its pose, beyond (−π, π]."""
    r_x, r_y = rig.lowest(state)
    return np.arctan2(r_y, r_x) - state.theta
