"""Attitudes as in the file, if the motion was found with another convention or time base of its quaternions.

Not candidate effects.  Hits and flights cannot be found along a wrong path.  They are therefore found with the
quaternion convention under which the body falls freely (`RELABELLINGS` are the conventions that effects represent) and
with attitudes shifted in time until they change when positions do.  The models then judge which convention and time
base are right: `AsWritten` and `AsStamped` map the states that were found to the states in the file.

| on paper | in code | unit | shape  |                                                     |
|----------|---------|------|--------|-----------------------------------------------------|
| P        | `P`     | 1    | (4, 4) | signed permutation, as in `relabelled_rotation`     |
| L        | `lag`   | s    |        | delay of the attitudes in the file                  |
"""

import numpy as np

from thesis_lib.effects import mirrored_rotation, misread_rotation
from thesis_lib.effects.effect import ONLY_SPACE, Effect
from thesis_lib.effects.relabelled_rotation import relabelled
from thesis_lib.effects.time_lag import TimeLag

RELABELLINGS = {
    f"{effect.name}, {p.said(option)}": by_option[round(option)]
    for effect, p, by_option in (
        (misread_rotation.EFFECT, misread_rotation.EFFECT.parameters[0], misread_rotation.READINGS),
        (mirrored_rotation.EFFECT, mirrored_rotation.EFFECT.own_in_space[0], mirrored_rotation.SIGNS),
    )
    for option in p.options
}


class AsWritten(Effect):
    """Part of every model of states whose attitudes are Pᵀ times the quaternions in the file."""

    name = "as_written"
    family = "measurement"
    title = "quaternions as they are written"
    equation = "q_file = P q"
    parameters = ()
    channels = ("impact", "touch", "flight")
    needs_angle = True
    dimensions = ONLY_SPACE

    def __init__(self, P: np.ndarray) -> None:
        self.P = P

    def to_true(self, state, p, rig):
        return relabelled(state, self.P, rig)

    def to_measured(self, state, p, rig):
        return relabelled(state, self.P.T, rig)


class AsStamped(TimeLag):
    """Part of every model of states whose attitudes appear in the file a time L later."""

    name = "as_stamped"
    title = "orientations as they are stamped"
    equation = "R_file(t + L) = R(t)"
    parameters = ()
    dimensions = ONLY_SPACE

    def __init__(self, lag: float) -> None:
        self.lag = {"lag": -lag}

    def seen(self, state, p, way, rig):
        return super().seen(state, self.lag, way, rig)

    def meet(self, jump, before, after, p):
        return super().meet(jump, before, after, self.lag)
