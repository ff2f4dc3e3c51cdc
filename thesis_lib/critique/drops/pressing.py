"""Contacts integrated in time: forces at all contact points of a body, from touch until none presses any more.

They resolve contacts that overlap, and all contacts of a compliant law.  Each contact point has the normal force of the
law, or a linear spring that returns the share ε² of its work where the law has none, and Coulomb friction; L and v₀ are
the units of `thesis_lib/contact/normal_force.py`.  Per unit mass, with x the depth over L,

    normal     f_n = f(x, x', x_m; D) v₀²/L,   D and L from ε and τ of a central contact
    friction   what ends the slip within the step, at most μ f_n; of a convex contact a damper, at most μ f_n

The lowest point of a smooth body moves over it as the body turns.  Effects act on the frame, on the contact points and
on (μ, ε) as in a single contact; shifts of a contact point turn with the body.  What they add to the impulse of
the law is added to the impulse of each corner, at the velocity with which it touched.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from thesis_lib.bodies.shapes import Corner, Polygon, Shape
from thesis_lib.contact.normal_force import SPEED, ConvexDamper, NormalForce
from thesis_lib.contact.space import ContactSpace
from thesis_lib.critique.drops.model import DAMPING_RATIO, Model, contact_space_of
from thesis_lib.effects.effect import Effect, Impulse, Rig, State

MOST_CORNERS = 12  # a polygon with more is a curve drawn with corners
STEPS = 48  # in one central contact
SHORTEST = 1e-6  # s; no camera tells it from an instant
LONGEST = 4  # central contacts; a body that presses longer rests
SPRING = NormalForce()  # of laws without a force


@dataclass(frozen=True)
class _Springs:
    """The p contact points of n bodies at first touch: (p, n) from the centre of mass in m, gap in m, μ, loss D, unit
    L of depth in m.

    `w` is 1/k² in 1/m², `gravity` in m/s²; `shape` of a smooth body, with its angles `theta` (n,) in rad.
    """

    r_x: np.ndarray
    r_y: np.ndarray
    gap: np.ndarray
    mu: np.ndarray
    loss: np.ndarray
    length: np.ndarray
    force: NormalForce
    ratio: np.ndarray  # of a convex contact: damping along the surface over that across it
    w: np.ndarray
    gravity: float
    shape: Shape | None
    theta: np.ndarray

    def points(self, rows: np.ndarray, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """r_x, r_y (p, rows) in m of bodies that have turned by `turn` in rad."""
        cos, sin = np.cos(turn), np.sin(turn)
        r_x, r_y = self.r_x[:, rows], self.r_y[:, rows]
        if self.shape is None:
            return cos * r_x - sin * r_y, sin * r_x + cos * r_y
        then, now = (self.shape.contact_point(self.theta[rows] + angle).T[:, None] for angle in (0.0, turn))
        shift_x, shift_y = r_x - then[0], r_y - then[1]
        return now[0] + cos * shift_x - sin * shift_y, now[1] + sin * shift_x + cos * shift_y


@dataclass(frozen=True)
class _Pressed:
    """Shift (n, 3) in m, m, rad, velocity (n, 3) and time (n,) in s when no corner presses any more; by corner (p, n)
    the impulses per unit mass."""

    shift: np.ndarray
    v: np.ndarray
    elapsed: np.ndarray
    c_t: np.ndarray
    c_n: np.ndarray


def contact_points(rig: Rig) -> int:
    """Number of points of the body that may touch: its corners; one, the lowest, if it has none or too many."""
    if isinstance(rig.shape, Polygon) and len(rig.shape.corners) <= MOST_CORNERS:
        return len(rig.shape.corners)
    return 1


def one_point(rig: Rig, index: np.ndarray) -> Rig:
    """The rig with one contact point for each of n bodies, by its index (n,)."""
    if contact_points(rig) == 1:
        return rig
    return replace(rig, shape=Corner(rig.shape, index))  # pyright: ignore[reportArgumentType]


def press(model: Model, values: Mapping[str, float], rig: Rig, true: State) -> tuple[State, np.ndarray]:
    """True states (n,) after the corners have pressed, from true states at first touch, and the time (n,) in s.

    `values` are numbers, or arrays (n,) with one for each body.
    """
    corners, n = contact_points(rig), len(true.x)
    at_corners: dict[str, Any] = {
        name: np.tile(v, corners) if isinstance(v, np.ndarray) else v for name, v in values.items()
    }
    active = model.active(at_corners)
    at_corner = one_point(rig, np.repeat(np.arange(corners), n))
    smooth = None if isinstance(rig.shape, Polygon) and corners > 1 else rig.shape
    tiled = State(*(np.tile(getattr(true, item.name), corners) for item in fields(State)))
    seen, r_x, r_y, k_g = model.contact_at(tiled, active, at_corner)
    space = contact_space_of(seen, r_x, r_y, k_g)
    force = model.law.force or SPRING
    mu, epsilon, tau = (np.full(corners * n, at_corners[name]) for name in ("mu", "epsilon", "tau"))
    as_fitted = force.loss(epsilon)
    for effect, p in active:
        mu, epsilon = effect.coefficients(mu, epsilon, space, seen, p, rig)
        tau = effect.contact_time(tau, space, seen, p, rig)
    length = force.length(np.maximum(tau, SHORTEST), as_fitted)
    of_corners = (r_x, r_y, model.gap(tiled, at_corners, at_corner), mu, force.loss(epsilon), length)
    r, r_up, gap, friction, loss, unit = (a.reshape(corners, n) for a in of_corners)
    springs = _Springs(
        *(r, r_up, gap, friction, loss, unit),
        force=force,
        ratio=np.full(n, values.get(DAMPING_RATIO.name, DAMPING_RATIO.null)),
        w=np.full(corners * n, k_g**-2.0)[:n],
        gravity=rig.gravity,
        shape=smooth,
        theta=true.theta,
    )
    frame = seen.select(np.arange(n))
    central = force.duration(as_fitted[:n]) * unit.min(axis=0) / SPEED
    pressed = _integrate(springs, frame.v, central / STEPS)
    v = pressed.v + _added(active, rig, pressed, (seen, r_x, r_y), space, mu, epsilon, k_g)
    after = State.of(frame.q + pressed.shift, v, frame.trial, frame.t + pressed.elapsed)
    # the origin moves by its own mean velocity, where that is not the one that the contact sees
    origin, shift = after, pressed.shift
    for effect, p in reversed(model.active(values)):
        frame, origin = effect.from_contact(frame, p, rig), effect.from_contact(origin, p, rig)
    shift = shift + 0.5 * pressed.elapsed[:, None] * (frame.v - seen.v[:n] + origin.v - v)
    return State.of(true.q + shift, origin.v, true.trial, true.t + pressed.elapsed), pressed.elapsed


def _added(
    active: Sequence[tuple[Effect, Mapping]],
    rig: Rig,
    pressed: _Pressed,
    contact: tuple[State, np.ndarray, np.ndarray],
    space: ContactSpace,
    mu: np.ndarray,
    epsilon: np.ndarray,
    k_g: float,
) -> np.ndarray:
    """Change of velocity (n, 3) by what effects add to the impulse of each corner that has pressed."""
    seen, r_x, r_y = contact
    plain = Impulse(pressed.c_t.ravel(), pressed.c_n.ravel(), np.zeros_like(r_x))
    impulse = plain
    for effect, p in active:
        impulse = effect.impulse(impulse, space, mu, epsilon, (r_x, r_y), seen, p, rig)
    touched = (plain.c_n > 0.0) & (space.v_n < 0.0)
    d_t, d_n, couple = (
        np.where(touched, getattr(impulse, name) - getattr(plain, name), 0.0) for name in ("c_t", "c_n", "tau")
    )
    turn = (r_x * d_n - r_y * d_t + couple) / k_g**2
    return np.stack([a.reshape(pressed.c_t.shape).sum(axis=0) for a in (d_t, d_n, turn)], axis=1)


def _integrate(s: _Springs, v: np.ndarray, steps: np.ndarray) -> _Pressed:
    """Steps (n,) in s, half a drift, a kick and half a drift, from velocity v (n, 3) until all corners are free."""
    n, moving = len(v), np.arange(len(v))
    shift, elapsed = np.zeros((n, 3)), np.zeros(n)
    c_t, c_n, deepest = (np.zeros_like(s.gap) for _ in range(3))
    v = v.copy()
    for _ in range(LONGEST * STEPS):
        h, unit, mu, w = steps[moving], s.length[:, moving], s.mu[:, moving], s.w[moving]
        ratio = s.ratio[moving]
        half, speed = 0.5 * h[:, None], v[moving]
        at = shift[moving] + half * speed
        r_x, r_y = s.points(moving, at[:, 2])
        depth = -(s.gap[:, moving] + at[:, 1] + r_y - s.r_y[:, moving])
        rate = -(speed[:, 1] + r_x * speed[:, 2])
        most = np.maximum(deepest[:, moving], depth)
        deep, fast, loss = depth / unit, rate / SPEED, s.loss[:, moving]
        force, slope = s.force.push(deep, fast, most / unit, loss)
        if isinstance(s.force, ConvexDamper):
            slip = np.abs(speed[:, 0] - r_y * speed[:, 2]) / SPEED
            force = s.force.lifted(force, deep, fast, loss, slip, mu, ratio)
        # a damper acts at the velocity in the middle of the step
        kick = h * SPEED**2 / unit
        push = kick * force / (1.0 + 0.5 * kick * slope * (1.0 + r_x * r_x * w))
        speed[:, 1] += push.sum(axis=0) - h * s.gravity
        speed[:, 2] += w * (r_x * push).sum(axis=0)
        several = np.maximum((push > 0.0).sum(axis=0), 1)
        slip = speed[:, 0] - r_y * speed[:, 2]
        ends = 1.0 / ((1.0 + r_y * r_y * w) * several)
        if isinstance(s.force, ConvexDamper):
            slows = ratio * loss * h * SPEED / unit
            ends = ends * slows / (ends + slows)
        drag = np.clip(-slip * ends, -mu * push, mu * push)
        speed[:, 0] += drag.sum(axis=0)
        speed[:, 2] -= w * (r_y * drag).sum(axis=0)
        shift[moving], v[moving] = at + half * speed, speed
        elapsed[moving] += h
        c_t[:, moving] += drag
        c_n[:, moving] += push
        # a corner that has left the surface may press again
        deepest[:, moving] = np.where(depth <= 0.0, 0.0, most)
        moving = moving[(push > 0.0).any(axis=0) | (depth > 0.0).any(axis=0) & (elapsed[moving] < 2.0 * h)]
        if not len(moving):
            break
    return _Pressed(shift, v, elapsed, c_t, c_n)
