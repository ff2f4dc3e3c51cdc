"""Application of a model at given parameter values to states: contacts and flights.

An impact is computed in the following steps; `thesis_lib/effects/effect.py` defines the hooks of effects in each step.

| step         | from, to                            | method         | hooks of effects                         |
|--------------|-------------------------------------|----------------|------------------------------------------|
| to_true      | measured state, true state          | `to_true`      | `to_true`                                |
| to_contact   | true state, state in contact frame  | `contact`      | `to_contact`, `contact_point`, `inertia` |
| coefficients | μ, ε of the law, of each impact     | `coefficients` | `coefficients`                           |
| law          | contact, μ and ε, impulse           | `Law.impulse`  |                                          |
| impulse      | law's impulse, impulse and couple   | `_struck`      | `impulse`                                |
| time         | touch, pose at the impulse          | `_delay`       | `contact_time`                           |
| from_contact | state in contact frame, true state  | `from_contact` | `from_contact`                           |
| to_measured  | true state, measured state          | `to_measured`  | `to_measured`                            |

`thesis_lib/critique/likelihood/at_impact.py` connects flights to the first and the last step;
`thesis_lib/critique/contacts/kinds.py` defines the kinds of contact, of which an impulse is one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.polynomial.legendre import leggauss, legint, legval, legvander

from thesis_lib.contact.compliant.normal_force import NormalForce
from thesis_lib.contact.compliant.watched_slide import on_ellipse
from thesis_lib.critique.contacts.contact_time import EDGE_ANGLE, TURNED, normal_mobility
from thesis_lib.critique.contacts.model import Model
from thesis_lib.effects.effect import Effect, Impulse, Rig
from thesis_lib.mechanics.contact import Contact, contact, velocity_change
from thesis_lib.mechanics.free_motion import attitudes
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import about_normal
from thesis_lib.mechanics.state import State

_H = 1e-3  # s, step for the derivative of a linear map: exact for any step
_H_PATH = 0.02  # s, step for the change of the acceleration over a tenth of a second
_H_BENT = 1e-4  # s, step for a map that distorts parabolas: error 1e-6 of ω² at 30 rad/s
_AROUND = np.array([-1e-4, 0.0, 1e-4])  # s, for the velocity along an arc: equally accurate
EQUAL = 1e-6  # relative difference of moments of inertia that count as equal
COURSE = leggauss(12)[0]  # times at which a flight of half-length 1 is evaluated
_ROUNDS = 6  # iterations for a flight, the first with gravity alone: off by 5e-4 rad at 19 rad/s, drag 0.5/s, 0.15 s
_ONCE, _TWICE = (  # integrals from the middle, of polynomials given at `COURSE`
    legval(COURSE, legint(np.eye(len(COURSE)), m, lbnd=0)).T @ np.linalg.inv(legvander(COURSE, len(COURSE) - 1))
    for m in (1, 2)
)


class Dynamics:
    """A model at given values, on a rig; base class of all kinds of contact (`kinds.bind` selects one).

    `values` are numbers by full parameter name, or arrays (n,) with one entry per body.  `active` are the effects in
    the order in which they act, each with the parameters of its hooks.  States are true unless called `measured`.
    `integrated`: whether single hits are integrated in time; the pose after them is then also predicted.
    """

    integrated = False

    def __init__(self, model: Model, values: Mapping[str, Any], rig: Rig) -> None:
        self.model, self.values, self.rig = model, values, rig
        self.active = [(effect, {p: values[name] for p, name in names.items()}) for effect, names in model.hooks]

    def select(self, rows: np.ndarray) -> Self:
        """Dynamics of the bodies at `rows`."""
        if not any(isinstance(value, np.ndarray) for value in self.values.values()):
            return self
        of_rows = {name: v[rows] if isinstance(v, np.ndarray) else v for name, v in self.values.items()}
        return type(self)(self.model, of_rows, self.rig)

    def tiled(self, copies: int, n: int) -> Self:
        """Dynamics of n bodies, repeated `copies` times one after the other."""
        return self.select(np.tile(np.arange(n), copies))

    def on(self, rig: Rig) -> Self:
        """The same dynamics on another rig."""
        return self._with(rig=rig)

    def with_active(self, active: Sequence[tuple[Effect, dict[str, Any]]]) -> Self:
        """The same dynamics with the given effects only."""
        return self._with(active=list(active))

    def _with(self, **changes: Any) -> Self:
        """A copy with some attributes replaced; `copy.copy` took a twentieth of the time of an episode."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, **changes)
        other.__dict__.pop("flying", None)
        return other

    def press(self, true: State, left: np.ndarray | float = 0.0) -> tuple[State, np.ndarray]:
        """States (n,) after all contact points have separated, from states at first touch, and the time (n,) in s.

        A contact that lasts too long ends after the time `left` (n,) in s.
        """
        raise NotImplementedError

    # the steps --------------------------------------------------------------------------------------------------
    def to_true(self, measured: State) -> State:
        """True state for a measured state."""
        for effect, p in reversed(self.active):
            measured = effect.to_true(measured, p, self.rig)
        return measured

    def to_measured(self, true: State) -> State:
        """State that the camera reports for a true state."""
        for effect, p in self.active:
            true = effect.to_measured(true, p, self.rig)
        return true

    def to_contact(self, true: State) -> State:
        """State in the frame of the contact."""
        for effect, p in self.active:
            true = effect.to_contact(true, p, self.rig)
        return true

    def from_contact(self, seen: State) -> State:
        """The inverse of `to_contact`."""
        for effect, p in reversed(self.active):
            seen = effect.from_contact(seen, p, self.rig)
        return seen

    def contact(
        self, true: State, offset: np.ndarray | None = None, turned: np.ndarray | None = None
    ) -> tuple[State, Contact]:
        """State in the frame of the contact, and contact, per unit mass, of the true body.

        `offset` (d, n) in m is added to the contact point of the shape; `turned` (turns, n) in rad is the turn of the
        body in addition to the pose.
        """
        rig, pose = self.rig, true
        if turned is not None:
            pose = true.changed(attitude=true.space.attitude_after(true.attitude, turned))
        r, G = rig.lowest(pose), rig.G
        if offset is not None:
            r = r + offset
        seen = self.to_contact(pose)
        for effect, p in self.active:
            r, G = effect.contact_point(r, seen, p, rig), effect.inertia(G, p)
        at = contact(seen, r, mobility(seen.space, G, seen.attitude))
        if turned is not None:
            seen = seen.changed(attitude=seen.space.attitude_after(seen.attitude, -turned))
        return seen, at

    def measured_contact(self, measured: State, offset: np.ndarray | None = None) -> tuple[State, Contact]:
        """As `contact`, from a measured state; `offset` (n, d), one row per body, refers to the measured pose."""
        true = self.to_true(measured)
        return self.contact(true, self._true_offset(measured, true, offset))

    def approaches(self, true: State) -> np.ndarray:
        """Mask (n,) of bodies whose contact point approaches the surface in the frame of the contact: v_n < 0."""
        return self.contact(true)[1].v_n < 0.0

    def coefficients(self, seen: State, at: Contact) -> tuple[np.ndarray, np.ndarray]:
        """μ and ε (n,) of each impact, from the result of `contact`."""
        mu, epsilon = (np.full(len(seen), self.values[name]) for name in ("mu", "epsilon"))
        for effect, p in self.active:
            mu, epsilon = effect.coefficients(mu, epsilon, at, seen, p, self.rig)
        return mu, epsilon

    def contact_time(self, seen: State, at: Contact) -> np.ndarray:
        """τ (n,) in s of each impact, from the result of `contact`."""
        tau = np.full(len(seen), self.values["tau"])
        for effect, p in self.active:
            tau = effect.contact_time(tau, at, seen, p, self.rig)
        return tau

    def predict(self, measured: State, offset: np.ndarray | None = None) -> State:
        """Measured state after impact, from the measured state before it; `offset` as in `measured_contact`."""
        return self.strike(measured, offset)[0]

    def strike(self, measured: State, offset: np.ndarray | None = None) -> tuple[State, np.ndarray]:
        """Result of `predict`, and the depth t̄ |v_n| (n,) in m of the contact point where the arcs meet."""
        true = self.to_true(measured)
        after, depth = self.collide(true, self._true_offset(measured, true, offset))
        return self.to_measured(after), depth

    def collide(self, true: State, offset: np.ndarray | None = None) -> tuple[State, np.ndarray]:
        """As `strike`, for true states before and after; `offset` as in `contact`."""
        seen, at = self.contact(true, offset)
        after, depth = self._struck(seen, at), np.zeros(len(true))
        if self.model.takes_time:
            delay = self._delay(seen, at, after)
            rig, earlier = self.rig, true.flown(self.rig.fall(true).T, -delay)
            depth = np.where(at.v_n < 0.0, rig.gap(earlier) - rig.gap(true), 0.0)
            seen, at = self.contact(true, offset, TURNED * delay * (after.spin - seen.spin))
            after = self._struck(seen, at)
        return self.from_contact(after), depth

    def delay(self, true: State) -> np.ndarray:
        """t̄ (n,) in s of contacts that begin in the given states; 0 if contacts are instantaneous."""
        if not self.model.takes_time:
            return np.zeros(len(true))
        seen, at = self.contact(true)
        return self._delay(seen, at, self._struck(seen, at))

    def _true_offset(self, measured: State, true: State, offset: np.ndarray | None) -> np.ndarray | None:
        """Offset (d, n) at the true pose, from the offset (n, d) at the measured pose; None if there is none."""
        if offset is None or not offset.any():
            return None
        if not self.rig.space.is_plane:
            return offset.T
        # the offset refers to the measured angle: mirroring the angle mirrors the offset
        further = self.to_true(measured.moved(theta=measured.theta + _H))
        return np.stack([offset[:, 0] * np.sign(further.theta - true.theta), offset[:, 1]])

    def _delay(self, seen: State, at: Contact, after: State) -> np.ndarray:
        """t̄ (n,) in s of each impact, from the result of `contact` and the state after the impulse."""
        tau, law = self.contact_time(seen, at), self.model.law
        push = after.velocity[-1] - seen.velocity[-1]
        rebound = after.space.velocity_at(after.velocity, after.spin, at.r)[-1]
        b = normal_mobility(push, rebound - at.v_n)
        if law.force is not None:
            tau = law.force.tau_at(tau, np.full_like(tau, self.values["epsilon"]), b, at.v_n)
        return tau / np.sqrt(b)

    def _struck(self, seen: State, at: Contact) -> State:
        """State after the impulse in the frame of the contact, from the result of `contact`."""
        mu, epsilon = self.coefficients(seen, at)
        at = at.with_coefficients(mu, epsilon)
        with np.errstate(all="ignore"):
            none = np.zeros_like(seen.spin if at.dimension == 3 else mu)
            impulse = Impulse(self.model.law.impulse(at, mu, epsilon), none)
            for effect, p in self.active:
                impulse = effect.impulse(impulse, at, seen, p, self.rig)
        touches = at.v_n < 0.0
        c = tuple(np.where(touches, part, 0.0) for part in impulse.c)
        couple = np.where(touches, impulse.couple, 0.0)
        return seen.with_motion(seen.motion + velocity_change(c, at.r, at.mobility, couple=couple))

    # where bodies are at an impact ------------------------------------------------------------------------------
    def gap(self, true: State) -> np.ndarray:
        """Gap (n,) in m between true body and surface: gap of the believed shape minus the part due to effects."""
        taken = np.zeros(len(true))
        for effect, p in self.active:
            taken = effect.gap(taken, true, p, self.rig)
        return self.rig.gap(true) - taken

    def jump(self, before: State, after: State) -> np.ndarray:
        """Predicted measured pose after impact minus before (n, 3), in m, m, rad, from measured states."""
        if not before.space.is_plane and self.model.acting("meet"):  # the true pose is continuous
            true = self.to_true(after).with_pose(self.to_true(before).pose)
            return before.space.difference(self.to_measured(true).pose, before.pose).T
        jump = np.zeros(before.motion.shape)
        for effect, p in self.active:
            jump = effect.meet(jump, before, after, p)
        return jump.T

    # flight -----------------------------------------------------------------------------------------------------
    def acceleration(self, measured: State) -> np.ndarray:
        """Measured acceleration in flight (n, 3), m/s² and rad/s²."""
        if self.model.camera_is_exact:
            return self.true_acceleration(measured)
        true = self.to_true(measured)
        a = self.true_acceleration(true)
        if self.model.camera_bends:
            near = [self.to_measured(true.flown(a, h)).v for h in (-_H_BENT, _H_BENT)]
            return (near[1] - near[0]) / (2.0 * _H_BENT)
        # the camera's map is linear in the velocity: a difference quotient is exact
        later = true.with_velocity(true.v + _H * a)
        return (self.to_measured(later).v - self.to_measured(true).v) / _H

    @cached_property
    def flying(self) -> Rig:
        """Rig with the true inertia, with which bodies turn in flight."""
        if self.rig.tensor is None or not self.model.acting("inertia"):
            return self.rig
        G = self.rig.G
        for effect, p in self.active:
            G = effect.inertia(G, p)
        return replace(self.rig, tensor=np.asarray(G))

    @cached_property
    def turns_otherwise(self) -> bool:
        """Whether a body appears to turn differently than believed; with three equal moments all bodies turn evenly."""
        model = self.model
        if not model.turns_otherwise or (model.camera_bends and not model.spins_evenly):
            return model.turns_otherwise
        G = np.asarray(self.flying.tensor).reshape(3, 3, -1)
        return bool(np.abs(G - G[0, 0] * np.eye(3)[:, :, None]).max() > EQUAL * G[0, 0].max())

    def true_acceleration(self, true: State) -> np.ndarray:
        """Acceleration in flight (n, d + turns), m/s² and rad/s²."""
        rig = self.flying
        a = rig.fall(true)
        for effect, p in self.active:
            a = effect.acceleration(a, true, p, rig)
        return a.T

    def course(self, true: State, half: np.ndarray) -> State:
        """States (n 12,) at the times `COURSE` · `half` (n,) in s around true states in space, body by body.

        Accelerations in addition to free rotation are integrated along the path of the previous iteration; the
        additional turn δ obeys δ' = Rᵀ δω in body axes.
        """
        n, d, k = len(true), true.space.dimension, len(COURSE)
        rows = np.repeat(np.arange(n), k)
        each, tau, h = self.select(rows), np.multiply.outer(half, COURSE).ravel(), np.repeat(half, k)
        turns = attitudes(true.attitude, true.spin, np.asarray(self.flying.tensor), tau.reshape(n, k).T)
        attitude, spin = (np.swapaxes(part, 1, 2).reshape(len(part), -1) for part in turns)
        free = true.select(rows).changed(attitude=attitude, spin=spin)
        free = State(free.pose, free.motion, free.trial, free.t + tau, free.surface, free.space)
        at, fall = free, each.flying.fall(free)

        def integrated(f: np.ndarray, by: np.ndarray) -> np.ndarray:
            return (f.reshape(-1, n, k) @ by.T).reshape(-1, n * k)

        for i in range(_ROUNDS if self.model.has_varying_flight else 1):
            a = each.true_acceleration(at).T if i else fall
            faster = h * integrated(a[d:] - fall[d:], _ONCE)
            turned = h * integrated(true.space.turned_back(attitude, faster), _ONCE)
            at = free.changed(
                position=free.position + tau * free.velocity + h * h * integrated(a[:d], _TWICE),
                attitude=true.space.attitude_after(attitude, true.space.turned(attitude, turned)),
                velocity=free.velocity + h * integrated(a[:d], _ONCE),
                spin=spin + faster,
            )
        return at

    def sliding(self, true: State, span: np.ndarray | float = 0.0) -> np.ndarray:
        """Acceleration along the surface, (n,) in m/s² ((2, n) in space), of bodies that slide for `span` in s."""
        seen, at = self.contact(true)
        mu, _ = self.coefficients(seen, at)
        for effect, p in self.active:
            mu = effect.sliding(mu, at, seen, p, self.rig)
        if true.space.is_plane:
            a_t, a_n = self.true_acceleration(true)[:, :2].T
            return a_t - mu * np.maximum(-a_n, 0.0) * np.sign(at.v_t)
        *along, a_n = self.true_acceleration(true)[:, :3].T
        limit, slip, pull = mu * np.maximum(-a_n, 0.0), np.stack(at.v[:2]), np.stack(along)
        if limit.ndim > 1:
            return on_ellipse(slip, limit, pull, span)
        edges = self.values.get(EDGE_ANGLE.name, 0.0)
        slip, pull = (about_normal(-edges, along) for along in (slip, pull))
        return about_normal(edges, (self.model.law.force or NormalForce()).sliding(slip, limit, pull, span))

    def flown(self, true: State, h: np.ndarray) -> State:
        """States after times h (n,) in s of flight."""
        if true.space.is_plane:
            return true.flown(self.middle_acceleration(true, h), h)
        if not self.model.has_varying_flight:
            return self.along(true, h[None])
        middle = self.along(true, 0.5 * h[None], self.true_acceleration(true))
        a = self.true_acceleration(middle) + (self.flying.fall(true) - self.flying.fall(middle)).T
        return self.along(true, h[None], a)

    def middle_acceleration(self, true: State, h: np.ndarray) -> np.ndarray:
        """Acceleration (n, 3), m/s² and rad/s², in the middle of flights of h (n,) in s."""
        a = self.rig.fall(true).T if self.model.spins_evenly else self.true_acceleration(true)
        return self.true_acceleration(true.flown(a, 0.5 * h)) if self.model.has_varying_flight else a

    def stepped(self, true: State, h: np.ndarray, steps: int) -> State:
        """States after 0, 1, 2, ... `steps` flights of h (n,) in s each, as in `flown`, one set after the other."""
        if not self.model.spins_evenly:
            path = [true]
            for _ in range(steps):
                path.append(self.flown(path[-1], h))
            return State.joined(path)

        def summed(first: np.ndarray, changes: np.ndarray) -> np.ndarray:
            return np.cumsum(np.concatenate([first[:, None], changes], axis=1), axis=1)

        each, d = np.arange(steps + 1), true.space.dimension
        end = true.tiled(steps + 1)
        if true.space.is_plane:
            turns = np.repeat((h * true.spin)[:, None], steps, axis=1)
            middle = summed(true.attitude, turns)[:, :-1] + 0.5 * h * true.spin[:, None]
            turned = true.tiled(steps).changed(attitude=middle.reshape(1, -1))
        else:
            turned = self.along(true, np.multiply.outer(each[1:] - 0.5, h))
            end = self.along(true, np.multiply.outer(each, h))
        a = self.tiled(steps, len(true)).true_acceleration(turned).T.reshape(-1, steps, len(true))
        m = true.space.motions if true.space.is_plane else d  # in space `along` gives the turns
        motion = summed(true.motion[:m], h * a[:m])
        pose = summed(true.pose[:m], h * motion[:, :-1] + 0.5 * h * h * a[:m])
        t = true.tiled(steps + 1).t + np.multiply.outer(each, h).ravel()
        pose, motion = (
            np.concatenate([new.reshape(m, -1), old[m:]]) for new, old in ((pose, end.pose), (motion, end.motion))
        )
        return State(pose, motion, end.trial, t, end.surface, end.space)

    def arc(self, tau: np.ndarray, true: State) -> np.ndarray | None:
        """Deviation (n, W, 3) of true flight paths from parabolas at times τ (n, W) in s; None without such effects."""
        parts = [part for effect, p in self.active if (part := effect.arc(tau, true, p, self.flying)) is not None]
        return np.moveaxis(sum(parts[1:], parts[0]), 0, -1) if parts else None

    def path(self, tau: np.ndarray, measured: State) -> np.ndarray:
        """Poses (n, W, 3) that the camera reports at times τ (n, W) in s after `measured`, in m, m, rad.

        The flight is accurate to third order in τ: the acceleration changes with the velocity.
        """
        true = self.to_true(measured)
        a = self._pull(true)
        beyond = self._beyond(tau, true, a)
        n, W = tau.shape  # states (W n,): all bodies at their first time, then at their second, ...
        if a is None or not true.space.is_plane:
            at = self.along(true, tau.T, a)
        else:
            at = true.tiled(W).flown(np.tile(a, (W, 1)), tau.T.ravel())
        if beyond is not None:
            at = at.with_pose(at.space.shift(at.pose, beyond.swapaxes(0, 1).reshape(n * W, -1).T))
        poses = self.tiled(W, n).to_measured(at).pose
        return np.ascontiguousarray(poses.reshape(len(poses), W, n).transpose(2, 1, 0))

    def later(self, tau: np.ndarray, measured: State) -> State:
        """Measured states in space at times τ (n,) in s after the given measured states; compare `path` for poses."""
        true = self.to_true(measured)
        a = self._pull(true)
        at, beyond = self.along(true, tau[None], a), self._beyond(tau[:, None] + _AROUND, true, a)
        if beyond is not None:
            earlier, here, later = np.moveaxis(beyond, 1, 0)
            at = at.with_pose(at.space.shift(at.pose, here.T)).with_velocity(at.v + (later - earlier) / np.ptp(_AROUND))
        return self.to_measured(at)

    def _pull(self, true: State) -> np.ndarray | None:
        """Acceleration (n, d + turns) of true states; None in space if it is gravity alone, the default of `along`."""
        falls = not self.model.has_varying_flight and not true.space.is_plane
        return None if falls else self.true_acceleration(true)

    def _beyond(self, tau: np.ndarray, true: State, a: np.ndarray | None) -> np.ndarray | None:
        """Deviation (n, W, d + turns) of true paths from constant acceleration a, at times τ (n, W) in s."""
        beyond = self.arc(tau, true)
        if a is not None and self.model.has_varying_flight:
            early, late = (self.true_acceleration(true.with_velocity(true.v + h * a)) for h in (-_H_PATH, _H_PATH))
            cubic = tau[..., None] ** 3 / 6.0 * (late - early)[:, None] / (2.0 * _H_PATH)
            beyond = cubic if beyond is None else beyond + cubic
        return beyond

    def along(self, true: State, tau: np.ndarray, a: np.ndarray | None = None) -> State:
        """States (k n,) in space at times τ (k, n) in s, ordered by time: all n bodies at their first time first.

        The acceleration a (n, 6), by default gravity, is constant, except for the angular acceleration of torque-free
        motion that it contains.
        """
        d, k = true.space.dimension, len(tau)
        turns, spins = attitudes(true.attitude, true.spin, np.asarray(self.flying.tensor), tau)
        attitude, spin = turns.reshape(len(turns), -1), spins.reshape(len(spins), -1)
        straight = (self.flying.pull if a is None else a.T[:d])[:, None]
        position = true.position[:, None] + (tau * true.velocity[:, None] + 0.5 * tau * tau * straight)
        velocity = true.velocity[:, None] + tau * straight
        extra, t = None if a is None else a.T[d:] - self.flying.fall(true)[d:], tau.ravel()
        if extra is not None and extra.any():
            extra = np.tile(extra, k)
            attitude = true.space.attitude_after(attitude, 0.5 * t * t * extra)
            spin = spin + t * extra
        pose = np.concatenate([position.reshape(d, -1), attitude])
        motion = np.concatenate([velocity.reshape(d, -1), spin])
        surface = None if true.surface is None else np.tile(true.surface, k)
        return State(pose, motion, np.tile(true.trial, k), np.tile(true.t, k) + t, surface, true.space)
