"""Accelerations of the flights between impacts, measured by parabolas (`thesis_lib/datasets/flights/parabolas.py`)."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Self

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import roots_gegenbauer

from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.critique.likelihood.beside import Accelerations
from thesis_lib.datasets.flights.parabolas import SOME, Parabolas
from thesis_lib.mechanics.space import PLANE, Space
from thesis_lib.mechanics.state import State

BENDINGS = 2  # iterations for the state of a distorted path; each reduces the error of a 1 % lens at 0.25 m to a tenth
# nodes on [−1, 1] and weights, of sum 1, for the comparison of a path with a parabola; exact to degree 23
_ARC, _OF_ARC = leggauss(12)
_OF_ARC = _OF_ARC / _OF_ARC.sum()
_PARABOLA = roots_gegenbauer(3, 2.5)  # nodes and weights for (1 − u²)² on [−1, 1]
_PARABOLA = _PARABOLA[0], _PARABOLA[1] / _PARABOLA[1].sum()
MANY = 1.0 / 3.0  # fraction of the flights; short flights do not show a curvature that affects all of them


@dataclass(frozen=True)
class Flights(Accelerations):
    """m flights: state at mid-flight, acceleration (m, 3) in m/s², rad/s² with variance (m, 3), span (m,) in s.

    `bent` (b,) are the trials of further flights that are not parabolas and do not give an acceleration.
    """

    span: np.ndarray
    bent: np.ndarray = field(default_factory=lambda: np.zeros(0, int), kw_only=True)

    channel = "flight"
    of_all = ("bent",)

    @staticmethod
    def joined(parts: "Sequence[Flights]") -> "Flights":
        """Flights of all parts, one after the other."""
        names = [one.name for one in fields(parts[0]) if one.name != "state"]
        arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return replace(parts[0], state=State.joined([part.state for part in parts]), **arrays)

    def of_trials(self, trials: np.ndarray) -> Self:
        """Flights of the given trials."""
        return replace(super().of_trials(trials), bent=self.bent[np.isin(self.bent, trials)])

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Acceleration measured minus predicted (m, 3), m/s² and rad/s²."""
        if not len(self):
            return self.acceleration
        state, tau = self.state, 0.5 * self.span[:, None] * _ARC
        variance = (tau**2) @ _OF_ARC
        square = tau**2 - variance[:, None]
        of_square = _OF_ARC * 2.0 * square / (square**2 @ _OF_ARC)[:, None]
        if dynamics.model.camera_bends:
            of_line = _OF_ARC * tau / variance[:, None]
            for _ in range(BENDINGS):
                path = dynamics.path(tau, state)
                predicted, v = (np.einsum("nw,nwc->nc", part, path) for part in (of_square, of_line))
                q = _OF_ARC @ path - 0.5 * predicted * variance[:, None]
                moved = [
                    known + wanted - found
                    for known, wanted, found in ((state.q, self.state.q, q), (state.v, self.state.v, v))
                ]
                state = State.of(*moved, state.trial, state.t)
            return self.acceleration - predicted
        predicted = dynamics.acceleration(state)
        if dynamics.model.has_varying_flight:
            # the slope of the parabola fitted to x(τ) exceeds x'(0) by x''' T²/40
            span = self.span[:, None]
            early, late = (
                dynamics.acceleration(state.with_velocity(state.v + h * predicted)) for h in (-0.25 * span, 0.25 * span)
            )
            jerk = 2.0 * (late - early) / span
            speed = state.v - jerk * span**2 / 40.0
            first = dynamics.acceleration(state.with_velocity(speed))
            # the parabola averages x'' with the weight (1 − (2τ/T)²)²
            predicted = 0.0
            for node, weight in zip(*_PARABOLA):
                h = 0.5 * node * span
                later = state.with_velocity(speed + h * first + 0.5 * h**2 * jerk)
                predicted = predicted + weight * dynamics.acceleration(later)
        beyond = dynamics.arc(tau, dynamics.to_true(state))
        if beyond is not None:
            # curvature of the parabola fitted to the path's deviation from constant acceleration
            predicted = predicted + np.einsum("nw,nwc->nc", of_square, beyond)
        return self.acceleration - predicted

    @property
    def are_bent(self) -> bool:
        """Whether too many flights are not parabolas for undetected hits to explain them."""
        return len(self.bent) >= SOME and len(self.bent) > MANY * (len(self.bent) + len(self))


def flights_of(found: Parabolas) -> Flights:
    """Flights measured by the given parabolas."""
    state = State.of(found.fitted[:, 0], found.fitted[:, 1], found.trial, found.t)
    return Flights(state, found.variance, found.fitted[:, 2], found.span, bent=found.bent)


def no_flights(space: Space = PLANE) -> Flights:
    """Flights without entries."""
    none = np.zeros((0, space.motions))
    return Flights(State.empty(space), none, none, np.zeros(0))
