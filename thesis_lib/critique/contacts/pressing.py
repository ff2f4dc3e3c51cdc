"""Contacts of finite duration, integrated in time at all contact points of a body until all have separated.

Integration is used for contacts that overlap, and for all contacts of a compliant law.  Each contact point has Coulomb
friction and the normal force of the law or, if the law has none, a linear spring that returns the fraction ε² of its
work; L and v₀ are the units of `thesis_lib/contact/compliant/normal_force.py`.  The accelerations of flight also act in
contact.  Per unit mass, with x the depth over L,

    normal     f_n = f(x, x', x_m; D) v₀²/L,   D and L from ε and τ of a central contact
    friction   ends the slip within the step, at most μ f_n

Both forces of a convex contact follow from its program.
The lowest point of a smooth body moves over it as the body turns.  Effects act on the frame, on the contact points and
on (μ, ε) as in a single contact; shifts of a contact point turn with the body.  Contributions of effects to the impulse
of the law are added to the impulse of each corner, at its velocity at touch.  Six effects are integrated with the
motion: in the plane `tangential_compliance` is a spring along the surface, and with `soft_body` the force acts within
the chord where the surface cuts the body, higher for greater depth; in space the μ of `velocity_dependent_friction`
follows the slip, the ellipse of `anisotropic_friction` limits the friction of springs, and the couples of
`torsional_friction` and `contact_torque` act during the contact.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from thesis_lib.bodies.minkowski import SupportPoint
from thesis_lib.bodies.shapes import Corner, Ellipse, Polygon, Shape
from thesis_lib.contact.compliant import compiled_in_space
from thesis_lib.contact.compliant.compiled import SPEED, central_pressure, integrate
from thesis_lib.contact.compliant.normal_force import ConvexDamper, NormalForce, PressureField
from thesis_lib.contact.law import Law
from thesis_lib.critique.contacts.contact_time import EDGE_ANGLE, IMPEDANCE
from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.effects.anisotropic_friction import AnisotropicFriction
from thesis_lib.effects.contact_torque import ContactTorque
from thesis_lib.effects.effect import Effect, Impulse, Rig
from thesis_lib.effects.soft_body import SoftBody, lean
from thesis_lib.effects.tangential_compliance import TangentialCompliance
from thesis_lib.effects.torsional_friction import TorsionalFriction
from thesis_lib.effects.velocity_dependent_friction import VelocityDependentFriction
from thesis_lib.engines.parameters import PLANAR
from thesis_lib.mechanics.contact import Contact, velocity_change
from thesis_lib.mechanics.space import Space, about_normal, cross, rotation_matrix, rotation_vector
from thesis_lib.mechanics.state import State

MOST_CORNERS = 12  # a polygon with more corners approximates a smooth curve
STEPS = 64  # per central contact: the errors of 3 ms contacts are then a twentieth of the rig's noise
SHORTEST = 1e-6  # s; a camera cannot resolve it
INSTANT = 1e-6  # s, step of the difference quotient for the acceleration
SHALLOW = 1e-4  # m, depth at which a pressure field is compared with a spring
LONGEST = 4  # durations of a central contact; a body that presses longer rests
GAIN = 30.0  # ratio of speeds beyond physical contacts; reached if steps are too long for a trial value of the damping
CUT = 32  # further durations in space (a body turns over an edge, for example); after them it hits again
MIDDLE = 0.5  # of the overlap: where simulators apply the force of a convex contact
SPRING = NormalForce()  # for laws without a force


@dataclass(frozen=True)
class Pressed:
    """Change of pose (n, d + turns) in m and rad, motion (n, d + turns) and time (n,) in s when all corners have
    separated; impulses per unit mass (d, p, n) of each corner."""

    shift: np.ndarray
    v: np.ndarray
    elapsed: np.ndarray
    c: np.ndarray


@dataclass(frozen=True)
class Touching:
    """Input of the integration from first touch on: n bodies, each with p contact points.

    Attributes:
        dynamics: dynamics with one contact point for each of the p n `tiled` states.
        frame: (n,) states in the frame of the contact; `at` (p n,) is the contact of each point.
        points: (4, p, n) gap in m, μ, loss, and length in m (`normal_force`).
        falling: (n, d + turns) acceleration in flight.
        tau: (p n,) s.
        step, most: (n,) step in s, and the number of steps after which a contact ends.
    """

    dynamics: Dynamics
    tiled: State
    frame: State
    at: Contact
    points: np.ndarray
    falling: np.ndarray
    tau: np.ndarray
    step: np.ndarray
    most: np.ndarray

    @property
    def shape(self) -> Any:
        """Shape of the whole body."""
        shape = self.dynamics.rig.shape
        return shape.polygon if isinstance(shape, Corner) else shape.solid if isinstance(shape, SupportPoint) else shape

    @property
    def turning(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """In space: inertia per mass (3, 3, n), angular momentum and couple in addition to free motion (3, n)."""
        G = np.moveaxis(np.linalg.inv(np.moveaxis(self.at.mobility[:, :, : len(self.frame)], -1, 0)), 0, -1)
        momentum, couple = (np.einsum("ijn,jn->in", G, u) for u in (self.frame.spin, self.falling[:, 3:].T))
        return G, momentum, couple + cross(self.frame.spin, momentum)


def contact_points(rig: Rig) -> int:
    """Number of points of the body that may touch: its corners, or 1 (the lowest point) if it has none or too many."""
    if not rig.space.is_plane:
        points = rig.shape.minkowski.centres.shape[1]  # pyright: ignore[reportAttributeAccessIssue]
        return points if points <= MOST_CORNERS else 1
    if isinstance(rig.shape, Polygon) and len(rig.shape.corners) <= MOST_CORNERS:
        return len(rig.shape.corners)
    return 1


def one_point(rig: Rig, index: np.ndarray) -> Rig:
    """Rig with one contact point for each of n bodies, given by its index (n,)."""
    if contact_points(rig) == 1:
        return rig
    if not rig.space.is_plane:
        return replace(rig, shape=SupportPoint(rig.shape, index))
    return replace(rig, shape=Corner(rig.shape, index))  # pyright: ignore[reportArgumentType]


def all_points(rig: Rig, bodies: int) -> Rig:
    """Rig with the first contact point of all `bodies`, then the second of all, and so on."""
    points = contact_points(rig)
    if points == 1:
        return rig
    if not rig.space.is_plane:
        return one_point(rig, np.repeat(np.arange(points), bodies))
    return replace(rig, shape=Corner(rig.shape, bodies))  # pyright: ignore[reportArgumentType]


def integrates(law: Law, effect: Effect, space: Space) -> bool:
    """Whether the effect is part of the integrated motion; some laws have their own friction and point of action."""
    if not space.is_plane:
        if isinstance(effect, AnisotropicFriction):
            return not isinstance(law.force, ConvexDamper)
        return isinstance(effect, VelocityDependentFriction | TorsionalFriction | ContactTorque)
    return isinstance(effect, TangentialCompliance | SoftBody) and not isinstance(
        law.force, ConvexDamper | PressureField
    )


def press(
    dynamics: Dynamics,
    true: State,
    left: np.ndarray | float = 0.0,
    integrated: Callable[[Touching], Pressed] | None = None,
) -> tuple[State, np.ndarray]:
    """True states (n,) after all corners have separated, from true states at first touch, and the time (n,) in s.

    A contact ends at the latest `LONGEST` durations of a central contact after the time `left` (n,) in s; in space
    `left` adds at most `CUT` durations.  `integrated` replaces our own integration.
    """
    model, rig, space = dynamics.model, dynamics.rig, true.space
    force = model.law.force or SPRING
    is_field = isinstance(force, PressureField)
    corners, n = 1 if is_field else contact_points(rig), len(true)
    at_corners = dynamics.tiled(corners, n).on(rig if is_field else all_points(rig, n))
    tiled = true.tiled(corners)
    others = at_corners.with_active([(e, p) for e, p in at_corners.active if not integrates(model.law, e, space)])
    seen, at = others.contact(tiled)
    as_fitted = force.loss(np.full(corners * n, at_corners.values["epsilon"]))
    (mu, epsilon), tau = at_corners.on(rig).coefficients(seen, at), at_corners.on(rig).contact_time(seen, at)
    length = force.length(np.maximum(tau, SHORTEST), as_fitted)
    gap = np.maximum(at_corners.gap(tiled), 0.0)  # penetration here is noise, or a dent
    points = np.stack([gap, mu, force.loss(epsilon), length]).reshape(4, corners, n)
    frame = seen.select(np.arange(n))
    central = force.duration(as_fitted[:n]) * points[3].min(axis=0) / SPEED
    falling = _acceleration(dynamics, true)
    lasting = left / central if space.is_plane else np.minimum(left / central, CUT)
    steps = central / STEPS, np.ceil((LONGEST + lasting) * STEPS).astype(int)
    integrated = integrated or (_in_plane if space.is_plane else _in_space)
    pressed = integrated(Touching(at_corners, tiled, frame, at, points, falling, tau, *steps))
    added = _added(others.on(rig), pressed, seen, at.with_coefficients(mu, epsilon))
    v, shift = pressed.v + added, pressed.shift
    if not space.is_plane:  # visible at the precision of hits in space: it acts on average over half the contact
        shift = shift + 0.5 * pressed.elapsed[:, None] * added
    after = _moved(frame, shift, v, pressed.elapsed)
    if model.has_varying_flight:
        # the contact changes the velocity, and so the drag: use the mean of before and after
        behind = dynamics.from_contact(after)
        changed = 0.5 * pressed.elapsed[:, None] * (_acceleration(dynamics, behind) - falling)
        if not space.is_plane:
            changed[:, space.dimension :] = 0.0  # the integrated turn already includes the change of the spin
        v, shift = v + changed, shift + 0.5 * pressed.elapsed[:, None] * changed
        after = _moved(frame, shift, v, pressed.elapsed)
    # the origin moves with its own mean velocity if it differs from the velocity in the contact's frame
    frame, origin = dynamics.from_contact(frame), dynamics.from_contact(after)
    shift = shift + 0.5 * pressed.elapsed[:, None] * (frame.v - seen.v[:n] + origin.v - v)
    return _moved(true, shift, origin.v, pressed.elapsed), pressed.elapsed


def _moved(state: State, shift: np.ndarray, v: np.ndarray, elapsed: np.ndarray) -> State:
    """States `elapsed` (n,) in s later, with poses changed by `shift` and motions v, each (n, d + turns)."""
    pose = state.space.shift(state.pose, shift.T)
    return State(pose, v.T, state.trial, state.t + elapsed, state.surface, state.space)


def _in_plane(touching: Touching) -> Pressed:
    """Integrated motion of planar bodies."""
    at_corners, frame, at, points, tau = (
        getattr(touching, name) for name in ("dynamics", "frame", "at", "points", "tau")
    )
    law, n = at_corners.model.law, len(frame)
    corners, shape = points.shape[1], touching.shape
    force = law.force or SPRING
    is_field = isinstance(force, PressureField)
    ratio, regularisation = _of_friction(at_corners, n)
    spring, soft = (_parameters(at_corners, kind) for kind in (TangentialCompliance, SoftBody))
    eta, zeta = (np.full(corners * n, spring.get(name, 0.0))[:n] for name in ("eta", "zeta"))
    share, slopes = _chord(law, soft, tau[:n], at_corners.rig.shape, touching.tiled.theta)
    falling = np.ascontiguousarray(touching.falling)  # a fixed memory layout: a single kernel is compiled
    shift, v, elapsed, c_t, c_n = integrate(
        (force.kind, force.exponent, ratio, regularisation, _central_pressure(shape) if is_field else 1.0),
        np.concatenate([np.reshape(at.r, (2, corners, n)), points]),
        (np.full(corners * n, at.mobility)[:n], falling, np.ascontiguousarray(touching.tiled.theta[:n])),
        _outline(shape, corners),
        (eta, zeta),
        (share, slopes.reshape(corners, n)),
        np.ascontiguousarray(frame.v),
        touching.step,
        touching.most,
    )
    return Pressed(shift, v, elapsed, np.stack([c_t, c_n]))


def _in_space(touching: Touching) -> Pressed:
    """Integrated motion of bodies in space."""
    at_corners, frame, at, falling = touching.dynamics, touching.frame, touching.at, touching.falling
    force, n = at_corners.model.law.force or SPRING, len(frame)
    ratio, regularisation = _of_friction(at_corners, n)
    share = MIDDLE if isinstance(force, ConvexDamper) else 0.0
    kinds = (VelocityDependentFriction, TorsionalFriction, ContactTorque, AnisotropicFriction)
    resisted = {name: value for kind in kinds for name, value in _parameters(at_corners, kind).items()}
    nulls = {"s": 0.0, "v_s": 1.0, "m_t": 0.0, "m_r": 0.0, "a_c": 0.0, "a_s": 0.0}
    friction = np.stack([np.full(len(touching.tiled), resisted.get(name, null))[:n] for name, null in nulls.items()])
    W, spin, outline = at.mobility[:, :, :n], frame.spin, touching.shape.minkowski
    _, momentum, couple = touching.turning
    axes = rotation_matrix(frame.attitude)
    arrays = [at.r.reshape(3, -1, n), W, momentum, falling[:, :3].T, couple, axes, frame.velocity, spin]
    edges = np.full(len(touching.tiled), at_corners.values.get(EDGE_ANGLE.name, 0.0))[:n]
    if is_turned := bool(edges.any()):  # into the axes of a pyramid, and back below
        arrays = [about_normal(-edges, array) for array in arrays]
        arrays[1] = about_normal(-edges, arrays[1].swapaxes(0, 1))  # second index of a symmetric tensor
    r, W, momentum, a, couple, axes, velocity, spin = (np.ascontiguousarray(array) for array in arrays)
    shift, turn, velocity, spin, elapsed, c = compiled_in_space.integrate(
        (force.kind, force.exponent, ratio, regularisation, np.full(n, share)),
        r,
        touching.points,
        friction,
        (W, momentum, a, couple),
        (outline.squares, axes, outline.radius),
        velocity,
        spin,
        touching.step,
        touching.most,
    )
    turn = rotation_vector(turn)
    if is_turned:
        shift, turn, velocity, spin, c = (about_normal(edges, array) for array in (shift, turn, velocity, spin, c))
    k = at_corners.rig.k_g
    before = np.linalg.norm(np.concatenate([frame.velocity, k * frame.spin]), axis=0)
    after = np.linalg.norm(np.concatenate([velocity, k * spin]), axis=0)
    lost = ~(after <= GAIN * np.maximum(before, 1.0))
    if lost.any():  # NaN or absurd values: such a body stops where it touched
        shift[:, lost], velocity[:, lost], spin[:, lost], c[:, :, lost] = 0.0, 0.0, 0.0, 0.0
        turn[:, lost] = 0.0
    return Pressed(np.concatenate([shift, turn]).T, np.concatenate([velocity, spin]).T, elapsed, c)


def _acceleration(dynamics: Dynamics, true: State) -> np.ndarray:
    """Acceleration in flight (n, d + turns) in m/s² and rad/s², in the frame of the contact, of true states."""
    a = dynamics.true_acceleration(true)
    if not dynamics.model.has_varying_flight:
        return a
    now, later = dynamics.to_contact(true), dynamics.to_contact(true.flown(a, INSTANT))
    return (later.v - now.v) / INSTANT


def _of_friction(dynamics: Dynamics, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Damping ratio or stiction tolerance, and R m of a convex contact, (n,) each; 0 for laws without them."""
    # with several points per body, the first n entries cover all bodies
    own = {
        p.name: np.array(np.broadcast_to(np.ravel(dynamics.values.get(p.name, p.null))[:n], n))
        for p in dynamics.model.of_friction
    }
    first, impedance = next(iter(own.values()), np.zeros(n)), own.get(IMPEDANCE.name, np.ones(n))
    return first, (PLANAR if dynamics.rig.space.is_plane else 1.0) * (1.0 - impedance) / impedance


def _central_pressure(shape: Shape) -> float:
    """`central_pressure` of a body on its flattest point, or on the corner farthest from its centre."""
    _, axes, corners = _outline(shape, 1)
    if not len(corners):
        return central_pressure(axes, corners, 0.0 if axes[0] >= axes[1] else 0.5 * np.pi, SHALLOW)
    x, y = corners[np.hypot(*corners.T).argmax()]
    return central_pressure(axes, corners, -0.5 * np.pi - np.arctan2(y, x), SHALLOW)


def _parameters(dynamics: Dynamics, kind: type[Effect]) -> Mapping:
    """Parameters of the effect of the given kind if it is integrated; otherwise empty."""
    law, space = dynamics.model.law, dynamics.rig.space
    return next((p for effect, p in dynamics.active if isinstance(effect, kind) and integrates(law, effect, space)), {})


def _chord(
    law: Law, soft: Mapping, tau: np.ndarray, shape: Shape | Corner, theta: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fraction (n,) of the depth that is in the body, and relative shift (p n,) of the force along the surface."""
    if isinstance(law.force, ConvexDamper):
        return np.full(len(tau), MIDDLE), np.zeros(len(theta))
    if not soft:
        return np.zeros(len(tau)), np.zeros(len(theta))
    # with a linear spring the mean depth is half the penetration of the arc
    lam = np.full(len(theta), soft["lam"])[: len(tau)]
    return 2.0 * lam / np.maximum(tau, SHORTEST), lean(shape, theta)


def _added(dynamics: Dynamics, pressed: Pressed, seen: State, at: Contact) -> np.ndarray:
    """Change of motion (n, d + turns) due to the contributions of effects to the impulse of each corner."""
    if not dynamics.model.acting("impulse"):
        return np.zeros_like(pressed.v)
    c = pressed.c.reshape(len(pressed.c), -1)
    plain = Impulse(c, np.zeros_like(c if at.dimension == 3 else c[0]))
    impulse = plain
    for effect, p in dynamics.active:
        impulse = effect.impulse(impulse, at, seen, p, dynamics.rig)
    touched = (plain.c_n > 0.0) & (at.v_n < 0.0)
    added = tuple(np.where(touched, now - before, 0.0) for now, before in zip(impulse.c, plain.c))
    couple = np.where(touched, impulse.couple - plain.couple, 0.0)
    change = velocity_change(added, at.r, at.mobility, couple=couple)
    return change.reshape(-1, *pressed.c.shape[1:]).sum(axis=1).T


def _outline(shape: Shape, corners: int) -> tuple[bool, np.ndarray, np.ndarray]:
    """Whether the lowest point moves over the body as it turns; squared semi-axes (2,) in m², or vertices (k, 2)
    in m."""
    none = np.zeros((0, 2))
    if isinstance(shape, Polygon):
        return corners == 1, np.zeros(2), shape.corners if corners == 1 else none
    axes = shape.semi_axes if isinstance(shape, Ellipse) else (shape.radius, shape.radius)
    return True, np.square(axes), none
