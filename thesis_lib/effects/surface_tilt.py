"""Surface tilt: the surface is not level, while the axes of the camera follow the surface.

    gravity g (sin φ, −cos φ) in place of g (0, −1):   a ← a + g (sin φ, 1 − cos φ)

and in space gravity g (sin φ_x, sin φ_y, −…) along t_1, t_2 and the normal, if the surface is assumed level.

The contact frame and the impact do not change, so the effect is visible only in flight.  For φ > 0 the surface falls
to the right.

| on paper | in code       | unit | shape |                              |
|----------|---------------|------|-------|------------------------------|
| φ        | `phi`         | rad  |       | angle of the surface to the horizontal |
| φ_x, φ_y | `phi_x`, `phi_y` | rad |    | in space, in addition to the assumed slope |
| g        | `rig.gravity` | m/s² |       | assumed gravity              |
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, components, vector

_ANGLE = Parameter("phi", "rad", null=0.0, low=-0.5, high=0.5, scale=0.01)
_NAMES = ("phi_x", "phi_y")


class SurfaceTilt(Effect):
    name = "surface_tilt"
    family = "surface"
    title = "tilted surface"
    equation = "a = g (sin φ, −cos φ)"
    equation_in_space = "a_t = g_t + |g| (sin φ_x, sin φ_y), |a| = |g|"
    parameters = (_ANGLE,)
    own_in_space = components(_ANGLE, _NAMES)
    embedded = (("phi_x", "phi", 1.0),)
    channels = ("flight",)
    even = True
    needs_one_surface = True
    dimensions = IN_SPACE
    reference = "inclined plane"
    breaks_mirror = True

    def applies_to(self, rig):
        return rig.gravity > 0.0

    def acceleration(self, a, state, p, rig):
        if not state.space.is_plane:
            down = np.array([0.0, 0.0, -1.0]) if rig.down is None else rig.down
            along = down[:2, None] + np.sin(vector(p, _NAMES))
            across = np.sqrt(np.maximum(1.0 - (along**2).sum(axis=0, keepdims=True), 0.0))
            tilted = np.array(a)
            tilted[:3] += rig.gravity * (np.concatenate([along, -across]) - down[:, None])
            return tilted
        sin, cos, g = np.sin(p["phi"]), np.cos(p["phi"]), rig.gravity
        oblique = a.copy()
        oblique[0] += g * sin
        oblique[1] += g * (1.0 - cos)
        return oblique


EFFECT = SurfaceTilt()
