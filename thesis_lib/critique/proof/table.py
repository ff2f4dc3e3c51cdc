"""Tables of the proof: truth against verdict, and the datasets that were missed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.critique.proof.cases import RATIO
from thesis_lib.critique.proof.results import CELL, outcomes, recovered
from thesis_lib.critique.proof.store import STORE, VERDICTS
from thesis_lib.statistics.intervals import wilson

TABLE = {"ratio": RATIO, "drops": 150, "noise": 1.0}  # of the summary; other sizes show the curve
MISFITS = ("error_before", "error_after", "floor", "before_over_floor", "after_over_floor")
CONFUSION = (
    *CELL,
    *("kind", "n", "right", "right_low", "right_high", "group_size", "named_first", "verdicts"),
    *MISFITS,
    *("n_parameters", "z", "coverage", "coverage_low", "coverage_high", "width"),
)
MISSES = ("source", "truth", "seed", "kind", "verdict", "named", "why")


def of_table(table: pd.DataFrame, **changes: float) -> pd.DataFrame:
    """Rows at the size, drops and noise of `TABLE`, or of `changes`."""
    keep = np.ones(len(table), bool)
    for key, value in (TABLE | changes).items():
        keep &= (table[key] == value).to_numpy()
    return table[keep]


def confusion(store: Path = STORE) -> pd.DataFrame:
    """A row per cell of datasets: shares with Wilson's intervals, medians of misfits, |z| and widths."""
    datasets, parameters = outcomes(store), recovered(store)
    by_cell = dict(list(parameters.groupby(list(CELL)))) if len(parameters) else {}
    rows = []
    for cell, group in datasets.groupby(list(CELL), sort=False):
        values = by_cell.get(cell, parameters.iloc[:0])
        row = dict(zip(CELL, cell)) | {name: group[name].median() for name in MISFITS}
        row |= {"kind": group["kind"].iloc[0], "n": len(group)}
        row |= {"right": group["right"].mean(), "group_size": group["group_size"].mean()}
        row["right_low"], row["right_high"] = wilson(int(group["right"].sum()), len(group))
        row["named_first"] = _counts(group.loc[group["named_first"] != "", "named_first"])
        row["verdicts"] = _counts(group["verdict"], VERDICTS)
        row |= {"n_parameters": len(values), "z": values["z"].abs().median(), "width": values["width"].median()}
        row["coverage"] = values["inside"].mean() if len(values) else np.nan
        row["coverage_low"], row["coverage_high"] = wilson(int(values["inside"].sum()), len(values))
        rows.append(row)
    return pd.DataFrame(rows, columns=list(CONFUSION))


def _counts(values: pd.Series, order: Sequence[str] | None = None) -> str:
    """Counts as "a:3;b:1", the most frequent first, or in `order`."""
    counts = values.value_counts()
    names = sorted(counts.index, key=lambda name: (-counts[name], name))
    names = [name for name in order if name in counts.index] if order else names
    return ";".join(f"{name}:{counts[name]}" for name in names)


def misses(store: Path = STORE) -> pd.DataFrame:
    """Every dataset of `TABLE` with a wrong verdict; columns `MISSES`."""
    datasets = of_table(outcomes(store))
    return datasets.loc[~datasets["right"].astype(bool), list(MISSES)].reset_index(drop=True)
