"""Angle offset: the marker frame is turned against the body.

    θ_measured = θ + d_θ

| on paper | in code   | unit | shape |                                            |
|----------|-----------|------|-------|--------------------------------------------|
| d_θ      | `d_theta` | rad  |       | angle that the camera adds                 |

The contact point follows from the true angle; a disk has the same one at every angle.  Breaks mirror symmetry.
"""

import math

from thesis_lib.bodies.shapes import Disk
from thesis_lib.effects.effect import Effect, Parameter


class AngleOffset(Effect):
    name = "angle_offset"
    family = "measurement"
    title = "angle offset"
    equation = "θ_measured = θ + d_θ"
    # wide and with far starts: a frame on the wrong axis of the body is a quarter of a turn off
    parameters = (
        Parameter("d_theta", "rad", null=0.0, low=-math.pi / 2, high=math.pi / 2, scale=0.02, starts=(-0.4, 0.4, 1.4)),
    )
    channels = ("impact", "touch")
    needs_angle = True
    rank = 90
    reference = "camera calibration"
    breaks_mirror = True

    def applies_to(self, rig):
        return not isinstance(rig.shape, Disk)

    def to_true(self, state, p, rig):
        return state.moved(theta=state.theta - p["d_theta"])

    def to_measured(self, state, p, rig):
        return state.moved(theta=state.theta + p["d_theta"])


EFFECT = AngleOffset()
