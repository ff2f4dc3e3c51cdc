"""Tables of the proof: truth against verdict, the datasets that were missed, and a rerun of a few stored ones."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from thesis_lib.critique.proof.cases import RATIO, SEEDS, STORE, Case, run
from thesis_lib.critique.proof.results import CELL, VERDICTS, outcomes, recovered, wilson
from thesis_lib.foundation.errors import UserError
from thesis_lib.foundation.files import read_json

TABLE = {"ratio": RATIO, "drops": 150, "noise": 1.0}  # of the summary's table; the other sizes show the curve
MISFITS = ("error_before", "error_after", "floor", "before_over_floor", "after_over_floor")
CONFUSION = (
    *CELL,
    *("kind", "n", "right", "right_low", "right_high", "group_size", "named_first", "verdicts"),
    *MISFITS,
    *("n_parameters", "z", "coverage", "coverage_low", "coverage_high", "width"),
)
MISSES = ("source", "truth", "seed", "kind", "verdict", "named", "why")


def of_table(table: pd.DataFrame, **changes: float) -> pd.DataFrame:
    """Rows at the size, drops and noise of the summary's table, or with `changes` of these."""
    keep = np.ones(len(table), bool)
    for key, value in (TABLE | changes).items():
        keep &= (table[key] == value).to_numpy()
    return table[keep]


def confusion(store: Path = STORE) -> pd.DataFrame:
    """A row per source, truth, ratio, drops and noise: how often the verdict was right, and how well.

    Shares have Wilson intervals; misfits, |z| and widths are medians; columns are explained in foundation/columns.yaml,
    what is right and the misfit over its floor in `proof_results`.

    Raises:
        CorruptFileError: a stored result cannot be read.
    """
    datasets, parameters = outcomes(store), recovered(store)
    by_cell = dict(list(parameters.groupby(list(CELL)))) if len(parameters) else {}
    rows = []
    for cell, own in datasets.groupby(list(CELL), sort=False):
        values = by_cell.get(cell, parameters.iloc[:0])
        low, high = wilson(int(own["right"].sum()), len(own))
        inside_low, inside_high = wilson(int(values["inside"].sum()), len(values))
        rows.append(
            dict(zip(CELL, cell))
            | {
                "kind": own["kind"].iloc[0],
                "n": len(own),
                "right": own["right"].mean(),
                "right_low": low,
                "right_high": high,
                "group_size": own["group_size"].mean(),
                "named_first": _counts(own.loc[own["named_first"] != "", "named_first"]),
                "verdicts": _counts(own["verdict"], VERDICTS),
                **{name: own[name].median() for name in MISFITS},
                "n_parameters": len(values),
                "z": values["z"].abs().median(),
                "coverage": values["inside"].mean() if len(values) else np.nan,
                "coverage_low": inside_low,
                "coverage_high": inside_high,
                "width": values["width"].median(),
            }
        )
    return pd.DataFrame(rows, columns=list(CONFUSION))


def _counts(values: pd.Series, order: Sequence[str] | None = None) -> str:
    """As "a:3;b:1", the most frequent first, or in the given order."""
    counts = values.value_counts()
    names = sorted(counts.index, key=lambda name: (-counts[name], name))
    names = [name for name in order if name in counts.index] if order else names
    return ";".join(f"{name}:{counts[name]}" for name in names)


def misses(store: Path = STORE) -> pd.DataFrame:
    """Every stored dataset of the table (of its size, drops and noise: `TABLE`) that is wrong; columns `MISSES`.

    Raises:
        CorruptFileError: a stored result cannot be read.
    """
    own = of_table(outcomes(store))
    return own.loc[~own["right"].astype(bool), list(MISSES)].reset_index(drop=True)


def rerun(cases: Sequence[str], store: Path = STORE) -> pd.DataFrame:
    """Run the first dataset of each "source/truth" again and compare what it says with what is stored.

    Raises:
        UserError: a result is not stored; or a verdict, or what is named first, is not the stored one.
    """
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name in cases:
            source, truth = name.split("/")
            case = Case(source, truth, SEEDS)
            if not (store / case.path).is_file():
                raise UserError(
                    f"The proof holds no result of {name} to compare with. Make it with python -m "
                    f"thesis_lib.critique.proof run --source {source} --truths {truth}, or leave it out of "
                    "critique.proof in the configuration."
                )
            stored = read_json(store / case.path)
            again = run(case, Path(folder))
            same = all(stored[key] == again[key] for key in ("source", "truth", "verdict")) and (
                stored.get("steps", [])[:1] == again.get("steps", [])[:1]
            )
            rows.append({"source": source, "truth": truth, "verdict": again["verdict"], "agrees": int(same)})
    table = pd.DataFrame(rows, columns=["source", "truth", "verdict", "agrees"])
    if not table["agrees"].all():
        changed = (table["source"] + "/" + table["truth"])[table["agrees"] == 0].tolist()
        raise UserError(
            f"The critique says something else than the stored proof on {', '.join(changed)}. If the change is meant, "
            "delete config/proof and run python -m thesis_lib.critique.proof run again."
        )
    return table
