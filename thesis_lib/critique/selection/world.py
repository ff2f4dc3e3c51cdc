"""Interface between the search and a world, its statistical problem.

A *world* is the data of some trials and the models that may explain them.  A model is a base (a contact law, or the
assumed equations of motion) with effects in order.  docs/architecture.md lists the implementations.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, Protocol, Self, TypeVar

import numpy as np

from thesis_lib.critique.selection.settings import SearchSettings


class Candidate(Protocol):
    """An effect that may be missing."""

    @property
    def name(self) -> str: ...


class FittedModel(Protocol):
    """A fitted model: base, effects, parameter values, and log score of the fitted data in nats."""

    @property
    def base(self) -> str: ...
    @property
    def effects(self) -> tuple[Any, ...]: ...
    @property
    def values(self) -> Mapping[str, Any]: ...
    @property
    def score(self) -> float: ...


class HeldOutScores(Protocol):
    """Scores of a fitted model on data that it was not fitted to.

    `trials`: their numbers, ascending.  `units`: impacts or windows; gains are reported per unit.  `total`, `by_trial`:
    log score in nats of all, and of each of `trials`.
    """

    @property
    def trials(self) -> np.ndarray: ...
    @property
    def units(self) -> int: ...
    @property
    def total(self) -> float: ...
    def by_trial(self, trials: np.ndarray) -> np.ndarray: ...


Effort = Literal["quick", "near", "full"]  # a part of the data; all of them in one round; until nothing changes

Asked = tuple[str, tuple[Any, ...], Mapping[str, Any] | None, Effort]  # base, effects, start and effort of a fit

E = TypeVar("E", bound=Candidate)
F = TypeVar("F", bound=FittedModel)
J = TypeVar("J", bound=HeldOutScores)


@dataclass(frozen=True)
class Slopes:
    """A fitted model, linearised.

    Attributes:
        residual: (N,) whitened.
        fitted: (N, p) change of the residual per unit of each fitted parameter.
        candidates: by name, (N, n_p) the same for its parameters.
        unit_noise: whether the noise is known; else it is estimated from the variance of the residuals.
    """

    residual: np.ndarray
    fitted: np.ndarray
    candidates: dict[str, np.ndarray]
    unit_noise: bool


@dataclass(frozen=True)
class Remaining:
    """Structure left in the residuals of the final model.

    Attributes:
        p_value: of the structure, under noise alone.
        error_before: of the residual; error_after: of noise or the unlearnable part alone; in the world's unit.
        depends_on: names of the states on which it depends, by relevance.
    """

    p_value: float
    error_before: float
    error_after: float
    depends_on: tuple[str, ...]

    def is_structured(self, settings: SearchSettings, floor: float) -> bool:
        """Whether it is significant and matters; `floor`: error of noise alone, in the world's unit."""
        return self.p_value <= settings.alpha and settings.matters(self.error_before, self.error_after, floor)


class World(ABC, Generic[E, F, J]):
    """Data of some trials and the models that may explain them.

    Attributes:
        candidates: effects that these data can test, by name; not_testable: name -> why not.
        bases: names of the models without effects, of which the best is chosen.
        reserve: second-stage bases, slow to fit, tried if a model leaves an error, chosen if clearly better.
        most_effects: largest number of effects in one model, unless the settings give one.
        asks_reserve_first: whether a base of the reserve that leaves no error is taken before any effect is tried.
        forgives_rungs: whether an error that an effect raises when it is added counts only if the final model still
            has it: one cause of several may move errors until all are in the model.
        rivals: number of bases tried with the first effect; without it the wrong base may fit best.
        trials: numbers of the trials, ascending.
        unit: "impact" or "window".
        resamples: draws of null distributions and of the bootstrap.
        refits: fits to data drawn without an effect whose gain is near the null.
    """

    candidates: Mapping[str, E]
    not_testable: Mapping[str, str] = {}
    bases: tuple[str, ...]
    reserve: tuple[str, ...] = ()
    most_effects: int = 4
    asks_reserve_first: bool = False
    forgives_rungs: bool = False
    rivals: int = 1
    trials: np.ndarray
    unit: str
    resamples: int = 999
    refits: int = 199

    @abstractmethod
    def fit(
        self, base: str, effects: tuple[E, ...], start: Mapping[str, Any] | None = None, effort: Effort = "full"
    ) -> F:
        """Fit all parameters to these data, from `start` where it has them.

        A "quick" fit is for ranking, and may use a part of the data; a "near" one is accurate enough for comparisons,
        and is repeated in "full" if it is chosen.
        """

    def fits(self, asked: Sequence[Asked]) -> list[F]:
        """Several fits, each as `fit` makes it from these arguments; a world may make them side by side."""
        return [self.fit(*one) for one in asked]

    def quick_gain(self, fitted: F, contenders: Sequence[F]) -> float:
        """Gain in nats of a quick fit over the best of the contenders, which lack its last effect."""
        return fitted.score - max(f.score for f in contenders)

    @abstractmethod
    def judge(self, fitted: F) -> J:
        """Judge a model that was fitted to other data."""

    @abstractmethod
    def cross_validate(self, fitted: F, folds: np.ndarray) -> J:
        """Judge each fold by a fit to the others; `folds` holds the fold of each trial."""

    def cross_validated(self, fits: Sequence[F], folds: np.ndarray) -> list[J]:
        """Several models, each judged as `cross_validate` does; a world may judge them side by side."""
        return [self.cross_validate(fitted, folds) for fitted in fits]

    @abstractmethod
    def slopes(self, fitted: F, candidates: Sequence[E]) -> Slopes:
        """Slopes of the fitted model and of the candidates."""

    def leaves_an_error(self, judged: J) -> bool:
        """Whether a model without the reserve errs by more than noise, so that a base of the reserve may be better."""
        return False

    def reserve_fits(self, fitted: F, refine: bool = False) -> list[F]:
        """Quick fits, with the effects of `fitted`, of the bases of the reserve that may explain a remaining error.

        All of them if `fitted` has such a base already.  To `refine` a fit that leaves no error: the base that is the
        same with the fewest approximations.
        """
        return []

    def errs_more(self, judged: J, than: J, settings: SearchSettings) -> bool:
        """Whether any error of a model exceeds another model's by an amount that matters, whatever their log scores."""
        return False

    def is_vetoed(self, judged: J, than: J, settings: SearchSettings) -> bool:
        """Whether the model with an effect errs more than without it, in a way that no other effect could correct."""
        return self.errs_more(judged, than, settings)

    def acting_on(self, judged: J, than: J, settings: SearchSettings) -> list[E]:
        """Candidates that change only those errors that exceed another model's by an amount that matters."""
        return []

    def leaves_little(self, fitted: F, judged: J, candidate: E) -> bool:
        """Whether a model errs by little more than noise where the candidate acts, so that its slope is enough."""
        return fitted.base in self.reserve

    @abstractmethod
    def is_material(self, better: J, worse: J, candidate: E, settings: SearchSettings) -> bool:
        """Whether the candidate lowers an error of its channels by an amount that matters."""

    def misjudged(self, candidate: E) -> bool:
        """Whether slopes and quick fits may miss what a candidate gains on a base of the reserve."""
        return False

    def turns_bases(self, candidate: E) -> bool:
        """Whether a base that is among the worst without the candidate may be the best with it."""
        return False

    def includes(self, candidate: str, other: str) -> bool:
        """Whether `other` is a special case of a candidate, which then is not an alternative to it."""
        return False

    def start_with(self, fitted: F, candidate: E) -> Mapping[str, Any]:
        """Start values for the fit with one more effect."""
        return fitted.values

    def values_of_base(self, fitted: F) -> Mapping[str, Any]:
        """Values of the parameters of a model's base, without those of its effects."""
        return {}

    def moved(self, fitted: F, before: F) -> float:
        """How much further a fit with one more effect has the other effects from their nulls, in squares of scales."""
        return 0.0

    def drawn(self, fitted: F, rng: np.random.Generator) -> Self | None:
        """Data drawn from the fitted model; None for linear fits, whose refits gain what the score test predicts."""
        return None
