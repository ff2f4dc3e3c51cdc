"""Camera skew: the axes of the camera are not square, as where a calibration let them differ.

    x_measured = x + s (y − H),   v_x,measured = v_x + s v_y;   y, θ and ω are correct

| on paper | in code      | unit | shape |                                                             |
|----------|--------------|------|-------|-------------------------------------------------------------|
| s        | `s`          | 1    |       | tangent of the angle by which y leans over, towards x > 0   |
| H        | `rig.height` | m    |       | height of the surface, where x is correct                   |

Where y leans over and x is correct, the picture is turned, too (camera_pose).  Breaks mirror symmetry.
"""

from thesis_lib.effects.effect import Effect, Parameter


class CameraSkew(Effect):
    name = "camera_skew"
    family = "measurement"
    title = "camera axes not square"
    equation = "x_measured = x + s (y − H)"
    parameters = (Parameter("s", "1", null=0.0, low=-0.3, high=0.3, scale=0.01),)
    channels = ("impact", "flight")
    needs_one_surface = True
    reference = "Hartley and Zisserman 2004 (skew of a camera), doi:10.1017/CBO9780511811685"
    breaks_mirror = True
    rank = 40

    def to_true(self, state, p, rig):
        return _leaning(state, -p["s"], rig)

    def to_measured(self, state, p, rig):
        return _leaning(state, p["s"], rig)


def _leaning(state, s, rig):
    """The state with y leaning over by s."""
    return state.moved(x=state.x + s * (state.y - rig.height), vx=state.vx + s * state.vy)


EFFECT = CameraSkew()
