"""Bootstrap intervals: independent units (trials, throws, pushes) are resampled with replacement.

An interval is the central 95 % of the resampled values (the percentile bootstrap).  For statistics made of sums over
trials, it suffices to count how often each trial is drawn.

Source: B. Efron and R. J. Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13,
doi:10.1007/978-1-4899-4541-9.
"""

from collections.abc import Callable

import numpy as np

CENTRAL_95 = (0.025, 0.975)


def central_95(values: np.ndarray) -> tuple[float, float]:
    """Ends of the central 95 % of resampled values (B,)."""
    low, high = np.quantile(values, CENTRAL_95)
    return float(low), float(high)


def draw_counts(n: int, draws: int, rng: np.random.Generator) -> np.ndarray:
    """Number of times that each of n trials is drawn in each resampling, (draws, n); rows sum to n."""
    return rng.multinomial(n, np.full(n, 1.0 / n), size=draws)


def bootstrap_mean(values: np.ndarray, trial: np.ndarray, draws: int, rng: np.random.Generator) -> tuple[float, float]:
    """95 % interval of the mean of `values` (n,), in their unit; only values of different `trial` are independent."""
    trials, index = np.unique(trial, return_inverse=True)
    total, count = np.bincount(index, values), np.bincount(index).astype(float)
    counts = draw_counts(len(trials), draws, rng)
    return central_95((counts @ total) / (counts @ count))


def bootstrap_gain(gain: np.ndarray, n: int, draws: int, rng: np.random.Generator) -> tuple[float, float, float]:
    """Gain per case, the sum of the gains of trials (T,) divided by n cases in all, and its 95 % interval."""
    low, high = central_95(draw_counts(len(gain), draws, rng) @ gain / n)
    return float(gain.sum() / n), low, high


def resampled(
    values: np.ndarray, statistic: Callable[[np.ndarray], float], draws: int, rng: np.random.Generator
) -> np.ndarray:
    """A statistic of `values` (n, ...) with independent rows, in each resampling: (draws,)."""
    rows = rng.integers(len(values), size=(draws, len(values)))
    return np.array([statistic(values[drawn]) for drawn in rows])
