"""Permutation test of whether residual generalised forces depend on coordinates or velocities.

A feature f is the mean of a coordinate or velocity over a window.  Its range is cut into eight quantile cells.  Its
strength is the sum of squares of the whitened residuals z between cells, summed over the free coordinates,

    S_f = Σ_coordinates Σ_cells (Σ_cell z)² / n_cell.

The null permutes the windows.  Strengths are standardised by their null; p refers to the maximum over features.
"""

import numpy as np

from thesis_lib.critique.mechanisms.windows import WeakForm

BINS = 8
PERMUTATIONS = 199


def window_means(weak: WeakForm, values: np.ndarray) -> np.ndarray:
    """Mean (windows, j) of values (n, j) over each window."""
    counts = np.diff(np.append(weak.starts, len(values)))
    return np.add.reduceat(values, weak.starts, axis=0) / counts[:, None]


def dependence(weak: WeakForm, z: np.ndarray, alpha: float, rng: np.random.Generator) -> tuple[tuple[str, ...], float]:
    """At most three coordinates and velocities ("d" + name) that z (N,) depends on, and the least p-value."""
    names = [f"{prefix}{name}" for prefix in ("", "d") for name in weak.model.coordinates]
    features = window_means(weak, np.concatenate([weak.motion.q, weak.motion.v], axis=1))
    cells = np.stack([np.searchsorted(np.quantile(f, np.linspace(0, 1, BINS + 1)[1:-1]), f) for f in features.T])
    rows = [np.flatnonzero(weak.coordinate == c) for c in np.unique(weak.coordinate)]

    def strengths(permuted: np.ndarray) -> np.ndarray:
        sums = np.zeros(len(cells))
        for r in rows:
            cells_of_rows = cells[:, permuted[weak.window[r]]]
            for j, cell in enumerate(cells_of_rows):
                n = np.maximum(np.bincount(cell, minlength=BINS), 1)
                sums[j] += np.sum(np.bincount(cell, z[r], minlength=BINS) ** 2 / n)
        return sums

    measured = strengths(np.arange(len(features)))
    null = np.array([strengths(rng.permutation(len(features))) for _ in range(PERMUTATIONS)])
    # standardised by its null, so that the maximum treats all features alike
    centre, width = null.mean(axis=0), null.std(axis=0)
    score, best = (measured - centre) / width, ((null - centre) / width).max(axis=1)
    p = (1 + (best[:, None] >= score).sum(axis=0)) / (1 + len(best))
    ranked = [int(j) for j in np.argsort(-score) if p[j] <= alpha]
    return tuple(names[j] for j in ranked[:3]), float(p.min())
