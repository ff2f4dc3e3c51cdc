"""Statements of chapter 3 expressed as numbers with standard errors, for the claims ledger.

Each row has `statement`, `law` ('' if it concerns no law), `value`, `std` (NaN if undefined), `unit`.

| statement                  | value                                                                            |
|----------------------------|----------------------------------------------------------------------------------|
| irb_bound                  | mean held-out velocity error of the IRB Bound                                    |
| irb_bound_mirrored         | the same after reading θ and ω clockwise (sensitivity: handedness of the angle)  |
| over_best_post_hoc         | mean held-out error of a law minus the error of Best Post Hoc of its variant     |
| steep_friction             | mean held-out error at the inclined plane's μ = 0.3 minus that at the ensemble's μ |
| tail_outside               | share of impulses outside a law's range in the tail of its errors, minus that elsewhere |
| error_bumps                | laws whose density of errors (figure 3-8) has a second peak beyond the highest   |
| bump_outside               | as `tail_outside`, for errors beyond the valley before that peak, mean over these laws |
| back_spin                  | share of measured impacts after which v_t has changed its sign                   |
| beyond_sticking            | share of measured impulses beyond the line of sticking                           |
| predicted_back_spin, predicted_beyond_sticking | the same shares for a law's predictions                      |
| converged_at               | least k from which μ and ε of every subset stay within 10 % of their final values |
| convexity_violations       | share of grid triples at which the cost of figure 3-7 is not convex              |
| local_minima               | number of points of that grid below all eight neighbours                         |
| small_momentum             | AP Poisson: mean error at the lowest fourth of tangential momentum over the rest |
| single_hits                | share of the first three hits of a trial that are clean single impacts (section 2.5) |

`converged_at` without a law is the value of the slowest law.  Rows from `energy` are defined there.

The thesis's insights from figure 3-10, about individual parameters (μ_i, ε_i):

| statement                  | law  | value                                                                       |
|----------------------------|------|-----------------------------------------------------------------------------|
| individual_minus_ensemble_mu, _epsilon | all | mean of the individual parameters minus the ensemble parameter   |
| mu_zero                    | some | share of impacts whose individual μ is below 0.001                          |
| mu_zero_offset             | some | mean abs(r_x) of these impacts over the mean of the rest (figure 3-11 a)    |
| back_spin_outside          | some | share of impacts with back-spin outside the law's range (figure 3-11 b)     |
| beyond_sticking_outside    | some | the same for measured impulses beyond the line of sticking                  |
| misfit_lower_left          | some | mean misfit where both μ_i and ε_i are in their lowest quarter, over the rest |
| epsilon_mode               | some | peak of the density of the individual ε (Gaussian kernel, Scott's bandwidth) |
| epsilon_modes              | some | number of peaks above a tenth of the highest                                |
| individual_spread_mu, _epsilon | some | standard deviation of the individual parameters over the ensemble's value |
| flatness_mu, _epsilon      | some | width of the shortest interval with half of the values over their 95 % quantile |

Flatness is 0.53 for a uniform density from 0, and 0.12 for a Gaussian whose spread is a tenth of its mean.
"Some" laws are those in `FOLLOWED`.  All rows describe the individually fitted impacts,
training and held-out alike; nothing is predicted.  Undefined values are omitted (if no impact has μ = 0, or a group has
a single impact).
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.ndimage import minimum_filter

from thesis_lib.coefficients.cost import contact_momentum, target_of
from thesis_lib.contact import LAWS
from thesis_lib.contact.bounds import best_post_hoc, irb_bound
from thesis_lib.contact.space import beyond_sticking, velocity_error
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.mechanics.contact import Contact
from thesis_lib.statistics.intervals import Z95, clustered_mean, mean_of, ratio_of_means, share_of
from thesis_lib.thesis.impact_study.study import convexity_violations, pick
from thesis_lib.thesis.impact_study.tables import MU_ZERO, VARIANTS

MU_INCLINED_PLANE = 0.3  # PLA on aluminium, thesis section 3.4
MAPPED = "anitescu_potra_poisson"  # the law of figure 3-9
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
TAIL = 0.1  # share of the held-out impacts with the largest errors
BOUNCES = 3  # bounces per trial; section 2.5: "we considered the first 3 bounces"
NOT_SEEN = ("off_wall", "lost_frames", "window_too_short", "no_approach")  # reasons that do not concern the hit
FOLLOWED = (STUDIED, "mirtich", "wang_mason", "anitescu_potra_poisson")

Row = tuple[str, str, float, float, str]


def statements(
    impacts: Impacts,
    split: pd.DataFrame,
    ensemble: pd.DataFrame,
    individual: pd.DataFrame,
    errors: pd.DataFrame,
    topography: pd.DataFrame,
    convergence: pd.DataFrame,
    tolerance: float,
    energy: pd.DataFrame | None = None,
    left_out: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """All statements, in the kinetic weighting; predictions are evaluated only on impacts with train = 0 in `split`.

    `ensemble` and `individual` (for all impacts studied) have both weightings, `errors` are the `held_out_errors` in
    this weighting, `topography` and `convergence` (any laws) as in figure 3-7, `energy` from `energy_statements`,
    `left_out` the hits of recorded motions that are not single impacts (None: no motions were recorded).
    An impulse is in a law's range if it is within `tolerance` in m/s, over the mass, of a possible prediction.
    """
    held_out = pick(impacts, split, train=0)
    ensemble = ensemble[ensemble["weighting"] == "kinetic"].set_index("law")
    individual = individual[individual["weighting"] == "kinetic"]
    target = target_of(held_out)
    slowest = {str(law): converged_at(part) for law, part in convergence.groupby("law")}
    rows = [
        ("irb_bound", "", *mean_of(_irb(held_out)), "m/s"),
        ("irb_bound_mirrored", "", *mean_of(_irb(mirrored_rotation(held_out))), "m/s"),
        ("convexity_violations", topography["law"].iloc[0], convexity_violations(topography), np.nan, "1"),
        ("local_minima", topography["law"].iloc[0], local_minima(topography), np.nan, "1"),
        ("back_spin", "", *share_of(reverses(target.space, target.c_t, target.c_n)), "1"),
        ("beyond_sticking", "", *share_of(crosses(target.space, target.c_t, target.c_n)), "1"),
        ("small_momentum", MAPPED, *_small_momentum(held_out, errors), "1"),
    ]
    rows += [("converged_at", law, k, np.nan, "1") for law, k in slowest.items()]
    if slowest:
        rows.append(("converged_at", "", max(slowest.values()), np.nan, "1"))
    bumps: list[tuple[float, float]] = []
    for law, fit in ensemble.iterrows():
        with np.errstate(all="ignore"):  # branches of the law that are not taken
            predicted = LAWS[str(law)].impulse(target.space, np.asarray(fit["mu"]), np.asarray(fit["epsilon"]))
        rows.append(("predicted_back_spin", law, *share_of(reverses(target.space, *predicted)), "1"))
        rows.append(("predicted_beyond_sticking", law, *share_of(crosses(target.space, *predicted)), "1"))
        of_law = errors[errors["model"] == law]
        at_ensemble = of_law["velocity_error"].to_numpy()
        each = individual[individual["law"] == law]
        largest = float(of_law["velocity_error"].quantile(1.0 - TAIL))
        rows.append(("tail_outside", law, *outside_beyond(largest, of_law, each, tolerance * impacts.mass), "1"))
        if (valley := before_bump(at_ensemble)) is not None:
            bumps.append(outside_beyond(valley, of_law, each, tolerance * impacts.mass))
        steep = _errors_at(held_out, str(law), MU_INCLINED_PLANE, fit["epsilon"])
        rows.append(("steep_friction", law, *mean_of(steep - at_ensemble), "m/s"))
    rows.append(("error_bumps", "", len(bumps), np.nan, "1"))
    rows.append(("bump_outside", "", *(np.mean(bumps, axis=0) if bumps else (0.0, 0.0)), "1"))
    rows += _over_best_post_hoc(errors)
    rows += individual_rows(impacts, individual, ensemble, tolerance * impacts.mass)
    if left_out is not None:
        rows.append(single_hits(impacts, left_out))
    table = pd.DataFrame(rows, columns=["statement", "law", "value", "std", "unit"])
    return table if energy is None else pd.concat([table, energy], ignore_index=True)


def reverses(space: Contact, c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
    """1.0 where the impulse (n,) changes the sign of v_t (back-spin, thesis 3.3.2), else 0.0; NaN without impulse."""
    # a stuck contact has v_t⁺ = 0 up to rounding
    changes = space.velocity_after(c_t, c_n)[0] * np.sign(space.v_t) < -1e-9 * np.abs(space.v_n)
    return np.where(np.isfinite(c_t + c_n), changes, np.nan)


def crosses(space: Contact, c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
    """1.0 where the impulse (n,) lies beyond the line of sticking, else 0.0; NaN without impulse."""
    beyond = beyond_sticking(space, c_t, c_n) > 1e-9 * np.hypot(c_t, c_n)
    return np.where(np.isfinite(c_t + c_n), beyond, np.nan)


def outside_beyond(
    edge: float, errors: pd.DataFrame, individual: pd.DataFrame, tolerance: float
) -> tuple[float, float]:
    """Share of impulses outside a law's range at errors from `edge`, minus share at lower errors; standard error.

    `errors` (trial, impact, velocity_error) and `individual` (trial, impact, misfit) are for one law; an impulse lies
    outside if its misfit exceeds `tolerance` in N s.
    """
    rows = errors.merge(individual[["trial", "impact", "misfit"]], on=["trial", "impact"])
    outside = (rows["misfit"] > tolerance).to_numpy(float)
    beyond = (rows["velocity_error"] >= edge).to_numpy()
    (worst, of_worst), (rest, of_rest) = share_of(outside[beyond]), share_of(outside[~beyond])
    return worst - rest, float(np.hypot(of_worst, of_rest))


def before_bump(error: np.ndarray) -> float | None:
    """Lowest point of the density of errors (n,) between its highest peak and the next peak at larger errors, or None.

    The density is reflected at 0 (Scott's bandwidth); a peak stands out by a fiftieth of the highest.
    """
    from scipy.signal import find_peaks
    from scipy.stats import gaussian_kde

    finite = error[np.isfinite(error)]
    width = len(finite) ** -0.2 * finite.std() / np.sqrt(np.mean(finite**2))  # of the errors without reflection
    kernel = gaussian_kde(np.concatenate([finite, -finite]), bw_method=width)
    grid = np.linspace(0.0, float(finite.max()), 1001)
    density = kernel(grid)
    peaks, _ = find_peaks(density, prominence=0.02 * density.max())
    top = int(np.argmax(density))
    beyond = peaks[peaks > top]
    return float(grid[top + np.argmin(density[top : beyond[0]])]) if len(beyond) else None


def converged_at(convergence: pd.DataFrame, share: float = 0.1) -> float:
    """Least k from which μ and ε of every subset of one law stay within `share` of their values at the largest k."""
    sizes = np.sort(convergence["k"].unique())
    off = np.zeros(len(sizes), dtype=bool)
    for _, part in convergence.groupby("subset"):
        values = part.sort_values("k")[["mu", "epsilon"]].to_numpy()
        off |= np.any(np.abs(values - values[-1]) > share * np.abs(values[-1]), axis=1)
    last_off = np.flatnonzero(off)
    return float(sizes[last_off[-1] + 1] if len(last_off) else sizes[0])


def local_minima(topography: pd.DataFrame) -> int:
    """Number of grid points, borders included, with a lower cost than all their neighbours."""
    cost = topography.pivot(index="mu", columns="epsilon", values="cost").to_numpy()
    beside = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]])
    return int((cost < minimum_filter(cost, footprint=beside, mode="constant", cval=np.inf)).sum())


def mirrored_rotation(impacts: Impacts) -> Impacts:
    """Return the impacts with θ and ω taken as clockwise, and the corresponding contact point."""
    flip = np.array([1.0, 1.0, -1.0])
    states = {name: getattr(impacts, name) * flip for name in ("q", "v_pre", "v_post")}
    return replace(impacts, **states, r=impacts.r * np.array([-1.0, 1.0]), cov=None)


def _irb(impacts: Impacts) -> np.ndarray:
    return irb_bound(impacts.v_pre, impacts.v_post, impacts.r, mass=impacts.mass, k_g=impacts.k_g).error


def _errors_at(impacts: Impacts, law: str, mu: float, epsilon: float) -> np.ndarray:
    out = LAWS[law](impacts.v_pre, impacts.r, mass=impacts.mass, k_g=impacts.k_g, mu=mu, epsilon=epsilon)
    return velocity_error(impacts.v_post - out.v_post, impacts.k_g)


def _over_best_post_hoc(errors: pd.DataFrame) -> list[tuple[str, str, float, float, str]]:
    """Paired differences to Best Post Hoc; a law that is in both variants is compared among the published laws."""
    wide = errors.pivot(index=["trial", "impact"], columns="model", values="velocity_error")
    rows = {}
    for laws in (VARIANTS["as_defined"], VARIANTS["as_published"]):  # the later one counts
        best = best_post_hoc(wide[list(laws)].to_numpy())[1]
        rows |= {law: mean_of(wide[law].to_numpy() - best) for law in laws}
    return [("over_best_post_hoc", law, *mean_and_std, "m/s") for law, mean_and_std in rows.items()]


def _small_momentum(held_out: Impacts, errors: pd.DataFrame) -> tuple[float, float]:
    momentum = np.abs(contact_momentum(held_out)[:, 0])
    error = errors.loc[errors["model"] == MAPPED, "velocity_error"].to_numpy()
    small = momentum <= np.quantile(momentum, 0.25)
    return ratio_of_means(error[small], error[~small])


def single_hits(impacts: Impacts, left_out: pd.DataFrame) -> Row:
    """Share of the first `BOUNCES` hits of a trial that are clean single impacts, with standard error over trials.

    `impacts` are all single impacts found, `left_out` (trial, impact, reason) the other hits, numbered together: hits
    close together, and hits after which the body stays down or does not fly.  Hits that were not observed well enough
    (`NOT_SEEN`) do not count.
    """
    seen = left_out[(left_out["impact"] < BOUNCES) & ~left_out["reason"].isin(NOT_SEEN)]
    alone = impacts.trial[impacts.impact < BOUNCES]
    is_single = np.concatenate([np.ones(len(alone)), np.zeros(len(seen))])
    share, low, high = clustered_mean(is_single, np.concatenate([alone, seen["trial"].to_numpy(int)]))
    return "single_hits", "", share, (high - low) / (2.0 * Z95), "1"


def individual_rows(impacts: Impacts, individual: pd.DataFrame, ensemble: pd.DataFrame, tolerance: float) -> list[Row]:
    """Rows (statement, law, value, std, unit) on individual parameters.

    `individual` (trial, impact, law, mu, epsilon, misfit; impacts among `impacts`) and `ensemble` (mu, mu_std, epsilon,
    epsilon_std, indexed by law) have one weighting.  An impulse lies outside if its misfit exceeds `tolerance` in
    N s.
    """
    keys = pd.MultiIndex.from_arrays([impacts.trial, impacts.impact])
    offset = pd.Series(np.abs(impacts.r[:, 0]), keys)
    target = target_of(impacts)
    measured = target.space, target.c_t, target.c_n
    unusual = {
        "back_spin": pd.Series(reverses(*measured), keys),
        "beyond_sticking": pd.Series(crosses(*measured), keys),
    }
    rows: list[Row] = []
    for law, fit in ensemble.iterrows():
        each = individual[individual["law"] == law]
        for name in ("mu", "epsilon"):
            mean, std = mean_of(each[name].to_numpy())
            std = float(np.hypot(std, fit[f"{name}_std"]))
            rows.append((f"individual_minus_ensemble_{name}", str(law), mean - fit[name], std, "1"))
    for law in FOLLOWED:
        each = individual[(individual["law"] == law) & individual["misfit"].notna()]
        chosen = pd.MultiIndex.from_frame(each[["trial", "impact"]])
        rows += _of_one_law(law, each, offset.reindex(chosen).to_numpy(), ensemble.loc[law])
        outside = (each["misfit"] > tolerance).to_numpy(float)
        for name, happens in unusual.items():
            cases = outside[happens.reindex(chosen).to_numpy() == 1.0]
            if len(cases):
                rows.append((f"{name}_outside", law, *share_of(cases), "1"))
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
    """Position of the peak of the density of ε (n,), and number of peaks above a tenth of the highest."""
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
