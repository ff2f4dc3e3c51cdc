"""Camera skew: the axes of the camera are not perpendicular, for example because of a calibration with skew.

    x_measured = x + s (y − H),   v_x,measured = v_x + s v_y;   y, θ and ω are correct

In space the reported normal of the surface is inclined along t_1 and t_2 of the surface.  This concerns the tracked
point only: attitude and spin are correct.

| on paper | in code      | unit | shape |                                                             |
|----------|--------------|------|-------|-------------------------------------------------------------|
| s        | `s`          | 1    |       | tangent of the inclination of y, towards x > 0              |
|          | `s_x`, `s_y` | 1    |       | in space: towards t_1 and t_2                               |
| H        | `rig.height` | m    |       | height of the surface, where x is correct                   |

If instead x is correct and y_measured = y + s x, the image is also rotated (camera_pose).  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, CameraEffect, Parameter, components, vector

_LEAN = Parameter("s", "1", null=0.0, low=-0.3, high=0.3, scale=0.01)
_NAMES = ("s_x", "s_y")


class CameraSkew(CameraEffect):
    name = "camera_skew"
    title = "camera axes not square"
    equation = "x_measured = x + s (y − H)"
    equation_in_space = "x_measured = x + (s_x, s_y, 0) (x_n − H)"
    parameters = (_LEAN,)
    own_in_space = components(_LEAN, _NAMES)
    embedded = (("s_x", "s", 1.0),)
    level = (("s_x", "s_y", 1),)
    channels = ("impact", "flight")
    needs_one_surface = True
    reference = "Hartley and Zisserman 2004 (skew of a camera), doi:10.1017/CBO9780511811685"
    breaks_mirror = True
    rank = 40
    dimensions = IN_SPACE

    def seen(self, state, p, way, rig):
        if state.space.is_plane:
            s = way * p["s"]
            return state.moved(x=state.x + s * (state.y - rig.height), vx=state.vx + s * state.vy)
        lever, s = rig.lever(state), way * vector(p, _NAMES)
        v = state.space.velocity_at(state.velocity, state.spin, lever)
        none = np.zeros((1, len(state)))
        shift = np.concatenate([s * (state.position[2] + lever[2] - rig.height), none])
        faster = np.concatenate([s * v[2], none])
        return state.changed(state.position + shift, velocity=state.velocity + faster)


EFFECT = CameraSkew()
