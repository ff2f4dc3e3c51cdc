"""Tails and quantiles of common distributions, and a robust line, without the half second that scipy.stats takes.

scipy.special and numpy have all that is needed; the tests compare with scipy.stats.

Sources: P. K. Sen, J. Am. Stat. Assoc. 63 (1968), doi:10.1080/01621459.1968.10480934 (line and its interval).
"""

import numpy as np
from scipy import special

from thesis_lib.statistics.intervals import Z95


def normal_tail(z: float) -> float:
    """Chance that a standard normal variable is above z."""
    return float(special.ndtr(-z))


def chi_square_tail(x: float, k: int) -> float:
    """Chance that χ² with k degrees of freedom is above x; 1 for k = 0."""
    return float(special.chdtrc(k, x)) if k else 1.0


def chi_square_quantile(share: np.ndarray, k: int) -> np.ndarray:
    """Below which lies the `share` (n,) of χ² with k degrees of freedom."""
    return 2.0 * special.gammaincinv(0.5 * k, share)


def f_tail(x: float, k: int, rest: int) -> float:
    """Chance that F with k and `rest` degrees of freedom is above x."""
    return float(special.fdtrc(k, rest, x))


def binomial_tail(count: int, n: int, p: float) -> float:
    """Chance of at least `count` of n cases of chance p each."""
    return float(special.bdtrc(count - 1, n, p)) if count else 1.0


def theil_sen(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """Slope of a line through points (n,), the median of the slopes of all pairs, with the ends of its 95 % interval.

    n is at least 3; few values of x or y are equal.
    """
    i, j = np.triu_indices(len(x), 1)
    i, j = i[x[i] != x[j]], j[x[i] != x[j]]
    slopes = np.sort((y[j] - y[i]) / (x[j] - x[i]))
    n, pairs = len(x), len(slopes)
    half = Z95 * np.sqrt(n * (n - 1) * (2 * n + 5) / 18.0)  # of Kendall's S
    low, high = max(round((pairs - half) / 2.0) - 1, 0), min(round((pairs + half) / 2.0), pairs - 1)
    return float(np.median(slopes)), float(slopes[low]), float(slopes[high])
