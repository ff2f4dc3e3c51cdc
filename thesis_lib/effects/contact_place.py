"""Place of a contact along the surface and on the body.

A property of the surface depends on the place that is touched, x + r_x, not on the place of the body origin: at a
corner they are up to half a diagonal apart.  The place is counted from the reference x_0, which lies where drops fall.

| on paper | in code | unit | shape | meaning                                                                        |
|----------|---------|------|-------|--------------------------------------------------------------------------------|
| x_c      |         | m    | (n,)  | contact point along the surface, from x_0                                      |
| x_0      | `rig.reference.x` | m |  | reference place in the coordinates of the dataset                              |
| g        |         | 1/m  |       | slope of a property along the surface, in space a vector (g_x, g_y)            |
| u        |         | 1    | (3, n) | in space: direction of the body that faces the surface, axes of the body      |
| β        |         | rad  | (n,)  | polar angle of the contact point about the body origin, in the axes of the body |
"""

import numpy as np

from thesis_lib.effects.effect import Parameters, Rig, vector
from thesis_lib.mechanics.state import State


def along_surface(state: State, rig: Rig) -> np.ndarray:
    """Place x_c (n,) in m at which the assumed shape touches the surface."""
    return state.x - rig.reference.x + rig.lowest(state)[0]


def along_gradient(state: State, p: Parameters, name: str, rig: Rig) -> np.ndarray:
    """Product g·x_c (n,) with the slope g that is the parameter `name`, in space `name`_x and `name`_y."""
    if state.space.is_plane:
        return p[name] * along_surface(state, rig)
    place = state.position[:2] - np.array([[rig.reference.x], [rig.reference.y]]) + rig.lowest(state)[:2]
    return (vector(p, (f"{name}_x", f"{name}_y")) * place).sum(axis=0)


def down_in_body(state: State) -> np.ndarray:
    """Direction u (3, n) of the body that faces the surface, in body axes."""
    return state.space.turned_back(state.attitude, np.array([[0.0], [0.0], [-1.0]]))


def around_body(state: State, rig: Rig) -> np.ndarray:
    """Polar angle β (n,) in rad at which the assumed shape touches, not limited to (−π, π]."""
    r_x, r_y = rig.lowest(state)
    return np.arctan2(r_y, r_x) - state.theta
