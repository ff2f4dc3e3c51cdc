"""Moving surface: the surface slides along t at a constant velocity, like a conveyor.

    v_x relative to the surface = v_x − V

| on paper | in code | unit | shape |                                            |
|----------|---------|------|-------|--------------------------------------------|
| V        | `V`     | m/s  |       | velocity of the surface along +t           |
|          | `V_x`, `V_y` | m/s |   | in space: along both axes of the surface   |

Impacts alone cannot distinguish it from a camera that drifts at this velocity (the laws hold in both frames).
Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components, vector

_VELOCITY = Parameter("V", "m/s", null=0.0, low=-3.0, high=3.0, scale=0.1)


class MovingSurface(Effect):
    name = "moving_surface"
    family = "surface"
    title = "moving surface"
    equation = "v_t = v_x − V − r_y ω"
    equation_in_space = "v_t = (v + ω × r)_t − (V_x, V_y)"
    parameters = (_VELOCITY,)
    own_in_space = components(_VELOCITY, ("V_x", "V_y"))
    level = (("V_x", "V_y", 1),)
    embedded = (("V_x", "V", 1.0),)
    needs_one_surface = True
    needs_angle = True
    rank = 8
    dimensions = IN_SPACE
    reference = "Galilean invariance"
    breaks_mirror = True

    def to_contact(self, state, p, rig):
        return _faster(state, p, -1.0)

    def from_contact(self, state, p, rig):
        return _faster(state, p, 1.0)


def _faster(state, p, way):
    """State whose velocity is increased by `way` times the velocity of the surface."""
    along = way * vector(p, ("V",) if state.space.is_plane else ("V_x", "V_y"))
    return state.changed(velocity=np.concatenate([state.velocity[:-1] + along, state.velocity[-1:]]))


EFFECT = MovingSurface()
