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
| back_spin                  | share of measured impacts after which v_t has changed its sign                   |
| beyond_sticking            | share of measured impulses beyond the line of sticking                           |
| predicted_back_spin, predicted_beyond_sticking | the same shares of a law's predictions                       |
| energy_loss                | share of impacts that lose contact-space energy                                  |
| converged_at               | least k from which on every subset's μ and ε stay within 10 % of their final value |
| convexity_violations       | share of grid triples at which the cost of figure 3-7 is not convex              |
| local_minima               | points of that grid that are below all eight neighbours                          |
| small_momentum             | AP Poisson: mean error at the lowest fourth of tangential momentum over the rest |
"""

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd

from thesis_lib.contact import LAWS
from thesis_lib.contact.bounds import irb_bound
from thesis_lib.contact.space import ContactSpace, beyond_sticking, velocity_error
from thesis_lib.datasets.impacts import Impacts
from thesis_lib.datasets.quality import contact_measures
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
    convergence: pd.DataFrame,
) -> pd.DataFrame:
    """All statements; `held_out` and `errors` hold held-out impacts, in the kinetic weighting."""
    ensemble = ensemble[ensemble["weighting"] == "kinetic"].set_index("law")
    individual = individual[individual["weighting"] == "kinetic"]
    target = target_of(held_out)
    rows = [
        ("irb_bound", "", *_mean(_irb(held_out)), "m/s"),
        ("irb_bound_mirrored", "", *_mean(_irb(mirrored_rotation(held_out))), "m/s"),
        ("convexity_violations", topography["law"].iloc[0], convexity_violations(topography), np.nan, "1"),
        ("local_minima", topography["law"].iloc[0], local_minima(topography), np.nan, "1"),
        ("energy_loss", "", *_mean((contact_measures(held_out).alpha < 1.0).astype(float)), "1"),
        ("back_spin", "", *_mean(reverses(target.space, target.c_t, target.c_n)), "1"),
        ("beyond_sticking", "", *_mean(crosses(target.space, target.c_t, target.c_n)), "1"),
        ("small_momentum", MAPPED, *_small_momentum(held_out, errors), "1"),
    ]
    rows += [
        ("converged_at", law, converged_at(part), np.nan, "1") for law, part in convergence.groupby("law")
    ]
    for law, fit in ensemble.iterrows():
        predicted = _prediction(target.space, str(law), fit["mu"], fit["epsilon"])
        rows.append(("predicted_back_spin", law, *_mean(reverses(target.space, *predicted)), "1"))
        rows.append(("predicted_beyond_sticking", law, *_mean(crosses(target.space, *predicted)), "1"))
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


def reverses(space: ContactSpace, c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
    """1.0 where the impulse changes the sign of v_t (back-spin, thesis 3.3.2), else 0.0; NaN: no impulse."""
    # a stuck contact has v_t⁺ = 0 up to rounding
    changes = space.velocity_after(c_t, c_n)[0] * np.sign(space.v_t) < -1e-9 * np.abs(space.v_n)
    return np.where(np.isfinite(c_t + c_n), changes, np.nan)


def crosses(space: ContactSpace, c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
    """1.0 where the impulse lies beyond the line of sticking, else 0.0; NaN: no impulse."""
    beyond = beyond_sticking(space, c_t, c_n) > 1e-9 * np.hypot(c_t, c_n)
    return np.where(np.isfinite(c_t + c_n), beyond, np.nan)


def _prediction(space: ContactSpace, law: str, mu: float, epsilon: float) -> tuple[np.ndarray, np.ndarray]:
    with np.errstate(all="ignore"):  # branches that are not taken
        return LAWS[law].impulse(space, np.asarray(mu), np.asarray(epsilon))


def converged_at(convergence: pd.DataFrame, share: float = 0.1) -> float:
    """Least k from which on μ and ε of every subset stay within `share` of their value at the largest k.

    The largest k itself if nothing smaller does; `convergence` holds one law.
    """
    sizes = np.sort(convergence["k"].unique())
    off = np.zeros(len(sizes), dtype=bool)
    for _, part in convergence.groupby("subset"):
        values = part.sort_values("k")[["mu", "epsilon"]].to_numpy()
        off |= np.any(np.abs(values - values[-1]) > share * np.abs(values[-1]), axis=1)
    last_off = np.flatnonzero(off)
    return float(sizes[last_off[-1] + 1] if len(last_off) else sizes[0])


def local_minima(topography: pd.DataFrame) -> int:
    """Number of grid points whose cost is below that of all their neighbours, borders included."""
    cost = topography.pivot(index="mu", columns="epsilon", values="cost").to_numpy()
    padded = np.pad(cost, 1, constant_values=np.inf)
    lowest = np.ones(cost.shape, dtype=bool)
    for i, j in itertools.product(range(3), range(3)):
        if (i, j) != (1, 1):
            lowest &= cost < padded[i : i + cost.shape[0], j : j + cost.shape[1]]
    return int(lowest.sum())


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
