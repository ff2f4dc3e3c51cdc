"""Evidence in addition to impacts; each kind of evidence defines its residuals."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from thesis_lib.critique.contacts.dynamics import Dynamics
from thesis_lib.mechanics.state import State


@dataclass(frozen=True)
class Beside:
    """m measured states, independent of each other and of the impacts, and the variance (m, c) of their residuals.

    `channel` is the name in `channels`; `of_all` names the arrays that do not have one row per measurement.
    """

    state: State
    variance: np.ndarray

    channel: ClassVar[str]
    of_all: ClassVar[tuple[str, ...]] = ()

    def __len__(self) -> int:
        return len(self.variance)

    @property
    def trial(self) -> np.ndarray:
        """Trial (m,) of each measurement."""
        return self.state.trial

    def select(self, rows: np.ndarray) -> Self:
        """Measurements at `rows`."""
        arrays = {name: part for name, part in vars(self).items() if name not in ("state", *self.of_all)}
        return replace(self, state=self.state.select(rows), **{name: part[rows] for name, part in arrays.items()})

    def of_trials(self, trials: np.ndarray) -> Self:
        """Measurements of the given trials."""
        return self.select(np.flatnonzero(np.isin(self.trial, trials)))

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Measured minus predicted values (m, c)."""
        raise NotImplementedError

    def less(self, residuals: np.ndarray) -> Self:
        """Copy with the measured values reduced by `residuals` (m, c)."""
        raise NotImplementedError

    def whitened(self, dynamics: Dynamics) -> np.ndarray:
        """Residuals (m, c) in standard deviations."""
        return self.residuals(dynamics) / np.sqrt(self.variance)

    def drawn(self, dynamics: Dynamics, rng: np.random.Generator) -> Self:
        """Copy with measurements drawn from a model, including noise."""
        residuals = self.residuals(dynamics)
        return self.less(residuals).less(-np.sqrt(self.variance) * rng.standard_normal(residuals.shape))


@dataclass(frozen=True)
class Accelerations(Beside):
    """Measured accelerations (m, c)."""

    acceleration: np.ndarray

    def less(self, residuals: np.ndarray) -> Self:
        return replace(self, acceleration=self.acceleration - residuals)
