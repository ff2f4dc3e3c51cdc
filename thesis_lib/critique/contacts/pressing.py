"""Contacts integrated in time: forces at all contact points of a body, from touch until none presses any more.

They resolve contacts that overlap, and all contacts of a compliant law.  Each contact point has the normal force of the
law, or a linear spring that returns the share ε² of its work where the law has none, and Coulomb friction; L and v₀ are
the units of `thesis_lib/contact/compliant/normal_force.py`.  What accelerates the body in flight does so in contact,
too.  Per unit mass, with x the depth over L,

    normal     f_n = f(x, x', x_m; D) v₀²/L,   D and L from ε and τ of a central contact
    friction   what ends the slip within the step, at most μ f_n

Both forces of a convex contact follow from its program.
The lowest point of a smooth body moves over it as the body turns.  Effects act on the frame, on the contact points and
on (μ, ε) as in a single contact; shifts of a contact point turn with the body.  What they add to the impulse of
the law is added to the impulse of each corner, at the velocity with which it touched; but `tangential_compliance` is a
spring along the surface, integrated with the rest, and under `soft_body` the force acts in the chord that the surface
cuts off, the higher the deeper the body sinks in.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from thesis_lib.bodies.shapes import Corner, Ellipse, Polygon, Shape
from thesis_lib.contact.compliant.compiled import SPEED, central_pressure, integrate
from thesis_lib.contact.compliant.normal_force import ConvexDamper, NormalForce, PressureField
from thesis_lib.contact.law import Law
from thesis_lib.critique.contacts.contact_time import IMPEDANCE
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.effects.effect import Effect, Impulse, Rig
from thesis_lib.effects.soft_body import SoftBody, lean
from thesis_lib.effects.tangential_compliance import TangentialCompliance
from thesis_lib.engines.parameters import PLANAR
from thesis_lib.mechanics.contact import Contact, velocity_change
from thesis_lib.mechanics.state import State

MOST_CORNERS = 12  # a polygon with more is a curve drawn with corners
STEPS = 64  # in one central contact: errors of contacts of 3 ms are then a twentieth of a rig's noise
SHORTEST = 1e-6  # s; no camera tells it from an instant
INSTANT = 1e-6  # s, for the acceleration as a difference quotient
SHALLOW = 1e-4  # m, depth at which a pressure field is compared with a spring
LONGEST = 4  # central contacts; a body that presses longer rests
MIDDLE = 0.5  # of the overlap: there simulators put the force of a convex contact
SPRING = NormalForce()  # of laws without a force


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


def all_points(rig: Rig, bodies: int) -> Rig:
    """The rig with the first contact point of all `bodies`, then the second of all, and so on."""
    if contact_points(rig) == 1:
        return rig
    return replace(rig, shape=Corner.each(rig.shape, bodies))  # pyright: ignore[reportArgumentType]


def integrates(law: Law, effect: Effect) -> bool:
    """Whether the effect is part of the integrated motion; others have friction and place of their own."""
    return isinstance(effect, TangentialCompliance | SoftBody) and not isinstance(
        law.force, ConvexDamper | PressureField
    )


def press(dynamics: Dynamics, true: State, left: np.ndarray | float = 0.0) -> tuple[State, np.ndarray]:
    """True states (n,) after the corners have pressed, from true states at first touch, and the time (n,) in s.

    A contact that is not over `LONGEST` central ones after the time `left` (n,) in s ends there.
    """
    model, rig = dynamics.model, dynamics.rig
    force = model.law.force or SPRING
    is_field = isinstance(force, PressureField)
    corners, n = 1 if is_field else contact_points(rig), len(true.x)
    at_corners = dynamics.tiled(corners, n).on(rig if is_field else all_points(rig, n))
    tiled = true.tiled(corners)
    others = at_corners.with_active([(e, p) for e, p in at_corners.active if not integrates(model.law, e)])
    seen, at = others.contact(tiled)
    as_fitted = force.loss(np.full(corners * n, at_corners.values["epsilon"]))
    (mu, epsilon), tau = at_corners.on(rig).coefficients(seen, at), at_corners.on(rig).contact_time(seen, at)
    length = force.length(np.maximum(tau, SHORTEST), as_fitted)
    gap = np.maximum(at_corners.gap(tiled), 0.0)  # what is below is noise, or a dent
    points = np.stack([*at.r, gap, mu, force.loss(epsilon), length])
    points = points.reshape(6, corners, n)
    frame = seen.select(np.arange(n))
    central = force.duration(as_fitted[:n]) * points[5].min(axis=0) / SPEED
    ratio, regularisation = _of_friction(dynamics, n)
    spring, soft = (_parameters(at_corners, kind) for kind in (TangentialCompliance, SoftBody))
    eta, zeta = (np.full(corners * n, spring.get(name, 0.0))[:n] for name in ("eta", "zeta"))
    share, slopes = _chord(model.law, soft, tau[:n], at_corners.rig.shape, tiled.theta)
    falling = _acceleration(dynamics, true)
    pressed = _Pressed(
        *integrate(
            (force.kind, force.exponent, ratio, regularisation, _central_pressure(rig.shape) if is_field else 1.0),
            points,
            (np.full(corners * n, at.mobility)[:n], falling, np.ascontiguousarray(true.theta)),
            _outline(rig.shape, corners),
            (eta, zeta),
            (share, slopes.reshape(corners, n)),
            np.ascontiguousarray(frame.v),
            central / STEPS,
            np.ceil((LONGEST + left / central) * STEPS).astype(int),
        )
    )
    v, shift = pressed.v + _added(others.on(rig), pressed, seen, at.with_coefficients(mu, epsilon)), pressed.shift
    after = State.of(frame.q + shift, v, frame.trial, frame.t + pressed.elapsed, frame.surface)
    if model.has_varying_flight:
        # the contact turns the velocity, and with it what slows the flight: the mean of before and after
        behind = dynamics.from_contact(after)
        changed = 0.5 * pressed.elapsed[:, None] * (_acceleration(dynamics, behind) - falling)
        v, shift = v + changed, shift + 0.5 * pressed.elapsed[:, None] * changed
        after = State.of(frame.q + shift, v, frame.trial, after.t, frame.surface)
    # the origin moves by its own mean velocity, where that is not the one that the contact sees
    frame, origin = dynamics.from_contact(frame), dynamics.from_contact(after)
    shift = shift + 0.5 * pressed.elapsed[:, None] * (frame.v - seen.v[:n] + origin.v - v)
    return State.of(true.q + shift, origin.v, true.trial, true.t + pressed.elapsed, true.surface), pressed.elapsed


def _acceleration(dynamics: Dynamics, true: State) -> np.ndarray:
    """Acceleration in flight (n, 3) in m/s² and rad/s² of the frame that the contact sees, in true states."""
    a = dynamics.true_acceleration(true)
    if not dynamics.model.has_varying_flight:
        return a
    now, later = dynamics.to_contact(true), dynamics.to_contact(true.flown(a, INSTANT))
    return (later.v - now.v) / INSTANT


def _of_friction(dynamics: Dynamics, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Damping ratio or stiction tolerance, and R m of a convex contact, (n,); 0 of a law without."""
    own = {p.name: np.full(n, dynamics.values.get(p.name, p.null)) for p in dynamics.model.of_friction}
    first, impedance = next(iter(own.values()), np.zeros(n)), own.get(IMPEDANCE.name, np.ones(n))
    return first, PLANAR * (1.0 - impedance) / impedance


def _central_pressure(shape: Shape) -> float:
    """`central_pressure` of a body on its flattest point, or on the corner furthest from its centre."""
    _, axes, corners = _outline(shape, 1)
    if not len(corners):
        return central_pressure(axes, corners, 0.0 if axes[0] >= axes[1] else 0.5 * np.pi, SHALLOW)
    x, y = corners[np.hypot(*corners.T).argmax()]
    return central_pressure(axes, corners, -0.5 * np.pi - np.arctan2(y, x), SHALLOW)


def _parameters(dynamics: Dynamics, kind: type[Effect]) -> Mapping:
    """The parameters of the effect of that kind, if it is integrated; none otherwise."""
    law = dynamics.model.law
    return next((p for effect, p in dynamics.active if isinstance(effect, kind) and integrates(law, effect)), {})


def _chord(
    law: Law, soft: Mapping, tau: np.ndarray, shape: Shape | Corner, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Share (n,) of the depth that is in the body, and by how much further along the surface the force acts (p n,)."""
    if isinstance(law.force, ConvexDamper):
        return np.full(len(tau), MIDDLE), np.zeros(len(theta))
    if not soft:
        return np.zeros(len(tau)), np.zeros(len(theta))
    # under a linear spring the mean depth is half of what the arc sinks in
    lam = np.full(len(theta), soft["lam"])[: len(tau)]
    return 2.0 * lam / np.maximum(tau, SHORTEST), lean(shape, theta)


def _added(dynamics: Dynamics, pressed: _Pressed, seen: State, at: Contact) -> np.ndarray:
    """Change of velocity (n, 3) by what effects add to the impulse of each corner that has pressed."""
    plain = Impulse.planar(pressed.c_t.ravel(), pressed.c_n.ravel(), np.zeros(len(seen)))
    impulse = plain
    for effect, p in dynamics.active:
        impulse = effect.impulse(impulse, at, seen, p, dynamics.rig)
    touched = (plain.c_n > 0.0) & (at.v_n < 0.0)
    d_t, d_n, couple = (
        np.where(touched, getattr(impulse, name) - getattr(plain, name), 0.0) for name in ("c_t", "c_n", "couple")
    )
    change = velocity_change((d_t, d_n), at.r, at.mobility, couple=couple)
    return change.reshape(3, *pressed.c_t.shape).sum(axis=1).T


def _outline(shape: Shape, corners: int) -> tuple[bool, np.ndarray, np.ndarray]:
    """Whether the lowest point moves over the body as it turns; squares (2,) of its semi-axes in m², or its vertices
    (k, 2) in m."""
    none = np.zeros((0, 2))
    if isinstance(shape, Polygon):
        return corners == 1, np.zeros(2), shape.corners if corners == 1 else none
    axes = shape.semi_axes if isinstance(shape, Ellipse) else (shape.radius, shape.radius)
    return True, np.square(axes), none
