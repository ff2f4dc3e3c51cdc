"""The thesis's insights from figure 3-10, about individual parameters (μ_i, ε_i), as numbers with standard errors.

| statement                  | law  | value                                                                       |
|----------------------------|------|-----------------------------------------------------------------------------|
| individual_minus_ensemble_mu, _epsilon | all | mean of the individual parameters minus the ensemble's           |
| mu_zero                    | some | share of impacts whose individual μ is below 0.001                          |
| mu_zero_offset             | some | mean abs(r_x) of those impacts over that of the rest (figure 3-11 a)        |
| misfit_lower_left          | some | mean misfit where both μ_i and ε_i are in their lowest quarter, over the rest |
| epsilon_mode               | some | where the density of the individual ε peaks (Gaussian kernel, Scott's bandwidth) |
| epsilon_modes              | some | number of peaks above a tenth of the highest                                |
| individual_spread_mu, _epsilon | some | standard deviation of the individual parameters over the ensemble's value |
| flatness_mu, _epsilon      | some | width of the shortest interval with half of the values over their 95 % quantile |

Flatness is 0.53 for an even density from 0 up, and 0.12 for a Gaussian whose spread is a tenth of its mean.
`law` is one of `FOLLOWED` where only some laws have the row.  All rows describe the individually fitted impacts,
training and held-out alike; nothing is predicted.  Undefined values are omitted (no impact has μ = 0, a group has a
single impact).
"""

import numpy as np
import pandas as pd

from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.statistics.intervals import mean_of, ratio_of_means, share_of

MU_ZERO = 1e-3  # far below the thesis's smallest ensemble value, 0.062
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
FOLLOWED = (STUDIED, "mirtich", "wang_mason", "anitescu_potra_poisson")

Row = tuple[str, str, float, float, str]


def individual_rows(impacts: Impacts, individual: pd.DataFrame, ensemble: pd.DataFrame) -> list[Row]:
    """Rows (statement, law, value, std, unit).

    `individual` (trial, impact, law, mu, epsilon, misfit; impacts among `impacts`) and `ensemble` (mu, mu_std, epsilon,
    epsilon_std, indexed by law) are of one weighting.
    """
    keys = pd.MultiIndex.from_arrays([impacts.trial, impacts.impact])
    offset = pd.Series(np.abs(impacts.r[:, 0]), keys)
    rows: list[Row] = []
    for law, fit in ensemble.iterrows():
        each = individual[individual["law"] == law]
        for name in ("mu", "epsilon"):
            mean, std = mean_of(each[name].to_numpy())
            std = float(np.hypot(std, fit[f"{name}_std"]))
            rows.append((f"individual_minus_ensemble_{name}", str(law), mean - fit[name], std, "1"))
    for law in FOLLOWED:
        each = individual[(individual["law"] == law) & individual["misfit"].notna()]
        r_x = offset.reindex(pd.MultiIndex.from_frame(each[["trial", "impact"]])).to_numpy()
        rows += _of_one_law(law, each, r_x, ensemble.loc[law])
    return [row for row in rows if np.isfinite(row[2])]


def _of_one_law(law: str, each: pd.DataFrame, r_x: np.ndarray, fit: pd.Series) -> list[Row]:
    mu, epsilon, misfit = (each[name].to_numpy(float) for name in ("mu", "epsilon", "misfit"))
    zero = mu < MU_ZERO
    lower_left = (mu <= np.quantile(mu, 0.25)) & (epsilon <= np.quantile(epsilon, 0.25))
    peak, peaks = epsilon_modes(epsilon)
    return [
        ("mu_zero", law, *share_of(zero), "1"),
        ("mu_zero_offset", law, *ratio_of_means(r_x[zero], r_x[~zero]), "1"),
        ("misfit_lower_left", law, *ratio_of_means(misfit[lower_left], misfit[~lower_left]), "1"),
        ("epsilon_mode", law, peak, np.nan, "1"),
        ("epsilon_modes", law, peaks, np.nan, "1"),
        ("individual_spread_mu", law, mu.std(ddof=1) / fit["mu"], np.nan, "1"),
        ("individual_spread_epsilon", law, epsilon.std(ddof=1) / fit["epsilon"], np.nan, "1"),
        ("flatness_mu", law, flatness(mu), np.nan, "1"),
        ("flatness_epsilon", law, flatness(epsilon), np.nan, "1"),
    ]


def epsilon_modes(epsilon: np.ndarray) -> tuple[float, int]:
    """Peak of the density of the ε (n,), and number of peaks above a tenth of the highest."""
    from scipy.signal import find_peaks
    from scipy.stats import gaussian_kde

    epsilon = epsilon[np.isfinite(epsilon)]
    if np.ptp(epsilon) == 0.0:
        return float(epsilon[0]), 1
    grid = np.linspace(-0.2, 1.2, 1401)
    density = gaussian_kde(epsilon)(grid)
    peaks, _ = find_peaks(density, height=0.1 * density.max())
    return float(grid[np.argmax(density)]), len(peaks)


def flatness(values: np.ndarray) -> float:
    """Width of the shortest interval with half of the values (n,) ≥ 0, over their 95 % quantile (0 if that is 0)."""
    ordered = np.sort(values)
    half = (len(ordered) + 1) // 2
    shortest = float(np.min(ordered[half - 1 :] - ordered[: len(ordered) - half + 1]))
    top = float(np.quantile(ordered, 0.95))
    return shortest / top if top > 0.0 else 0.0
