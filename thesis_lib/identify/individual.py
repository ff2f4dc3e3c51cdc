"""Best parameters (μ_i, ε_i) of every single impact (thesis section 3.4, equations 3.8 and 3.9).

    (μ*, ε*) = argmin ‖c_irb − Model(μ, ε)‖   subject to   0 ≤ μ ≤ μ_s, 0 ≤ ε ≤ 1

μ_s, the lowest coefficient of friction beyond which the predicted impulse no longer changes (sticking), is found by
bisection (to a share of the impulse, `STUCK`); μ is unobservable above it.  The minimum is sought on a coarse grid
over the whole box, then on grids that shrink about the best point, all impacts at once; no gradient is needed, and
ties go to the lowest μ.
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.contact.law import Law
from thesis_lib.identify.cost import BLOCK, Metric, Target, misfit

MU_MAX = 2.0  # own choice: above the friction of dry solids, and above nearly every μ_s of the chapter's data
STUCK = 1e-3  # of the impulse: a change below a tenth of any measurement's noise; path-wise laws never stop changing
COARSE = 33  # points a side of the first grid
FINE = 7  # points a side of the shrinking grids; the box shrinks to a third each time
ROUNDS = 14  # leaves a box of 2 / 32 / 3^14 ≈ 1e-8 in μ


@dataclass(frozen=True)
class IndividualFit:
    """Best parameters of n impacts: mu, epsilon, error (n,) in the metric's unit, and mu_s (n,) at that ε."""

    mu: np.ndarray
    epsilon: np.ndarray
    error: np.ndarray
    mu_s: np.ndarray


def fit_individual(law: Law, target: Target, metric: Metric) -> IndividualFit:
    """Fit every impact by itself; an impact that the law never resolves gets NaN."""
    n = len(target)
    mu, epsilon, error = np.full(n, MU_MAX / 2.0), np.full(n, 0.5), np.empty(n)
    half = np.array([MU_MAX, 1.0]) / 2.0
    for points in (COARSE, *[FINE] * ROUNDS):
        width = max(1, BLOCK // points**2)
        for start in range(0, n, width):
            rows = slice(start, start + width)
            mu[rows], epsilon[rows], error[rows] = _best_on_grid(
                law, target[rows], metric, mu[rows], epsilon[rows], half, points
            )
        half = half * (2.0 / (points - 1))
    failed = ~np.isfinite(error)
    mu, epsilon, error = (np.where(failed, np.nan, a) for a in (mu, epsilon, error))
    mu_s = sticking_bound(law, target, epsilon)
    return IndividualFit(np.fmin(mu, mu_s), epsilon, error, mu_s)


def _best_on_grid(
    law: Law,
    target: Target,
    metric: Metric,
    mu: np.ndarray,
    epsilon: np.ndarray,
    half: np.ndarray,
    points: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best (μ, ε, error) of each impact on a grid of ± `half` about its present (μ, ε)."""
    n = len(target)
    offset = np.linspace(-1.0, 1.0, points)[:, None]
    mus = np.clip(mu + half[0] * offset, 0.0, MU_MAX)
    epsilons = np.clip(epsilon + half[1] * offset, 0.0, 1.0)
    # first axis μ, so that argmin over the flattened grid breaks ties in favour of the lowest μ
    errors = misfit(law, target, mus[:, None, :], epsilons[None, :, :], metric).reshape(points**2, n)
    errors = np.where(np.isnan(errors), np.inf, errors)
    best, columns = np.argmin(errors, axis=0), np.arange(n)
    return mus[best // points, columns], epsilons[best % points, columns], errors[best, columns]


def sticking_bound(law: Law, target: Target, epsilon: np.ndarray) -> np.ndarray:
    """μ_s (n,): lowest μ from which on the impulse is that at `MU_MAX` up to the share `STUCK`."""
    space = target.space
    with np.errstate(all="ignore"):
        final = law.impulse(space, np.full(len(target), MU_MAX), epsilon)
        scale = STUCK * np.hypot(*final)

        def sticks(mu: np.ndarray) -> np.ndarray:
            c_t, c_n = law.impulse(space, mu, epsilon)
            return np.hypot(c_t - final[0], c_n - final[1]) <= scale

        low, high = np.zeros(len(target)), np.full(len(target), MU_MAX)
        for _ in range(40):  # 2 / 2^40 ≈ 2e-12
            middle = 0.5 * (low + high)
            stuck = sticks(middle)
            low, high = np.where(stuck, low, middle), np.where(stuck, middle, high)
    return high
