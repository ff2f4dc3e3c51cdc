"""Smoothing for figures: densities that respect a boundary, and local means over a plane.

    f̂(x) = 1/(n h) Σ_i [φ((x − x_i)/h) + φ((x − 2a + x_i)/h) + φ((x − 2b + x_i)/h)]     for a ≤ x ≤ b

The last two terms reflect the mass that a Gaussian kernel would leak past the boundaries a and b, so the density
integrates to one inside; without them a density of errors would seem to fall towards zero.  h follows Silverman's rule,
0.9 min(σ, IQR/1.34) n^(−1/5) (Silverman, Density Estimation, 1986, eq. 3.31), computed from the inner 98 %.
"""

import numpy as np

# share of values at either end that the bandwidth ignores, so that single outliers do not smear the peak
TRIM = 0.01


def reflected_density(
    values: np.ndarray, grid: np.ndarray, lower: float = -np.inf, upper: float = np.inf
) -> np.ndarray:
    """Return the density (G,) of `values` (n,) at `grid` (G,), reflected at the boundaries; ignores non-finite values.

    Raises:
        ValueError: no value is finite.
    """
    values = values[np.isfinite(values)]
    if not len(values):
        raise ValueError("a density needs at least one finite value")
    h = max(bandwidth(values), 0.5 * float(np.min(np.diff(grid))))  # the grid cannot resolve less
    mirrors = [values, *(2.0 * edge - values for edge in (lower, upper) if np.isfinite(edge))]
    total = sum(np.exp(-0.5 * ((grid[:, None] - copy) / h) ** 2).sum(axis=1) for copy in mirrors)
    inside = (grid >= lower) & (grid <= upper)
    return np.where(inside, total / (len(values) * h * np.sqrt(2.0 * np.pi)), 0.0)


def error_curves(error: np.ndarray, grid: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the density (G,) of errors (n,) ≥ 0 at `grid` (G,), quantiles (G,) and shares (G,) of errors below them.

    A failed solve (NaN) counts as infinite: quantiles are NaN beyond the share that was solved.

    Raises:
        ValueError: no error is finite.
    """
    finite, shares = np.sort(error[np.isfinite(error)]), (np.arange(len(grid)) + 0.5) / len(grid)
    density = reflected_density(error, grid, lower=0.0)
    at = np.minimum((shares * len(error)).astype(int), len(finite) - 1)
    return density, np.where(shares * len(error) < len(finite), finite[at], np.nan), shares


def bandwidth(values: np.ndarray) -> float:
    """Return Silverman's bandwidth of finite values (n,), in their unit; 0 if they are all equal."""
    low, quarter, three, high = np.quantile(values, [TRIM, 0.25, 0.75, 1.0 - TRIM])
    std = np.clip(values, low, high).std()
    spread = min(std, (three - quarter) / 1.34) or std
    return 0.9 * float(spread) * len(values) ** -0.2


def local_mean(
    points: np.ndarray, values: np.ndarray, nodes: np.ndarray, neighbours: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean (G,) of finite `values` (n,) nearest to each node (G, 2), and the distance (G,) to the nearest.

    The mean is over `neighbours` values, or all if there are fewer.  Distances to `points` (n, 2) are in standard
    deviations of the points along each axis.
    """
    from scipy.spatial import cKDTree

    scale = np.maximum(points.std(axis=0), np.finfo(float).tiny)
    count = min(neighbours, len(points))
    distance, nearest = cKDTree(points / scale).query(nodes / scale, k=[*range(1, count + 1)])
    return values[nearest].mean(axis=1), distance[:, 0]
