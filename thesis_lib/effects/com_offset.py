"""Displaced centre of mass: it is not at the body origin, where it is believed (magnets, markers, infill).

With c = (c_x, c_y) the true minus the believed centre of mass in the body frame and C = R(θ) c:

    velocity    v_com = v_o + ω × C,   ω × C = ω (−C_y, C_x)
    lever       r ← r − C
    flight      a_o = a_com + ω² C − α × C      (the origin circles the centre of mass, which gravity pulls)
    arc         −(R(ω τ) − 1 − ω τ R(π/2) + (ω τ)²/2) C, what the circle has beyond that at time τ

| on paper | in code      | unit | shape |                                                                    |
|----------|--------------|------|-------|--------------------------------------------------------------------|
| c        | `c_x`, `c_y` | m    |       | body frame                                                         |
| C        | `C_x`, `C_y` | m    | (n,)  | axes of the surface                                                |
| α        | `a[:, 2]`    | rad/s² | (n,) | angular acceleration                                               |

The radius of gyration stays that about the true centre of mass.  The outline is where it is believed to be; where it is
displaced with the mass, the tracked point is off the centre (marker_offset).
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class ComOffset(Effect):
    name = "com_offset"
    family = "geometry"
    title = "displaced centre of mass"
    equation = "v_com = v_o + ω × R(θ) c, r = r_o − R(θ) c"
    parameters = (
        Parameter("c_x", "m", null=0.0, low=-0.02, high=0.02, scale=5e-4),
        Parameter("c_y", "m", null=0.0, low=-0.02, high=0.02, scale=5e-4),
    )
    channels = ("impact", "flight")
    denies = "centre of mass"
    needs_angle = True
    rank = 6
    reference = "rigid-body kinematics"
    breaks_mirror = True

    def to_contact(self, state, p, rig):
        C_x, C_y = _turned(state, p)
        return state.moved(vx=state.vx - state.omega * C_y, vy=state.vy + state.omega * C_x)

    def from_contact(self, state, p, rig):
        C_x, C_y = _turned(state, p)
        return state.moved(vx=state.vx + state.omega * C_y, vy=state.vy - state.omega * C_x)

    def contact_point(self, r_x, r_y, state, p, rig):
        C_x, C_y = _turned(state, p)
        return r_x - C_x, r_y - C_y

    def acceleration(self, a, state, p, rig):
        C_x, C_y = _turned(state, p)
        square, alpha = state.omega * state.omega, a[:, 2]
        return a + np.stack([square * C_x + alpha * C_y, square * C_y - alpha * C_x, 0.0 * alpha], axis=-1)

    def arc(self, tau, state, p, rig):
        # the origin's circle about the centre of mass
        C_x, C_y = (C[:, None] for C in _turned(state, p))
        turn = state.omega[:, None] * tau
        along, across = 1.0 - np.cos(turn) - 0.5 * turn * turn, turn - np.sin(turn)
        x, y = along * C_x - across * C_y, across * C_x + along * C_y
        return np.stack([x, y, np.zeros_like(x)], axis=-1)


def _turned(state, p):
    """C = R(θ) c, two arrays (n,)."""
    sin, cos = np.sin(state.theta), np.cos(state.theta)
    return cos * p["c_x"] - sin * p["c_y"], sin * p["c_x"] + cos * p["c_y"]


EFFECT = ComOffset()
