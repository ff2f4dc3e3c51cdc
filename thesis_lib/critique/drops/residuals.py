"""Residuals of all measurements, their covariance, and measurements drawn from a model.

The residual of an impact has three components, velocity after impact measured minus predicted ("impact").  Trajectories
add four: pose after minus before (3, "meet") and gap at impact (1, "touch").  That of an episode has the velocity and
the pose where the flight after it begins, measured minus predicted; its touch is solved for, so that the component is 0
and has unit variance.  The residual of a flight has three, acceleration measured minus predicted ("flight").  The covariance includes the noise of *all* data, also of the law's
inputs:

    S = A C Aᵀ + κ² w wᵀ + σ_m² D,    A = ∂R/∂data,  w = ∂R/∂t_c,  D = diag(1, 1, 1/k²) on the impact components

A is made of secants over one standard deviation of each datum, so that a kink between sticking and sliding counts as
far as noise reaches it.  κ is wide, because the instant of impact is unknown a priori.  σ_m is scatter that neither
noise nor model explains.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product

import numpy as np
from scipy.special import roots_gegenbauer

from thesis_lib.critique.drops.episodes import play
from thesis_lib.critique.drops.flights import Flights
from thesis_lib.critique.drops.model import Model
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.effects.effect import Rig, State

INSTANT = 2e-3  # s, κ: the prior of t_c; half a frame at 250 Hz
ARC_POINTS = 33  # points of a flight at which its path is compared with a parabola
# a line through τ³/6 on [−W, 0] has the slope 0.15 W², as for the acceleration at −0.3 W; its own slope is the velocity
# at −0.5 W
ARC_MEAN = 0.6
_PARABOLA = roots_gegenbauer(3, 2.5)  # nodes and weights for (1 − u²)² on [−1, 1]
_PARABOLA = _PARABOLA[0], _PARABOLA[1] / _PARABOLA[1].sum()
_H_INSTANT = 1e-4  # s, for the derivative by the instant of impact


def states_at_impact(model: Model, values: Mapping[str, float], observations: Observations) -> tuple[State, State]:
    """Measured states just before and after impact, extrapolated with the model's flight."""
    o, value, slope = observations, observations.value, observations.slope
    sides = []
    for side in (0, 1):
        t = o.t if side == 0 else o.t + o.span
        state = State.of(value[:, side], slope[:, side], o.trial, t)
        if o.arcs:
            a = model.acceleration(state, values, o.rig)
            if model.has_varying_flight:
                v = slope[:, side] - (1.0 - ARC_MEAN) * o.bow[:, side, 1:] * a
                a = model.acceleration(state.with_velocity(v), values, o.rig)
            q = value[:, side] - o.bow[:, side, :1] * a
            v = slope[:, side] - o.bow[:, side, 1:] * a
            state = State.of(q, v, o.trial, t)
            beyond = model.arc(o.nodes[:, side], state, values, o.rig)
            if beyond is not None:
                line = o.weights[:, side] @ beyond
                state = State.of(q - line[:, 0], v - line[:, 1], o.trial, t)
        sides.append(state)
    return sides[0], sides[1]


def impact_residuals(
    model: Model, values: Mapping[str, float], observations: Observations, states: tuple[State, State] | None = None
) -> np.ndarray:
    """R (n, 7 or 3): impact (m/s, m/s, rad/s), meet (m, m, rad), touch (m); `states` as of `states_at_impact`."""
    o, rig = observations, observations.rig
    before, after = states or states_at_impact(model, values, o)
    predicted, depth = model.strike(before, values, rig, o.offset)
    if not o.arcs:
        return after.v - predicted.v
    active = model.active(values)
    meet = after.q - before.q - model.jump(before, after, values)
    gap = model.gap(model.to_true(before, active, rig), values, rig)
    residual = np.concatenate([after.v - predicted.v, meet, (gap + depth)[:, None]], axis=1)
    rows = np.flatnonzero(o.span)
    if len(rows):
        residual[rows] = _episode_residuals(model, values, rig, before.select(rows), after.select(rows), o.span[rows])
    return residual


def _episode_residuals(
    model: Model, values: Mapping[str, float], rig: Rig, before: State, after: State, span: np.ndarray
) -> np.ndarray:
    played = play(model, values, rig, model.to_true(before, model.active(values), rig), span)
    predicted = model.to_measured(played.after, model.active(values), rig)
    return np.concatenate([after.v - predicted.v, after.q - predicted.q, np.zeros((len(span), 1))], axis=1)


def flight_residuals(model: Model, values: Mapping[str, float], flights: Flights, rig: Rig) -> np.ndarray:
    """Acceleration measured minus predicted (m, 3), m/s² and rad/s²."""
    state = flights.state
    predicted = model.acceleration(state, values, rig)
    if model.has_varying_flight:
        # the parabola through x(τ) averages x'' with the weight (1 − (2τ/T)²)²
        first, total = predicted, 0.0
        for node, weight in zip(*_PARABOLA):
            tau = 0.5 * node * flights.span[:, None]
            later = state.with_velocity(state.v + tau * first)
            total = total + weight * model.acceleration(later, values, rig)
        predicted = total
    tau = flights.span[:, None] * np.linspace(-0.5, 0.5, ARC_POINTS)
    beyond = model.arc(tau, state, values, rig)
    if beyond is not None:
        # curvature of the parabola through the path's deviation from constant acceleration
        square = tau**2 - (tau**2).mean(axis=1, keepdims=True)
        predicted = predicted + 2.0 * np.einsum("nw,nwc->nc", square, beyond) / (square**2).sum(1)[:, None]
    return flights.acceleration - predicted


def residual_covariance(
    model: Model, values: Mapping[str, float], observations: Observations, instant: np.ndarray | float = INSTANT
) -> np.ndarray:
    """S (n, m, m) without σ_m.

    `instant` is κ in s: wide if S weighs residuals (a fit of the instant), `t_std` for their size at the estimated one.
    """
    S = noise_covariance(lambda o: impact_residuals(model, values, o), observations, instant, model.has_arc)
    if observations.span.any():
        S[observations.span > 0.0, -1, -1] = 1.0
    return S


def noise_covariance(
    statistic: Callable[[Observations], np.ndarray],
    observations: Observations,
    instant: np.ndarray | float,
    with_samples: bool,
) -> np.ndarray:
    """Covariance (n, m, m) of a statistic of n impacts from the noise of all data, by secants.

    Args:
        statistic: maps any observations to (n, m).
        instant: κ in s, scalar or (n,).
        with_samples: whether the statistic uses `nodes` and `weights`.
    """
    o, n = observations, len(observations)
    std = np.sqrt(np.einsum("nsckk->nsck", o.cov))
    step = np.where(std > 0.0, std, 1e-6)
    data = list(product((0, 1), range(3), (0, 1)))  # side, channel, and value (0) or slope (1) of its line
    # all secants in one call, on copies of the impacts: each datum moved up and down, and the instant as measured and
    # a moment later
    copies = o.tiled(2 * len(data) + 2, with_samples)
    lines = [array.reshape(-1, n, 2, 3) for array in (copies.value, copies.slope)]
    for i, (side, channel, k) in enumerate(data):
        lines[k][2 * i, :, side, channel] += step[:, side, channel, k]
        lines[k][2 * i + 1, :, side, channel] -= step[:, side, channel, k]
    lines[0][-1] += _H_INSTANT * o.slope
    R = statistic(copies).reshape(2 * len(data) + 2, n, -1)

    up, down, (here, later) = R[0:-2:2], R[1:-2:2], R[-2:]
    secants = (up - down).reshape(2, 3, 2, n, -1)
    S = np.zeros((n, R.shape[2], R.shape[2]))
    for side, channel in product((0, 1), range(3)):
        A = np.stack(list(secants[side, channel]), axis=1) / (2.0 * step[:, side, channel, :, None])  # (n, 2, m)
        S += np.swapaxes(A, 1, 2) @ o.cov[:, side, channel] @ A
    if o.arcs:
        w = (later - here) / _H_INSTANT
        w[o.span > 0.0] = 0.0  # the touch is solved for
        S += np.broadcast_to(instant, n)[:, None, None] ** 2 * w[:, :, None] * w[:, None, :]
    return S


def synthesise(
    model: Model,
    values: Mapping[str, float],
    observations: Observations,
    rng: np.random.Generator,
    scatter: float = 0.0,
) -> Observations:
    """Observations drawn from `model` at `values`, at the states and with the noise of given ones.

    The states before impact and at mid-flight are taken as true.  `scatter`: σ_m in m/s of the velocity after impact.
    """
    o, rig = observations, observations.rig
    before, _ = states_at_impact(model, values, o)
    active = model.active(values)
    if o.arcs:
        # at impact the body touches: set its measured height accordingly
        true = model.to_true(before, active, rig)
        raise_by = model.gap(true, values, rig) + model.strike(before, values, rig, o.offset)[1]
        raised = model.to_measured(true.moved(y=true.y - raise_by), active, rig)
        before = before.moved(y=raised.y)
    after = model.predict(before, values, rig, o.offset)
    rows = np.flatnonzero(o.span)
    if len(rows):
        played = play(model, values, rig, model.to_true(before.select(rows), active, rig), o.span[rows])
        ends = model.to_measured(played.after, active, rig)
        q, v = after.q, after.v
        q[rows], v[rows] = ends.q, ends.v
        after = State.of(q, v, o.trial, o.t + o.span)
    jitter = scatter * rng.standard_normal((len(o), 3)) / [1.0, 1.0, rig.k_g]
    after = after.with_velocity(after.v + jitter)
    value, slope = np.empty_like(o.value), np.empty_like(o.slope)
    for side, state in enumerate((before, after)):
        pose, speed = state.q, state.v
        if o.arcs:
            if side == 1:
                # `after` contains the jump already: the pose is that of before plus one jump
                pose = before.q + model.jump(before, after, values)
                pose[rows] = after.q[rows]
            a = model.acceleration(state, values, rig)
            if model.has_varying_flight:
                v = speed + ARC_MEAN * o.bow[:, side, 1:] * a
                a = model.acceleration(state.with_velocity(v), values, rig)
            beyond = model.arc(o.nodes[:, side], state, values, rig)
            if beyond is not None:
                line = o.weights[:, side] @ beyond
                pose, speed = pose + line[:, 0], speed + line[:, 1]
            pose, speed = pose + o.bow[:, side, :1] * a, speed + o.bow[:, side, 1:] * a
        value[:, side], slope[:, side] = pose, speed
    L = np.linalg.cholesky(o.cov + 1e-30 * np.eye(2))
    noise = (L @ rng.standard_normal((*o.cov.shape[:3], 2, 1)))[..., 0]
    flights = o.flights
    acceleration = flights.acceleration - flight_residuals(model, values, flights, rig)
    acceleration = acceleration + np.sqrt(flights.variance) * rng.standard_normal(acceleration.shape)
    flights = replace(flights, acceleration=acceleration)
    return replace(o, value=value + noise[..., 0], slope=slope + noise[..., 1], flights=flights)
