"""Time lag: the angle lags behind the position, for example because of a second sensor or a filter.

    θ_measured(t) = θ(t − T) = θ − ω T          while ω is constant

The reported angle is too small by ω T before an impact and by ω⁺ T after it, so the measured angle jumps by
−(ω⁺ − ω) T, which is impossible for a rigid body.

| on paper | in code | unit | shape |                                              |
|----------|---------|------|-------|----------------------------------------------|
| T        | `lag`   | s    |       | lag of θ behind x and y; negative: ahead     |
"""

from thesis_lib.effects.effect import IN_SPACE, CameraEffect, Parameter


class TimeLag(CameraEffect):
    name = "time_lag"
    title = "angle lags behind position"
    equation = "θ_measured(t) = θ(t − T)"
    equation_in_space = "R_measured(t) = R(t − T)"
    parameters = (Parameter("lag", "s", null=0.0, low=-0.05, high=0.05, scale=2e-3, starts=(-0.01, 0.01)),)
    channels = ("impact", "meet", "touch")
    needs_angle = True
    rank = 20
    dimensions = IN_SPACE
    reference = "kinematics"

    def seen(self, state, p, way, rig):
        return rig.turned(state, state.space.attitude_after(state.attitude, -way * state.spin * p["lag"]), state.spin)

    def meet(self, jump, before, after, p):
        jumped = jump.copy()
        jumped[before.space.dimension :] -= (after.spin - before.spin) * p["lag"]
        return jumped


EFFECT = TimeLag()
