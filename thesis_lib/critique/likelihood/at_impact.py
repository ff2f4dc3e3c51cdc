"""Measured states just before and after impact, extrapolated with a model's flight.

Lines through samples (`datasets/flights/lines.py`) have value and slope Σ w_k f(τ_k) for any path f; the deviation of a
model's flight from a straight line is subtracted.
"""

from collections.abc import Callable

import numpy as np

from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.likelihood.flights import BENDINGS
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.mechanics.free_motion import attitudes
from thesis_lib.mechanics.state import State

# a line through τ³/6 on [−W, 0] has the slope 0.15 W², as for the acceleration at −0.3 W; its own slope is the velocity
# at −0.5 W
ARC_MEAN = 0.6
TURNINGS = 3  # iterations for differing rotation: moments wrong by 5 % leave 2 mrad after a turn of 1 to 3 rad


def state_beside(dynamics: Dynamics, o: Observations, side: int) -> State:
    """Measured state on one side of the impact: 0 before, 1 after."""
    lines = o.lines(side)
    if not o.arcs:
        return lines

    if dynamics.turns_otherwise:
        return _turned_to_impact(dynamics, o, side, lines)
    if dynamics.model.camera_bends:
        # find the state whose path, seen by the camera, has this line
        a = _beside_lines(o, lines, o.rig.fall(lines).T)
        state = lines.shifted(-o.bow[:, side, :1] * a, -o.bow[:, side, 1:] * a)
        for _ in range(BENDINGS):
            state = state.corrected(lines, line_of_path(dynamics, o, side, state))
        return state

    acceleration = _acceleration_beside_lines(dynamics, o)
    state = _flown_to_impact(o, side, acceleration, dynamics.model.has_varying_flight)
    beyond = dynamics.arc(o.nodes[:, side], dynamics.to_true(state)) if dynamics.model.has_arc else None
    if beyond is None:
        return state
    line = o.weights[:, side] @ beyond
    return state.shifted(-line[:, 0], -line[:, 1])


def lines_beside(dynamics: Dynamics, o: Observations, side: int, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope (n, 3) of the lines of flights through measured states at impact, as seen by the camera.

    The inverse of `state_beside`.
    """
    if dynamics.turns_otherwise or dynamics.model.camera_bends:
        beside = _lines_of_turning if dynamics.turns_otherwise else line_of_path
        line = beside(dynamics, o, side, state)
        return line.q, line.v
    acceleration = _acceleration_beside_lines(dynamics, o)
    pose, speed, a = state.pose, state.v, acceleration(state)
    if dynamics.model.has_varying_flight:
        a = acceleration(state.with_velocity(speed + ARC_MEAN * o.bow[:, side, 1:] * a))
        pose = o.space.shift(pose, _bent(o, side, acceleration, state, a).T)
    beyond = dynamics.arc(o.nodes[:, side], dynamics.to_true(state))
    if beyond is not None:
        line = o.weights[:, side] @ beyond
        pose, speed = o.space.shift(pose, line[:, 0].T), speed + line[:, 1]
    return o.space.shift(pose, (o.bow[:, side, :1] * a).T).T, speed + o.bow[:, side, 1:] * a


def line_of_path(dynamics: Dynamics, o: Observations, side: int, state: State) -> State:
    """Value and slope of the lines through the paths that the camera reports from measured states at impact.

    In space attitude and spin are taken from the states, because their lines follow the flight.
    """
    line = o.weights[:, side] @ dynamics.path(o.nodes[:, side], state)
    if o.space.is_plane:
        return State.of(line[:, 0], line[:, 1], state.trial, state.t, state.surface)
    d = o.space.dimension
    return state.changed(position=line[:, 0, :d].T, velocity=line[:, 1, :d].T)


def _turned_to_impact(dynamics: Dynamics, o: Observations, side: int, lines: State) -> State:
    """State at the impact whose path, seen by the camera, has the line of one side, if the body turns differently.

    Path and line are compared in the middle of the window, where similar motions are close to each other; at the
    impact, beyond the end of the window, they have diverged.
    """
    middle, tau, weights = _from_middle(o, side)
    wanted = _turned_freely(o, lines, middle)
    believed = attitudes(lines.attitude, lines.spin, np.asarray(o.rig.tensor), o.nodes[:, side].T)[0]
    state = wanted
    for _ in range(TURNINGS):
        state = state.corrected(wanted, _line_beside(o, weights, dynamics.path(tau, state), believed, wanted))
    return dynamics.later(-middle, state)


def _lines_of_turning(dynamics: Dynamics, o: Observations, side: int, state: State) -> State:
    """Lines at the impact; the inverse of `_turned_to_impact`."""
    middle, tau, weights = _from_middle(o, side)
    line = dynamics.later(middle, state)
    path = dynamics.path(tau, line)
    for _ in range(TURNINGS):
        believed = attitudes(line.attitude, line.spin, np.asarray(o.rig.tensor), tau.T)[0]
        line = _line_beside(o, weights, path, believed, line)
    return _turned_freely(o, line, -middle)


def _from_middle(o: Observations, side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles (n,) of the windows in s from the impact, and nodes and weights of lines with values in the middle."""
    nodes, weights = o.nodes[:, side], o.weights[:, side].copy()
    middle = 0.5 * (nodes[:, 0] + nodes[:, -1])
    weights[:, 0] += middle[:, None] * weights[:, 1]
    return middle, nodes - middle[:, None], weights


def _turned_freely(o: Observations, line: State, tau: np.ndarray) -> State:
    """Line at times τ (n,) in s later: straight in position, free rotation of the believed body in attitude."""
    attitude, spin = attitudes(line.attitude, line.spin, np.asarray(o.rig.tensor), tau[None])
    return State(
        np.concatenate([line.position + tau * line.velocity, attitude[:, 0]]),
        np.concatenate([line.velocity, spin[:, 0]]),
        line.trial,
        line.t + tau,
        line.surface,
        line.space,
    )


def _line_beside(o: Observations, weights: np.ndarray, path: np.ndarray, believed: np.ndarray, near: State) -> State:
    """Line of a path (n, W, 7); for attitudes the line `near` of the `believed` ones, plus the deviation from it."""
    d = o.space.dimension
    line = weights @ path[..., :d]
    beyond = o.space.turn_between(believed, np.moveaxis(path[..., d:], (2, 1), (0, 1)))
    value, slope = np.einsum("nsk,akn->san", weights, beyond)
    turned = o.space.attitude_after(near.attitude, value)
    return near.changed(line[:, 0].T, turned, line[:, 1].T, near.spin + slope)


def _beside_lines(o: Observations, state: State, a: np.ndarray) -> np.ndarray:
    """Acceleration a (n, d + turns) minus the part included in the lines: in space the torque-free change of spin."""
    if o.space.is_plane:
        return a
    d = o.space.dimension
    return np.concatenate([a[:, :d], a[:, d:] - o.rig.fall(state)[d:].T], axis=1)


def _acceleration_beside_lines(dynamics: Dynamics, o: Observations) -> Callable[[State], np.ndarray]:
    """A model's acceleration as a function of the state, reduced as in `_beside_lines`."""
    return lambda state: _beside_lines(o, state, dynamics.acceleration(state))


def _flown_to_impact(o: Observations, side: int, acceleration: Callable[[State], np.ndarray], varying: bool) -> State:
    """State on one side of the impact, from the line there and the acceleration (n, 3) of a state, which may be
    `varying` with the velocity."""
    slope, bow = o.slope[:, side], o.bow[:, side]
    state, bent = o.lines(side), 0.0
    a = acceleration(state)
    if varying:
        a = acceleration(state.with_velocity(slope - (1.0 - ARC_MEAN) * bow[:, 1:] * a))
        bent = _bent(o, side, acceleration, state.with_velocity(slope - bow[:, 1:] * a), a)
    return state.shifted(-bow[:, :1] * a - bent, -bow[:, 1:] * a)


def _bent(
    o: Observations, side: int, acceleration: Callable[[State], np.ndarray], at: State, a: np.ndarray
) -> np.ndarray:
    """Shift (n, 3) in m, rad of the line at the impact due to varying acceleration; 0 unless the arcs resolve it.

    `at` is the state at impact, `a` the acceleration that gives the slope, at 0.3 W of a line from 0 to W = 2 b_1.
    A line through τ³/6 is −W³/30 at 0, a line through 0.3 W τ²/2 only −W³/40: the rest is −W³/120 times the jerk.
    """
    if o.found.arcs_air is None:
        return np.zeros_like(a)
    W = 2.0 * o.bow[:, side, 1:]
    return -(W**2) / 120.0 * (a - acceleration(at)) / (0.5 * ARC_MEAN)
