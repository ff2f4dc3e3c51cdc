"""A share of n impacts and its standard error, which stays above zero where none or all of them count.

| on paper | in code | unit | shape |                                                   |
|----------|---------|------|-------|---------------------------------------------------|
| p        | `share` | 1    |       | observed share                                    |
| s        | `std`   | 1    |       | half the width of Wilson's interval for one sigma |

    s = √(p (1 − p)/n + 1/(4 n²)) / (1 + 1/n)

The usual √(p (1 − p)/n) takes the observed share for the true one, and is 0 at p = 0: no impact out of 800 would then
rule out a true share of a thousandth.  Wilson's s is 1/(2 (n + 1)) there, and the usual one elsewhere up to 1/n.

Source: Wilson, J. Am. Stat. Assoc. 22 (1927), doi:10.1080/01621459.1927.10502953.
"""

import numpy as np


def wilson_std(share: float, n: int) -> float:
    """Standard error of a share observed in n cases (n ≥ 1)."""
    return float(np.sqrt(share * (1.0 - share) / n + 0.25 / n**2) / (1.0 + 1.0 / n))


def share_of(cases: np.ndarray) -> tuple[float, float]:
    """Share of ones among n zeros and ones, and its standard error; NaN (no answer) is left out.

    Raises:
        ValueError: nothing is left.
    """
    cases = np.asarray(cases, float)
    cases = cases[np.isfinite(cases)]
    if not len(cases):
        raise ValueError("there are no cases to take a share of")
    share = float(cases.mean())
    return share, wilson_std(share, len(cases))


def mean_of(values: np.ndarray) -> tuple[float, float]:
    """Mean of the finite values and its standard error."""
    values = values[np.isfinite(values)]
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values)))


def ratio_of_means(above: np.ndarray, below: np.ndarray) -> tuple[float, float]:
    """Mean of `above` over mean of `below`, independent samples of positive values, and its standard error.

    NaN where one of them has fewer than two values, or the mean of `below` is 0.
    """
    if min(np.isfinite(above).sum(), np.isfinite(below).sum()) < 2:
        return float("nan"), float("nan")
    (a, a_std), (b, b_std) = mean_of(above), mean_of(below)
    if b == 0.0:
        return float("nan"), float("nan")
    return a / b, float(np.hypot(a_std, a / b * b_std)) / b
