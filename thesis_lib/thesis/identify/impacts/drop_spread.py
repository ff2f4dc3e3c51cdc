"""How far the thesis's estimate of m/I scatters: from drop to drop, and from one set of 280 drops to another.

Section 2.5 gives "587.50 (standard deviation in error of 27.6)", which is 4.7 % of the estimate, and does not say of
what.  Two readings, both of least squares over impacts i (eq. 2.23 at known contacts; `mass_ratio.plain_program`),

    m/I = Σ_i L_i Δω_i / Σ_i L_i²,     L = r_x Δv_y − r_y Δv_x:

- `drop_spread`    the standard deviation of the m/I of single drops, each of its first `IMPACTS` bounces, by their
                   median deviation, since a drop with hardly any lever L has any m/I;
- `sample_spread`  the standard deviation of the m/I of all impacts of `DROPS` drops, by resampling drops.

Both are shares of the m/I of all impacts, so that the unit of the body's lengths does not matter.  Where a trial has
one impact only, as in the published set of the ellipse, drops are put together at random.
"""

import numpy as np
import pandas as pd

from thesis_lib.statistics.spread import robust_std

IMPACTS = 3  # of a drop; thesis: "we considered the first 3 bounces"
DROPS = 280  # thesis
_DRAWS = 400  # samples of drops: their spread is known to 4 %


def spreads(lever: np.ndarray, spin: np.ndarray, trial: np.ndarray, rng: np.random.Generator) -> dict[str, float]:
    """`drop_spread` and `sample_spread` of impacts with L `lever` in m²/s and Δω `spin` in rad/s, (n,) each.

    `trial` (n,) names the drop of each impact; impacts of a drop stand in their order.
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
