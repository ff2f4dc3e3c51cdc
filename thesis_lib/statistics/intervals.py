"""Shares, means and medians with their standard errors and 95 % intervals.

| on paper | in code | unit | shape |                                                                        |
|----------|---------|------|-------|------------------------------------------------------------------------|
| k of n   | `k`, `n` | 1   |       | counted cases, and all cases                                           |
| p        | `share` | 1    |       | observed share k/n                                                     |
| s        | `std`   | 1    |       | standard error of a share: half the width of Wilson's interval for z = 1 |

Wilson's interval of a share is

    (k + z²/2 ± z √(k (n − k)/n + z²/4)) / (n + z²)          scipy.stats has it too, but takes a second to import

The usual standard error √(p (1 − p)/n) takes the observed share for the true one, and is 0 at p = 0: no impact out of
800 would then exclude a true share of 0.001.  There Wilson's s is 1/(2 (n + 1)); elsewhere it equals the usual one up
to 1/n.

Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927), doi:10.1080/01621459.1927.10502953.
"""

import math

import numpy as np

Z95 = 1.959963984540054  # half the width of a normal distribution's 95 % interval, in standard deviations


def wilson(k: float, n: float, z: float = Z95) -> tuple[float, float]:
    """Wilson's interval of a share of `k` in `n` for `z` standard errors, by default 95 %; (NaN, NaN) for n = 0."""
    if n == 0:
        return math.nan, math.nan
    centre = k + 0.5 * z**2
    half = z * math.sqrt(k * (n - k) / n + 0.25 * z**2)
    return max(0.0, (centre - half) / (n + z**2)), min(1.0, (centre + half) / (n + z**2))


def wilson_std(share: float, n: int) -> float:
    """Standard error of a share observed in n cases (n ≥ 1)."""
    low, high = wilson(share * n, n, z=1.0)
    return 0.5 * (high - low)


def share_of(cases: np.ndarray) -> tuple[float, float]:
    """Share of ones among zeros and ones (n,), NaN ignored, and its standard error; ValueError if all are NaN."""
    cases = np.asarray(cases, float)
    cases = cases[np.isfinite(cases)]
    if not len(cases):
        raise ValueError("a share needs at least one case that is not NaN")
    share = float(cases.mean())
    return share, wilson_std(share, len(cases))


def mean_of(values: np.ndarray) -> tuple[float, float]:
    """Mean of the finite values (n,) and its standard error, in their unit; the error of a single value is NaN."""
    values = values[np.isfinite(values)]
    return float(values.mean()), standard_error(values)


def standard_error(values: np.ndarray) -> float:
    """Standard error of the mean of `values` (n,), in their unit; NaN for a single value."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else math.nan


def student_mean(values: np.ndarray) -> tuple[float, float, float]:
    """Mean of independent normal values (n,) and its 95 % interval by Student's t; NaN bounds for a single value."""
    from scipy.special import stdtrit

    mean = float(np.mean(values))
    half = float(stdtrit(max(len(values) - 1, 1), 0.975)) * standard_error(values)
    return mean, mean - half, mean + half


def mean_row(values: np.ndarray) -> tuple[float, float, float, float, int]:
    """Mean of independent normal values (n,) as in a table: mean, standard error, 95 % interval by Student's t, n."""
    mean, low, high = student_mean(values)
    return mean, standard_error(values), low, high, len(values)


def clustered_mean(values: np.ndarray, trial: np.ndarray) -> tuple[float, float, float]:
    """Mean of `values` (n,) and its 95 % interval, in their unit; only values of different `trial` are independent.

    From the linearised variance of Σ_t s_t / Σ_t n_t, with s_t the sum and n_t the number of values of trial t.  NaN
    without values; NaN bounds for a single trial.
    """
    values, trial = np.asarray(values, float), np.asarray(trial)
    if not len(values):
        return math.nan, math.nan, math.nan
    mean = float(values.mean())
    _, label = np.unique(trial, return_inverse=True)
    off = np.bincount(label, values - mean)
    m = len(off)
    if m < 2:
        return mean, math.nan, math.nan
    half = Z95 * np.sqrt(m / (m - 1) * np.sum(off**2)) / len(values)
    return mean, float(mean - half), float(mean + half)


def median_interval(values: np.ndarray) -> tuple[float, float]:
    """95 % interval of the median of `values` (n,) from order statistics; their range if there are fewer than six."""
    from scipy.stats import binom

    ordered = np.sort(values)
    # the number of values below the median is binomial (n, 1/2)
    k = max(int(binom.ppf(0.025, len(ordered), 0.5)) - 1, 0)
    return float(ordered[k]), float(ordered[len(ordered) - 1 - k])


def ratio_of_means(above: np.ndarray, below: np.ndarray) -> tuple[float, float]:
    """Mean of `above` (n,) over mean of `below` (m,), independent samples of positive values, and its standard error.

    NaN if either has fewer than two values, or if the mean of `below` is 0.
    """
    if min(np.isfinite(above).sum(), np.isfinite(below).sum()) < 2:
        return math.nan, math.nan
    (a, a_std), (b, b_std) = mean_of(above), mean_of(below)
    if b == 0.0:
        return math.nan, math.nan
    return a / b, float(np.hypot(a_std, a / b * b_std)) / b
