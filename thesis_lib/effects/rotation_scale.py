"""Rotation scale: a tracker that integrates angular rates from the first frame of a toss has a wrong scale factor.

    ω_measured = (1 + s_R) ω,   R_measured(t) = E(t) R(t),   E(0) = 1

| on paper | in code | unit | shape  |                                                                     |
|----------|---------|------|--------|---------------------------------------------------------------------|
| s_R      | `s_R`   | 1    |        | relative error of the rates                                         |
| E        |         | 1    | (4, n) | integrated error of the rates, a rotation (`whole_tosses.py`)       |

The tracked point is correct.  The error of the attitude grows with the total rotation of the body, so contact points
are increasingly wrong at later hits.
"""

import numpy as np

from thesis_lib.effects.effect import ONLY_SPACE, Effect, Parameter
from thesis_lib.mechanics.space import conjugate, multiplied


class RotationScale(Effect):
    name = "rotation_scale"
    family = "measurement"
    title = "wrong scale of rotation"
    equation = "ω_measured = (1 + s_R) ω, summed from the first frame"
    parameters = (Parameter("s_R", "1", null=0.0, low=-0.5, high=1.0, scale=0.02),)
    channels = ("impact", "touch", "flight")
    needs_angle = True
    needs_history = True
    turns = True
    rank = 97  # E is the sum of turns as reported, in axes however they are mirrored or misread
    dimensions = ONLY_SPACE
    reference = "Titterton and Weston 2004, Strapdown Inertial Navigation Technology (scale factor of a gyroscope)"

    def to_true(self, state, p, rig):
        E = _summed(state, p["s_R"], rig)
        return rig.turned(state, multiplied(conjugate(E), state.attitude), state.spin / (1.0 + p["s_R"]))

    def to_measured(self, state, p, rig):
        E = _summed(state, p["s_R"], rig)
        return rig.turned(state, multiplied(E, state.attitude), state.spin * (1.0 + p["s_R"]))


def _summed(state, scale, rig):
    """Rotation E (4, n) for one scale, or for one scale per body."""
    if rig.recorded is None:
        return np.array([[1.0], [0.0], [0.0], [0.0]]) * np.ones(len(state))
    scales = np.broadcast_to(scale, len(state))
    E = np.empty((4, len(state)))
    for one in np.unique(scales):  # a fit tries only a few at once
        rows = np.flatnonzero(scales == one)
        E[:, rows] = rig.recorded.over(state.select(rows), one)
    return E


EFFECT = RotationScale()
