"""Prediction of everything that is measured, by a law with any set of effects switched on.

For each impact the residual has up to seven components: velocity after impact, measured minus predicted (3, "impact"),
pose after minus before (3, "meet") and gap at impact (1, "touch"); the last four need trajectories.  For each flight it
has three, acceleration measured minus predicted ("flight").

The covariance of the residual is that of *all* data in it, the inputs of the law included (they are measured too):

    S = A C Aᵀ + κ² w wᵀ + σ_m² D,    A = ∂R/∂data,  w = ∂R/∂t_c,  D = diag(1, 1, 1/k²) on the impact components

A by secants over one standard deviation of each datum, so that a kink of the law between sticking and sliding counts
with the share of it that the noise reaches; κ wide, because the instant of impact is not known beforehand; σ_m is
scatter that neither noise nor model explain.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import roots_gegenbauer

from thesis_lib.contact.law import Law
from thesis_lib.contact.space import ContactSpace
from thesis_lib.critique.drops.flights import Flights
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.effects.effect import Effect, Impulse, Parameter, Rig, State

BASE_PARAMETERS = (
    Parameter("mu", "1", null=0.1, low=0.0, high=2.0, scale=0.05),
    Parameter("epsilon", "1", null=0.5, low=0.0, high=1.0, scale=0.05),
)
INSTANT = 2e-3  # s, κ: the prior of t_c; half a frame at 250 Hz
ARC_POINTS = 33  # of a flight, at which its path is compared with a parabola
# a line through τ³/6 on [−W, 0] has the slope 0.15 W², as if the acceleration were that at −0.3 W; the line's own slope
# is the velocity at −0.5 W
ARC_MEAN = 0.6
_PARABOLA = roots_gegenbauer(3, 2.5)  # nodes and weights for (1 − u²)² on [−1, 1]
_PARABOLA = _PARABOLA[0], _PARABOLA[1] / _PARABOLA[1].sum()
_H = 1e-3  # s, for the derivative of a linear map
_H_INSTANT = 1e-4  # s, for the derivative by the instant of impact


@dataclass(frozen=True)
class Model:
    """A law with effects; parameters are `mu`, `epsilon` and `effect.parameter` for each effect's own."""

    law: Law
    effects: tuple[Effect, ...] = ()

    @property
    def parameters(self) -> dict[str, Parameter]:
        """All parameters in order, by their full name."""
        named = {p.name: p for p in BASE_PARAMETERS}
        for effect in self.effects:
            named |= {f"{effect.name}.{p.name}": p for p in effect.parameters}
        return named

    @property
    def has_varying_flight(self) -> bool:
        """Whether the acceleration in flight may change with the velocity."""
        return any(type(effect).acceleration is not Effect.acceleration for effect in self.effects)

    @property
    def has_arc(self) -> bool:
        """Whether paths in flight may differ from parabolas."""
        return any(type(effect).arc is not Effect.arc for effect in self.effects)

    @property
    def flight_parameters(self) -> list[str]:
        """Names of the parameters on which the measured flights, and so the states at impact, depend."""
        hooks = ("to_true", "to_measured", "acceleration", "arc")
        return [
            f"{effect.name}.{p.name}"
            for effect in self.effects
            if any(getattr(type(effect), hook) is not getattr(Effect, hook) for hook in hooks)
            for p in effect.parameters
        ]

    def with_effect(self, effect: Effect) -> "Model":
        """The model with one more effect."""
        return Model(self.law, (*self.effects, effect))

    def without(self, name: str) -> "Model":
        """The model without the effect of that name."""
        return Model(self.law, tuple(effect for effect in self.effects if effect.name != name))

    def contact(
        self, measured: State, values: Mapping[str, float], rig: Rig, offset: np.ndarray | None = None
    ) -> tuple[State, np.ndarray, np.ndarray, float]:
        """State as the contact sees it, contact point r_x, r_y (n,) from the true centre of mass, and true k, m."""
        own = self.own(values)
        true = self.to_true(measured, own, rig)
        r = rig.shape.contact_point(true.theta)
        r_x, r_y = r[:, 0], r[:, 1]
        if offset is not None and offset.any():
            # a given contact point belongs to the measured angle; where that is mirrored, so is its offset
            turned = self.to_true(measured.moved(theta=measured.theta + _H), own, rig)
            r_x, r_y = r_x + offset[:, 0] * np.sign(turned.theta - true.theta), r_y + offset[:, 1]
        seen, k_g = true, rig.k_g
        for effect, p in own:
            seen = effect.to_contact(seen, p, rig)
        for effect, p in own:
            r_x, r_y = effect.contact_point(r_x, r_y, seen, p, rig)
        for effect, p in own:
            k_g = effect.radius_of_gyration(k_g, p)
        return seen, r_x, r_y, k_g

    def predict(
        self,
        measured: State,
        values: Mapping[str, float],
        rig: Rig,
        offset: np.ndarray | None = None,
        mu: np.ndarray | None = None,
        epsilon: np.ndarray | None = None,
    ) -> State:
        """Measured state after impact, from the measured state before it (see effects/effect.py for the stages)."""
        own = self.own(values)
        seen, r_x, r_y, k_g = self.contact(measured, values, rig, offset)
        w = 1.0 / (k_g * k_g)
        space = ContactSpace(
            v_t=seen.vx - r_y * seen.omega,
            v_n=seen.vy + r_x * seen.omega,
            K_tt=1.0 + r_y * r_y * w,
            K_nn=1.0 + r_x * r_x * w,
            K_tn=-r_x * r_y * w,
        )
        n = len(seen.x)
        mu = np.full(n, values["mu"]) if mu is None else mu
        epsilon = np.full(n, values["epsilon"]) if epsilon is None else epsilon
        for effect, p in own:
            mu, epsilon = effect.coefficients(mu, epsilon, space, seen, p, rig)
        with np.errstate(all="ignore"):
            impulse = Impulse(*self.law.impulse(space, mu, epsilon), np.zeros(n))
            for effect, p in own:
                impulse = effect.impulse(impulse, space, mu, epsilon, (r_x, r_y), seen, p, rig)
        touches = space.v_n < 0.0
        c_t, c_n, tau = (np.where(touches, a, 0.0) for a in (impulse.c_t, impulse.c_n, impulse.tau))
        after = seen.moved(
            vx=seen.vx + c_t,
            vy=seen.vy + c_n,
            omega=seen.omega + w * (r_x * c_n - r_y * c_t + tau),
        )
        for effect, p in reversed(own):
            after = effect.from_contact(after, p, rig)
        return self.to_measured(after, own, rig)

    def acceleration(self, measured: State, values: Mapping[str, float], rig: Rig) -> np.ndarray:
        """Measured acceleration in flight, (n, 3)."""
        own = self.own(values)
        true = self.to_true(measured, own, rig)
        a = np.zeros((len(true.x), 3))
        a[:, 1] = -rig.gravity
        for effect, p in own:
            a = effect.acceleration(a, true, p, rig)
        # the camera's map is linear in the velocity: its difference quotient is exact
        later = true.with_velocity(true.v + _H * a)
        return (self.to_measured(later, own, rig).v - self.to_measured(true, own, rig).v) / _H

    def arc(
        self, tau: np.ndarray, measured: State, values: Mapping[str, float], rig: Rig
    ) -> np.ndarray | None:
        """What flight paths have beyond constant acceleration at times τ (n, W), (n, W, 3); None if nothing."""
        own = self.own(values)
        true = self.to_true(measured, own, rig)
        parts = [part for effect, p in own if (part := effect.arc(tau, true, p, rig)) is not None]
        return sum(parts[1:], parts[0]) if parts else None

    def gap(self, true: State, values: Mapping[str, float], rig: Rig) -> np.ndarray:
        """Gap (n,) m between the true body and surface: that of the believed shape, less what effects take of it."""
        left = np.zeros(len(true.x))
        for effect, p in self.own(values):
            left = effect.gap(left, true, p, rig)
        return rig.shape.gap(true.y, true.theta, rig.height) - left

    def camera_and_body(self) -> tuple["Model", "Model"]:
        """The model of the camera (measurement effects only), and that of what happens (all others)."""
        camera = tuple(e for e in self.effects if e.family == "measurement")
        body = tuple(e for e in self.effects if e.family != "measurement")
        return Model(self.law, camera), Model(self.law, body)

    def own(self, values: Mapping[str, float]) -> list[tuple[Effect, dict[str, float]]]:
        """The effects in order, each with the parameters p that its hooks take."""
        return [
            (effect, {p.name: values[f"{effect.name}.{p.name}"] for p in effect.parameters})
            for effect in self.effects
        ]

    @staticmethod
    def to_true(state: State, own: Sequence, rig: Rig) -> State:
        """True state behind a measured one; `own` as the method of that name gives it."""
        for effect, p in reversed(own):
            state = effect.to_true(state, p, rig)
        return state

    @staticmethod
    def to_measured(state: State, own: Sequence, rig: Rig) -> State:
        """What the camera makes of a true state."""
        for effect, p in own:
            state = effect.to_measured(state, p, rig)
        return state


def components(observations: Observations) -> int:
    """Residual components of an impact: 7 with trajectories, else 3."""
    return 7 if observations.arcs else 3


def states_at_impact(
    model: Model,
    values: Mapping[str, float],
    observations: Observations,
) -> tuple[State, State]:
    """Measured states just before and just after impact, extrapolated with the model's flight."""
    o, value, slope = observations, observations.value, observations.slope
    sides = []
    for side in (0, 1):
        state = State.of(value[:, side], slope[:, side], o.trial, o.t)
        if o.arcs:
            a = model.acceleration(state, values, o.rig)
            if model.has_varying_flight:
                v = slope[:, side] - (1.0 - ARC_MEAN) * o.bow[:, side, 1:] * a
                a = model.acceleration(state.with_velocity(v), values, o.rig)
            q = value[:, side] - o.bow[:, side, :1] * a
            v = slope[:, side] - o.bow[:, side, 1:] * a
            state = State.of(q, v, o.trial, o.t)
            beyond = model.arc(o.nodes[:, side], state, values, o.rig)
            if beyond is not None:
                line = o.weights[:, side] @ beyond
                state = State.of(q - line[:, 0], v - line[:, 1], o.trial, o.t)
        sides.append(state)
    return sides[0], sides[1]


def impact_residuals(
    model: Model,
    values: Mapping[str, float],
    observations: Observations,
    states: tuple[State, State] | None = None,
) -> np.ndarray:
    """R (n, 7 or 3): impact (m/s, m/s, rad/s), meet (m, m, rad), touch (m).

    `states` are those of `states_at_impact` where they are known already.
    """
    o, rig = observations, observations.rig
    before, after = states or states_at_impact(model, values, o)
    predicted = model.predict(before, values, rig, o.offset)
    residual = [after.vx - predicted.vx, after.vy - predicted.vy, after.omega - predicted.omega]
    if o.arcs:
        own = model.own(values)
        jump = np.zeros((len(o), 3))
        for effect, p in own:
            jump = effect.meet(jump, before, after, p)
        residual += [after.x - before.x - jump[:, 0], after.y - before.y - jump[:, 1]]
        residual += [after.theta - before.theta - jump[:, 2]]
        residual.append(model.gap(model.to_true(before, own, rig), values, rig))
    return np.stack(residual, axis=1)


def flight_residuals(model: Model, values: Mapping[str, float], flights: Flights, rig: Rig) -> np.ndarray:
    """Acceleration measured minus predicted, (m, 3)."""
    state = flights.state
    predicted = model.acceleration(state, values, rig)
    if model.has_varying_flight:
        # a parabola through x(τ) has the mean of x'' with the weight (1 − (2τ/T)²)²
        first, total = predicted, 0.0
        for node, weight in zip(*_PARABOLA):
            tau = 0.5 * node * flights.span[:, None]
            later = state.with_velocity(state.v + tau * first)
            total = total + weight * model.acceleration(later, values, rig)
        predicted = total
    tau = flights.span[:, None] * np.linspace(-0.5, 0.5, ARC_POINTS)
    beyond = model.arc(tau, flights.state, values, rig)
    if beyond is not None:
        # curvature of the parabola through what the path has beyond constant acceleration
        square = tau**2 - (tau**2).mean(axis=1, keepdims=True)
        predicted = predicted + 2.0 * np.einsum("nw,nwc->nc", square, beyond) / (square**2).sum(1)[:, None]
    return flights.acceleration - predicted


def residual_covariance(
    model: Model,
    values: Mapping[str, float],
    observations: Observations,
    instant: np.ndarray | float = INSTANT,
) -> np.ndarray:
    """S (n, m, m) without σ_m.

    `instant` is κ in s: wide where S weighs residuals (the instant is then fitted), `t_std` where S says how large
    residuals at the estimated instant are.
    """
    return noise_covariance(
        lambda o: impact_residuals(model, values, o), observations, instant, model.has_arc
    )


def noise_covariance(
    statistic: Callable[[Observations], np.ndarray],
    observations: Observations,
    instant: np.ndarray | float,
    with_samples: bool,
) -> np.ndarray:
    """Covariance (n, m, m) that the noise of all data gives to `statistic` (n, m), by secants (see above).

    `with_samples` says whether the statistic looks at `nodes` and `weights`.
    """
    o = observations
    n = len(o)
    data = [(side, channel, k) for side in (0, 1) for channel in range(3) for k in (0, 1)]
    std = np.sqrt(np.einsum("nsckk->nsck", o.cov))
    step = np.where(std > 0.0, std, 1e-6)
    # all secants in one call: two copies of the impacts for each of the data, and two for the instant
    copies = o.tiled(2 * len(data) + 2, with_samples)
    value, slope = copies.value.reshape(-1, n, 2, 3), copies.slope.reshape(-1, n, 2, 3)
    for i, (side, channel, k) in enumerate(data):
        moved = slope if k else value
        moved[2 * i, :, side, channel] += step[:, side, channel, k]
        moved[2 * i + 1, :, side, channel] -= step[:, side, channel, k]
    value[-1] += _H_INSTANT * o.slope
    R = statistic(copies).reshape(len(value), n, -1)
    S = np.zeros((n, R.shape[2], R.shape[2]))
    for i in range(0, len(data), 2):
        side, channel, _ = data[i]
        A = np.stack([R[2 * j] - R[2 * j + 1] for j in (i, i + 1)], axis=1)
        A /= 2.0 * step[:, side, channel, :, None]  # (n, 2, m)
        S += np.swapaxes(A, 1, 2) @ o.cov[:, side, channel] @ A
    if o.arcs:
        w = (R[-1] - R[-2]) / _H_INSTANT
        S += np.broadcast_to(instant, n)[:, None, None] ** 2 * w[:, :, None] * w[:, None, :]
    return S
