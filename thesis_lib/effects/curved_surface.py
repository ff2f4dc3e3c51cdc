"""Curved surface: a plate that is bent, or the outside of a large roller.

    height   h(x) = κ (x − x_0 − c)²/2,   angle ψ(x_c) = κ (x_c − x_0 − c) at the contact point
    gap      φ_n = y + (R(ψ) r)_y − H − h(x_c),   r the contact point of the body at the angle θ − ψ
    contact  velocities along and across the surface there, R(−ψ) v

| on paper | in code           | unit | shape |                                                                    |
|----------|-------------------|------|-------|--------------------------------------------------------------------|
| κ        | `kappa`           | 1/m  |       | curvature, 1 over the radius; positive: a hollow                   |
| c        | `x_0`             | m    |       | where the surface is level, and as high as believed, from x_0      |
| x_0      | `rig.reference.x` | m    |       | the place where the drops fall                                     |
| x_c      |                   | m    | (n,)  | place of the contact point, x + (R(ψ) r)_x                         |

To first order in κ r, which is a few thousandths.  The believed surface is level; one that slopes everywhere alike is
camera_pose, with a slope.  Breaks mirror symmetry.
"""

import numpy as np

from thesis_lib.effects.effect import Effect, Parameter


class CurvedSurface(Effect):
    name = "curved_surface"
    family = "surface"
    title = "curved surface"
    equation = "h(x) = κ (x − c)²/2, normal turned by κ (x − c)"
    parameters = (
        Parameter("kappa", "1/m", null=0.0, low=-2.0, high=2.0, scale=0.1),
        Parameter("x_0", "m", null=0.0, low=-2.0, high=2.0, scale=0.05, along="x"),
    )
    channels = ("impact", "touch")
    needs_one_surface = True
    reference = "differential geometry of a plane curve, to second order"
    breaks_mirror = True
    along = ("x",)
    rank = 7

    def shapes(self, state, rig):
        return [{"x_0": x} for x in (-0.2, 0.0, 0.2)]

    def to_contact(self, state, p, rig):
        return _turned(state, -_angle(state, p, rig)[0])

    def from_contact(self, state, p, rig):
        return _turned(state, _angle(state, p, rig)[0])

    def contact_point(self, r, state, p, rig):
        _, there, believed = _angle(state, p, rig)
        return r + there - believed

    def gap(self, gap, state, p, rig):
        psi, r, believed = _angle(state, p, rig)
        x = state.x + r[0] - psi * r[1] - rig.reference.x - p["x_0"]
        return gap + 0.5 * p["kappa"] * x * x + believed[1] - r[1] - psi * r[0]


def _angle(state, p, rig):
    """ψ (n,) in rad, and the contact points (2, n) in m in the axes of the surface there and as believed."""
    believed = rig.lowest(state)
    x = state.x - rig.reference.x - p["x_0"]
    r = rig.shape.lowest(state.attitude - p["kappa"] * (x + believed[0]))
    return p["kappa"] * (x + r[0]), r, believed


def _turned(state, angle):
    """The state with its velocity turned by angles (n,) in rad."""
    sin, less = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    return state.moved(vx=state.vx - less * state.vx - sin * state.vy, vy=state.vy + sin * state.vx - less * state.vy)


EFFECT = CurvedSurface()
