"""Surface height: the surface is higher or lower than assumed.

    φ_n ← φ_n + h:   at contact the body is h above the assumed surface

| on paper | in code | unit | shape |                                  |
|----------|---------|------|-------|----------------------------------|
| h        | `h`     | m    |       | true minus assumed height        |

Velocities after impact do not depend on it.
"""

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class SurfaceHeight(Effect):
    name = "surface_height"
    family = "surface"
    title = "wrong surface height"
    equation = "φ_n = y − h(θ) − (H + h)"
    equation_in_space = "φ_n = x_n + r_n − (H + h)"
    parameters = (Parameter("h", "m", null=0.0, low=-0.1, high=0.1, scale=1e-3),)
    channels = ("touch",)
    dimensions = IN_SPACE
    reference = "definition of the gap"

    def gap(self, gap, state, p, rig):
        return gap + p["h"]


EFFECT = SurfaceHeight()
