"""Curved surface: a plate that is bent, or the outside of a large roller.

    height   h(x) = κ (x − x_0 − c)²/2,   angle ψ(x_c) = κ (x_c − x_0 − c) at the contact point
    gap      φ_n = y + (R(ψ) r)_y − H − h(x_c),   r the contact point of the body at the angle θ − ψ
    contact  velocities along and across the surface there, R(−ψ) v

In space it is a bowl, as curved along y as along x: h = κ |s|²/2, with s from its lowest place to the contact point,
and the axes there are turned by the rotation vector κ (s_y, −s_x, 0).  The whole body is seen in these axes, attitude
and spin, too.

| on paper | in code           | unit | shape |                                                                    |
|----------|-------------------|------|-------|--------------------------------------------------------------------|
| κ        | `kappa`           | 1/m  |       | curvature, 1 over the radius; positive: a hollow                   |
| c        | `x_0`             | m    |       | where the surface is level, and as high as believed, from x_0      |
|          | `x_0`, `y_0`      | m    |       | in space: the lowest place, from the reference (x_0, y_0)          |
| x_0      | `rig.reference.x` | m    |       | the place where the drops fall                                     |
| x_c      |                   | m    | (n,)  | place of the contact point, x + (R(ψ) r)_x                         |

To first order in κ r, which is a few thousandths.  The believed surface is level; one that slopes everywhere alike is
camera_pose, with a slope.  Breaks mirror symmetry.
"""

from dataclasses import replace

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, vector
from thesis_lib.mechanics.space import multiplied, of_rotation_vector, rotated

_PLACE = Parameter("x_0", "m", null=0.0, low=-2.0, high=2.0, scale=0.05, along="x")
_ROUNDS = 6  # to the axes at the contact point: each leaves κ r of what the one before has left
_LOWEST = (-0.2, 0.0, 0.2)  # m: places with which a fit may start


class CurvedSurface(Effect):
    name = "curved_surface"
    family = "surface"
    title = "curved surface"
    equation = "h(x) = κ (x − c)²/2, normal turned by κ (x − c)"
    parameters = (Parameter("kappa", "1/m", null=0.0, low=-2.0, high=2.0, scale=0.1), _PLACE)
    own_in_space = (*parameters, replace(_PLACE, name="y_0", along="y"))
    level = (("x_0", "y_0", 1),)
    channels = ("impact", "touch")
    needs_one_surface = True
    reference = "differential geometry of a plane curve, to second order"
    breaks_mirror = True
    along = ("x",)
    rank = 7
    dimensions = IN_SPACE

    def shapes(self, state, rig):
        if not state.space.is_plane:
            return [{"x_0": x, "y_0": y} for x in _LOWEST for y in _LOWEST]
        return [{"x_0": x} for x in _LOWEST]

    def to_contact(self, state, p, rig):
        if not state.space.is_plane:
            seen = state
            for _ in range(_ROUNDS):
                seen = _seen_from(state, -_slope(seen, p, rig)[0])
            return seen
        return _turned(state, -_angle(state, p, rig)[0])

    def from_contact(self, state, p, rig):
        if not state.space.is_plane:
            return _seen_from(state, _slope(state, p, rig)[0])
        return _turned(state, _angle(state, p, rig)[0])

    def contact_point(self, r, state, p, rig):
        if not state.space.is_plane:
            return r + rig.lowest(state) - rig.lowest(self.from_contact(state, p, rig))
        _, there, believed = _angle(state, p, rig)
        return r + there - believed

    def gap(self, gap, state, p, rig):
        if not state.space.is_plane:
            slope, place, r = _slope(self.to_contact(state, p, rig), p, rig)
            bowl = 0.5 * p["kappa"] * ((place - slope * r[2]) ** 2).sum(axis=0)
            return gap + bowl + (rig.lowest(state) - r)[2] - (slope * r[:2]).sum(axis=0)
        psi, r, believed = _angle(state, p, rig)
        x = state.x + r[0] - psi * r[1] - rig.reference.x - p["x_0"]
        return gap + 0.5 * p["kappa"] * x * x + believed[1] - r[1] - psi * r[0]


def _angle(state, p, rig):
    """ψ (n,) in rad, and the contact points (2, n) in m in the axes of the surface there and as believed."""
    believed = rig.lowest(state)
    x = state.x - rig.reference.x - p["x_0"]
    r = rig.shape.lowest(state.attitude - p["kappa"] * (x + believed[0]))
    return p["kappa"] * (x + r[0]), r, believed


def _slope(seen, p, rig):
    """In space: slope (2, n) of the surface under a body in its axes there, the place (2, n) of the contact point from
    the lowest one and that point (3, n) from the body, both in m."""
    r = rig.lowest(seen)
    place = seen.position[:2] + r[:2] - np.array([[rig.reference.x], [rig.reference.y]]) - vector(p, ("x_0", "y_0"))
    return p["kappa"] * place, place, r


def _seen_from(state, slope):
    """In space: the state in axes of a surface whose slope is −`slope`, with that slope turned back."""
    turn = of_rotation_vector(np.stack([slope[1], -slope[0], np.zeros(len(state))]))
    attitude = multiplied(turn, state.attitude)
    return state.changed(None, attitude, rotated(turn, state.velocity), rotated(turn, state.spin))


def _turned(state, angle):
    """The state with its velocity turned by angles (n,) in rad."""
    sin, less = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    return state.moved(vx=state.vx - less * state.vx - sin * state.vy, vy=state.vy + sin * state.vx - less * state.vy)


EFFECT = CurvedSurface()
