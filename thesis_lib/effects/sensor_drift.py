"""Sensor drift: the camera slides along x, and what it reports slides the other way.

    x_measured = x + d_x t,   v_x,measured = v_x + d_x

| on paper | in code   | unit | shape |                                                         |
|----------|-----------|------|-------|---------------------------------------------------------|
| d_x      | `d_x`     | m/s  |       | velocity that the camera adds                           |
| t        | `state.t` | s    | (n,)  | since the first sample; where unknown, x stays as it is |

A body at rest would show it.  Impacts alone cannot tell it from a moving surface.  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class SensorDrift(Effect):
    name = "sensor_drift"
    family = "measurement"
    title = "drifting camera"
    equation = "x_measured = x + d_x t"
    parameters = (Parameter("d_x", "m/s", null=0.0, low=-1.0, high=1.0, scale=0.1),)
    needs_one_surface = True
    reference = "Galilean invariance"
    breaks_mirror = True

    def to_true(self, state, p, rig):
        return _drifted(state, -p["d_x"])

    def to_measured(self, state, p, rig):
        return _drifted(state, p["d_x"])


def _drifted(state, velocity):
    """State as from a camera that adds `velocity`."""
    t = np.where(np.isfinite(state.t), state.t, 0.0)
    return state.moved(x=state.x + velocity * t, vx=state.vx + velocity)


EFFECT = SensorDrift()
