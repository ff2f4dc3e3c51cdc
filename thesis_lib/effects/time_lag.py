"""Time lag: the angle is behind the position, as from a second sensor or a filter.

    θ_measured(t) = θ(t − T) = θ − ω T          while ω is constant

At an impact the angle is reported ω T too small before it and ω⁺ T too small after it, so the measured angle jumps by
−(ω⁺ − ω) T, which no body does.

| on paper | in code | unit | shape |                                              |
|----------|---------|------|-------|----------------------------------------------|
| T        | `lag`   | s    |       | lag of θ behind x and y; negative: ahead     |
"""

from thesis_lib.effects.effect import IN_SPACE, CameraEffect, Parameter


class TimeLag(CameraEffect):
    name = "time_lag"
    title = "angle lags behind position"
    equation = "θ_measured(t) = θ(t − T)"
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
