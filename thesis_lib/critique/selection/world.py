"""What the search must know of a world: its candidates, how a model is fitted and judged, its residuals' slopes.

A *world* is the data of some trials together with the models that may explain them.  A model is a base (a contact law,
the believed equations of motion) with effects switched on in order.  docs/architecture.md shows who implements it.

| name in code | what the search reads of it                                                                    |
|--------------|------------------------------------------------------------------------------------------------|
| candidate    | `name`                                                                                         |
| fit          | `base`, `effects`, `values` of the parameters, `score`: log score of the data fitted to, nats  |
| judgement    | log score of other data by trial, their number of units, the total; what else the world shows  |
| slopes       | whitened residuals and what each parameter, fitted or not, changes in them                     |
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np

from thesis_lib.critique.selection.settings import SearchSettings


class Candidate(Protocol):
    """An effect that may be missing."""

    @property
    def name(self) -> str: ...


class Fit(Protocol):
    """A model whose parameters are fitted."""

    @property
    def base(self) -> str: ...
    @property
    def effects(self) -> tuple[Any, ...]: ...
    @property
    def values(self) -> Mapping[str, Any]: ...
    @property
    def score(self) -> float: ...


class Judgement(Protocol):
    """How well a fitted model predicts data that it was not fitted to."""

    @property
    def trials(self) -> np.ndarray:
        """Numbers of the trials judged, ascending."""
        ...

    @property
    def units(self) -> int:
        """Number of impacts, windows, ...: what a gain is told for one of."""
        ...

    @property
    def total(self) -> float:
        """Log score in nats."""
        ...

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        """Log score of each of `trials` in nats."""
        ...


E = TypeVar("E", bound=Candidate)
F = TypeVar("F", bound=Fit)
J = TypeVar("J", bound=Judgement)


@dataclass(frozen=True)
class Slopes:
    """A fitted model to first order.

    Attributes:
        residual: (N,) whitened.
        fitted: (N, p) change of the residual by a unit of each parameter in the model.
        candidates: by name, (N, n_p) the same for parameters of candidates.
        unit_noise: whether the noise is known, so that residuals of a right model have variance 1; else their own
            variance is taken for it.
    """

    residual: np.ndarray
    fitted: np.ndarray
    candidates: dict[str, np.ndarray]
    unit_noise: bool


class World(ABC, Generic[E, F, J]):
    """Data of some trials and the models that may explain them.

    Attributes:
        candidates: effects that these data can test, by name; not_testable: name -> why not.
        bases: names of the models without effects, of which the best is chosen.
        rivals: number of bases with which the first effect is tried: without it the wrong one may be best.
        trials: numbers of the trials, ascending.
        unit: what a gain is told for one of: "impact", "window".
        resamples: draws of null distributions and of the bootstrap.
    """

    candidates: Mapping[str, E]
    not_testable: Mapping[str, str] = {}
    bases: tuple[str, ...]
    rivals: int = 1
    trials: np.ndarray
    unit: str
    resamples: int = 999

    @abstractmethod
    def fit(
        self,
        base: str,
        effects: tuple[E, ...],
        start: Mapping[str, Any] | None = None,
        *,
        quick: bool = False,
    ) -> F:
        """All parameters fitted to these data, from `start` where it names them; `quick` may stop early."""

    @abstractmethod
    def judge(self, fitted: F) -> J:
        """Judgement of a model that was fitted to other data."""

    @abstractmethod
    def cross_validate(self, fitted: F, folds: np.ndarray) -> J:
        """Judgement on these data, each fold's by a fit to the others; `folds` numbers the fold of each trial."""

    @abstractmethod
    def slopes(self, fitted: F, candidates: Sequence[E]) -> Slopes:
        """The fitted model to first order, and what candidates would add."""

    @abstractmethod
    def is_material(self, better: J, worse: J, candidate: E, settings: SearchSettings) -> bool:
        """Whether the candidate lowers an error that it is about by an amount that matters."""

    def start_with(self, fitted: F, candidate: E) -> Mapping[str, Any]:
        """Values from which the fit with one more effect starts."""
        return fitted.values

    def drawn(self, fitted: F, rng: np.random.Generator) -> Self | None:
        """These data as the fitted model would have made them; None where fits are linear, so that refits gain what
        the score test says."""
        return None
