"""Camera pose: the axes of the image are rotated relative to the surface.

The image is rotated by β = ρ + α about the place x_0 of the surface where the drops fall, with R(β) counter-clockwise,
and shows that place higher by h:

    pose        (x_measured − x_0, y_measured − H − h) = R(β) (x − x_0, y − H),   θ_measured = θ + β
    velocity    v_measured = R(β) v
    flight      gravity g (−sin α, −cos α) in place of g (0, −1) in the axes of the surface

The camera may be rolled above a level surface (ρ), or level in front of a surface that slopes in the image (α).  Either
way a horizontal line in the image does not follow the surface: gap, normal, velocity and angle rotate together.  If the
surface has its assumed height at another place, it does not have it at x_0; h is that difference.  If ρ = −α, the image
keeps the axes of the surface and only gravity is oblique: this is surface_tilt with φ = −α.  If both angles are 0, h
acts as in surface_height.

| on paper | in code             | unit | shape |                                                                   |
|----------|---------------------|------|-------|-------------------------------------------------------------------|
| ρ        | `roll`              | rad  |       | angle by which the camera rotates the image of a level surface    |
| α        | `slope`             | rad  |       | angle of the surface to the horizontal; positive: rises with x    |
| h        | `h`                 | m    |       | height of the surface in the image at x_0 minus assumed height    |
| x_0, H   | `rig.reference.x`, `rig.height` | m |  | the centre of rotation                                         |

In space the axes of the recording, with table and gravity, are rotated by exp(b) about the point (0, 0, H):

    x_measured = exp(b) x,   R_measured = exp(b) R,   v and ω alike;   b along the axes of the recording

| on paper | in code             | unit | shape |                                                                   |
|----------|---------------------|------|-------|-------------------------------------------------------------------|
| b        | `b_x`, `b_y`, `b_z` | rad  |       | rotation vector; unobservable about the normal of a level table   |

Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, along_axes, components
from thesis_lib.mechanics.space import multiplied, of_rotation_vector, rotated


class CameraPose(Effect):
    name = "camera_pose"
    family = "measurement"
    title = "camera turned against the surface"
    equation = "x_measured − x₀ = R(ρ + α) (x − x₀), a = g (−sin α, −cos α)"
    equation_in_space = "x_measured = exp(b) x, R_measured = exp(b) R, v and ω alike"
    parameters = (
        Parameter("roll", "rad", null=0.0, low=-0.6, high=0.6, scale=0.01, starts=(0.0,)),
        Parameter("slope", "rad", null=0.0, low=-0.6, high=0.6, scale=0.01, starts=(0.0,)),
        Parameter("h", "m", null=0.0, low=-0.2, high=0.2, scale=1e-3, starts=(0.0,)),
    )
    own_in_space = components(
        Parameter("b", "rad", null=0.0, low=-0.6, high=0.6, scale=0.01, starts=(0.0,)), ("b_x", "b_y", "b_z")
    )
    embedded = (("b_y", "roll", -1.0),)
    channels = ("impact", "touch", "flight")
    even = True
    needs_one_surface = True
    includes = ("surface_tilt", "surface_height")
    reference = "rigid rotation; inclined plane"
    breaks_mirror = True
    along = ("x",)
    rank = 30
    dimensions = IN_SPACE

    def applies_to(self, rig):
        return rig.gravity > 0.0

    def unseen(self, rig):
        if rig.space.is_plane or rig.down is not None:
            return super().unseen(rig)
        normal = np.array([[0.0], [0.0], [1.0]])
        return (normal if rig.world is None else rotated(rig.world[:, None], normal)).T

    def to_true(self, state, p, rig):
        if not state.space.is_plane:
            return _about_surface(state, p, -1.0, rig)
        return _turned(state.moved(y=state.y - p["h"]), -(p["roll"] + p["slope"]), rig)

    def to_measured(self, state, p, rig):
        if not state.space.is_plane:
            return _about_surface(state, p, 1.0, rig)
        turned = _turned(state, p["roll"] + p["slope"], rig)
        return turned.moved(y=turned.y + p["h"])

    def acceleration(self, a, state, p, rig):
        if not state.space.is_plane:
            return a  # gravity remains opposite to the normal
        sin, cos, g = np.sin(p["slope"]), np.cos(p["slope"]), rig.gravity
        oblique = a.copy()
        oblique[0] -= g * sin
        oblique[1] += g * (1.0 - cos)
        return oblique


def _about_surface(state, p, sign, rig):
    """State in space rotated by ±b about the point (0, 0, H) of the surface."""
    turn = of_rotation_vector(sign * rig.from_recording(along_axes(p, "b", state.space)))
    up = np.array([[0.0], [0.0], [rig.height]])
    return state.changed(
        up + rotated(turn, state.position - up),
        multiplied(np.broadcast_to(turn, state.attitude.shape), state.attitude),
        rotated(turn, state.velocity),
        rotated(turn, state.spin),
    )


def _turned(state, angle, rig):
    """State rotated about (x_0, H) by an angle in rad; half angles keep precision for small rotations."""
    sin, less = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    x, y = state.x - rig.reference.x, state.y - rig.height
    return state.moved(
        x=state.x - less * x - sin * y,
        y=state.y + sin * x - less * y,
        theta=state.theta + angle,
        vx=state.vx - less * state.vx - sin * state.vy,
        vy=state.vy + sin * state.vx - less * state.vy,
    )


EFFECT = CameraPose()
