"""Length scale: the lengths that the camera reports, and so the velocities, are too large or too small by a factor.

    x_measured = (1 + s_L) x,   y_measured − H = (1 + s_L) (y − H),   v_measured = (1 + s_L) v;   θ and ω are correct

| on paper | in code      | unit | shape |                                                            |
|----------|--------------|------|-------|------------------------------------------------------------|
| s_L      | `s_L`        | 1    |       | relative error of the camera's scale                       |
| H        | `rig.height` | m    |       | height of the surface, where y is correct                  |
"""

from thesis_lib.effects.effect import Effect, Parameter


class LengthScale(Effect):
    name = "length_scale"
    family = "measurement"
    title = "wrong length scale"
    equation = "x_measured = (1 + s_L) x"
    parameters = (Parameter("s_L", "1", null=0.0, low=-0.5, high=1.0, scale=0.02),)
    channels = ("impact", "touch", "flight")
    needs_one_surface = True
    reference = "camera calibration"

    def to_true(self, state, p, rig):
        return _scaled(state, -p["s_L"] / (1.0 + p["s_L"]), rig.height)

    def to_measured(self, state, p, rig):
        return _scaled(state, p["s_L"], rig.height)


def _scaled(state, s, height):
    """Lengths times 1 + s, about the surface's origin (0, height)."""
    factor = 1.0 + s
    return state.moved(
        x=state.x * factor, y=state.y + s * (state.y - height), vx=state.vx * factor, vy=state.vy * factor
    )


EFFECT = LengthScale()
