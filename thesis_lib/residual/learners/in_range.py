"""Whether an impact lies within the range of the training impacts.

    d(x) = mean distance of x to its K nearest training impacts,   x = (X1, ω) in their standard deviations
    x is in range  ⇔  d(x) ≤ d_q,   d_q = the q quantile of d over the training impacts, each without itself

Not the predictive variance: a process that learned a long length scale from a narrow range is certain far outside it.
Not a Mahalanobis distance: the inertia of the contact point follows a curve, and an unseen body angle can lie inside an
ellipsoid.  A share 1 − q of new impacts of the same kind is flagged.

Source: Ramaswamy, Rastogi and Shim 2000 (outliers by distance to nearest neighbours), doi:10.1145/335191.335437.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.residual.learners.features import features

NEIGHBOURS = 3  # with one, a single wild training impact would admit its neighbourhood
QUANTILE = 0.99  # flags one in a hundred ordinary impacts


@dataclass(frozen=True)
class TrainingRange:
    """Range of n training impacts: centre and scale (6,), standardised `points` (n, 6), and the `threshold` d_q."""

    centre: np.ndarray
    scale: np.ndarray
    points: np.ndarray
    threshold: float

    @classmethod
    def of(cls, impacts: Impacts, quantile: float = QUANTILE) -> "TrainingRange":
        """Range of training impacts; raises ValueError for fewer than two."""
        if len(impacts) < 2:
            raise ValueError("a range needs at least two impacts")
        x = features(impacts, "X1_omega")
        centre, scale = x.mean(axis=0), x.std(axis=0)
        scale = np.where(scale > 1e-12 * (1e-300 + np.abs(x).max(axis=0)), scale, 1.0)
        uncalibrated = cls(centre, scale, (x - centre) / scale, np.nan)
        distances = uncalibrated._nearest(uncalibrated.points, skip=1)
        return cls(centre, scale, uncalibrated.points, float(np.quantile(distances, quantile)))

    def distance(self, impacts: Impacts) -> np.ndarray:
        """Mean distance (n,) to the nearest training impacts, in standard deviations."""
        return self._nearest((features(impacts, "X1_omega") - self.centre) / self.scale, skip=0)

    def contains(self, impacts: Impacts) -> np.ndarray:
        """Mask (n,) of impacts within the range; predictions for the others are extrapolations."""
        return self.distance(impacts) <= self.threshold

    @cached_property
    def _tree(self) -> Any:
        return cKDTree(self.points)

    def _nearest(self, x: np.ndarray, skip: int) -> np.ndarray:
        count = min(NEIGHBOURS, len(self.points) - skip)
        distance, _ = self._tree.query(x, k=[*range(1 + skip, count + skip + 1)])
        return distance.mean(axis=1)
