"""Fit all parameters of a model under the measured noise, and score it.

    log score of an impact   log t_ν(R; 0, S),   Student's t with ν = 8 in m dimensions
    log score of a flight    the same in 3 dimensions

The t distribution limits the influence of single impacts; for Gaussian residuals it loses 2 % of efficiency.  The fit
is iteratively reweighted Gauss-Newton (Levenberg-Marquardt) on whitened residuals, with weights (ν + m)/(ν + d²).  At
fixed S this maximises the likelihood; S and σ_m are updated between rounds.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import gammaln
from scipy.stats import chi2

from thesis_lib.critique.drops.covariance import residual_covariance
from thesis_lib.critique.drops.model import Model, inward
from thesis_lib.critique.drops.observations import Observations
from thesis_lib.critique.drops.residuals import flight_residuals, impact_residuals, states_at_impact
from thesis_lib.effects.effect import Effect, State

NU = 8.0
ROUNDS = 3  # of S, σ_m and weights; the third moves parameters by less than a tenth of their standard error
STEPS = 12  # Levenberg-Marquardt steps per round
SLOPE_STEP = 1e-3  # of a parameter's scale: finite differences
SHAPES = 2  # of an effect's shapes that are fitted, the best by their score tests
ENOUGH = 1e-3  # nats; a round ends below this gain per step, a twentieth of a standard error
ENOUGH_SINGLE = 30  # single hits that a first fit takes alone
# of the likelihood, over that of a normal one: the floor for tails heavier than Student's t
LEAST_CURVATURE = 0.1
SIGMA_LOW, SIGMA_HIGH = 1e-5, 3.0  # m/s, range of σ_m


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        values, std: by full parameter name.
        covariance: (p, p) of the parameters in their order.
        sigma_m: scatter beyond noise, m/s.
        score: log score of the training data, nats; n: number of impacts.
    """

    model: Model
    values: dict[str, float]
    std: dict[str, float]
    covariance: np.ndarray
    sigma_m: float
    score: float
    n: int

    @property
    def base(self) -> str:
        """Name of the law."""
        return self.model.law.name

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Effects in the order of selection."""
        return self.model.effects


class Whitening:
    """Whitened residuals of a model at fixed S and σ_m.

    Flights and states at impact are cached until one of their parameters changes.
    """

    def __init__(self, model: Model, observations: Observations, S: np.ndarray, sigma_m: float) -> None:
        self.model, self.observations, self.sigma_m = model, observations, sigma_m
        L = np.linalg.cholesky(S + _scatter(observations, sigma_m))
        self._inverse = np.linalg.inv(L)
        self._log_det = 2.0 * np.log(np.einsum("nii->ni", L)).sum(1)
        self._kept: tuple | None = None

    @classmethod
    def at(cls, model: Model, values: Mapping[str, float], observations: Observations) -> "Whitening":
        """With the covariance and the most probable σ_m of the model at `values`."""
        S = residual_covariance(model, values, observations)
        return cls(model, observations, S, _best_sigma(model, values, observations, S))

    def __call__(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """Whitened residuals of impacts (n, m) and flights (f, 3)."""
        model, o = self.model, self.observations
        key = [values[name] for name in model.flight_parameters]
        if self._kept is None or self._kept[0] != key:
            f = flight_residuals(model, values, o.flights, o.rig) / np.sqrt(o.flights.variance)
            self._kept = key, states_at_impact(model, values, o), f
        _, states, f = self._kept
        R = impact_residuals(model, values, o, states)
        return (self._inverse @ R[:, :, None])[:, :, 0], f

    def stacked(self, values: Mapping[str, float]) -> np.ndarray:
        """All whitened residuals as one vector (N,), impacts first."""
        return np.concatenate([part.ravel() for part in self(values)])

    def log_scores(self, values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
        """Log score in nats of each impact (n,) and each flight (f,)."""
        z, f = self(values)
        return _log_t(z, self._log_det), _log_t(f, np.log(self.observations.flights.variance).sum(1))


def fit(
    model: Model, observations: Observations, start: Mapping[str, float] | None = None, rounds: int = ROUNDS
) -> Fit:
    """Fit all parameters from `start` (nulls if absent) and from every start that the last effect declares or finds."""
    tries = [dict(start or {})]
    if model.effects:
        effect = model.effects[-1]
        if not any(key.startswith(f"{effect.name}.") for key in tries[0]):
            tries = _best_shapes(model, observations, tries[0]) or tries
        for p in effect.parameters:
            key = f"{effect.name}.{p.name}"
            if p.discrete is not None:
                tries = [{**t, key: p.discrete} for t in tries]
            elif key not in tries[0]:
                # off the null, where many effects have no slope
                either_side = (p.null + p.scale, p.null - p.scale)
                options = p.starts[:2] or either_side[: 2 if p.low < p.null < p.high else 1]
                tries = [{**t, key: float(np.clip(x, p.low, p.high))} for t in tries for x in options]
    if "mu" not in tries[0]:
        # single hits find the basin: an episode is far from linear while (μ, ε) are far off
        simple = observations.single if len(observations.single) >= ENOUGH_SINGLE else observations
        tries = [t | basin for t in tries for basin in _basins(model, simple, t)]
        best = max((_fit_from(model, simple, t, 1) for t in tries), key=lambda fitted: fitted.score)
        return _fit_from(model, observations, best.values, rounds)
    return max((_fit_from(model, observations, t, rounds) for t in tries[:4]), key=lambda fitted: fitted.score)


def _best_shapes(model: Model, observations: Observations, start: Mapping[str, float]) -> list[dict[str, float]]:
    """Starts at the best of the last effect's `shapes`, with its other parameters as in their score test; [] if none.

    `start` without (μ, ε) stands for the fit without that effect.
    """
    effect, o = model.effects[-1], observations
    shapes = effect.shapes(State.of(o.value[:, 0], o.slope[:, 0], o.trial, o.t), o.rig)
    if not shapes:
        return []
    smaller = replace(model, effects=model.effects[:-1])
    if "mu" not in start:
        start = fit(smaller, o, start, rounds=1).values
    at = {name: p.null for name, p in model.parameters.items()} | dict(start)
    whitening = Whitening.at(model, at, o)
    here = whitening(at)

    def column(values: Mapping[str, float], name: str, step: float) -> np.ndarray:
        moved = whitening({**values, name: values[name] + step})
        return np.concatenate([(_weight(z) * (m - z) / step).ravel() for z, m in zip(here, moved)])

    residual = np.concatenate([(_weight(z) * z).ravel() for z in here])
    free = smaller.fitted_parameters.items()
    fitted = [column(at, name, inward(p, at[name], SLOPE_STEP * p.scale)) for name, p in free]
    sizes = {f"{effect.name}.{p.name}": p for p in effect.parameters if p.name not in shapes[0]}
    found = []
    for shape in shapes:
        values = at | {f"{effect.name}.{name}": value for name, value in shape.items()}
        A = np.stack(fitted + [column(values, name, p.scale) for name, p in sizes.items()], axis=1)
        x = np.linalg.lstsq(A, -residual, rcond=None)[0]
        best = {
            name: float(np.clip(p.null + d, p.low, p.high)) for (name, p), d in zip(sizes.items(), x[len(fitted) :])
        }
        found.append((float(np.sum((residual + A @ x) ** 2)), values | best))
    return [values for _, values in sorted(found, key=lambda pair: pair[0])[:SHAPES]]


def _fit_from(model: Model, observations: Observations, start: dict[str, float], rounds: int) -> Fit:
    values = {name: float(start.get(name, p.null)) for name, p in model.parameters.items()}
    free = model.fitted_parameters
    low, high = (np.array([getattr(p, bound) for p in free.values()]) for bound in ("low", "high"))
    step = np.array([SLOPE_STEP * p.scale for p in free.values()])
    x = np.clip([values[name] for name in free], low, high)
    for _ in range(rounds):
        values |= dict(zip(free, map(float, x)))
        whitening = Whitening.at(model, values, observations)

        def residuals(x: np.ndarray) -> np.ndarray:
            return np.concatenate([_robust(z).ravel() for z in whitening({**values, **dict(zip(free, x))})])  # noqa: B023

        x = _levenberg_marquardt(residuals, x, low, high, step)
    values |= dict(zip(free, map(float, x)))
    whitening = Whitening.at(model, values, observations)
    score, flight_score = whitening.log_scores(values)
    covariance = _covariance(whitening, values)
    std = dict.fromkeys(values, 0.0) | dict(zip(free, np.sqrt(np.diag(covariance)).tolist()))
    total = float(score.sum() + flight_score.sum())
    return Fit(model, values, std, covariance, whitening.sigma_m, total, len(observations))


def _levenberg_marquardt(
    residuals: Callable[[np.ndarray], np.ndarray], x: np.ndarray, low: np.ndarray, high: np.ndarray, step: np.ndarray
) -> np.ndarray:
    """Minimise |residuals(x)|² over x (p,) within the bounds `low`, `high`; `step` (p,): finite differences."""
    r = residuals(x)
    cost, damping = r @ r, 1e-3
    J = np.zeros((len(r), len(x)))
    for _ in range(STEPS):
        for i in range(len(x)):
            h = step[i] if x[i] + step[i] <= high[i] else -step[i]
            moved = x.copy()
            moved[i] += h
            J[:, i] = (residuals(moved) - r) / h
        JtJ, g = J.T @ J, J.T @ r
        for _ in range(6):
            # keep parameters at a bound if their step leaves the box
            held = ((x <= low) & (g > 0)) | ((x >= high) & (g < 0))
            move = ~held
            d = np.zeros_like(x)
            if not move.any():
                return x
            H = JtJ[np.ix_(move, move)]
            d[move] = -np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-12), g[move], rcond=None)[0]
            new = np.clip(x + d, low, high)
            r_new = residuals(new)
            cost_new = r_new @ r_new
            if cost_new < cost:
                break
            damping *= 10.0
        else:
            return x
        gain = cost - cost_new
        x, r, cost, damping = new, r_new, cost_new, max(damping / 10.0, 1e-8)
        if gain < ENOUGH:
            return x
    return x


def _covariance(whitening: Whitening, values: Mapping[str, float]) -> np.ndarray:
    """Sandwich covariance (p, p) of the fitted parameters, as of an M-estimator.

    With weights w = (ν + m)/(ν + d²) of the likelihood's gradient and J the Jacobian of the whitened residuals,

        H⁻¹ B H⁻¹,   H = Σ a JᵀJ,  a = ⟨w + 2 w' d²/m⟩,   B = Σ b JᵀJ,  b = ⟨w² d²/m⟩

    summed over impacts and flights, with the mean ⟨⟩ over each.  For normal residuals this is 1.02 times the Cramér-Rao
    bound.  Residuals larger than S predicts widen it; smaller ones do not narrow it.
    """
    here = whitening(values)
    columns: list[list[np.ndarray]] = [[], []]
    free = whitening.model.fitted_parameters
    for name, p in free.items():
        h = inward(p, values[name], SLOPE_STEP * p.scale)
        for part, moved, base in zip(columns, whitening({**values, name: values[name] + h}), here):
            part.append((moved - base).ravel() / h)
    H, B = np.zeros((2, len(free), len(free)))
    for part, z in zip(columns, here):
        if not len(z):
            continue
        J, m = np.stack(part, axis=1), z.shape[1]
        normal = _curvature_and_variance(chi2.ppf((np.arange(2000) + 0.5) / 2000, m), m)
        measured = _curvature_and_variance(np.einsum("nm,nm->n", z, z), m)
        a, b = max(measured, normal, key=lambda pair: pair[1] / pair[0] ** 2)
        information = J.T @ J
        H += a * information
        B += b * information
    # scaled by the information of each parameter, so that units do not matter
    unit = np.sqrt(np.diag(H))
    unit = np.outer(unit, unit) + (unit == 0.0) + (unit == 0.0)[:, None]
    inverse = np.linalg.pinv(H / unit, hermitian=True) / unit
    return inverse @ B @ inverse


def _curvature_and_variance(d2: np.ndarray, m: int) -> tuple[float, float]:
    """a and b of `_covariance` from d² (n,) in m dimensions."""
    w = (NU + m) / (NU + d2)
    a = max(float(np.mean(w - 2.0 * w / (NU + d2) * d2 / m)), LEAST_CURVATURE)
    return a, float(np.mean(w * w * d2 / m))


def _robust(z: np.ndarray) -> np.ndarray:
    """Residuals with the sum of squares −2 log t_ν up to a constant."""
    m = z.shape[1]
    d2 = np.einsum("nm,nm->n", z, z)
    scale = (NU + m) * np.log1p(d2 / NU) / np.where(d2 > 0, d2, 1.0)
    return z * np.sqrt(np.where(d2 > 0, scale, 1.0))[:, None]


def _weight(z: np.ndarray) -> np.ndarray:
    """Square roots (n, 1) of the t distribution's weights, for whitened residuals (n, m)."""
    return np.sqrt((NU + z.shape[1]) / (NU + np.einsum("nm,nm->n", z, z)))[:, None]


def _log_t(z: np.ndarray, log_det: np.ndarray) -> np.ndarray:
    m = z.shape[1]
    d2 = np.einsum("nm,nm->n", z, z)
    constant = gammaln(0.5 * (NU + m)) - gammaln(0.5 * NU) - 0.5 * m * np.log(NU * np.pi)
    return constant - 0.5 * log_det - 0.5 * (NU + m) * np.log1p(d2 / NU)


def _scatter(observations: Observations, sigma_m: float) -> np.ndarray:
    """σ_m² D (m, m); with episodes (n, m, m): the velocity after their first hit scatters, and moves the pose."""
    variance = np.zeros(7 if observations.arcs else 3)
    variance[:3] = sigma_m**2, sigma_m**2, (sigma_m / observations.rig.k_g) ** 2
    scatter, span = np.diag(variance), observations.span
    if not span.any():
        return scatter
    scatter = np.tile(scatter, (len(span), 1, 1))
    for i in range(3):
        scatter[:, 3 + i, 3 + i] = span**2 * variance[i]
        scatter[:, i, 3 + i] = scatter[:, 3 + i, i] = span * variance[i]
    return scatter


def _best_sigma(model: Model, values: Mapping[str, float], observations: Observations, S: np.ndarray) -> float:
    R = impact_residuals(model, values, observations)

    def loss(log_sigma: float) -> float:
        L = np.linalg.cholesky(S + _scatter(observations, np.exp(log_sigma)))
        z = np.linalg.solve(L, R[:, :, None])[:, :, 0]
        return -_log_t(z, 2.0 * np.log(np.einsum("nii->ni", L)).sum(1)).sum()

    bounds = (np.log(SIGMA_LOW), np.log(SIGMA_HIGH))
    best = minimize_scalar(loss, bounds=bounds, method="bounded", options={"xatol": 0.05})
    return float(np.exp(best.x))


def _basins(model: Model, observations: Observations, start: Mapping[str, float]) -> list[dict[str, float]]:
    """Starts (μ, ε): the best on a grid in the kinetic norm, and others with less friction, where more impacts slide.

    The cost is the mean over the better 90 % of the impacts.  A median would ignore μ if more than half of them stick,
    and no step leads back from a μ at which all stick.
    """
    values = {name: p.null for name, p in model.parameters.items()} | dict(start)
    k = observations.rig.k_g

    def cost(mu: float, epsilon: float) -> float:
        R = impact_residuals(model, {**values, "mu": mu, "epsilon": epsilon}, observations)[:, :3]
        error = np.sort(np.abs(R[:, 0]) + np.abs(R[:, 1]) + k * np.abs(R[:, 2]))
        return float(error[: max(1, round(0.9 * len(error)))].mean())

    grid = product((0.02, 0.05, 0.1, 0.2, 0.4, 0.8), (0.2, 0.4, 0.6, 0.8))
    mu, epsilon = min(grid, key=lambda pair: cost(*pair))
    mu = min((mu * 2.0 ** (i / 4.0) for i in range(-4, 5)), key=lambda finer: cost(finer, epsilon))
    return [{"mu": factor * mu, "epsilon": epsilon} for factor in (1.0, 0.5, 0.2)]


def cramer_rao(model: Model, true: Mapping[str, float], observations: Observations) -> dict[str, float]:
    """Cramér-Rao bound on the std of each parameter, by name.

    The Fisher information is JᵀJ of the whitened residuals at the true values, with measured noise and no scatter.
    """
    whitening = Whitening(model, observations, residual_covariance(model, true, observations), SIGMA_LOW)
    free, columns = model.fitted_parameters, []
    for name, p in free.items():
        h = SLOPE_STEP * p.scale
        up, down = (whitening.stacked({**true, name: true[name] + step}) for step in (h, -h))
        columns.append((up - down) / (2.0 * h))
    J = np.stack(columns, axis=1)
    return dict(zip(free, np.sqrt(np.diag(np.linalg.pinv(J.T @ J, hermitian=True))).tolist()))
