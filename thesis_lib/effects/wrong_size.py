"""Wrong size: the body is larger or smaller than its drawing but has the same shape.

    r ← r + s r_shape(θ),   φ_n ← φ_n + s h(θ),   h = −r_y,shape > 0

| on paper | in code | unit | shape |                                                   |
|----------|---------|------|-------|---------------------------------------------------|
| s        | `s`     | 1    |       | true size is (1 + s) times the assumed size       |
| r_shape  | `r`     | m    | (n, 2)| contact point of the assumed shape                |

The radius of gyration is measured independently and does not change.
"""

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class WrongSize(Effect):
    name = "wrong_size"
    family = "geometry"
    title = "wrong size"
    equation = "r = (1 + s) r_shape(θ)"
    equation_in_space = "r = (1 + s) r_shape(R)"
    parameters = (Parameter("s", "1", null=0.0, low=-0.5, high=0.5, scale=0.03),)
    channels = ("impact", "touch")
    denies = "size"
    dimensions = IN_SPACE
    reference = "similarity of shapes"

    # the change is added, not multiplied: r may contain the shift of another effect, which does not scale with size
    def contact_point(self, r, state, p, rig):
        return r + p["s"] * rig.lowest(state)

    def gap(self, gap, state, p, rig):
        return gap - p["s"] * rig.lowest(state)[-1]


EFFECT = WrongSize()
