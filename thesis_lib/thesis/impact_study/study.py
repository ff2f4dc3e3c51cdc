"""The impact study of chapter 3: tables of parameters, held-out errors and predictive ranges from impacts.

Training and held-out impacts are separate.  `split_trials` draws the training trials for the ensemble parameters; every
error and every best/worst count are from the other trials.  Individual parameters and predictive ranges describe
single impacts without predicting, and use all impacts.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from thesis_lib.coefficients.cost import MeasuredImpulses, Weighting, misfit_table, target_of
from thesis_lib.coefficients.ensemble import fit_ensemble
from thesis_lib.coefficients.individual import fit_individual
from thesis_lib.contact import LAWS
from thesis_lib.contact.bounds import irb_bound
from thesis_lib.contact.space import contact_space, velocity_error
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.datasets.impacts.quality import thesis_filter
from thesis_lib.foundation.randomness import generator
from thesis_lib.statistics.intervals import mean_of
from thesis_lib.thesis.impact_study.predictive_range import covered_share

ALL_LAWS = tuple(LAWS)


def split_trials(trials: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a `share` of the trials for training; mask (n,) of their impacts.  ValueError for fewer than two trials."""
    units = np.unique(trials)
    if len(units) < 2:
        raise ValueError("at least two trials are needed to separate training and held-out data")
    count = int(np.clip(round(share * len(units)), 1, len(units) - 1))
    return np.isin(trials, rng.choice(units, size=count, replace=False))


def select_impacts(impacts: Impacts, filtering: str, max_impacts: int | None, rng: np.random.Generator) -> Impacts:
    """Select up to `max_impacts` approaching impacts, filtered as in the thesis or not; ValueError if none is left."""
    body = {"mass": impacts.mass, "k_g": impacts.k_g}
    impacts = impacts.select(contact_space(impacts.v_pre, impacts.r, **body).v_n < 0.0)
    if filtering == "thesis":
        impacts = impacts.select(thesis_filter(impacts))
    impacts = impacts.sample(max_impacts, rng)
    if not len(impacts):
        raise ValueError("no impact is left to study; see left_out.csv and the flags in impacts.csv")
    return impacts


def split_table(impacts: Impacts, train: np.ndarray) -> pd.DataFrame:
    """Table of the impacts studied, with the training mask `train` (n,)."""
    return pd.DataFrame({"trial": impacts.trial, "impact": impacts.impact, "train": train.astype(int)})


def pick(impacts: Impacts, split: pd.DataFrame, train: int | None = None) -> Impacts:
    """Return the impacts listed in `split`: all, or only training (1) or held-out (0) impacts."""
    chosen = split if train is None else split[split["train"] == train]
    keys = pd.MultiIndex.from_frame(chosen[["trial", "impact"]])
    here = pd.MultiIndex.from_arrays([impacts.trial, impacts.impact])
    return impacts.select(here.isin(keys))


def ensemble_table(
    impacts: Impacts, laws: Sequence[str], weightings: Sequence[Weighting], bootstrap: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Table of ensemble (μ, ε) with bootstrap standard errors, a row per law and weighting of eq. 3.7."""
    rows = []
    seed = int(rng.integers(2**63))  # streams by name, so that adding a law does not change others
    for weighting in weightings:
        target = target_of(impacts, weighting)
        for name in laws:
            stream = generator(seed, weighting, name)
            fit = fit_ensemble(LAWS[name], target, "impulse", trials=impacts.trial, bootstrap=bootstrap, rng=stream)
            rows.append({"law": name, "weighting": weighting, **fit.columns()})
    return pd.DataFrame(rows)


def convergence_table(
    impacts: Impacts, laws: Iterable[str], sizes: Sequence[int], subsets: int, rng: np.random.Generator
) -> pd.DataFrame:
    """Table of ensemble parameters and cost (N s) by number of impacts k, for nested random subsets (figure 3-7 b)."""
    target = target_of(impacts)
    orders = [rng.permutation(len(impacts)) for _ in range(subsets)]
    rows = []
    for name in laws:
        for subset, order in enumerate(orders):
            for k in sorted({min(k, len(impacts)) for k in sizes}):
                fit = fit_ensemble(LAWS[name], target[order[:k]], "impulse")
                best = {"mu": fit.mu, "epsilon": fit.epsilon, "cost": fit.cost}
                rows.append({"law": name, "subset": subset, "k": k, **best})
    return pd.DataFrame(rows)


def topography_table(
    impacts: Impacts, law: str, n: int, mu: np.ndarray, epsilon: np.ndarray, rng: np.random.Generator
) -> pd.DataFrame:
    """Table of the mean misfit (N s) of n random impacts over a grid of (μ, ε) (figure 3-7 a)."""
    rows = rng.choice(len(impacts), size=min(n, len(impacts)), replace=False)
    grid = {"mu": np.repeat(mu, len(epsilon)), "epsilon": np.tile(epsilon, len(mu))}
    misfits = misfit_table(LAWS[law], target_of(impacts)[rows], **grid, metric="impulse")
    return pd.DataFrame({"law": law, "n": len(rows), **grid, "cost": np.nanmean(misfits, axis=1)})


def convexity_violations(topography: pd.DataFrame) -> float:
    """Share of triples of adjacent grid points, along axes and diagonals, with c(a) + c(b) < 2 c(middle)."""
    cost = topography.pivot(index="mu", columns="epsilon", values="cost").to_numpy()
    slack = -1e-9 * np.ptp(cost)  # for rounding
    second = [
        cost[2:, :] - 2 * cost[1:-1, :] + cost[:-2, :],
        cost[:, 2:] - 2 * cost[:, 1:-1] + cost[:, :-2],
        cost[2:, 2:] - 2 * cost[1:-1, 1:-1] + cost[:-2, :-2],
        cost[2:, :-2] - 2 * cost[1:-1, 1:-1] + cost[:-2, 2:],
    ]
    values = np.concatenate([part.ravel() for part in second])
    return float(np.mean(values < slack))


def individual_table(impacts: Impacts, laws: Iterable[str], weightings: Sequence[Weighting]) -> pd.DataFrame:
    """Table of individual (μ_i, ε_i), misfit and sticking bound μ_s, per impact, law and weighting (figure 3-10)."""
    parts = []
    for weighting in weightings:
        target = target_of(impacts, weighting)
        for name in laws:
            fit = fit_individual(LAWS[name], target, "impulse")
            labels = {"trial": impacts.trial, "impact": impacts.impact, "law": name, "weighting": weighting}
            values = {"mu": fit.mu, "epsilon": fit.epsilon, "misfit": fit.error, "mu_s": fit.mu_s}
            parts.append(pd.DataFrame(labels | values))
    return pd.concat(parts, ignore_index=True)


def held_out_errors(
    impacts: Impacts, split: pd.DataFrame, ensemble: pd.DataFrame, weighting: Weighting
) -> pd.DataFrame:
    """Table of errors of the held-out impacts, a row per impact and model.

    Columns: trial, impact, model (a law, or `irb_bound`), velocity_error in m/s (kinetic norm of the velocity of the
    centre of mass) and impulse_error in N s (against the measured impulse in that weighting).
    """
    impacts = pick(impacts, split, train=0)
    target = target_of(impacts, weighting)
    body = {"mass": impacts.mass, "k_g": impacts.k_g}
    bound = irb_bound(impacts.v_pre, impacts.v_post, impacts.r, **body)
    errors = {"irb_bound": (bound.error, _distance(target, *bound.impulse.T))}
    for row in ensemble[ensemble["weighting"] == weighting].itertuples():
        out = LAWS[row.law](impacts.v_pre, impacts.r, **body, mu=row.mu, epsilon=row.epsilon)
        velocity = velocity_error(impacts.v_post - out.v_post, impacts.k_g)
        errors[row.law] = (velocity, _distance(target, *out.impulse.T))
    # whole columns at once, because joining tables would need twice the memory
    velocity, impulse = (np.concatenate(parts) for parts in zip(*errors.values()))
    columns = {name: np.tile(getattr(impacts, name), len(errors)) for name in ("trial", "impact")}
    columns["model"] = pd.array(list(errors), dtype="str").repeat(len(impacts))
    return pd.DataFrame(columns | {"velocity_error": velocity, "impulse_error": impulse}, copy=False)


def _distance(target: MeasuredImpulses, c_t: np.ndarray, c_n: np.ndarray) -> np.ndarray:
    return np.hypot(c_t - target.c_t, c_n - target.c_n)


def coverage_table(impacts: Impacts, laws: Iterable[str]) -> pd.DataFrame:
    """Table of the share of the admissible set that each law covers, averaged over impacts (figure 3-3)."""
    space = target_of(impacts).space
    rows = [(name, *mean_of(covered_share(LAWS[name], space))) for name in laws]
    return pd.DataFrame(rows, columns=["law", "share", "share_std"])
