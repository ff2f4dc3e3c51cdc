"""A mechanism's equations of motion as a world for the search: one base, forces as candidates, windows as data.

With z (N,) the window equations of `windows`, U = -∂z/∂p (N, n_p) and unit noise,

    p̂ = argmin |z(0) - U p|²,    cov p̂ = (U'U)⁻¹,    log score = -|z|²/2 + const.

The direction of gravity is not linear in its parameter, nor are effects that need contact forces, which depend on the
other effects.  So the linear fit is repeated, each time at the last values.  All else is linear: parameters of a fold
follow from the full fit, and refits gain what the score test predicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from thesis_lib.critique.mechanisms.effects import MechanismEffect
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.selection.scan import RANK
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Slopes, World
from thesis_lib.statistics.bootstrap import central_95, draw_counts

BASE = "believed"
ROUNDS = 3  # linear fits


@dataclass(frozen=True)
class ForceFit:
    """Effects fitted to the window equations of a set of trials.

    Attributes:
        values, std: by effect, (n_p,) parameters and standard errors.
        z: (N,) whitened residual with the effects.
        columns: (N, sum n_p) U.
    """

    effects: tuple[MechanismEffect, ...]
    values: dict[str, np.ndarray]
    std: dict[str, np.ndarray]
    z: np.ndarray
    columns: np.ndarray
    base: str = BASE

    @property
    def score(self) -> float:
        """Log score in nats, up to a constant."""
        return float(-0.5 * (self.z @ self.z))


@dataclass(frozen=True)
class ForceJudgement:
    """Whitened residuals z (N,) of the windows `weak` under a model fitted to other windows."""

    z: np.ndarray
    weak: WeakForm

    @property
    def trials(self) -> np.ndarray:
        return np.unique(self.weak.trial)

    @property
    def units(self) -> int:
        return len(self.weak.starts)

    @property
    def total(self) -> float:
        return float(-0.5 * (self.z @ self.z))

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
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
        return ForceJudgement(residual(self.weak, fitted.effects, fitted.values), self.weak)

    def cross_validate(self, fitted: ForceFit, folds: np.ndarray) -> ForceJudgement:
        z = fitted.z.copy()
        fold = folds[self.weak.trial]
        for k in np.unique(folds):
            inside, others = fold == k, fold != k
            z[inside] -= fitted.columns[inside] @ _solve(fitted.columns[others], fitted.z[others])
        return ForceJudgement(z, self.weak)

    def slopes(self, fitted: ForceFit, candidates: Sequence[MechanismEffect]) -> Slopes:
        columns = {e.name: _columns(self.weak, e, fitted.effects, fitted.values) for e in candidates}
        return Slopes(fitted.z, fitted.columns, columns, unit_noise=True)

    def is_material(
        self, better: ForceJudgement, worse: ForceJudgement, candidate: MechanismEffect, settings: SearchSettings
    ) -> bool:
        return settings.matters(worse.misfit, better.misfit, 1.0)


def fit_effects(weak: WeakForm, effects: Sequence[MechanismEffect]) -> ForceFit:
    """Fit all parameters of `effects` to `weak`."""
    values = {e.name: np.zeros(len(e.parameters)) for e in effects}
    std: dict[str, np.ndarray] = {}
    ends = np.cumsum([len(e.parameters) for e in effects])[:-1]
    z, U = residual(weak, effects, values), np.zeros((len(weak.trial), 0))
    for _ in range(ROUNDS if effects else 0):
        U = np.concatenate([_columns(weak, e, effects, values) for e in effects], axis=1)
        change, spread = _solve(U, z), np.sqrt(np.diag(np.linalg.pinv(U.T @ U)))
        for e, step, error in zip(effects, np.split(change, ends), np.split(spread, ends)):
            values[e.name], std[e.name] = values[e.name] + step, error
        z = residual(weak, effects, values)
    return ForceFit(tuple(effects), values, std, z, U)


def residual(weak: WeakForm, effects: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]) -> np.ndarray:
    """z (N,) of `weak` with `effects` at `values`."""
    return weak.residual(total_force(weak, effects, values))


def total_force(weak: WeakForm, effects: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Force (n, nv) in N or N m of `effects` at `values`, with the contact forces that they cause."""
    force = np.zeros_like(weak.f)
    for _ in range(2 if any(e.needs_normal for e in effects) else 1):
        motion = weak.with_normals(force)
        force = sum((e.force(weak.model, motion, values[e.name]) for e in effects), np.zeros_like(weak.f))
    return force


def _columns(
    weak: WeakForm, effect: MechanismEffect, effects: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]
) -> np.ndarray:
    """U (N, n_p): change of -z per unit of each parameter, with `effects` at `values` already acting."""
    motion = weak.with_normals(total_force(weak, effects, values))
    here = values.get(effect.name, np.zeros(len(effect.parameters)))
    base = effect.force(weak.model, motion, here)
    slopes = [
        (effect.force(weak.model, motion, here + p.scale * unit) - base) / p.scale
        for p, unit in zip(effect.parameters, np.eye(len(here)))
    ]
    return weak.gathered(np.stack(slopes, axis=2))


def _solve(U: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Least squares with columns of unit norm."""
    scale = np.linalg.norm(U, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(U / scale, z, rcond=RANK)[0] / scale
