"""Numbers of a critique for plots and pages: ladder, errors of laws, parameters that moved."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from thesis_lib.critique.contacts.contact_time import BASE_PARAMETERS, CONTACT_TIME
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.statistics.intervals import Z95, clustered_mean

MOVED, MATERIAL = 3.0, 0.02  # least change of a compensating parameter: standard errors, and share
BASE_NAMES = tuple(p.name for p in (*BASE_PARAMETERS, CONTACT_TIME))


def ladder_table(critique: DropsCritique, tables: Mapping[str, pd.DataFrame] | None = None) -> pd.DataFrame:
    """Held-out error after 0, 1, ... effects: label, error, error_low, error_high (m/s), and
    the channels in sigma.

    Rows come from `tables["ladder"]` if it exists, so that page, plot and table agree.
    """
    names = list(critique.ladder[0][2].sigmas)
    columns = ["label", "error", "error_low", "error_high", *names]
    stored = (tables or {}).get("ladder")
    if stored is not None:
        return stored[columns].reset_index(drop=True)
    rows = []
    for label, _, judged in critique.ladder:
        sigma = [judged.misfit(name)[0] for name in names]
        rows.append((label, *clustered_mean(judged.error, judged.trial), *sigma))
    return pd.DataFrame(rows, columns=columns)


def law_errors(critique: DropsCritique) -> tuple[pd.DataFrame, np.ndarray]:
    """Held-out error and score of each law without effects, best first, and Best Post Hoc's error (n,) in m/s.

    Columns: model, error, error_low, error_high (m/s), gain, gain_low, gain_high (nats per impact over the base law).
    """
    base = critique.laws[critique.discovery.base]
    trials = base.trials
    n, m = len(base.score), len(trials)
    rows = []
    for name, judged in critique.laws.items():
        difference = judged.by_trial(trials) - base.by_trial(trials)
        gain = float(difference.sum() / n)
        half = Z95 * np.sqrt(m * difference.var(ddof=1)) / n if m > 1 else np.nan
        rows.append((name, *clustered_mean(judged.error, judged.trial), gain, gain - half, gain + half))
    table = pd.DataFrame(rows, columns=["model", "error", "error_low", "error_high", "gain", "gain_low", "gain_high"])
    best = np.min(np.stack([judged.error for judged in critique.laws.values()]), axis=0)
    return table.sort_values("error", kind="stable", ignore_index=True), best


def parameter_table(critique: DropsCritique) -> pd.DataFrame:
    """Each parameter at each rung of the ladder: columns label, parameter, unit, value, std; of a bound std is NaN."""
    rows = [
        (label, name, p.unit, fitted.content(name)["value"], fitted.std[name])
        for label, fitted, _ in critique.ladder
        for name, p in fitted.model.parameters.items()
    ]
    return pd.DataFrame(rows, columns=["label", "parameter", "unit", "value", "std"])


def compensations(critique: DropsCritique) -> pd.DataFrame:
    """Change of each base parameter from the first to the last rung: columns parameter, before, after, sigmas.

    `sigmas` is the change over the joint standard error.  Empty if the law changed: μ and ε of different laws differ.
    """
    first, last = critique.ladder[0][1], critique.ladder[-1][1]
    rows = []
    for name in first.values if first.model.law.name == last.model.law.name else ():
        if name in last.values and not np.isnan(first.std[name] + last.std[name]):
            std = float(np.hypot(first.std[name], last.std[name]))
            moved = last.values[name] - first.values[name]
            rows.append((name, first.values[name], last.values[name], moved / std if std > 0 else np.nan))
    return pd.DataFrame(rows, columns=["parameter", "before", "after", "sigmas"])


def compensated(critique: DropsCritique, material: bool = True) -> pd.DataFrame:
    """The rows of `compensations` with a significant change that is material, or is not."""
    table = compensations(critique)
    share = (table["after"] - table["before"]).abs() / table["before"].abs()
    return table[(table["sigmas"].abs() > MOVED) & ((share > MATERIAL) if material else (share <= MATERIAL))]
