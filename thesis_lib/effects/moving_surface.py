"""Moving surface: the surface slides along t at a constant velocity, like a conveyor.

    v_x seen by the contact = v_x − V

| on paper | in code | unit | shape |                                            |
|----------|---------|------|-------|--------------------------------------------|
| V        | `V`     | m/s  |       | velocity of the surface along +t           |
|          | `V_x`, `V_y` | m/s |   | in space: along both axes of the surface   |

Impacts alone cannot tell it from a camera that drifts at the same velocity (the laws are the same in both frames).
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
        if not state.space.is_plane:
            return _faster(state, -vector(p, ("V_x", "V_y")))
        return state.moved(vx=state.vx - p["V"])

    def from_contact(self, state, p, rig):
        if not state.space.is_plane:
            return _faster(state, vector(p, ("V_x", "V_y")))
        return state.moved(vx=state.vx + p["V"])


def _faster(state, along):
    """In space: the state with a velocity (2, n) along the surface more."""
    return state.changed(velocity=np.concatenate([state.velocity[:2] + along, state.velocity[2:]]))


EFFECT = MovingSurface()
