"""Straight lines through the samples on either side of many impacts at once.

Of W samples around an impact, `side` (n, 2, W) is 1 for those used before and after it, else 0.  The line of a side
without samples is 0, with spread 0; callers look at `count` and `spread`.
"""

from dataclasses import dataclass

import numpy as np


def rank(side: np.ndarray) -> np.ndarray:
    """Rank 1, 2, … of the used samples (n, 2, W), counted away from the impact on either side."""
    return np.stack([np.cumsum(side[:, 0, ::-1], 1)[:, ::-1], np.cumsum(side[:, 1], 1)], 1)


def norm(a: np.ndarray) -> np.ndarray:
    """Euclidean norm of `a` (..., d) over its last axis: (...)."""
    return np.sqrt(np.sum(a * a, axis=-1))


@dataclass(frozen=True)
class Lines:
    """Least-squares lines through C channels on both sides of n impacts."""

    value: np.ndarray  # value, slope: (n, 2, C) at τ = 0, and per s
    slope: np.ndarray
    count: np.ndarray  # count, mean, spread: (n, 2) number, mean time (s) and Σ(τ − mean)² (s²) of the samples used
    mean: np.ndarray
    spread: np.ndarray
    residual: np.ndarray  # (n, 2, W, C) of all samples, used or not


def lines_through(side: np.ndarray, tau: np.ndarray, q: np.ndarray) -> Lines:
    """Lines through q (n, W, C) over tau (n, W) on each side; `side` (n, 2, W) is 1 for the samples used."""
    count = side.sum(2)
    safe = np.maximum(count, 1.0)
    mean = np.einsum("nsw,nw->ns", side, tau) / safe
    centred = (tau[:, None, :] - mean[..., None]) * side
    spread = (centred**2).sum(2)
    level = (side @ q) / safe[..., None]
    slope = (centred @ q) / np.where(spread > 0, spread, 1.0)[..., None]
    value = level - slope * mean[..., None]
    residual = q[:, None] - value[:, :, None] - slope[:, :, None] * tau[:, None, :, None]
    return Lines(value, slope, count, mean, spread, residual)
