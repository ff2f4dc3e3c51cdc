"""Moving surface: the surface slides along t at a constant velocity, like a conveyor.

    v_x seen by the contact = v_x − V

| on paper | in code | unit | shape |                                            |
|----------|---------|------|-------|--------------------------------------------|
| V        | `V`     | m/s  |       | velocity of the surface along +t           |

Impacts alone cannot tell it from a camera that drifts at the same velocity (the laws are the same in both frames).
Breaks mirror symmetry.
"""

from thesis_lib.effects.effect import Effect, Parameter


class MovingSurface(Effect):
    name = "moving_surface"
    family = "surface"
    title = "moving surface"
    equation = "v_t = v_x − V − r_y ω"
    parameters = (Parameter("V", "m/s", null=0.0, low=-3.0, high=3.0, scale=0.1),)
    needs_one_surface = True
    needs_angle = True
    rank = 8
    reference = "Galilean invariance"
    breaks_mirror = True

    def to_contact(self, state, p, rig):
        return state.moved(vx=state.vx - p["V"])

    def from_contact(self, state, p, rig):
        return state.moved(vx=state.vx + p["V"])


EFFECT = MovingSurface()
