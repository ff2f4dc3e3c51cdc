"""A law with any set of effects: prediction of measured states.

One impact goes down a ladder and up again; `thesis_lib/effects/effect.py` names the hooks of effects at each rung.

| rung         | from, to                            | where               | hooks of effects                         |
|--------------|-------------------------------------|---------------------|------------------------------------------|
| to_true      | measured state, true state          | `Model.to_true`     | `to_true`                                |
| to_contact   | true state, what the contact sees   | `Model.contact_at`  | `to_contact`, `contact_point`, `inertia` |
| coefficients | μ, ε of the law, of each impact     | `Model._struck`     | `coefficients`                           |
| law          | contact, μ and ε, impulse           | `Law.impulse`       |                                          |
| impulse      | its impulse, impulse and couple     | `Model._struck`     | `impulse`                                |
| time         | touch, pose at the impulse          | `Model._delay`      | `contact_time`                           |
| from_contact | what the contact sees, true state   | `Model.collide`     | `from_contact`                           |
| to_measured  | true state, what the camera reports | `Model.to_measured` | `to_measured`                            |

How flights lead to the first rung and on from the last says `thesis_lib/critique/likelihood/residuals.py`, which kinds
of contact there are beside an impulse, `thesis_lib/critique/contacts/kinds.py`.
"""

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from thesis_lib.contact.compliant.normal_force import ConvexDamper
from thesis_lib.contact.law import Law
from thesis_lib.critique.contacts.contact_time import (
    BASE_PARAMETERS,
    CONTACT_TIME,
    OF_FRICTION,
    TURNED,
    normal_mobility,
)
from thesis_lib.effects.effect import Effect, Impulse, Parameter, Rig, in_order, parameters_in
from thesis_lib.mechanics.contact import Contact, contact, velocity_change
from thesis_lib.mechanics.free_motion import attitudes
from thesis_lib.mechanics.inertia import mobility
from thesis_lib.mechanics.space import PLANE, Space
from thesis_lib.mechanics.state import State

_H = 1e-3  # s, for the derivative of a linear map: exact for any step
_H_PATH = 0.02  # s, for the change of the acceleration over a tenth of a second
_H_BENT = 1e-4  # s, for one that bends parabolas: off by 1e-6 of ω² at 30 rad/s


def inward(p: Parameter, value: float, step: float) -> float:
    """The step from `value`, or its opposite where it would leave the bounds."""
    return step if value + step <= p.high else -step


def _along(true: State, a: np.ndarray, tau: np.ndarray, rig: Rig) -> State:
    """The states (n W,) at times τ (n, W) in s, of constant acceleration a (n, d + turns); turns are free ones."""
    rows, t = np.repeat(np.arange(len(tau)), tau.shape[1]), tau.ravel()
    start = true.select(rows)
    if true.space.is_plane:
        return start.flown(a[rows], t)
    d = true.space.dimension
    turns, spins = attitudes(true.attitude, true.spin, np.asarray(rig.tensor), tau.T)
    extra = (a.T - rig.fall(true))[d:, rows]
    free = start.flown(np.concatenate([a.T[:d, rows], 0.0 * extra]).T, t)
    attitude, spin = (part.swapaxes(1, 2).reshape(len(part), -1) for part in (turns, spins))
    return free.changed(attitude=true.space.attitude_after(attitude, 0.5 * t * t * extra), spin=spin + t * extra)


def _without_camera(effect: Effect) -> Effect:
    """What an effect of the measurement does to the body, as gravity is oblique to a camera's axes."""
    inner = copy(effect)
    exact = {"to_true": Effect.to_true, "to_measured": Effect.to_measured}
    inner.__class__ = type(type(effect).__name__, (type(effect),), exact)
    return inner


@dataclass(frozen=True)
class Model:
    """A law with effects; its parameters are those of the law, `tau` if it `takes_time`, and `effect.parameter`.

    `effects` are in the order in which they were chosen; they act in that of `acting_order`.

    `always` are effects that every model of the data has, as the table under a body that slides over it: they act
    first, and their parameters go by their own names.  In `space` parameters of effects that are vectors have a
    component for each axis.
    """

    law: Law
    effects: tuple[Effect, ...] = ()
    takes_time: bool = False
    always: tuple[Effect, ...] = ()
    space: Space = PLANE

    def parameters_of(self, effect: Effect) -> tuple[Parameter, ...]:
        """The parameters of an effect where the body moves."""
        return parameters_in(effect, self.space)

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """All parameters by full name, in order."""
        of_effects = {f"{effect.name}.{p.name}": p for effect in self.effects for p in self.parameters_of(effect)}
        of_law = BASE_PARAMETERS + (CONTACT_TIME,) * self.takes_time + self.of_friction
        of_law += tuple(p for effect in self.always for p in self.parameters_of(effect))
        return {p.name: p for p in of_law} | of_effects

    @property
    def of_friction(self) -> tuple[Parameter, ...]:
        """The parameter beside μ of an integrated contact whose friction is not Coulomb's, or none."""
        return OF_FRICTION.get(type(self.law.force), ()) if self.is_compliant else ()

    @cached_property
    def fitted_parameters(self) -> dict[str, Parameter]:
        """Those that are not on or off."""
        return {name: p for name, p in self.parameters.items() if p.discrete is None}

    @cached_property
    def acting_order(self) -> list[Effect]:
        """The effects in the order in which they act, whatever the order of choice."""
        return [*self.always, *in_order(self.effects)]

    def name_of(self, effect: Effect, p: Parameter) -> str:
        """Full name of a parameter of an effect."""
        return p.name if effect in self.always else f"{effect.name}.{p.name}"

    def acting(self, *hooks: str) -> list[Effect]:
        """The effects that override one of these hooks."""
        return [
            e for e in self.acting_order if any(getattr(type(e), hook) is not getattr(Effect, hook) for hook in hooks)
        ]

    @cached_property
    def has_varying_flight(self) -> bool:
        """Whether the true acceleration in flight may change with the velocity."""
        return bool(self.acting("acceleration"))

    @cached_property
    def camera_is_exact(self) -> bool:
        """Whether measured states are true ones."""
        return not self.acting("to_true", "to_measured")

    @cached_property
    def camera_bends(self) -> bool:
        """Whether the camera reports parabolas as other curves, so that paths have to be followed through it."""
        return any(effect.bends for effect in self.acting("to_true", "to_measured"))

    @cached_property
    def has_arc(self) -> bool:
        """Whether measured paths in flight may differ from parabolas."""
        return bool(self.acting("arc")) or self.camera_bends

    @cached_property
    def flight_parameters(self) -> list[str]:
        """Parameters on which the measured flights, and so the states at impact, depend."""
        acting = self.acting("to_true", "to_measured", "acceleration", "arc")
        return [self.name_of(effect, p) for effect in acting for p in self.parameters_of(effect)]

    @property
    def is_compliant(self) -> bool:
        """Whether contacts are integrated in time rather than resolved by an impulse."""
        return self.takes_time and self.law.force is not None

    @property
    def limit(self) -> "Model":
        """The model with the impulse of short contacts, for a compliant law; a convex contact has no closed form."""
        has_limit = self.is_compliant and not isinstance(self.law.force, ConvexDamper)
        return replace(self, law=replace(self.law, force=None)) if has_limit else self

    def with_effect(self, effect: Effect) -> "Model":
        """The model with one more effect."""
        return replace(self, effects=(*self.effects, effect))

    def contact(
        self,
        measured: State,
        values: Mapping[str, float],
        rig: Rig,
        offset: np.ndarray | None = None,
        turned: np.ndarray | None = None,
    ) -> tuple[State, Contact]:
        """State as the contact sees it, and the contact, per unit mass, of the true body.

        `turned` (turns, n) in rad is how much further the body has turned than in the measured pose.
        """
        active = self.active(values)
        true = self.to_true(measured, active, rig)
        return self.contact_at(true, active, rig, self._true_offset(measured, true, active, rig, offset), turned)

    def _true_offset(
        self, measured: State, true: State, active: Sequence, rig: Rig, offset: np.ndarray | None
    ) -> np.ndarray | None:
        """The offset (d, n) at the true pose, of one by row (n, d); None if there is none."""
        if offset is None or not offset.any():
            return None
        # a measured contact point belongs to the measured angle: mirroring the angle mirrors its offset
        further = self.to_true(measured.moved(theta=measured.theta + _H), active, rig)
        return np.stack([offset[:, 0] * np.sign(further.theta - true.theta), offset[:, 1]])

    @staticmethod
    def contact_at(
        true: State, active: Sequence, rig: Rig, offset: np.ndarray | None = None, turned: np.ndarray | None = None
    ) -> tuple[State, Contact]:
        """As `contact`, from a true state; `active` is the result of `active`, `offset` (d, n) that at that pose."""
        pose = true
        if turned is not None:
            pose = true.changed(attitude=true.space.attitude_after(true.attitude, turned))
        r = rig.lowest(pose)
        if offset is not None:
            r = r + offset
        seen, G = pose, rig.G
        for effect, p in active:
            seen = effect.to_contact(seen, p, rig)
        for effect, p in active:
            r = effect.contact_point(r, seen, p, rig)
        for effect, p in active:
            G = effect.inertia(G, p)
        at = contact(seen, r, mobility(seen.space, G, seen.attitude))
        if turned is not None:
            seen = seen.changed(attitude=seen.space.attitude_after(seen.attitude, -turned))
        return seen, at

    @staticmethod
    def approaches(true: State, active: Sequence, rig: Rig) -> np.ndarray:
        """Mask (n,) of bodies in true states whose contact point comes down, as the contact sees it: v_n < 0."""
        return Model.contact_at(true, active, rig)[1].v_n < 0.0

    def predict(
        self,
        measured: State,
        values: Mapping[str, float],
        rig: Rig,
        offset: np.ndarray | None = None,
        mu: np.ndarray | None = None,
        epsilon: np.ndarray | None = None,
    ) -> State:
        """Measured state after impact, from the measured state before it; `mu`, `epsilon` (n,) replace the fitted."""
        return self.strike(measured, values, rig, offset, mu, epsilon)[0]

    def strike(
        self,
        measured: State,
        values: Mapping[str, float],
        rig: Rig,
        offset: np.ndarray | None = None,
        mu: np.ndarray | None = None,
        epsilon: np.ndarray | None = None,
    ) -> tuple[State, np.ndarray]:
        """As `predict`, and the depth t̄ |v_n| (n,) in m of the contact point where the arcs meet."""
        active = self.active(values)
        true = self.to_true(measured, active, rig)
        at_true = self._true_offset(measured, true, active, rig, offset)
        after, depth = self.collide(true, values, rig, at_true, mu, epsilon)
        return self.to_measured(after, active, rig), depth

    def collide(
        self,
        true: State,
        values: Mapping[str, float],
        rig: Rig,
        offset: np.ndarray | None = None,
        mu: np.ndarray | None = None,
        epsilon: np.ndarray | None = None,
    ) -> tuple[State, np.ndarray]:
        """As `strike`, from the true state to the true state; `offset` is that at the true pose."""
        active, n = self.active(values), len(true)
        seen, at = self.contact_at(true, active, rig, offset)
        mu = np.full(n, values["mu"]) if mu is None else mu
        epsilon = np.full(n, values["epsilon"]) if epsilon is None else epsilon
        after, depth = self._struck(seen, at, active, rig, mu, epsilon), np.zeros(n)
        if self.takes_time:
            delay = self._delay(seen, at, after, values, active, rig)
            depth = np.where(at.v_n < 0.0, rig.gap(true.flown(rig.fall(true).T, -delay)) - rig.gap(true), 0.0)
            turned = TURNED * delay * (after.spin - seen.spin)
            seen, at = self.contact_at(true, active, rig, offset, turned)
            after = self._struck(seen, at, active, rig, mu, epsilon)
        for effect, p in reversed(active):
            after = effect.from_contact(after, p, rig)
        return after, depth

    def delay(self, true: State, values: Mapping[str, float], rig: Rig) -> np.ndarray:
        """t̄ (n,) in s of contacts that begin in true states; 0 if contacts take no time."""
        n = len(true)
        if not self.takes_time:
            return np.zeros(n)
        active = self.active(values)
        seen, at = self.contact_at(true, active, rig)
        mu, epsilon = (np.full(n, values[name]) for name in ("mu", "epsilon"))
        after = self._struck(seen, at, active, rig, mu, epsilon)
        return self._delay(seen, at, after, values, active, rig)

    def _delay(
        self, seen: State, at: Contact, after: State, values: Mapping[str, float], active: Sequence, rig: Rig
    ) -> np.ndarray:
        """t̄ (n,) in s of each impact, from what `contact_at` returns and the state after the impulse."""
        tau = np.full(len(seen), values["tau"])
        for effect, p in active:
            tau = effect.contact_time(tau, at, seen, p, rig)
        push = after.velocity[-1] - seen.velocity[-1]
        rebound = after.space.velocity_at(after.velocity, after.spin, at.r)[-1]
        b = normal_mobility(push, rebound - at.v_n)
        if self.law.force is not None:
            tau = self.law.force.tau_at(tau, np.full_like(tau, values["epsilon"]), b, at.v_n)
        return tau / np.sqrt(b)

    def _struck(
        self, seen: State, at: Contact, active: Sequence, rig: Rig, mu: np.ndarray, epsilon: np.ndarray
    ) -> State:
        """State after the impulse as the contact sees it, from what `contact_at` returns and (μ, ε) of each impact."""
        for effect, p in active:
            mu, epsilon = effect.coefficients(mu, epsilon, at, seen, p, rig)
        at = at.with_coefficients(mu, epsilon)
        with np.errstate(all="ignore"):
            impulse = Impulse(self.law.impulse(at, mu, epsilon), np.zeros_like(seen.spin if at.dimension == 3 else mu))
            for effect, p in active:
                impulse = effect.impulse(impulse, at, seen, p, rig)
        touches = at.v_n < 0.0
        c = tuple(np.where(touches, part, 0.0) for part in impulse.c)
        couple = np.where(touches, impulse.couple, 0.0)
        return seen.with_motion(seen.motion + velocity_change(c, at.r, at.mobility, couple=couple))

    def acceleration(self, measured: State, values: Mapping[str, float], rig: Rig) -> np.ndarray:
        """Measured acceleration in flight (n, 3), m/s² and rad/s²."""
        active = self.active(values)
        if self.camera_is_exact:
            return self.true_acceleration(measured, active, rig)
        true = self.to_true(measured, active, rig)
        a = self.true_acceleration(true, active, rig)
        if self.camera_bends:
            near = [self.to_measured(true.flown(a, h), active, rig).v for h in (-_H_BENT, _H_BENT)]
            return (near[1] - near[0]) / (2.0 * _H_BENT)
        # the camera's map is linear in the velocity, so that a difference quotient is exact
        later = true.with_velocity(true.v + _H * a)
        return (self.to_measured(later, active, rig).v - self.to_measured(true, active, rig).v) / _H

    @staticmethod
    def true_acceleration(true: State, active: Sequence, rig: Rig) -> np.ndarray:
        """Acceleration in flight (n, 3) in a true state, m/s² and rad/s²; `active` is the result of `active`."""
        a = rig.fall(true)
        for effect, p in active:
            a = effect.acceleration(a, true, p, rig)
        return a.T

    def arc(self, tau: np.ndarray, measured: State, values: Mapping[str, float], rig: Rig) -> np.ndarray | None:
        """True flight paths (n, W, 3) less parabolas, at times τ (n, W) in s; None if no effect bends them."""
        active = self.active(values)
        return self._true_arc(tau, self.to_true(measured, active, rig), active, rig)

    @staticmethod
    def _true_arc(tau: np.ndarray, true: State, active: Sequence, rig: Rig) -> np.ndarray | None:
        """As `arc`, from a true state."""
        parts = [part for effect, p in active if (part := effect.arc(tau, true, p, rig)) is not None]
        return np.moveaxis(sum(parts[1:], parts[0]), 0, -1) if parts else None

    def path(self, tau: np.ndarray, measured: State, values: Mapping[str, float], rig: Rig) -> np.ndarray:
        """Poses (n, W, 3) that the camera reports at times τ (n, W) in s from `measured`, in m, m, rad.

        The flight is true to third order in τ: its acceleration changes with the velocity.
        """
        active = self.active(values)
        true = self.to_true(measured, active, rig)
        a = self.true_acceleration(true, active, rig)
        beyond = self._true_arc(tau, true, active, rig)
        if self.has_varying_flight:
            early, late = (
                self.true_acceleration(true.with_velocity(true.v + h * a), active, rig) for h in (-_H_PATH, _H_PATH)
            )
            cubic = tau[..., None] ** 3 / 6.0 * (late - early)[:, None] / (2.0 * _H_PATH)
            beyond = cubic if beyond is None else beyond + cubic
        rows = np.repeat(np.arange(len(tau)), tau.shape[1])
        at = _along(true, a, tau, rig)
        if beyond is not None:
            at = at.with_pose(at.space.shift(at.pose, beyond.reshape(len(rows), -1).T))
        each = [
            (effect, {name: v[rows] if isinstance(v, np.ndarray) else v for name, v in p.items()})
            for effect, p in active
        ]
        return self.to_measured(at, each, rig).q.reshape(*tau.shape, true.space.poses)

    def gap(self, true: State, values: Mapping[str, float], rig: Rig) -> np.ndarray:
        """Gap (n,) in m between true body and surface: that of the believed shape less the effects' share."""
        taken = np.zeros(len(true))
        for effect, p in self.active(values):
            taken = effect.gap(taken, true, p, rig)
        return rig.gap(true) - taken

    def jump(self, before: State, after: State, values: Mapping[str, float]) -> np.ndarray:
        """Measured pose after impact minus before (n, 3), in m, m, rad."""
        jump = np.zeros(before.motion.shape)
        for effect, p in self.active(values):
            jump = effect.meet(jump, before, after, p)
        return jump.T

    def camera_and_body(self) -> tuple["Model", "Model"]:
        """The model with measurement effects only, and the one with all that acts on the body; neither takes time."""
        camera = tuple(e for e in self.effects if e.family == "measurement")
        rest = Model(self.law, camera).acting("acceleration")
        body = tuple(_without_camera(e) if e in rest else e for e in self.effects if e not in camera or e in rest)
        return Model(self.law, camera), Model(self.law, body)

    def active(self, values: Mapping[str, float]) -> list[tuple[Effect, dict[str, float]]]:
        """The effects in the order in which they act, each with the parameters p of its hooks."""
        return [(e, {p.name: values[self.name_of(e, p)] for p in self.parameters_of(e)}) for e in self.acting_order]

    @staticmethod
    def to_true(state: State, active: Sequence, rig: Rig) -> State:
        """True state behind a measured one; `active` is the result of `active`."""
        for effect, p in reversed(active):
            state = effect.to_true(state, p, rig)
        return state

    @staticmethod
    def to_measured(state: State, active: Sequence, rig: Rig) -> State:
        """State that the camera reports for a true one."""
        for effect, p in active:
            state = effect.to_measured(state, p, rig)
        return state
