"""Length scale: lengths, and therefore velocities, reported by the camera are too large or too small by a factor.

    x_measured − x_0 = (1 + s_L) (x − x_0),   y_measured − H = (1 + s_L) (y − H),   v_measured = (1 + s_L) v

θ and ω are correct.  In space x is the place of the tracked point.

| on paper | in code      | unit | shape |                                                            |
|----------|--------------|------|-------|------------------------------------------------------------|
| s_L      | `s_L`        | 1    |       | relative error of the camera's scale                       |
| H        | `rig.height` | m    |       | height of the surface, where y is correct                  |
| x_0      | `rig.reference.x` | m |     | place where x is correct                                   |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class LengthScale(Effect):
    name = "length_scale"
    family = "measurement"
    title = "wrong length scale"
    equation = "x_measured − x₀ = (1 + s_L) (x − x₀)"
    parameters = (Parameter("s_L", "1", null=0.0, low=-0.5, high=1.0, scale=0.02),)
    channels = ("impact", "touch", "flight")
    needs_one_surface = True
    along = ("x",)
    rank = 60
    dimensions = IN_SPACE
    reference = "camera calibration"

    def to_true(self, state, p, rig):
        return _scaled(state, -p["s_L"] / (1.0 + p["s_L"]), rig)

    def to_measured(self, state, p, rig):
        return _scaled(state, p["s_L"], rig)


def _scaled(state, s, rig):
    """State with lengths times 1 + s, about the reference place on the surface."""
    about = np.zeros((state.space.dimension, 1))
    about[0], about[-1] = rig.reference.x, rig.height
    if rig.tracked is None:
        seen = state.position + s * (state.position - about)
        return state.changed(position=seen, velocity=state.velocity * (1.0 + s))
    D = rig.lever(state)
    velocity = state.space.velocity_at(state.velocity, state.spin, D)
    return state.changed(state.position + s * (state.position + D - about), velocity=state.velocity + s * velocity)


EFFECT = LengthScale()
