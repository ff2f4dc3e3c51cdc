"""Interface of evidence beside impacts, each kind with residuals of its own."""

from typing import Protocol, Self, TypeVar

import numpy as np

from thesis_lib.critique.contacts.dynamics import Dynamics


class Beside(Protocol):
    """m measurements with c residuals each, independent of each other and of the impacts.

    `channel`: its name in `channels`.  `trial` (m,).  `variance` (m, c) of the residuals.
    """

    @property
    def channel(self) -> str: ...
    @property
    def trial(self) -> np.ndarray: ...
    @property
    def variance(self) -> np.ndarray: ...
    def __len__(self) -> int: ...
    def of_trials(self, trials: np.ndarray) -> Self:
        """The same for the given trials only."""
        ...

    def residuals(self, dynamics: Dynamics) -> np.ndarray:
        """Measured minus predicted (m, c)."""
        ...

    def less(self, residuals: np.ndarray) -> Self:
        """The same with measurements that are smaller by (m, c)."""
        ...


def whitened(beside: Beside, dynamics: Dynamics) -> np.ndarray:
    """Residuals (m, c) in standard deviations."""
    return beside.residuals(dynamics) / np.sqrt(beside.variance)


B = TypeVar("B", bound=Beside)


def drawn(beside: B, dynamics: Dynamics, rng: np.random.Generator) -> B:
    """The same measurements drawn from a model, with their noise."""
    residuals = beside.residuals(dynamics)
    exact = beside.less(residuals)
    return exact.less(-np.sqrt(beside.variance) * rng.standard_normal(residuals.shape))
