"""Contact point offset: the impulse acts beside the lowest point (curved surface, moving contact point).

    r_x ← r_x + d_r

| on paper | in code | unit | shape |                                |
|----------|---------|------|-------|--------------------------------|
| d_r      | `d_r`   | m    |       | shift along t, constant        |

It appears as a couple d_r c_n about the assumed contact point.  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class ContactPointOffset(Effect):
    name = "contact_point_offset"
    family = "geometry"
    title = "contact point offset"
    equation = "r_x = r_x,shape + d_r"
    parameters = (Parameter("d_r", "m", null=0.0, low=-0.01, high=0.01, scale=5e-4),)
    needs_angle = True
    reference = "Brach 1989 (rigid body collisions: distributed contact)"
    breaks_mirror = True

    def contact_point(self, r, state, p, rig):
        return np.array((r[0] + p["d_r"], r[1]))


EFFECT = ContactPointOffset()
