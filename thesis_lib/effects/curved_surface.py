"""Curved surface: a bent plate, or the outside of a large roller.

    height   h(x) = κ ((x − x_0 − c)² − c²)/2,   angle ψ(x_c) = κ (x_c − x_0 − c) at the contact point
    gap      φ_n = y + (R(ψ) r)_y − H − h(x_c),   r the contact point of the body at the angle θ − ψ
    contact  velocities along and across the surface there, R(−ψ) v

In space it is a bowl, with equal curvature along x and y: h = κ (|s|² − |c|²)/2, with s from its lowest place to the
contact point.  The axes there are rotated about (s_y, −s_x, 0) until the third one is the normal of the bowl.
Velocity, attitude and spin of the body are expressed in these axes.

| on paper | in code           | unit | shape |                                                                    |
|----------|-------------------|------|-------|--------------------------------------------------------------------|
| κ        | `kappa`           | 1/m  |       | curvature, 1 over the radius; positive: a hollow                   |
| c        | `x_0`             | m    |       | place from x_0 where the surface is level                          |
|          | `x_0`, `y_0`      | m    |       | in space: the lowest place, from the reference (x_0, y_0)          |
| x_0      | `rig.reference.x` | m    |       | the place where the drops fall; there it has the assumed height    |
| x_c      |                   | m    | (n,)  | place of the contact point, x + (R(ψ) r)_x                         |

The height at the reference is the assumed one wherever the level place is: far away the effect is a slope, not another
height.  In the plane it holds to first order in κ r, which is a few thousandths.  The assumed surface is level; a
uniform slope is described by camera_pose.  Breaks mirror symmetry.
"""

from dataclasses import replace

import numpy as np

from thesis_lib.effects.effect import IN_SPACE, Effect, Parameter, vector
from thesis_lib.mechanics.space import multiplied, rotated

_PLACE = Parameter("x_0", "m", null=0.0, low=-2.0, high=2.0, scale=0.05, along="x")
_ROUNDS = (
    6  # most iterations to the axes at the contact point: each multiplies the error by κ r, or ends it at a corner
)
_FOUND = 1e-14  # change of a slope by rounding
_LOWEST = (-0.2, 0.0, 0.2)  # m: places from which a fit may start


class CurvedSurface(Effect):
    name = "curved_surface"
    family = "surface"
    title = "curved surface"
    equation = "h(x) = κ ((x − c)² − c²)/2, normal turned by κ (x − c)"
    equation_in_space = "h = κ (|s|² − x_0² − y_0²)/2, n ~ (−κ s, 1), s = (x − x_0, y − y_0)"
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
            return _seen_from(state, -_under(state, p, rig)[0])
        return _turned(state, -_angle(state, p, rig)[0])

    def from_contact(self, state, p, rig):
        if not state.space.is_plane:
            r = rig.lowest(state)
            return _seen_from(state, _found(state, lambda slope: rotated(_turn(slope), r), p, rig)[0])
        return _turned(state, _angle(state, p, rig)[0])

    def contact_point(self, r, state, p, rig):
        if not state.space.is_plane:
            return r + rig.lowest(state) - rig.lowest(self.from_contact(state, p, rig))
        _, there, believed = _angle(state, p, rig)
        return r + there - believed

    def gap(self, gap, state, p, rig):
        if not state.space.is_plane:
            _, r = _under(state, p, rig)
            place = state.position[:2] + r[:2] - _lowest(p, rig)
            height = 0.5 * p["kappa"] * ((place**2).sum(axis=0) - (vector(p, ("x_0", "y_0")) ** 2).sum(axis=0))
            return gap + height + (rig.lowest(state) - r)[2]
        psi, r, believed = _angle(state, p, rig)
        x = state.x + r[0] - psi * r[1] - rig.reference.x - p["x_0"]
        return gap + 0.5 * p["kappa"] * (x * x - p["x_0"] ** 2) + believed[1] - r[1] - psi * r[0]


def _angle(state, p, rig):
    """Angle ψ (n,) in rad, and the contact points (2, n) in m in the local axes of the surface and as assumed."""
    believed = rig.lowest(state)
    x = state.x - rig.reference.x - p["x_0"]
    r = rig.shape.lowest(state.attitude - p["kappa"] * (x + believed[0]))
    return p["kappa"] * (x + r[0]), r, believed


def _under(state, p, rig):
    """In space: slope (2, n) of the surface at the contact point, and that point (3, n) from the body origin in m."""

    def lowest(slope):
        back = multiplied(_turn(-slope), state.attitude)
        return rotated(_turn(slope), rig.lowest(state.changed(attitude=back)))

    return _found(state, lowest, p, rig)


def _found(state, point, p, rig):
    """In space: slope (2, n) of the surface under a point (3, n) of the body that depends on it, and that point."""
    slope = np.zeros((2, len(state)))
    for _ in range(_ROUNDS):
        r, before = point(slope), slope
        slope = p["kappa"] * (state.position[:2] + r[:2] - _lowest(p, rig))
        if np.abs(slope - before).max(initial=0.0) < _FOUND:
            break
    return slope, r


def _lowest(p, rig):
    """In space: lowest place (2, n) of the bowl."""
    return np.array([[rig.reference.x], [rig.reference.y]]) + vector(p, ("x_0", "y_0"))


def _turn(slope):
    """In space: quaternion (4, n) that rotates the vertical into the normal of a surface with this slope."""
    x, y = slope
    cos = 1.0 / np.sqrt(1.0 + x * x + y * y)
    half = np.sqrt(0.5 * (1.0 + cos))  # cosine of half the angle
    share = 0.5 * cos / half
    return np.stack([half, share * y, -share * x, np.zeros(len(half))])


def _seen_from(state, slope):
    """In space: state expressed in the axes of a surface whose slope is −`slope`."""
    turn = _turn(slope)
    attitude = multiplied(turn, state.attitude)
    return state.changed(None, attitude, rotated(turn, state.velocity), rotated(turn, state.spin))


def _turned(state, angle):
    """State with its velocity rotated by angles (n,) in rad."""
    sin, less = np.sin(angle), 2.0 * np.sin(0.5 * angle) ** 2
    return state.moved(vx=state.vx - less * state.vx - sin * state.vy, vy=state.vy + sin * state.vx - less * state.vy)


EFFECT = CurvedSurface()
