"""Scatter of the thesis's estimate of m/I: between single drops, and between sets of 280 drops.

Section 2.5 gives "587.50 (standard deviation in error of 27.6)", which is 4.7 % of the estimate, without definition.
There are two readings, both for least squares over impacts i (eq. 2.23 at known contacts; `mass_ratio.plain_program`),

    m/I = Σ_i L_i Δω_i / Σ_i L_i²,     L = r_x Δv_y − r_y Δv_x:

- `drop_spread`    the standard deviation of the m/I of single drops, each from its first `IMPACTS` bounces, by their
                   median deviation, because the m/I of a drop with hardly any lever L is arbitrary;
- `sample_spread`  the standard deviation of the m/I from all impacts of `DROPS` drops, by resampling drops.

Both are divided by the m/I of all impacts, so the unit of the body's lengths does not matter.  If each trial has
only one impact, as in the published set of the ellipse, impacts are combined into drops at random.
"""

import numpy as np
import pandas as pd

from thesis_lib.statistics.spread import robust_std

IMPACTS = 3  # per drop; thesis: "we considered the first 3 bounces"
DROPS = 280  # thesis
_DRAWS = 400  # resampled sets of drops, which determine the spread to 4 %


def spreads(lever: np.ndarray, spin: np.ndarray, trial: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """Compute `drop_spread` and `sample_spread` from L `lever` in m²/s and Δω `spin` in rad/s, (n,) each.

    `trial` (n,) identifies the drop of each impact; impacts of a drop are in order of time.
    """
    moments = np.stack([lever * spin, lever**2], axis=-1)
    whole = _ratio(moments.sum(axis=0))
    scatter, samples = [], []
    for _ in range(_DRAWS):
        drops = _drops(moments, trial, rng)
        ratio = _ratio(drops)
        scatter.append(robust_std(ratio - np.median(ratio)))
        samples.append(_ratio(drops[rng.integers(len(drops), size=DROPS)].sum(axis=0)))
    return {"drop_spread": float(np.mean(scatter) / whole), "sample_spread": float(np.std(samples, ddof=1) / whole)}


def _drops(moments: np.ndarray, trial: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Sums (d, 2) of the impacts' `moments` (n, 2) over the first `IMPACTS` of each drop."""
    _, drop = np.unique(trial, return_inverse=True)
    n = np.bincount(drop)
    if (n == 1).all():
        groups = rng.permutation(len(drop))[: len(drop) // IMPACTS * IMPACTS].reshape(-1, IMPACTS)
        return moments[groups].sum(axis=1)
    first = (pd.Series(drop).groupby(drop).cumcount() < IMPACTS).to_numpy()
    sums = np.zeros((len(n), 2))
    np.add.at(sums, drop[first], moments[first])
    return sums


def _ratio(moments: np.ndarray) -> np.ndarray:
    return moments[..., 0] / moments[..., 1]
