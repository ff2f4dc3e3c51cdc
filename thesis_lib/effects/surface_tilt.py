"""Surface tilt: the surface is not level; the camera's axes are those of the surface.

    gravity g (sin φ, −cos φ) in place of g (0, −1):   a ← a + g (sin φ, 1 − cos φ)

The contact frame and the impact stay as they are, so the effect shows in flight only.  For φ > 0 downhill is
to the right.

| on paper | in code       | unit | shape |                              |
|----------|---------------|------|-------|------------------------------|
| φ        | `phi`         | rad  |       | angle of the surface         |
| g        | `rig.gravity` | m/s² |       | believed gravity             |
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class SurfaceTilt(Effect):
    name = "surface_tilt"
    family = "surface"
    title = "tilted surface"
    equation = "a = g (sin φ, −cos φ)"
    parameters = (Parameter("phi", "rad", null=0.0, low=-0.5, high=0.5, scale=0.01),)
    channels = ("flight",)
    even = True
    needs_trajectories = True
    needs_one_surface = True
    reference = "inclined plane"
    breaks_mirror = True

    def applies_to(self, rig):
        return rig.gravity > 0.0

    def acceleration(self, a, state, p, rig):
        sin, cos, g = np.sin(p["phi"]), np.cos(p["phi"]), rig.gravity
        oblique = a.copy()
        oblique[0] += g * sin
        oblique[1] += g * (1.0 - cos)
        return oblique


EFFECT = SurfaceTilt()
