"""Residuals of all measurements, and measurements drawn from a model.

The residual of an impact has three components, velocity after impact measured minus predicted ("impact").  Trajectories
add four: pose after minus before (3, "meet") and gap at impact (1, "touch").  That of an episode is measured minus
predicted velocity and pose where the flight after it begins; its touch is solved for, so that the last component is 0.
A single hit whose contact is integrated has the pose predicted, too; its last component is how far the measured arcs
are apart where they should meet.
What is measured beside impacts has its own residuals (`beside`).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from thesis_lib.critique.contacts.contact_time import TURNED
from thesis_lib.critique.contacts.kinds import Prediction, kind_of, values_of
from thesis_lib.critique.contacts.model import Model
from thesis_lib.critique.likelihood.beside import drawn
from thesis_lib.critique.likelihood.flights import BENDINGS
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.effects.effect import Rig
from thesis_lib.mechanics.state import State

# a line through τ³/6 on [−W, 0] has the slope 0.15 W², as for the acceleration at −0.3 W; its own slope is the velocity
# at −0.5 W
ARC_MEAN = 0.6
# of an unknown spin, in standard deviations: nodes and weights for a normal distribution (Gauss and Hermite)
SPINS, _OF_SPIN = hermegauss(7)
_OF_SPIN = _OF_SPIN / _OF_SPIN.sum()


def states_at_impact(model: Model, values: Mapping[str, float], observations: Observations) -> tuple[State, State]:
    """Measured states just before and after impact, extrapolated with the model's flight."""
    return state_beside(model, values, observations, 0), state_beside(model, values, observations, 1)


def turned_until_impulse(
    model: Model, values: Mapping[str, float], observations: Observations, before: State, after: State
) -> np.ndarray | float:
    """Angle (n,) in rad by which bodies turn beyond the pose before impact until the impulse acts, as in `Model`.

    From the measured states `before` and `after`, with the sense of turning of the camera.
    """
    if not (model.takes_time and observations.arcs):
        return 0.0
    true = model.to_true(before, model.active(values), observations.rig)
    return TURNED * model.delay(true, values, observations.rig) * (after.omega - before.omega)


def state_beside(model: Model, values: Mapping[str, float], observations: Observations, side: int) -> State:
    """The state on one side of the impact: 0 before, 1 after."""
    o = observations
    lines = o.lines(side)
    if not o.arcs:
        return lines

    if model.camera_bends:
        # the state whose path, seen by the camera, has this line
        a = _beside_lines(o, lines, o.rig.fall(lines).T)
        state = lines.shifted(-o.bow[:, side, :1] * a, -o.bow[:, side, 1:] * a)
        for _ in range(BENDINGS):
            found = _line(model, values, o, side, state)
            state = state.corrected(lines, found)
        return state

    def acceleration(state: State) -> np.ndarray:
        return _beside_lines(o, state, model.acceleration(state, values, o.rig))

    state = _flown_to_impact(o, side, acceleration, model.has_varying_flight)
    beyond = model.arc(o.nodes[:, side], state, values, o.rig) if model.has_arc else None
    if beyond is None:
        return state
    line = o.weights[:, side] @ beyond
    return state.shifted(-line[:, 0], -line[:, 1])


def _beside_lines(o: Observations, state: State, a: np.ndarray) -> np.ndarray:
    """Acceleration a (n, d + turns) less what the lines know already: in space the torque-free change of the spin."""
    if o.space.is_plane:
        return a
    d = o.space.dimension
    return np.concatenate([a[:, :d], a[:, d:] - o.rig.fall(state)[d:].T], axis=1)


def _line(model: Model, values: Mapping[str, float], o: Observations, side: int, state: State) -> State:
    """Value and slope of the lines through the paths that the camera reports from measured states at impact.

    In space the attitude and the spin are those of the states: their lines follow the flight.
    """
    line = o.weights[:, side] @ model.path(o.nodes[:, side], state, values, o.rig)
    if o.space.is_plane:
        return State.of(line[:, 0], line[:, 1], state.trial, state.t, state.surface)
    d = o.space.dimension
    return state.changed(position=line[:, 0, :d].T, velocity=line[:, 1, :d].T)


def _flown_to_impact(o: Observations, side: int, acceleration: Callable[[State], np.ndarray], varying: bool) -> State:
    """The state on one side of the impact, from the line there and the acceleration (n, 3) of a state, if `varying`
    with the velocity."""
    slope, bow = o.slope[:, side], o.bow[:, side]
    state, bent = o.lines(side), 0.0
    a = acceleration(state)
    if varying:
        a = acceleration(state.with_velocity(slope - (1.0 - ARC_MEAN) * bow[:, 1:] * a))
        bent = _bent(o, side, acceleration, state.with_velocity(slope - bow[:, 1:] * a), a)
    return state.shifted(-bow[:, :1] * a - bent, -bow[:, 1:] * a)


def _bent(
    o: Observations, side: int, acceleration: Callable[[State], np.ndarray], at: State, a: np.ndarray
) -> np.ndarray | float:
    """How much further (n, 3) in m, rad the line lies at the impact as the acceleration varies; 0 unless arcs see it.

    `at` is the state at impact, `a` the acceleration that gives the slope, at 0.3 W of a line from 0 to W = 2 b_1.
    A line through τ³/6 is −W³/30 at 0, one through 0.3 W τ²/2 only −W³/40: the rest is −W³/120 times the jerk.
    """
    if o.found.arcs_air is None:
        return 0.0
    W = 2.0 * o.bow[:, side, 1:]
    return -(W**2) / 120.0 * (a - acceleration(at)) / (0.5 * ARC_MEAN)


def impact_residuals(
    model: Model, values: Mapping[str, float], observations: Observations, states: tuple[State, State] | None = None
) -> np.ndarray:
    """R (n, 7 or 3): impact (m/s, m/s, rad/s), meet (m, m, rad), touch (m); `states` as of `states_at_impact`."""
    before, after = states or states_at_impact(model, values, observations)
    return compare(model, values, observations.rig, before, after, predict(model, values, observations, before))


def predict(model: Model, values: Mapping[str, float], observations: Observations, before: State) -> Prediction:
    """What follows from the measured states `before` impact; where their spin is unknown, its mean over the spins."""
    if not observations.spin:
        return _predict(model, values, observations, before)
    v, touch, q = predict_by_spin(model, values, observations, before)
    return Prediction(over_spins(v), None if touch is None else over_spins(touch), None if q is None else over_spins(q))


def over_spins(values: np.ndarray) -> np.ndarray:
    """Mean (...) over `SPINS` of values (m, ...)."""
    return np.tensordot(_OF_SPIN, values, axes=1)


def predict_by_spin(
    model: Model, values: Mapping[str, float], o: Observations, before: State
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """v (m, n, 3), touch (m, n) and q (m, n, 3) of `Prediction` for `SPINS` times the unknown spin's one sigma."""
    m, n = len(SPINS), len(before.x)
    rows = np.tile(np.arange(n), m)
    spun = before.select(rows)
    spun = spun.moved(omega=spun.omega + o.spin * np.repeat(SPINS, n))
    of_all = replace(o, span=o.span[rows], offset=o.offset[rows])
    found = _predict(model, values_of(values, rows), of_all, spun)
    touch = None if found.touch is None else found.touch.reshape(m, n)
    return found.v.reshape(m, n, 3), touch, None if found.q is None else found.q.reshape(m, n, 3)


def _predict(model: Model, values: Mapping[str, float], o: Observations, before: State) -> Prediction:
    """What follows from states `before` impact."""
    if not o.arcs:
        return kind_of(model).stated(model, values, o.rig, before, o.offset)
    return kind_of(model).predict(model, values, o.rig, before, o.span, o.offset)


def compare(
    model: Model, values: Mapping[str, float], rig: Rig, before: State, after: State, prediction: Prediction
) -> np.ndarray:
    """R of measured states `before` and `after` impacts, as `impact_residuals`."""
    dv = after.v - prediction.v
    if prediction.touch is None:
        return dv
    space = after.space
    meet = space.difference(after.pose, before.pose).T - model.jump(before, after, values)
    if prediction.q is not None:
        played = ~np.isnan(prediction.q[:, 0])
        meet[played] = space.difference(after.pose[:, played], prediction.q[played].T).T
    touch, rows = prediction.touch.copy(), np.flatnonzero(np.isnan(prediction.touch))
    if len(rows):
        touch[rows] = _apart(model, values_of(values, rows), rig, before.select(rows), after.select(rows))
    return np.concatenate([dv, meet, touch[:, None]], axis=1)


def _apart(model: Model, values: Mapping[str, float], rig: Rig, before: State, after: State) -> np.ndarray:
    """How far apart (n,) in m measured arcs are across the surface, where they should meet.

    No contact that is integrated has a say in it; an impact law compares it instead of the pose after impact.  In the
    unit v_n⁻ / (v_n⁺ − v_n⁻), both sets of residuals have the same volume, so that their likelihoods can be compared.
    Where an effect (a time lag) says that the body did not come off, the unit is that of v_n⁺ = 0.
    """
    gaps, rates = [], []
    for state in (before, after):
        true = model.to_true(state, model.active(values), rig)
        gaps.append(model.gap(true, values, rig))
        rates.append(model.contact_at(true, model.active(values), rig)[1].v_n)
    apart = np.maximum(rates[1] - rates[0], np.abs(rates[0]))
    unit = np.divide(rates[0], apart, out=-np.ones_like(apart), where=apart > 0.0)
    return unit * (gaps[1] - gaps[0])


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
        before = model.to_measured(true.moved(y=true.y - raise_by), active, rig)
    struck = before.moved(omega=before.omega + o.spin * rng.standard_normal(len(o))) if o.spin else before
    after = model.predict(struck, values, rig, o.offset)
    played = np.zeros(len(o), bool)
    q, v = after.q, after.v
    for rows, ends in kind_of(model).played(model, values, rig, struck, o.span) if o.arcs else ():
        q[rows], v[rows], played[rows] = ends.q, ends.v, True
    after = State.of(q, v, o.trial, o.t + o.span, before.surface)
    jitter = scatter * rng.standard_normal((len(o), 3)) / [1.0, 1.0, rig.k_g]
    after = after.with_velocity(after.v + jitter)
    value, slope = np.empty_like(o.value), np.empty_like(o.slope)
    for side, state in enumerate((before, after)):
        pose, speed = state.q, state.v
        if o.arcs:
            if side == 1:
                # `after` contains the jump already: the pose is that of before plus one jump
                pose = before.q + model.jump(before, after, values)
                pose[played] = after.q[played]
            if model.camera_bends:
                line = _line(model, values, o, side, State.of(pose, speed, o.trial, state.t, state.surface))
                value[:, side], slope[:, side] = line.q, line.v
                continue
            a = model.acceleration(state, values, rig)
            if model.has_varying_flight:
                v = speed + ARC_MEAN * o.bow[:, side, 1:] * a
                a = model.acceleration(state.with_velocity(v), values, rig)
                pose = pose + _bent(o, side, lambda at: model.acceleration(at, values, rig), state, a)
            beyond = model.arc(o.nodes[:, side], state, values, rig)
            if beyond is not None:
                line = o.weights[:, side] @ beyond
                pose, speed = pose + line[:, 0], speed + line[:, 1]
            pose, speed = pose + o.bow[:, side, :1] * a, speed + o.bow[:, side, 1:] * a
        value[:, side], slope[:, side] = pose, speed
    L = np.linalg.cholesky(o.cov + 1e-30 * np.eye(2))
    noise = (L @ rng.standard_normal((*o.cov.shape[:3], 2, 1)))[..., 0]
    flights = drawn(o.flights, model, values, rig, rng)
    supports = tuple(drawn(beside, model, values, rig, rng) for beside in o.supports)
    return replace(o, value=value + noise[..., 0], slope=slope + noise[..., 1], flights=flights, supports=supports)
