"""Displaced centre of mass: it is not at the body origin, as assumed (magnets, markers, infill).

With c the true minus the assumed centre of mass along the body axes and C = R c:

    velocity    v_com = v_o + ω × C,   ω × C = ω (−C_y, C_x) in the plane
    lever       r ← r − C
    flight      a_o = a_com − ω × (ω × C) − α × C      (the origin circles the centre of mass, which falls)
    arc         −(R(ω τ) − 1 − ω τ R(π/2) + (ω τ)²/2) C, deviation of the circle from its parabola at time τ

| on paper | in code      | unit | shape |                                                                    |
|----------|--------------|------|-------|--------------------------------------------------------------------|
| c        | `c_x`, `c_y`, in space `c_z` | m | | axes of the body                                        |
| C        | `_turned`    | m    | (d, n) | axes of the surface                                               |
| α        | `a[d:]`      | rad/s² | (turns, n) | angular acceleration                                         |

The radius of gyration is about the true centre of mass.  The outline stays where it is assumed to be; if it is
displaced together with the mass, the tracked point is off the centre (marker_offset).
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, along_axes, components
from thesis_lib.mechanics.free_motion import attitudes
from thesis_lib.mechanics.space import cross, rotated


class ComOffset(Effect):
    name = "com_offset"
    family = "geometry"
    title = "displaced centre of mass"
    equation = "v_com = v_o + ω × R(θ) c, r = r_o − R(θ) c"
    equation_in_space = "v_com = v_o + ω × R c, r = r_o − R c"
    parameters = components(Parameter("c", "m", null=0.0, low=-0.02, high=0.02, scale=5e-4), ("c_x", "c_y"))
    channels = ("impact", "flight")
    even = True
    denies = "centre of mass"
    needs_angle = True
    rank = 6
    vectors = ("c",)
    dimensions = IN_SPACE
    reference = "rigid-body kinematics"
    breaks_mirror = True

    def to_contact(self, state, p, rig):
        return state.changed(velocity=state.space.velocity_at(state.velocity, state.spin, _turned(state, p)))

    def from_contact(self, state, p, rig):
        return state.changed(velocity=state.space.velocity_at(state.velocity, state.spin, -_turned(state, p)))

    def contact_point(self, r, state, p, rig):
        return r - _turned(state, p)

    def acceleration(self, a, state, p, rig):
        # the origin is at −C from the centre of mass: −α × C − ω × (ω × C)
        space, C = state.space, _turned(state, p)
        d, none = space.dimension, np.zeros_like(C)
        circling = space.velocity_at(none, state.spin, space.velocity_at(none, state.spin, C))
        made = a.copy()
        made[:d] -= space.velocity_at(circling, a[d:], C)
        return made

    def arc(self, tau, state, p, rig):
        if not state.space.is_plane:
            return _arc_in_space(tau, state, p, rig)
        # the origin's circle about the centre of mass
        C_x, C_y = (C[:, None] for C in _turned(state, p))
        turn = state.omega[:, None] * tau
        along, across = 1.0 - np.cos(turn) - 0.5 * turn * turn, turn - np.sin(turn)
        x, y = along * C_x - across * C_y, across * C_x + along * C_y
        return np.stack([x, y, np.zeros_like(x)])


def _turned(state, p):
    """Offset C = R c (d, n) in the axes of the surface."""
    return state.turned(along_axes(p, "c", state.space))


def _arc_in_space(tau, state, p, rig):
    """Deviation as in `arc`, for torque-free rotation in space."""
    C, omega, alpha = (part[:, :, None] for part in (_turned(state, p), state.spin, rig.fall(state)[3:]))
    later, _ = attitudes(state.attitude, state.spin, rig.tensor, tau.T)
    turned = rotated(later.swapaxes(1, 2), along_axes(p, "c", state.space)[:, :, None])
    first = cross(omega, C)
    second = cross(alpha, C) + cross(omega, first)
    beyond = C + tau * first + 0.5 * tau * tau * second - turned
    return np.concatenate([beyond, np.zeros_like(beyond)])


EFFECT = ComOffset()
