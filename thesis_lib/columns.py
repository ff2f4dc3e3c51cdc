"""Unit and meaning of every column in the tables under results/: one dictionary, written to results/columns.csv.

A column means the same in every table, except where `TABLES` says otherwise for one table (by the file's stem).
Impulses of a dataset without a mass are per kilogram, N s/kg = m/s.
"""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from thesis_lib.files import write_table

Meaning = tuple[str, str]  # unit ('' for text, "1" for pure numbers), meaning

COLUMNS: dict[str, Meaning] = {
    "panel": ("", "part of the figure, as lettered or titled in it"),
    "variant": (
        "",
        "as_published: the authors' code where it differs from its law; as_defined: the law itself",
    ),
    "series": ("", "what is drawn: the name of a curve, point or group of points"),
    "kind": ("", "sample: measured; arc: fitted flight; impact: instant of a detected impact"),
    "law": ("", "impact law, a key of thesis_lib.contact.LAWS"),
    "model": ("", "impact law or post-hoc bound"),
    "trial": ("", "number of the release"),
    "impact": ("", "number of the impact within its trial, from 0"),
    "subset": ("", "number of the random order in which impacts are added"),
    "x": ("m", "horizontal position"),
    "y": ("m", "vertical position"),
    "t": ("s", "time since the trial's first sample"),
    "value": ("m", "x, y, or θ times the radius of gyration, as `series` says"),
    "energy": ("J", "energy above rest on the surface; J/kg where the dataset gives no mass"),
    "c_t": ("N s", "tangential impulse on the body; N s/kg where the dataset gives no mass"),
    "c_n": ("N s", "normal impulse on the body; N s/kg where the dataset gives no mass"),
    "momentum_t": ("N s", "tangential contact momentum before impact, (M_C v_C)_t; N s/kg without a mass"),
    "momentum_n": ("N s", "normal contact momentum before impact, (M_C v_C)_n; N s/kg without a mass"),
    "mu": ("1", "coefficient of friction"),
    "epsilon": ("1", "coefficient of restitution"),
    "parameter": ("1", "value of μ or ε at which a density is given"),
    "cost": ("N s", "mean misfit in impulse space an impact; N s/kg without a mass"),
    "misfit": ("N s", "misfit of one impact in impulse space; N s/kg without a mass"),
    "error": ("m/s", "error of the velocity after impact, √(δv_x² + δv_y² + (k δω)²)"),
    "density": ("", "probability density: s/m over errors, 1 over parameters"),
    "share_below": ("1", "share of held-out impacts with at most this error"),
    "k": ("1", "number of impacts identified from"),
    "n": ("1", "impacts that went into the value"),
    "weighting": ("", "of Δω against Δv in equation 3.7: kinetic, or unweighted as the authors have it"),
    "mu_std": ("1", "bootstrap standard error of mu"),
    "epsilon_std": ("1", "bootstrap standard error of epsilon"),
    "mu_s": ("1", "sticking bound: the impulse does not change for larger mu"),
    "n_failed": ("1", "impacts for which the law has no solution"),
    "at_bound": ("", "parameters that ended at the edge of their range"),
    "train": ("1", "1: for identification, 0: held out"),
    "velocity_error": ("m/s", "error of the velocity after impact, √(δv_x² + δv_y² + (k δω)²)"),
    "impulse_error": ("N s", "distance from the measured impulse"),
    "mean": ("m/s", "mean error of the velocity after impact"),
    "mean_std": ("m/s", "standard error of the mean"),
    "median": ("m/s", "median error"),
    "quantile_90": ("m/s", "error that 90 % of the impacts do not exceed"),
    "best": ("%", "share of impacts in which the law is nearest to the measured impulse, of the six"),
    "best_std": ("%", "its binomial standard error"),
    "worst": ("%", "share of impacts in which the law is farthest from the measured impulse, of the six"),
    "worst_std": ("%", "its binomial standard error"),
    "n_train": ("1", "impacts identified from"),
    "n_held_out": ("1", "impacts judged on"),
    "tolerance": ("m/s", "impulse over mass up to which an outcome counts as within range"),
    "fraction": ("1", "share of outcomes within the law's range"),
    "fraction_std": ("1", "its binomial standard error"),
    "share": ("1", "area of the law's region over that of the admissible set, mean over impacts"),
    "share_std": ("1", "standard error of the mean"),
    "statement": ("", "what the thesis states, explained in thesis_lib/identify/statements.py"),
    "unit": ("", "unit of value"),
    "std": ("as value", "standard error of value"),
    "count": ("1", "number"),
}

TABLES: dict[str, dict[str, Meaning]] = {
    "statements": {"value": ("see unit", "the statement as a number")},
    "published_agreement": {
        "mu": ("1", "with which the authors' predictions were stored; s/m for Mirtich"),
        "epsilon": ("1", "with which the authors' predictions were stored"),
        "median": ("N s", "median distance between our impulses and the stored ones"),
        "quantile_95": ("N s", "distance that 95 % of the impacts do not exceed"),
    },
    "published_best_worst": {},
    "published_cost": {
        "cost_published": ("N s", "mean misfit at the parameters of table 3.1"),
        "cost_best": ("N s", "mean misfit at the best parameters for the same impacts"),
        "excess": ("1", "cost_published over cost_best, minus 1"),
    },
    "published_kept": {"drops": ("", "all, kept (without a flag), or the flag that they carry")},
}


def explain(table: str, columns: Iterable[str]) -> pd.DataFrame:
    """Rows (table, column, unit, meaning) for the columns of the table with file stem `table`.

    Raises:
        KeyError: a column is not explained.
    """
    own = TABLES.get(table, {})
    columns = list(columns)
    unknown = [name for name in columns if name not in own and name not in COLUMNS]
    if unknown:
        raise KeyError(f"{table} has columns without unit and meaning in columns.py: {', '.join(unknown)}")
    rows = [(table, name, *(own.get(name) or COLUMNS[name])) for name in columns]
    return pd.DataFrame(rows, columns=["table", "column", "unit", "meaning"])


def write_result(table: pd.DataFrame, path: str | Path) -> None:
    """Write a table of results, all of whose columns are explained here.

    Raises:
        KeyError: a column is not explained.
    """
    explain(Path(path).stem, table.columns)
    write_table(table, path)


def column_dictionary(paths: Iterable[str | Path]) -> pd.DataFrame:
    """The explanations of all columns in the given CSV files, one set of rows a kind of table."""
    parts = {}
    for path in sorted(map(Path, paths)):
        parts[path.stem] = explain(path.stem, pd.read_csv(path, nrows=0).columns)
    return pd.concat([parts[name] for name in sorted(parts)], ignore_index=True)
