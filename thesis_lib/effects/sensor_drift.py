"""Sensor drift: the camera slides along x, and the positions that it reports slide the other way.

    x_measured = x + d_x (t − t_0),   v_x,measured = v_x + d_x

| on paper | in code   | unit | shape |                                                         |
|----------|-----------|------|-------|---------------------------------------------------------|
| d_x      | `d_x`     | m/s  |       | velocity that the camera adds                           |
|          | `d_x`, `d_y` | m/s |     | in space: along both axes of the surface                |
| t        | `state.t` | s    | (n,)  | time; if unknown, x is unchanged                        |
| t_0      | `rig.reference.t` | s |  | time at which x is correct                              |

A body at rest would reveal it.  Impacts alone cannot distinguish it from a moving surface.  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, CameraEffect, Parameter, components, vector

_VELOCITY = Parameter("d_x", "m/s", null=0.0, low=-1.0, high=1.0, scale=0.1)


class SensorDrift(CameraEffect):
    name = "sensor_drift"
    title = "drifting camera"
    equation = "x_measured = x + d_x (t − t₀)"
    equation_in_space = "x_measured = x + (d_x, d_y, 0) (t − t₀)"
    parameters = (_VELOCITY,)
    own_in_space = components(_VELOCITY, ("d_x", "d_y"))
    level = (("d_x", "d_y", 1),)
    embedded = (("d_x", "d_x", 1.0),)
    needs_one_surface = True
    reference = "Galilean invariance"
    breaks_mirror = True
    along = ("t",)
    rank = 70
    dimensions = IN_SPACE

    def seen(self, state, p, way, rig):
        since = np.where(np.isfinite(state.t), state.t - rig.reference.t, 0.0)
        names = ("d_x",) if state.space.is_plane else ("d_x", "d_y")
        along = way * vector(p, names)
        along = np.concatenate([along, np.zeros_like(along[:1])])  # none along the normal
        return state.changed(position=state.position + along * since, velocity=state.velocity + along)


EFFECT = SensorDrift()
