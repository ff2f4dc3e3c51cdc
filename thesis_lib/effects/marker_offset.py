"""Marker offset: the tracked point is not the centre of the body, to which shape and mass are referred.

With d the tracked point minus the body's centre in the body frame and D = R(θ) d:

    pose        x_measured = x + D
    velocity    v_measured = v + ω × D,   ω × D = ω (−D_y, D_x)
    flight      a_measured = a − ω² D + α × D      (the tracked point circles the centre, which flies a parabola)

| on paper | in code      | unit | shape |                                                                    |
|----------|--------------|------|-------|--------------------------------------------------------------------|
| d        | `d_x`, `d_y` | m    |       | body frame                                                         |
| D        | `D_x`, `D_y` | m    | (n,)  | axes of the surface                                                |

A displaced centre of mass (com_offset) with c = −d has the same flights.  But then the outline of the body is where it
is assumed to be, whereas a marker offset shifts outline and mass together: the contact has the assumed lever, and the
gap at impact is wrong by D_y.  A rotated marker frame is described by angle_offset.
"""

from thesis_lib.effects.effect import IN_SPACE, CameraEffect, Parameter, along_axes, components


class MarkerOffset(CameraEffect):
    name = "marker_offset"
    title = "marker off the centre"
    equation = "x_measured = x + R(θ) d"
    equation_in_space = "x_measured = x + R d"
    parameters = components(
        Parameter("d", "m", null=0.0, low=-0.05, high=0.05, scale=5e-4, starts=(0.0,)), ("d_x", "d_y")
    )
    channels = ("impact", "touch", "flight")
    needs_angle = True
    rank = 10
    vectors = ("d",)
    dimensions = IN_SPACE
    reference = "rigid-body kinematics"
    breaks_mirror = True
    bends = True

    def seen(self, state, p, way, rig):
        D = way * state.turned(along_axes(p, "d", state.space))
        velocity = state.space.velocity_at(state.velocity, state.spin, D)
        return state.changed(position=state.position + D, velocity=velocity)


EFFECT = MarkerOffset()
