"""Accelerations of the flights between impacts, measured by parabolas (`thesis_lib/datasets/flights/parabolas.py`)."""

from dataclasses import dataclass, field, replace

import numpy as np

from thesis_lib.datasets.flights.parabolas import SOME, Parabolas
from thesis_lib.mechanics.state import State

MANY = 1.0 / 3.0  # share of the flights; where something bends all of them, short ones do not show it


@dataclass(frozen=True)
class Flights:
    """m flights: state at mid-flight, acceleration (m, 3) in m/s², rad/s² with variance (m, 3), span (m,) in s.

    `bent` (b,) are the trials of further flights, which are not parabolas and have no acceleration.
    """

    state: State
    acceleration: np.ndarray
    variance: np.ndarray
    span: np.ndarray
    bent: np.ndarray = field(default_factory=lambda: np.zeros(0, int))

    def __len__(self) -> int:
        return len(self.acceleration)

    def select(self, rows: np.ndarray) -> "Flights":
        """The flights at `rows`, and those that are not parabolas."""
        state = self.state.select(rows)
        return Flights(state, self.acceleration[rows], self.variance[rows], self.span[rows], self.bent)

    def of_trials(self, trials: np.ndarray) -> "Flights":
        """The flights of the given trials."""
        found = self.select(np.flatnonzero(np.isin(self.state.trial, trials)))
        return replace(found, bent=self.bent[np.isin(self.bent, trials)])

    @property
    def are_bent(self) -> bool:
        """Whether so many are not parabolas that hits which were not detected are no excuse."""
        return len(self.bent) >= SOME and len(self.bent) > MANY * (len(self.bent) + len(self))


def flights_of(found: Parabolas) -> Flights:
    """The flights that these parabolas measure."""
    state = State.of(found.fitted[:, 0], found.fitted[:, 1], found.trial, found.t)
    return Flights(state, found.fitted[:, 2], found.variance, found.span, found.bent)


NO_FLIGHTS = Flights(State.empty(), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
