"""Calibration of predictions: coverage, PIT (probability integral transform) and CRPS, with intervals.

For a scalar y predicted by samples y_1 … y_M:

    PIT        u = (#{y_i < y} + U (#{y_i = y} + 1))/(M + 1),  U uniform;  uniform if the prediction is right
    coverage   share of outcomes with |u − 1/2| ≤ level/2     (central regions)
    CRPS       mean |y_i − y| − mean |y_i − y_j|/2            (same unit as y; |y − ŷ| for a point prediction)

For a vector with a Gaussian prediction N(m, S) in d dimensions, u = χ²_d(z), z² = (y − m)ᵀ S⁻¹ (y − m), and the region
of a level is the ellipsoid u ≤ level.  Held-out outcomes of one trial are dependent, so intervals of coverage are from
a bootstrap over trials.  A level passes if |coverage − level| is at most `MARGIN` or the interval contains the level.

Source: Gneiting and Raftery 2007, doi:10.1198/016214506000001437.
"""

import numpy as np
import pandas as pd
from scipy.stats import binom, chi2, f

from thesis_lib.statistics.bootstrap import central_95, resampled

LEVELS = (0.5, 0.8, 0.95)
MARGIN = 0.03
REPLICATES = 1000  # of the bootstrap
BINS = 10  # of a histogram


def pit_of_samples(outcome: np.ndarray, samples: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """PIT (n,) of outcomes (n,) under samples (n, M)."""
    below = (samples < outcome[:, None]).sum(1)
    equal = (samples == outcome[:, None]).sum(1)
    return (below + rng.uniform(size=len(outcome)) * (equal + 1)) / (samples.shape[1] + 1)


def pit_of_gaussian(away: np.ndarray, cov: np.ndarray) -> np.ndarray:
    """Probability u (n,) by χ² of the smallest region with the outcome; its error `away` (n, d) is ~ N(0, cov)."""
    z2 = np.einsum("ni,ni->n", away, np.linalg.solve(cov, away[..., None])[..., 0])
    return chi2.cdf(z2, away.shape[1])


def pit_of_student(away: np.ndarray, freedom: float) -> np.ndarray:
    """Likewise for (outcome − mean)/standard deviation (n, d) under Student's t with uncorrelated coordinates."""
    d = away.shape[1]
    square = (away**2).sum(1)
    if np.isinf(freedom):
        return chi2.cdf(square, d)
    return f.cdf(square * freedom / (freedom - 2.0) / d, d, freedom)


def crps(outcome: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Continuous ranked probability score (n,) of outcomes (n,) under samples (n, M), in their unit; low is good."""
    ordered = np.sort(samples, axis=1)
    m = ordered.shape[1]
    # mean |y_i − y_j|/2 = Σ_i (2 i − m − 1) y_(i)/m²
    pairs = ordered @ (2.0 * np.arange(1, m + 1) - m - 1) / m**2
    return np.abs(samples - outcome[:, None]).mean(1) - pairs


def coverage_table(pit: np.ndarray, groups: np.ndarray, rng: np.random.Generator, *, central: bool) -> pd.DataFrame:
    """Table of the coverage of the regions of `LEVELS`: level, coverage, low, high, passes (1 or 0), n, left_out.

    NaN values of `pit` (n,) are excluded and counted.  `central` is True for a scalar's PIT (regions about the median),
    False for χ² probabilities.  `groups` (n,) are the trials that the bootstrap of the interval resamples.
    """
    kept = np.isfinite(pit)
    inside = 2.0 * np.abs(pit[kept] - 0.5) if central else pit[kept]
    _, index = np.unique(groups[kept], return_inverse=True)
    rows = []
    for level in LEVELS:
        hit = inside <= level
        n = len(hit)
        share, low, high = float(hit.mean()) if n else np.nan, np.nan, np.nan
        if n:
            by_group = np.stack([np.bincount(index, weights=hit), np.bincount(index)], axis=1)
            low, high = central_95(resampled(by_group, lambda drawn: np.divide(*drawn.sum(axis=0)), REPLICATES, rng))
        passes = abs(share - level) <= MARGIN or low <= level <= high
        rows.append((level, share, low, high, int(passes), n, int((~kept).sum())))
    return pd.DataFrame(rows, columns=["level", "coverage", "low", "high", "passes", "n", "left_out"])


def pit_histogram(pit: np.ndarray) -> pd.DataFrame:
    """Histogram of PITs in `BINS` equal bins with the 95 % band of a calibrated prediction: pit, share, low, high."""
    u = pit[np.isfinite(pit)]
    count, edges = np.histogram(u, BINS, (0.0, 1.0))
    n = max(len(u), 1)
    low, high = binom.ppf([0.025, 0.975], n, 1.0 / BINS) / n
    return pd.DataFrame({"pit": 0.5 * (edges[1:] + edges[:-1]), "share": count / n, "low": low, "high": high})
