"""A mechanism's equations of motion as a world for the search: one base, forces as candidates, windows as data.

The log score is that of unit noise, −|z|²/2 + const.  Fits are linear except in the direction of gravity.
So parameters of a fold follow from the full fit, and refits gain what the score test predicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.effects import MechanismEffect
from thesis_lib.critique.mechanisms.fit import BASE, ForceFit, columns_of, fit_effects, solve, total_force
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Slopes, World
from thesis_lib.statistics.bootstrap import central_95, draw_counts


@dataclass(frozen=True)
class ForceJudgement:
    """Whitened residuals z (N,) of the windows `weak` under a model fitted to other windows."""

    z: np.ndarray
    weak: WeakForm

    @property
    def trials(self) -> np.ndarray:
        """Numbers of the trials with a window, ascending."""
        return np.unique(self.weak.trial)

    @property
    def units(self) -> int:
        """Number of windows."""
        return len(self.weak.starts)

    @property
    def total(self) -> float:
        """Log score in nats."""
        return float(-0.5 * (self.z @ self.z))

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        """Log score in nats of each of `trials`."""
        return -0.5 * np.bincount(self.weak.trial, self.z**2, minlength=trials[-1] + 1)[trials]

    @property
    def misfit(self) -> float:
        """Root mean square of z, 1 if noise alone is left."""
        return float(np.sqrt(np.mean(self.z**2)))

    def misfit_interval(self, draws: int, rng: np.random.Generator) -> tuple[float, float, float]:
        """Misfit with its 95 % interval, from the bootstrap over trials."""
        trials = self.trials
        squares = np.bincount(self.weak.trial, self.z**2)[trials]
        rows = np.bincount(self.weak.trial)[trials]
        counts = draw_counts(len(trials), draws, rng)
        return self.misfit, *central_95(np.sqrt((counts @ squares) / (counts @ rows)))


class Windows(World[MechanismEffect, ForceFit, ForceJudgement]):
    """Window equations of trials, and the forces that they may lack."""

    unit = "window"
    bases = (BASE,)

    def __init__(self, weak: WeakForm, candidates: Sequence[MechanismEffect], resamples: int) -> None:
        self.weak, self.resamples = weak, resamples
        self.candidates = {e.name: e for e in candidates}
        self.trials = np.arange(weak.trials)
        self._fits: dict[tuple[str, ...], ForceFit] = {}

    def fit(
        self,
        base: str,
        effects: tuple[MechanismEffect, ...],
        start: Mapping[str, np.ndarray] | None = None,
        *,
        quick: bool = False,
    ) -> ForceFit:
        names = tuple(e.name for e in effects)
        if names not in self._fits:
            self._fits[names] = fit_effects(self.weak, effects)
        return self._fits[names]

    def judge(self, fitted: ForceFit) -> ForceJudgement:
        return ForceJudgement(applied(self.weak, fitted), self.weak)

    def cross_validate(self, fitted: ForceFit, folds: np.ndarray) -> ForceJudgement:
        z = fitted.z.copy()
        fold = folds[self.weak.trial]
        for k in np.unique(folds):
            inside, others = fold == k, fold != k
            z[inside] -= fitted.columns[inside] @ solve(fitted.columns[others], fitted.z[others])
        return ForceJudgement(z, self.weak)

    def slopes(self, fitted: ForceFit, candidates: Sequence[MechanismEffect]) -> Slopes:
        columns = {e.name: columns_of(self.weak, e, fitted.effects, fitted.values) for e in candidates}
        return Slopes(fitted.z, fitted.columns, columns, unit_noise=True)

    def is_material(
        self, better: ForceJudgement, worse: ForceJudgement, candidate: MechanismEffect, settings: SearchSettings
    ) -> bool:
        return settings.matters(worse.misfit, better.misfit, 1.0)


def applied(weak: WeakForm, fitted: ForceFit) -> np.ndarray:
    """z (N,) of `weak` with the effects as fitted."""
    return weak.residual(total_force(weak, fitted.effects, fitted.values))
