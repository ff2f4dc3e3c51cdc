"""Spread of normal values with a few outliers, from the median of their magnitudes.

    σ = median |x| / Φ⁻¹(3/4) = 1.4826 median |x|        for x ~ N(0, σ²)

Values with another mean are centred by the caller, on their median.  A quarter of the values may be outliers on either
side before σ becomes unbounded.

Source: F. R. Hampel, Journal of the American Statistical Association 69 (1974) 383,
doi:10.1080/01621459.1974.10482962.
"""

from statistics import NormalDist

import numpy as np

MAD_TO_STD = 1.482602218505602  # 1/Φ⁻¹(3/4)
OF_MEDIAN = 1.17  # relative standard error of such a spread of n normal values, times √n
MEDIAN = 1.2533  # standard error of a median over that of a mean, of normal errors


def robust_std(values: np.ndarray, axis: int | None = 0) -> np.ndarray:
    """Standard deviation of `values` about zero along `axis` (None: of all), in their unit; NaN without values."""
    return MAD_TO_STD * np.median(np.abs(values), axis=axis)


def robust_mean(values: np.ndarray) -> tuple[float, float]:
    """Median of `values` (n,) and its standard error for normal errors, from their robust spread."""
    median = float(np.median(values))
    return median, float(MEDIAN * robust_std(values - median) / np.sqrt(len(values)))


def quantile_std(values: np.ndarray, share: float, axis: int | None = 0) -> np.ndarray:
    """Standard deviation of `values` about zero from the quantile `share` of their magnitudes, in their unit.

    With share = 1/2 this is `robust_std`; at 0.9 it includes a minority of large values that a median ignores.
    """
    return np.quantile(np.abs(values), share, axis=axis) / NormalDist().inv_cdf(0.5 * (1.0 + share))


def median_error(values: np.ndarray) -> float:
    """Standard error of the median of normal values (n,)."""
    return float(MEDIAN * np.std(values, ddof=1) / np.sqrt(len(values)))
