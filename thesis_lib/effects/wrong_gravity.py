"""Wrong gravity: gravity differs from its assumed value (buoyancy, a surface that leans away from the camera).

    a_y ← a_y − dg;   in space along the assumed gravity, on a slope not along the normal

| on paper | in code | unit | shape |                               |
|----------|---------|------|-------|-------------------------------|
| dg       | `dg`    | m/s² |       | true minus assumed gravity    |

An error 1 + s of the time scale has the same signature, because impact laws contain no time: with recorded times
t (1 + s) bodies seem to fall with g / (1 + s)², so that dg = −2 s g for small s.
"""

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter


class WrongGravity(Effect):
    name = "wrong_gravity"
    family = "flight"
    title = "wrong gravity"
    equation = "a = (0, −(g + dg))"
    equation_in_space = "a = g (1 + dg/|g|)"
    parameters = (Parameter("dg", "m/s²", null=0.0, low=-9.0, high=9.0, scale=0.1),)
    channels = ("flight",)
    even = True
    needs_one_surface = True
    dimensions = IN_SPACE
    reference = "free fall"

    def acceleration(self, a, state, p, rig):
        faster = a.copy()
        if rig.down is not None:
            faster[: len(rig.down)] += p["dg"] * rig.down[:, None]
            return faster
        faster[state.space.dimension - 1] -= p["dg"]
        return faster


EFFECT = WrongGravity()
