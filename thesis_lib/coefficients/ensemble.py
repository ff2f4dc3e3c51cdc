"""Ensemble parameters (μ, ε): one pair for many impacts (thesis section 3.4, figure 3-7, table 3.1).

The cost is the sum of the misfits of the single impacts ("we simply sum up the cost function").  A zooming grid
minimises it: the misfit of every impact at every grid point gives a table (G, n), and the box shrinks to the
neighbourhood of the best points.  Standard errors come from the bootstrap over *trials*, whose replicates are weights
on the same table: all replicates zoom together until their spread fills the box.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from thesis_lib.coefficients.cost import MeasuredImpulses, Metric, misfit_table
from thesis_lib.contact.law import Law
from thesis_lib.statistics.bootstrap import draw_counts

MU_MAX = 1.0  # our choice: three times the friction of an inclined-plane test; a fit that ends here is reported
GRID = 21  # points per side
CELLS = 5_000_000  # of the table in memory at a time: 40 MB
TOLERANCE = 1e-6  # width of the final box in μ and ε: far below any standard error


@dataclass(frozen=True)
class EnsembleFit:
    """Ensemble parameters with bootstrap standard errors."""

    mu: float
    mu_std: float
    epsilon: float
    epsilon_std: float
    cost: float  # mean misfit in the metric's unit
    n: int
    n_failed: int
    at_bound: tuple[str, ...]  # parameters at the edge of their box, whose standard errors are then meaningless

    def columns(self) -> dict[str, Any]:
        """A table row, with `at_bound` as text."""
        return asdict(self) | {"at_bound": ";".join(self.at_bound)}


def fit_ensemble(
    law: Law,
    target: MeasuredImpulses,
    metric: Metric,
    *,
    trials: np.ndarray | None = None,
    bootstrap: int = 0,
    rng: np.random.Generator | None = None,
    tolerance: float = TOLERANCE,
) -> EnsembleFit:
    """Best common (μ, ε) of n measured impacts; standard errors from `bootstrap` replicates, which need `rng`.

    `trials` (n,), the trial of each impact, is the unit of the bootstrap; without it, each impact by itself.  The
    search ends in a box as wide as `tolerance`.
    Raises a ValueError without impacts, or for a bootstrap without rng.
    """
    n = len(target)
    if n == 0:
        raise ValueError("there are no impacts to identify from")
    (best,), cost, n_failed = _zoom(law, target, metric, np.ones((n, 1)), tolerance)
    std = np.full(2, np.nan)
    if bootstrap:
        if rng is None:
            raise ValueError("the bootstrap needs rng")
        # how often each impact counts in each replicate (n, B): trials are drawn with replacement
        _, unit = np.unique(np.arange(n) if trials is None else trials, return_inverse=True)
        weights = draw_counts(unit.max() + 1, bootstrap, rng).T[unit].astype(float)
        replicates, _, _ = _zoom(law, target, metric, weights)
        std = replicates.std(axis=0, ddof=1) if bootstrap > 1 else std
    edges = {"mu": (best[0], 0.0, MU_MAX), "epsilon": (best[1], 0.0, 1.0)}
    at_bound = tuple(k for k, (x, low, high) in edges.items() if min(x - low, high - x) <= 2 * tolerance)
    (mu, epsilon), (mu_std, epsilon_std) = best.tolist(), std.tolist()
    return EnsembleFit(mu, mu_std, epsilon, epsilon_std, cost, n, n_failed, at_bound)


def _zoom(
    law: Law, target: MeasuredImpulses, metric: Metric, weights: np.ndarray, tolerance: float = TOLERANCE
) -> tuple[np.ndarray, float, int]:
    """Minima of the costs for each column of `weights`: best points (B, 2); mean cost and failures of the first."""
    low, high = np.zeros(2), np.array([MU_MAX, 1.0])
    limits = low.copy(), high.copy()
    for _ in range(30):
        mu, epsilon = np.linspace(low[0], high[0], GRID), np.linspace(low[1], high[1], GRID)
        costs, failures = _costs(law, target, metric, np.repeat(mu, GRID), np.tile(epsilon, GRID), weights)
        best = np.argmin(costs, axis=0)
        points = np.stack([mu[best // GRID], epsilon[best % GRID]], axis=1)
        cell = (high - low) / (GRID - 1)
        new_low = np.maximum(points.min(axis=0) - cell, limits[0])
        new_high = np.minimum(points.max(axis=0) + cell, limits[1])
        shrunk = np.all(new_high - new_low > 0.7 * (high - low))
        low, high = new_low, new_high
        if np.all(high - low <= tolerance) or shrunk:
            break
    first = best[0]
    return points, float(costs[first, 0] / weights[:, 0].sum()), int(failures[first])


def _costs(
    law: Law, target: MeasuredImpulses, metric: Metric, mu: np.ndarray, epsilon: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Weighted misfits (G, B) at the points mu, epsilon (G,), and numbers (G,) of impacts without a solution.

    Such impacts get the largest misfit, so that a failure does not favour a parameter.
    """
    costs, failures, missing, worst = [], [], [], 0.0
    rows = max(1, CELLS // len(target))
    for start in range(0, len(mu), rows):
        part = slice(start, start + rows)
        table = misfit_table(law, target, mu[part], epsilon[part], metric)
        failed = np.isnan(table)
        failures.append(failed.sum(axis=1))
        if failed.any():
            worst = max(worst, float(np.nanmax(table)))
            table = np.where(failed, 0.0, table)
        missing.append(failed @ weights if failed.any() else np.zeros((len(table), weights.shape[1])))
        costs.append(table @ weights)
    return np.concatenate(costs) + worst * np.concatenate(missing), np.concatenate(failures)
