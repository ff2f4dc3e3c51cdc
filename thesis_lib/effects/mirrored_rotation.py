"""Mirrored rotation: θ and ω are reported with the wrong sign (clockwise instead of counter-clockwise).

    θ_measured = −θ,   ω_measured = −ω;   in space R_measured = M R M,   M the mirror of one axis of the recording

It is on or off and has no size.  The contact point follows from the true angle.  The effect resembles a huge contact
torque, τ ≈ −2 r_y c_t.

| on paper | in code    | unit | shape |                                                                      |
|----------|------------|------|-------|----------------------------------------------------------------------|
|          | `mirrored` | 1    |       | 0 off, 1 on                                                          |
|          | `mirrored_axis` | 1 |     | in space: 0 off; 1, 2, 3: x, y or z is mirrored                      |
"""

from dataclasses import replace

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter
from thesis_lib.effects.relabelled_rotation import relabelled

_ON = Parameter("mirrored", "1", null=0.0, low=0.0, high=1.0, scale=1.0, discrete=1.0)
# a rotation about the mirrored axis is unchanged, rotations about the other axes are reversed
SIGNS = {axis: np.diag([1.0, *np.where(np.arange(1, 4) == axis, 1.0, -1.0)]) for axis in (1, 2, 3)}


class MirroredRotation(Effect):
    name = "mirrored_rotation"
    family = "measurement"
    title = "mirrored rotation"
    equation = "θ_measured = −θ, ω_measured = −ω"
    equation_in_space = "R_measured = M R M, M the mirror of one axis of the recording"
    parameters = (_ON,)
    own_in_space = (
        replace(_ON, name="mirrored_axis", high=3.0, choices=(2.0, 3.0), words=("x axis", "y axis", "z axis")),
    )
    embedded = (("mirrored_axis", "mirrored", 1.0),)
    channels = ("impact", "touch")
    needs_angle = True
    rank = 80
    rank_in_space = 92  # R is the attitude of the tracked frame, however it is fixed to the body
    dimensions = IN_SPACE
    reference = "handedness of axes"

    def to_true(self, state, p, rig):
        if state.space.is_plane:
            return state.moved(theta=-state.theta, omega=-state.omega) if p["mirrored"] > 0.5 else state
        axis = round(p["mirrored_axis"])
        return relabelled(state, SIGNS[axis], rig) if axis else state

    to_measured = to_true  # its own inverse


EFFECT = MirroredRotation()
