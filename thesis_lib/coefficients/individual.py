"""Best parameters (μ_i, ε_i) for every single impact (thesis section 3.4, equations 3.8 and 3.9).

    (μ*, ε*) = argmin ‖c_irb − Model(μ, ε)‖   subject to   0 ≤ μ ≤ μ_s, 0 ≤ ε ≤ 1

μ_s is the friction coefficient above which the predicted impulse no longer changes (sticking), found by bisection (to
the share `STUCK` of the impulse); μ is unobservable above it.  Below it AP Poisson, Mirtich and Wang-Mason reach some
impulses with two pairs (μ, ε); of equally good pairs the pair with the lower μ is taken.

The misfit has kinks where slip ends, narrow slanted valleys near them and often several minima.  The search treats all
impacts at once:

1. profile: for each μ of a coarse grid (denser at low μ, where the outcomes are) the error of the best ε, measured to
   the chords between the impulses at neighbouring ε; its lowest minima are the starts;
2. the same about each start, on a denser grid;
3. pattern search: a small grid about the best point, and the solution of Model(μ, ε) = c_irb linearised about it; the
   better one is the next centre, and the grid shrinks once the best point lies inside it.

The search is our choice (the authors use a 20 × 20 grid and a gradient method from its best point).
"""

from dataclasses import dataclass

import numpy as np

from thesis_lib.coefficients.cost import BLOCK, MeasuredImpulses, Metric, misfit, misfit_of_impulse
from thesis_lib.contact.law import Law
from thesis_lib.mechanics.bisection import bisected

MU_MAX = 2.0  # our choice: above the friction of dry solids, and above nearly every μ_s of the chapter's data
STUCK = 1e-3  # of the impulse: below a tenth of any measurement's noise; path-wise laws never stop changing
COARSE = (65, 33)  # points in μ and ε of the first profile; with half of each, one impact in 300 misses its minimum
DENSE = (33, 9)  # points of the second profile, over two gaps of the first in μ and six in ε
STARTS = 2  # minima of the first profile that are followed
SAME = 1e-9  # of the misfit of zero impulse: smaller differences are rounding
FINE = 5  # points per side of the pattern, whose size halves
ROUNDS = 20  # leaves a pattern of 1e-9 in μ
STEPS = np.array([1.0, 0.5, 0.1])[:, None]  # shares of the linearised step to try, as the model has kinks


@dataclass(frozen=True)
class IndividualFit:
    """Best parameters of n impacts: mu, epsilon, error (n,) in the metric's unit, and mu_s (n,) at that ε."""

    mu: np.ndarray
    epsilon: np.ndarray
    error: np.ndarray
    mu_s: np.ndarray


def fit_individual(law: Law, target: MeasuredImpulses, metric: Metric) -> IndividualFit:
    """Fit (μ, ε) to each impact; an impact without a solution of the law gets NaN."""
    n = len(target)
    mu, epsilon, error = np.empty((STARTS, n)), np.empty((STARTS, n)), np.empty((STARTS, n))
    with np.errstate(all="ignore"):  # NaN marks impacts without a solution and loses every comparison
        for rows in _blocks(n, 2 * COARSE[0] * COARSE[1] // 5):
            mu[:, rows], epsilon[:, rows] = _starts(law, target[rows], metric)
        for start in range(STARTS):
            for rows in _blocks(n, DENSE[0] * DENSE[1]):
                mu[start, rows], epsilon[start, rows], error[start, rows] = _search(
                    law, target[rows], metric, mu[start, rows], epsilon[start, rows]
                )
    # of equal errors up to rounding, the lower μ: the choice must not depend on the last bit
    slack = SAME * misfit_of_impulse(target, 0.0, 0.0, metric)
    best = np.argmin(np.where(error <= error.min(axis=0) + slack, mu, np.inf), axis=0)
    mu, epsilon, error = (a[best, np.arange(n)] for a in (mu, epsilon, error))
    failed = ~np.isfinite(error)
    mu, epsilon, error = (np.where(failed, np.nan, a) for a in (mu, epsilon, error))
    mu_s = np.where(failed, np.nan, sticking_bound(law, target, epsilon))
    return IndividualFit(np.minimum(mu, mu_s), epsilon, error, mu_s)


def _blocks(n: int, each: int) -> list[slice]:
    """Rows in blocks for which arrays of `each` values per impact fit the cache."""
    width = max(1, BLOCK // each)
    return [slice(start, start + width) for start in range(0, n, width)]


def _profile(
    law: Law, target: MeasuredImpulses, metric: Metric, mu: np.ndarray, epsilon: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least error over ε and the ε that gives it, (I, n) each, for grids mu (I, n or 1) and epsilon (J, n or 1)."""
    shape = (len(mu), len(epsilon), len(target))
    c_t, c_n = (np.broadcast_to(a, shape) for a in law.impulse(target.space, mu[:, None], epsilon[None]))
    chord_t, chord_n = np.diff(c_t, axis=1), np.diff(c_n, axis=1)
    c_t, c_n = c_t[:, :-1], c_n[:, :-1]
    # foot of the perpendicular from the target on each chord, perpendicular in the metric
    across_t, across_n = chord_t, chord_n
    if metric == "velocity":
        space = target.space
        across_t = space.K_tt * chord_t + space.K_tn * chord_n
        across_n = space.K_tn * chord_t + space.K_nn * chord_n
    along = (target.c_t - c_t) * across_t + (target.c_n - c_n) * across_n
    share = np.clip(np.nan_to_num(along / (chord_t * across_t + chord_n * across_n)), 0.0, 1.0)
    errors = misfit_of_impulse(target, c_t + share * chord_t, c_n + share * chord_n, metric)
    errors = np.where(np.isnan(errors), np.inf, errors)
    chord = np.argmin(errors, axis=1)[:, None]
    grid = np.broadcast_to(epsilon[None], shape)
    low, high = (np.take_along_axis(grid, chord + i, axis=1)[:, 0] for i in (0, 1))
    error, share = (np.take_along_axis(a, chord, axis=1)[:, 0] for a in (errors, share))
    return error, low + share * (high - low)


def _starts(law: Law, target: MeasuredImpulses, metric: Metric) -> tuple[np.ndarray, np.ndarray]:
    """(μ, ε), (STARTS, n) each: the lowest minima over μ of the coarse profile; missing ones are arbitrary."""
    mu = MU_MAX * np.linspace(0.0, 1.0, COARSE[0])[:, None] ** 2
    epsilon = np.linspace(0.0, 1.0, COARSE[1])[:, None]
    error, epsilon = _profile(law, target, metric, mu, epsilon)
    beside = np.pad(error, ((1, 1), (0, 0)), constant_values=np.inf)
    # only the first point of a plateau (sticking) is a minimum
    lowest = (error < (1.0 - 1e-6) * beside[:-2]) & (error <= (1.0 + 1e-9) * beside[2:])
    order = np.argsort(np.where(lowest, error, np.inf), axis=0, kind="stable")[:STARTS]
    return mu[order, 0], np.take_along_axis(epsilon, order, axis=0)


def _search(
    law: Law, target: MeasuredImpulses, metric: Metric, mu: np.ndarray, epsilon: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best (μ, ε, error), (n,) each, of steps 2 and 3 from a start (n,)."""
    # a gap of the quadratic grid at μ = m (i/(N−1))² is m (2 i + 1)/(N−1)²
    i = np.rint(np.sqrt(mu / MU_MAX) * (COARSE[0] - 1))
    gap = MU_MAX * (2.0 * i + 1.0) / (COARSE[0] - 1) ** 2
    mus = np.clip(mu + gap * np.linspace(-1.0, 1.0, DENSE[0])[:, None], 0.0, MU_MAX)
    offset = np.linspace(-3.0, 3.0, DENSE[1])[:, None] / (COARSE[1] - 1)
    error, epsilons = _profile(law, target, metric, mus, np.clip(epsilon + offset, 0.0, 1.0))
    best, columns = np.argmin(error, axis=0), np.arange(len(target))
    mu, epsilon = mus[best, columns], epsilons[best, columns]
    half = 2.0 * gap / (DENSE[0] - 1), np.full(len(target), 1.0 / (COARSE[1] - 1))
    for _ in range(ROUNDS):
        mu, epsilon, error, inside = _round(law, target, metric, (mu, epsilon), half)
        half = tuple(h * np.where(inside, 2.0 / (FINE - 1), 1.0) for h in half)
    return mu, epsilon, error


def _round(
    law: Law, target: MeasuredImpulses, metric: Metric, point: tuple[np.ndarray, ...], half: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """One round of the pattern search: best (μ, ε, error), and whether the pattern may shrink, (n,) each."""
    columns = np.arange(len(target))
    offset = np.linspace(-1.0, 1.0, FINE)[:, None]
    mus = np.clip(point[0] + half[0] * offset, 0.0, MU_MAX)
    epsilons = np.clip(point[1] + half[1] * offset, 0.0, 1.0)
    shape = (FINE, FINE, len(target))
    c_t, c_n = (np.broadcast_to(a, shape) for a in law.impulse(target.space, mus[:, None], epsilons[None]))
    errors = misfit_of_impulse(target, c_t, c_n, metric).reshape(FINE**2, -1)
    errors = np.where(np.isnan(errors), np.inf, errors)
    # first axis μ, so that argmin over the flattened grid breaks ties in favour of the lowest μ
    best = np.argmin(errors, axis=0)
    i, j = best // FINE, best % FINE
    mu, epsilon, error = mus[i, columns], epsilons[j, columns], errors[best, columns]
    inside = ((i > 0) & (i < FINE - 1)) | (mu <= 0.0) | (mu >= MU_MAX)
    inside &= ((j > 0) & (j < FINE - 1)) | (epsilon <= 0.0) | (epsilon >= 1.0)

    # c(μ, ε) + A δ = c_irb, A from the neighbours on the grid
    i_0, i_1 = np.maximum(i - 1, 0), np.minimum(i + 1, FINE - 1)
    j_0, j_1 = np.maximum(j - 1, 0), np.minimum(j + 1, FINE - 1)
    d_mu, d_epsilon = mus[i_1, columns] - mus[i_0, columns], epsilons[j_1, columns] - epsilons[j_0, columns]
    A_tm, A_nm = ((c[i_1, j, columns] - c[i_0, j, columns]) / d_mu for c in (c_t, c_n))
    A_te, A_ne = ((c[i, j_1, columns] - c[i, j_0, columns]) / d_epsilon for c in (c_t, c_n))
    missing_t, missing_n = target.c_t - c_t[i, j, columns], target.c_n - c_n[i, j, columns]
    det = A_tm * A_ne - A_te * A_nm
    step_mu, step_epsilon = ((A_ne * missing_t - A_te * missing_n) / det, (A_tm * missing_n - A_nm * missing_t) / det)
    tried_mu = np.clip(mu + STEPS * step_mu, 0.0, MU_MAX)
    tried_epsilon = np.clip(epsilon + STEPS * step_epsilon, 0.0, 1.0)
    tried = misfit(law, target, tried_mu, tried_epsilon, metric)
    tried = np.where(np.isnan(tried), np.inf, tried)
    k = np.argmin(tried, axis=0)
    better = tried[k, columns] < error
    mu = np.where(better, tried_mu[k, columns], mu)
    epsilon = np.where(better, tried_epsilon[k, columns], epsilon)
    return mu, epsilon, np.where(better, tried[k, columns], error), inside | better


def sticking_bound(law: Law, target: MeasuredImpulses, epsilon: np.ndarray) -> np.ndarray:
    """μ_s (n,): lowest μ from which the impulse equals that at `MU_MAX` to within the share `STUCK`."""
    space = target.space
    with np.errstate(all="ignore"):
        final = law.impulse(space, np.full(len(target), MU_MAX), epsilon)
        scale = STUCK * np.hypot(*final)

        def sticks(mu: np.ndarray) -> np.ndarray:
            c_t, c_n = law.impulse(space, mu, epsilon)
            return np.hypot(c_t - final[0], c_n - final[1]) <= scale

        highest, lowest = np.full(len(target), MU_MAX), np.zeros(len(target))
        return bisected(sticks, highest, lowest, 40)[0]  # 2 / 2^40 ≈ 2e-12
