"""What chapter 3 says in words, as numbers with standard errors, for the claims ledger.

A row has `statement`, `law` ('' where it concerns none), `value`, `std` (NaN where it makes no sense), `unit`.

| statement                  | value                                                                            |
|----------------------------|----------------------------------------------------------------------------------|
| irb_bound                  | mean held-out velocity error of the IRB Bound                                    |
| irb_bound_mirrored         | the same after reading θ and ω clockwise (sensitivity: handedness of the angle)  |
| steep_friction             | mean held-out error at the inclined plane's μ = 0.3 minus that at the ensemble's μ |
| individual_minus_ensemble_mu, _epsilon | mean of the individual parameters minus the ensemble's              |
| individual_spread_mu, _epsilon | standard deviation of the individual parameters over the ensemble's value    |
| mu_zero                    | share of impacts whose individual μ is below 0.001                               |
| epsilon_mode               | where the density of the individual ε peaks (Gaussian kernel, Scott's bandwidth) |
| epsilon_modes              | number of peaks above a tenth of the highest                                     |
| back_spin                  | share of measured impulses beyond the line of sticking                           |
| convexity_violations       | share of grid triples at which the cost of figure 3-7 is not convex              |
| small_momentum             | AP Poisson: mean error at the lowest fourth of tangential momentum over the rest |
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS
from thesis_lib.contact.bounds import irb_bound
from thesis_lib.contact.space import velocity_error
from thesis_lib.datasets.impacts import Impacts
from thesis_lib.identify.cost import target_of
from thesis_lib.identify.impact_study import convexity_violations

MU_INCLINED_PLANE = 0.3  # PLA on aluminium, thesis section 3.4
MU_ZERO = 1e-3  # far below the thesis's smallest ensemble value, 0.062
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
MAPPED = "anitescu_potra_poisson"  # the law of figure 3-9


def statements(
    held_out: Impacts,
    ensemble: pd.DataFrame,
    individual: pd.DataFrame,
    errors: pd.DataFrame,
    topography: pd.DataFrame,
) -> pd.DataFrame:
    """All statements; `held_out` and `errors` hold held-out impacts, in the kinetic weighting."""
    ensemble = ensemble[ensemble["weighting"] == "kinetic"].set_index("law")
    individual = individual[individual["weighting"] == "kinetic"]
    rows = [
        ("irb_bound", "", *_mean(_irb(held_out)), "m/s"),
        ("irb_bound_mirrored", "", *_mean(_irb(mirrored_rotation(held_out))), "m/s"),
        ("convexity_violations", topography["law"].iloc[0], convexity_violations(topography), np.nan, "1"),
        ("back_spin", "", *_mean(back_spin(held_out).astype(float)), "1"),
        ("small_momentum", MAPPED, *_small_momentum(held_out, errors), "1"),
    ]
    for law, fit in ensemble.iterrows():
        own = errors.loc[errors["model"] == law, "velocity_error"].to_numpy()
        steep = _errors_at(held_out, str(law), MU_INCLINED_PLANE, fit["epsilon"])
        rows.append(("steep_friction", law, *_mean(steep - own), "m/s"))
        each = individual[individual["law"] == law]
        for name in ("mu", "epsilon"):
            mean, std = _mean(each[name].to_numpy())
            std = float(np.hypot(std, fit[f"{name}_std"]))
            rows.append((f"individual_minus_ensemble_{name}", law, mean - fit[name], std, "1"))
    for law in (STUDIED, "mirtich", "wang_mason", "anitescu_potra_poisson"):
        each = individual[individual["law"] == law]
        peak, peaks = epsilon_modes(each["epsilon"].to_numpy())
        rows += [
            ("mu_zero", law, *_mean((each["mu"] < MU_ZERO).to_numpy(float)), "1"),
            ("epsilon_mode", law, peak, np.nan, "1"),
            ("epsilon_modes", law, peaks, np.nan, "1"),
            ("individual_spread_mu", law, each["mu"].std() / ensemble.loc[law, "mu"], np.nan, "1"),
            (
                "individual_spread_epsilon",
                law,
                each["epsilon"].std() / ensemble.loc[law, "epsilon"],
                np.nan,
                "1",
            ),
        ]
    return pd.DataFrame(rows, columns=["statement", "law", "value", "std", "unit"])


def back_spin(impacts: Impacts) -> np.ndarray:
    """Whether the measured impulse lies beyond the line of sticking: v_t changes its sign (thesis 3.3.2)."""
    target = target_of(impacts)
    v_t, _ = target.space.velocity_after(target.c_t, target.c_n)
    return v_t * target.space.v_t < 0.0


def mirrored_rotation(impacts: Impacts) -> Impacts:
    """The same impacts with θ and ω read clockwise, and the contact point that goes with it."""
    flip = np.array([1.0, 1.0, -1.0])
    return replace(
        impacts,
        q=impacts.q * flip,
        v_pre=impacts.v_pre * flip,
        v_post=impacts.v_post * flip,
        r=impacts.r * np.array([-1.0, 1.0]),
        cov=None,
    )


def epsilon_modes(epsilon: np.ndarray) -> tuple[float, int]:
    """Where the density of ε peaks, and how many peaks exceed a tenth of the highest."""
    from scipy.signal import find_peaks
    from scipy.stats import gaussian_kde

    epsilon = epsilon[np.isfinite(epsilon)]
    if np.ptp(epsilon) == 0.0:
        return float(epsilon[0]), 1
    grid = np.linspace(-0.2, 1.2, 1401)
    density = gaussian_kde(epsilon)(grid)
    peaks, _ = find_peaks(density, height=0.1 * density.max())
    return float(grid[np.argmax(density)]), len(peaks)


def _irb(impacts: Impacts) -> np.ndarray:
    return irb_bound(impacts.v_pre, impacts.v_post, impacts.r, mass=impacts.mass, k_g=impacts.k_g).error


def _errors_at(impacts: Impacts, law: str, mu: float, epsilon: float) -> np.ndarray:
    out = LAWS[law](impacts.v_pre, impacts.r, mass=impacts.mass, k_g=impacts.k_g, mu=mu, epsilon=epsilon)
    return velocity_error(impacts.v_post - out.v_post, impacts.k_g)


def _small_momentum(impacts: Impacts, errors: pd.DataFrame) -> tuple[float, float]:
    space = target_of(impacts).space
    momentum = np.abs(space.impulse_to(0.0, 0.0)[0])
    error = errors.loc[errors["model"] == MAPPED, "velocity_error"].to_numpy()
    small = momentum <= np.quantile(momentum, 0.25)
    (a, a_std), (b, b_std) = _mean(error[small]), _mean(error[~small])
    return a / b, a / b * float(np.hypot(a_std / a, b_std / b))


def _mean(values: np.ndarray) -> tuple[float, float]:
    """Mean of the finite values and its standard error."""
    values = values[np.isfinite(values)]
    return float(values.mean()), float(values.std(ddof=1) / np.sqrt(len(values)))
