"""Attitudes as a file has them, where motions were found with another reading or another clock of its quaternions.

Not candidate effects: what is sought along a wrong path is not found, so that hits and flights of a body are found with
the reading with which it falls (`RELABELLINGS` are those that effects stand for), and with attitudes that change their
course when places do.  Which reading and which clock are right remains a question to the models: `AsWritten` and
`AsStamped` lead each from the states that were found to those of the file.

| on paper | in code | unit | shape  |                                                     |
|----------|---------|------|--------|-----------------------------------------------------|
| P        | `P`     | 1    | (4, 4) | of the file's numbers, as in `relabelled_rotation`  |
| L        | `lag`   | s    |        | by which attitudes come later in the file           |
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
    """Part of every model of states whose attitudes are Pᵀ times those of the file."""

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
    """Part of every model of states whose attitudes the file has a time L later."""

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
