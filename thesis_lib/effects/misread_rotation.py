"""Misread rotation: the components of a quaternion were read in another convention than they were written.

    q_measured = P q,   P one of the following

| on paper          | in code        | unit | shape |                                                              |
|-------------------|----------------|------|-------|--------------------------------------------------------------|
|                   | `reading`      | 1    |       | 0: correct; otherwise the number of a row below              |
| (w, −x, −y, −z)   | 1              |      |       | conjugate: rotation from the world into the body             |
| (x, y, z, w)      | 2              |      |       | scalar last, read as scalar first                            |
| (w, −x, y, z), …  | 3, 4, 5        |      |       | one sign is wrong: of x, y or z                              |

If the three principal moments of inertia are equal, flights cannot reveal it; hits and rests can.
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, CameraEffect, Parameter
from thesis_lib.effects.relabelled_rotation import relabelled

_ORDER = np.roll(np.eye(4), 1, axis=1)  # (w, x, y, z) becomes (x, y, z, w)
READINGS = (
    np.eye(4),
    np.diag([1.0, -1.0, -1.0, -1.0]),
    _ORDER,
    *(np.diag(np.where(np.arange(4) == i, -1.0, 1.0)) for i in (1, 2, 3)),
)


class MisreadRotation(CameraEffect):
    name = "misread_rotation"
    title = "misread quaternion"
    equation = "q_measured = P q: conjugate, scalar last, or one sign"
    parameters = (
        Parameter(
            "reading",
            "1",
            null=0.0,
            low=0.0,
            high=5.0,
            scale=1.0,
            discrete=1.0,
            choices=(2.0, 3.0, 4.0, 5.0),
            words=("conjugate", "scalar last", "sign of x", "sign of y", "sign of z"),
        ),
    )
    channels = ("impact", "touch", "flight")
    needs_angle = True
    rank = 95  # what is misread is the attitude of the tracked frame, however it is fixed to the body
    dimensions = ONLY_SPACE
    breaks_mirror = True
    reference = "Solà 2017, arXiv:1711.02508 (conventions of quaternions)"

    def seen(self, state, p, way, rig):
        if not (reading := round(p["reading"])):
            return state
        P = READINGS[reading]
        return relabelled(state, P if way > 0.0 else P.T, rig)


EFFECT = MisreadRotation()
