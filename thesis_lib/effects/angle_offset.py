"""Angle offset: the marker frame is rotated relative to the body.

    θ_measured = θ + d_θ;   in space R_measured = R exp(d),   d a rotation vector

| on paper | in code   | unit | shape |                                            |
|----------|-----------|------|-------|--------------------------------------------|
| d_θ      | `d_theta` | rad  |       | angle that the camera adds                 |
| d        | `d_rx`, `d_ry`, `d_rz` | rad | | in space, axes of the body; the tracked point does not move |

The contact point follows from the true angle; for a disk it is the same at every angle.  In space a rotation about an
axis of symmetry of the body is unobservable if the tracked point lies on that axis.  Breaks mirror symmetry.
"""

import math

import numpy as np

from thesis_lib.bodies.shapes import Disk
from thesis_lib.bodies.solids import Sphere
from thesis_lib.bodies.symmetry import Symmetry
from thesis_lib.effects.effect import IN_SPACE, CameraEffect, Parameter, components, vector
from thesis_lib.mechanics.space import multiplied, of_rotation_vector

# wide bounds and distant starts: a frame aligned with the wrong axis of the body is off by a quarter turn
_OFF = Parameter("d_theta", "rad", null=0.0, low=-math.pi / 2, high=math.pi / 2, scale=0.02, starts=(-0.4, 0.4, 1.4))
ON_AXIS = 1e-6  # m
_NAMES = ("d_rx", "d_ry", "d_rz")


class AngleOffset(CameraEffect):
    name = "angle_offset"
    title = "angle offset"
    equation = "θ_measured = θ + d_θ"
    equation_in_space = "R_measured = R exp(d)"
    parameters = (_OFF,)
    # start at the null only: fits try all combinations of the starts of the components
    own_in_space = components(Parameter("d", "rad", null=0.0, low=-1.6, high=1.6, scale=0.02, starts=(0.0,)), _NAMES)
    embedded = (("d_ry", "d_theta", -1.0),)
    channels = ("impact", "touch")
    needs_angle = True
    turns = True
    rank = 90
    dimensions = IN_SPACE
    reference = "camera calibration"
    breaks_mirror = True

    def applies_to(self, rig):
        return not isinstance(rig.shape, Disk | Sphere)

    def unseen(self, rig):
        if rig.space.is_plane:
            return super().unseen(rig)
        off = np.zeros(3) if rig.tracked is None else rig.tracked.origin
        about = Symmetry(rig.shape, np.asarray(rig.tensor)).axes  # pyright: ignore[reportArgumentType]
        return np.eye(3)[[axis for axis in about if np.abs(np.delete(off, axis)).max() < ON_AXIS]]

    def seen(self, state, p, way, rig):
        if state.space.is_plane:
            return state.moved(theta=state.theta + way * p["d_theta"])
        # about the body axes, with the tracked point fixed
        d = of_rotation_vector(way * vector(p, _NAMES))
        attitude = multiplied(state.attitude, np.broadcast_to(d, state.attitude.shape))
        return rig.turned(state, attitude, state.spin)


EFFECT = AngleOffset()
