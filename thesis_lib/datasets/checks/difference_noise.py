"""Noise of samples from their third differences; the impacts need not be known."""

import numpy as np

from thesis_lib.datasets.format.samples import Samples
from thesis_lib.statistics.spread import MAD_TO_STD


def noise_from_differences(samples: Samples) -> np.ndarray:
    """Robust noise (3,) of x, y, θ (m, m, rad) from third differences of equally spaced samples; NaN without any.

    Third differences remove a parabola; the few across impacts do not move the median.  Exact zeros (a body at rest,
    logged with few digits) say nothing about the noise in flight and are dropped.
    """
    same = (samples.run[3:] == samples.run[:-3]) if len(samples) > 3 else np.zeros(0, bool)
    third = np.abs(np.diff(samples.q, n=3, axis=0))[same]
    scale = MAD_TO_STD / np.sqrt(20.0)  # the variance of (1, −3, 3, −1) is 20 σ²
    columns = [column[column > 0] for column in third.T]
    return np.array([scale * np.median(c) if len(c) else np.nan for c in columns])
