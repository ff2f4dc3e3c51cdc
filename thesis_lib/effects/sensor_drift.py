"""Sensor drift: the camera slides along x, and what it reports slides the other way.

    x_measured = x + d_x (t − t_0),   v_x,measured = v_x + d_x

| on paper | in code   | unit | shape |                                                         |
|----------|-----------|------|-------|---------------------------------------------------------|
| d_x      | `d_x`     | m/s  |       | velocity that the camera adds                           |
| t        | `state.t` | s    | (n,)  | where unknown, x stays as it is                         |
| t_0      | `rig.reference.t` | s |  | when x is right                                         |

A body at rest would show it.  Impacts alone cannot tell it from a moving surface.  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class SensorDrift(Effect):
    name = "sensor_drift"
    family = "measurement"
    title = "drifting camera"
    equation = "x_measured = x + d_x (t − t₀)"
    parameters = (Parameter("d_x", "m/s", null=0.0, low=-1.0, high=1.0, scale=0.1),)
    needs_one_surface = True
    reference = "Galilean invariance"
    breaks_mirror = True
    along = ("t",)
    rank = 70

    def to_true(self, state, p, rig):
        return _drifted(state, -p["d_x"], rig)

    def to_measured(self, state, p, rig):
        return _drifted(state, p["d_x"], rig)


def _drifted(state, velocity, rig):
    """State as from a camera that adds `velocity`."""
    since = np.where(np.isfinite(state.t), state.t - rig.reference.t, 0.0)
    return state.moved(x=state.x + velocity * since, vx=state.vx + velocity)


EFFECT = SensorDrift()
