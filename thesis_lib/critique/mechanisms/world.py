"""Equations of motion of a mechanism as input of the search: one base model, forces as candidates, windows as data.

With z (N,) the window equations of `windows`, U = -∂z/∂p (N, n_p) and unit noise,

    p̂ = argmin |z(0) - U p|²,    cov p̂ = (U'U)⁻¹,    log score = -|z|²/2 + const.

Stated sensor errors (`sensors`) are fitted with every model.  Their priors add rows p / σ_p = 0 ± 1, which belong to
no trial.  Their remaining uncertainty increases the noise of windows to which they were not fitted; these windows are
judged one after the other, each conditional on the previous ones:

    S = I + U_s cov(p̂_s) U_s' = L L',      z → L⁻¹ z,      log score = -|L⁻¹ z|²/2 - log |L| + const.

Two kinds of force are not linear in their parameters: the direction of gravity, and effects that need contact forces,
which depend on the other effects.  So the linear fit is repeated, each time about the last values.  The rest is linear:
parameters of a fold follow from the full fit, and refits achieve the gain that the score test predicts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2

from thesis_lib.critique.mechanisms.effects import MechanismEffect, MotionSteps
from thesis_lib.critique.mechanisms.windows import WeakForm
from thesis_lib.critique.selection.scan import RANK
from thesis_lib.critique.selection.settings import SearchSettings
from thesis_lib.critique.selection.world import Effort, Slopes, World
from thesis_lib.statistics.bootstrap import central_95, draw_counts

BASE = "believed"
ROUNDS = 3  # linear fits
DETERMINED = 0.5  # ratio of posterior to prior variance below which the data determine a sensor error


@dataclass(frozen=True)
class ForceFit:
    """Effects fitted to the window equations of a set of trials.

    Attributes:
        values, std: by effect and sensor error, (n_p,) parameters and standard errors.
        z: (N,) whitened residual with the effects.
        columns: (N, sum n_p) U, with the columns of sensor errors first.
        sensors: stated errors of sensors, fitted with the effects.
    """

    effects: tuple[MechanismEffect, ...]
    values: dict[str, np.ndarray]
    std: dict[str, np.ndarray]
    z: np.ndarray
    columns: np.ndarray
    sensors: tuple[MechanismEffect, ...] = ()
    base: str = BASE

    @property
    def forces(self) -> tuple[MechanismEffect, ...]:
        """Sensor errors and effects, in the order of `columns`."""
        return (*self.sensors, *self.effects)

    @property
    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (n,) of the priors, and their `columns` (n, sum n_p)."""
        return _prior(self.forces, self.values)

    @property
    def score(self) -> float:
        """Log score in nats, up to a constant."""
        own = self.prior[0]
        return float(-0.5 * (self.z @ self.z + own @ own))


@dataclass(frozen=True)
class ForceJudgement:
    """Whitened residuals z (N,) of the windows `weak` under a model fitted to other windows.

    `spread` (N,) is the predicted standard deviation of each row, given the rows before it, over its noise alone.
    """

    z: np.ndarray
    weak: WeakForm
    spread: np.ndarray

    @property
    def trials(self) -> np.ndarray:
        return np.unique(self.weak.trial)

    @property
    def units(self) -> int:
        return len(self.weak.starts)

    @property
    def total(self) -> float:
        return float(-0.5 * (self.z @ self.z) - np.log(self.spread).sum())

    def by_trial(self, trials: np.ndarray) -> np.ndarray:
        score = 0.5 * self.z**2 + np.log(self.spread)
        return -np.bincount(self.weak.trial, score, minlength=trials[-1] + 1)[trials]

    @property
    def misfit(self) -> float:
        """Root mean square of z, 1 if only noise is left."""
        return float(np.sqrt(np.mean(self.z**2)))

    def misfit_interval(self, draws: int, rng: np.random.Generator) -> tuple[float, float, float]:
        """Return the misfit with its 95 % interval, from the bootstrap over trials."""
        trials = self.trials
        squares = np.bincount(self.weak.trial, self.z**2)[trials]
        rows = np.bincount(self.weak.trial)[trials]
        counts = draw_counts(len(trials), draws, rng)
        return self.misfit, *central_95(np.sqrt((counts @ squares) / (counts @ rows)))


class MechanismWorld(World[MechanismEffect, ForceFit, ForceJudgement]):
    """Window equations of trials, and the candidate forces that they may lack."""

    unit = "window"
    bases = (BASE,)

    def __init__(
        self,
        weak: WeakForm,
        candidates: Sequence[MechanismEffect],
        resamples: int,
        sensors: Sequence[MechanismEffect] = (),
    ) -> None:
        self.weak, self.resamples, self.sensors = weak, resamples, tuple(sensors)
        self.candidates = {e.name: e for e in candidates}
        self.trials = np.arange(weak.trials)
        self._fits: dict[tuple[str, ...], ForceFit] = {}

    def fit(
        self,
        base: str,
        effects: tuple[MechanismEffect, ...],
        start: Mapping[str, np.ndarray] | None = None,
        effort: Effort = "full",
    ) -> ForceFit:
        names = tuple(e.name for e in effects)
        if names not in self._fits:
            self._fits[names] = fit_effects(self.weak, effects, self.sensors)
        return self._fits[names]

    def judge(self, fitted: ForceFit) -> ForceJudgement:
        return predict(self.weak, fitted)

    def cross_validate(self, fitted: ForceFit, folds: np.ndarray) -> ForceJudgement:
        z, spread = fitted.z.copy(), np.ones(len(fitted.z))
        fold = folds[self.weak.trial]
        own, units = fitted.prior
        n = units.shape[0]
        for k in np.unique(folds):
            inside, others = fold == k, fold != k
            U, known = (np.concatenate(parts) for parts in ((fitted.columns[others], units), (fitted.z[others], own)))
            rest = z[inside] - fitted.columns[inside] @ _solve(U, known)
            z[inside], spread[inside] = _widened(rest, fitted.columns[inside, :n], _covariance(U)[:n, :n])
        return ForceJudgement(z, self.weak, spread)

    def slopes(self, fitted: ForceFit, candidates: Sequence[MechanismEffect]) -> Slopes:
        found = _columns(self.weak, candidates, fitted.forces, fitted.values)
        columns = dict(zip([e.name for e in candidates], found))
        own, units = fitted.prior
        columns = {name: np.concatenate([U, np.zeros((len(own), U.shape[1]))]) for name, U in columns.items()}
        z, U = np.concatenate([fitted.z, own]), np.concatenate([fitted.columns, units])
        return Slopes(z, U, columns, unit_noise=True)

    def is_material(
        self, better: ForceJudgement, worse: ForceJudgement, candidate: MechanismEffect, settings: SearchSettings
    ) -> bool:
        return settings.matters(worse.misfit, better.misfit, 1.0)

    def errs_more(self, judged: ForceJudgement, than: ForceJudgement, settings: SearchSettings) -> bool:
        return settings.matters(judged.misfit, than.misfit, 1.0)


def fit_effects(
    weak: WeakForm, effects: Sequence[MechanismEffect], sensors: Sequence[MechanismEffect] = ()
) -> ForceFit:
    """Fit all parameters of `effects` and of `sensors` to `weak`."""
    forces = (*sensors, *effects)
    values = {e.name: np.zeros(len(e.parameters)) for e in forces}
    std: dict[str, np.ndarray] = {}
    ends = np.cumsum([len(e.parameters) for e in forces])[:-1]
    z, U = weak.residual(total_force(weak, forces, values)), np.zeros((len(weak.trial), 0))
    for _ in range(ROUNDS if forces else 0):
        U = np.concatenate(_columns(weak, forces, forces, values), axis=1)
        own, units = _prior(forces, values)
        both = np.concatenate([U, units])
        change, spread = _solve(both, np.concatenate([z, own])), np.sqrt(np.diag(np.linalg.pinv(both.T @ both)))
        for e, step, error in zip(forces, np.split(change, ends), np.split(spread, ends)):
            values[e.name], std[e.name] = values[e.name] + step, error
        z = weak.residual(total_force(weak, forces, values))
    return ForceFit(tuple(effects), values, std, z, U, tuple(sensors))


def _prior(forces: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals -p / σ_p of the priors of `forces`, and their columns, one for each parameter of any force."""
    sigma = np.array([sigma for e in forces for sigma in e.prior])
    own = np.concatenate([np.zeros(0), *(values[e.name] for e in forces if e.prior)])
    # only sensor errors have priors, and their columns come first
    return -own / sigma, np.eye(len(sigma), sum(len(e.parameters) for e in forces)) / sigma[:, None]


def predict(weak: WeakForm, fitted: ForceFit) -> ForceJudgement:
    """Judge a model on windows to which it was not fitted."""
    z = weak.residual(total_force(weak, fitted.forces, fitted.values))
    _, units = fitted.prior
    if not len(units):
        return ForceJudgement(z, weak, np.ones(len(z)))
    U = np.concatenate(_columns(weak, fitted.sensors, (), {}), axis=1)
    cov = _covariance(np.concatenate([fitted.columns, units]))[: len(units), : len(units)]
    z, spread = _widened(z, U, cov)
    return ForceJudgement(z, weak, spread)


def sensor_excess(fitted: ForceFit) -> tuple[float, float]:
    """Return the rms of fitted sensor errors over the value expected from the stated errors, and the p-value.

    In directions that the data determine, p̂ has covariance S₀ - C, prior minus posterior; |p̂|² in these units is χ².
    """
    own, units = fitted.prior
    if not len(own):
        return 0.0, 1.0
    C = _covariance(np.concatenate([fitted.columns, units]))[: len(own), : len(own)]
    scale = units.max(axis=1)  # 1 / σ_p
    share, directions = np.linalg.eigh(scale[:, None] * C * scale)  # posterior over prior variance
    known = share < DETERMINED
    if not known.any():
        return 0.0, 1.0
    squares = (directions.T @ own)[known] ** 2 / (1.0 - share[known])
    return float(np.sqrt(squares.mean())), float(chi2.sf(squares.sum(), max(known.sum(), 1)))


def _covariance(U: np.ndarray) -> np.ndarray:
    return np.linalg.pinv(U.T @ U, hermitian=True)


def _widened(z: np.ndarray, U: np.ndarray, cov: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return L⁻¹ z and the diagonal of L, for parameters with columns U (N, n) and covariance `cov`."""
    if not U.shape[1]:
        return z, np.ones(len(z))
    L = np.linalg.cholesky(np.eye(len(z)) + U @ cov @ U.T)
    return solve_triangular(L, z, lower=True), np.diag(L)


def total_force(weak: WeakForm, effects: Sequence[MechanismEffect], values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the force (n, nv) in N or N m of `effects` at `values`, with the contact forces that they cause."""

    def of(motion: MotionSteps) -> np.ndarray:
        return sum((e.force(weak.model, motion, values[e.name]) for e in effects), np.zeros_like(weak.f))

    force = of(weak.motion)
    return of(weak.with_normals(force)) if any(e.needs_normal for e in effects) else force


def _columns(
    weak: WeakForm,
    asked: Sequence[MechanismEffect],
    effects: Sequence[MechanismEffect],
    values: Mapping[str, np.ndarray],
) -> list[np.ndarray]:
    """Return U (N, n_p) of each effect `asked`: change of -z per unit of its parameters, with `effects` acting."""
    found, with_contact = [], weak.motion
    if any(e.needs_normal for e in asked):  # other effects do not need the contact forces, and cost less
        with_contact = weak.with_normals(total_force(weak, effects, values))
    for e in asked:
        none = np.zeros(len(e.parameters))
        if e.prior:  # linear and independent of contact forces, so independent of all other forces
            if e.name not in weak.columns:
                weak.columns[e.name] = _slopes(weak, e, weak.motion, none)
            found.append(weak.columns[e.name])
        else:
            found.append(_slopes(weak, e, with_contact, values.get(e.name, none)))
    return found


def _slopes(weak: WeakForm, effect: MechanismEffect, motion: MotionSteps, here: np.ndarray) -> np.ndarray:
    """Return U (N, n_p) at the parameters `here`."""
    base = effect.force(weak.model, motion, here)
    slopes = [
        (effect.force(weak.model, motion, here + p.scale * unit) - base) / p.scale
        for p, unit in zip(effect.parameters, np.eye(len(here)))
    ]
    return weak.gathered(np.stack(slopes, axis=2))


def _solve(U: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Solve the least-squares problem with columns scaled to unit norm."""
    scale = np.linalg.norm(U, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(U / scale, z, rcond=RANK)[0] / scale
