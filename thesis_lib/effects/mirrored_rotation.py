"""Mirrored rotation: θ and ω are reported with the wrong sign (clockwise instead of counter-clockwise).

    θ_measured = −θ,   ω_measured = −ω          on or off, no size

The contact point follows from the true angle.  It looks like a huge contact torque, τ ≈ −2 r_y c_t.

| on paper | in code    | unit | shape |                            |
|----------|------------|------|-------|----------------------------|
|          | `mirrored` | 1    |       | 0 off, 1 on                |
"""

from thesis_lib.effects.effect import Effect, Parameter


class MirroredRotation(Effect):
    name = "mirrored_rotation"
    family = "measurement"
    title = "mirrored rotation"
    equation = "θ_measured = −θ, ω_measured = −ω"
    parameters = (Parameter("mirrored", "1", null=0.0, low=0.0, high=1.0, scale=1.0, discrete=1.0),)
    channels = ("impact", "touch")
    needs_angle = True
    rank = 80
    reference = "handedness of axes"

    def to_true(self, state, p, rig):
        return state.moved(theta=-state.theta, omega=-state.omega) if p["mirrored"] > 0.5 else state

    to_measured = to_true  # its own inverse


EFFECT = MirroredRotation()
