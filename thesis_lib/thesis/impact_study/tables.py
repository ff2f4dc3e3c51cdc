"""Tables 3.1 and 3.2 of the thesis, and the summary of held-out errors, from the tables of `impact_study`.

Every table has both weightings of equation 3.7 (see `cost`) and two variants: `as_published`, the authors' code where
it differs from the law of that name, and `as_defined`, the six laws themselves.  Standard errors of shares are Wilson's
(see `shares`), so a share of 0 % has one as well.
"""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from thesis_lib.contact import SIX_LAWS
from thesis_lib.contact.bounds import best_post_hoc
from thesis_lib.statistics.intervals import wilson_std
from thesis_lib.thesis.impact_study.settings import SIX_AS_PUBLISHED

VARIANTS = {"as_published": SIX_AS_PUBLISHED, "as_defined": SIX_LAWS}
MU_ZERO = 1e-3  # an individual μ below this counts as zero; the thesis's smallest ensemble value is 0.062


def best_and_worst(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shares of impacts in which each law is best and worst, from errors (n, laws); a failed solve is worst."""
    errors = np.where(np.isnan(errors), np.inf, errors)
    count = errors.shape[1]
    best = np.bincount(np.argmin(errors, axis=1), minlength=count) / len(errors)
    worst = np.bincount(np.argmax(errors, axis=1), minlength=count) / len(errors)
    return best, worst


def table_3_1(ensemble: pd.DataFrame, errors: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Table 3.1 for each variant and weighting; `errors` are held-out errors by weighting.

    Best and worst are counted, in per cent, in impulse space over held-out impacts among the six laws of a variant, as
    by the authors.  `at_bound` names parameters at the edge of their range, whose standard errors are meaningless.
    """
    rows = []
    for (weighting, table), (variant, laws) in itertools.product(errors.items(), VARIANTS.items()):
        wide = _by_model(table, "impulse_error")
        best, worst = best_and_worst(wide[list(laws)].to_numpy())
        for i, name in enumerate(laws):
            fit = ensemble[(ensemble["law"] == name) & (ensemble["weighting"] == weighting)].iloc[0]
            row = {"variant": variant, "weighting": weighting, "law": SIX_LAWS[i]}
            row |= {column: fit[column] for column in ("mu", "mu_std", "epsilon", "epsilon_std")}
            row["at_bound"] = "" if pd.isna(fit["at_bound"]) else fit["at_bound"]  # empty in a file
            for column, share in (("best", best[i]), ("worst", worst[i])):
                row |= {column: 100 * share, f"{column}_std": 100 * wilson_std(share, len(wide))}
            rows.append(row | {"n_train": int(fit["n"]), "n_held_out": len(wide)})
    return pd.DataFrame(rows)


def table_3_2(individual: pd.DataFrame, tolerances: Sequence[float], mass: float) -> pd.DataFrame:
    """Table 3.2: share of outcomes within each law's range; `tolerances` of impulse over mass in m/s.

    `fraction_up_to_one` is the share with μ <= 1.  Only Mirtich's as published needs more; its μ is a viscosity in s/m.
    """
    rows = []
    for (weighting, chosen), (variant, laws) in itertools.product(individual.groupby("weighting"), VARIANTS.items()):
        for i, name in enumerate(laws):
            mu, error = (chosen.loc[chosen["law"] == name, key].to_numpy() for key in ("mu", "misfit"))
            error = error / mass
            for tolerance in tolerances:
                share = float(np.mean(error <= tolerance))
                std = wilson_std(share, len(error))
                up_to_one = float(np.mean((error <= tolerance) & (mu <= 1.0)))
                rows.append((variant, weighting, SIX_LAWS[i], tolerance, share, std, up_to_one, len(error)))
    columns = ["variant", "weighting", "law", "tolerance", "fraction", "fraction_std", "fraction_up_to_one", "n"]
    return pd.DataFrame(rows, columns=columns)


def _by_model(errors: pd.DataFrame, values: str) -> pd.DataFrame:
    """Table with a column per model, a row per impact, as by `DataFrame.pivot` but with a quarter of the memory."""
    columns: dict[str, pd.Series] = {}
    for model in sorted(errors["model"].unique()):
        rows = errors.loc[errors["model"] == model, ["trial", "impact", values]]
        column = rows.set_index(["trial", "impact"])[values]
        first = next(iter(columns.values()), column)
        if column.index.equals(first.index):  # true unless a model lacks an impact: one index for all
            column.index = first.index
        columns[model] = column
    return pd.DataFrame(columns).sort_index()


def error_summary(errors: pd.DataFrame) -> pd.DataFrame:
    """Table of mean (with standard error), median and 90 % quantile of velocity errors per model and Best Post Hoc."""
    wide = _by_model(errors, "velocity_error")
    for variant, laws in VARIANTS.items():
        wide[f"best_post_hoc_{variant}"] = best_post_hoc(wide[list(laws)].to_numpy())[1]
    rows = []
    for model, values in wide.items():
        mean = values.mean(), values.std(ddof=1) / np.sqrt(values.count())
        rows.append((model, *mean, values.median(), values.quantile(0.9), values.count(), values.isna().sum()))
    columns = ["model", "mean", "mean_std", "median", "quantile_90", "n", "n_failed"]
    return pd.DataFrame(rows, columns=columns)
