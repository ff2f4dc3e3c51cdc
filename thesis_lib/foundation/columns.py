"""Unit and meaning of every column in the tables under results/, from columns.yaml, for results/columns.csv.

A column means the same in every table, unless `tables` in columns.yaml states otherwise for a table (by file stem);
columns of a single figure are explained in its record (`thesis_lib.thesis.records`).  Impulses of a dataset without a
mass are per kilogram, N s/kg = m/s.
"""

import functools
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

from thesis_lib.foundation.yaml_file import read_yaml

MEANINGS = Path(__file__).with_suffix(".yaml")
_COVARIANCE = ("product of both", "covariance of the two quantities in the column's name")


@functools.cache
def meanings() -> tuple[dict[str, list[str]], dict[str, dict[str, list[str]]]]:
    """(unit, meaning) by column, and by table and column; unit '' marks text, "1" pure numbers."""
    content = read_yaml(MEANINGS).content
    return content["columns"], content["tables"]


def explain(table: str, columns: Iterable[str], recorded: Mapping[str, tuple[str, str]] | None = None) -> pd.DataFrame:
    """Rows (table, column, unit, meaning) for the columns of the table with file stem `table`.

    `recorded`: (unit, meaning) of columns that only this table has.  KeyError if a column is not explained.
    """
    columns_of_all, tables = meanings()
    particular = {**tables.get(table, {}), **(recorded or {})}
    rows, unknown = [], []
    for name in columns:
        # cov_<one>_<other>: see datasets/format/impacts.py
        meaning = _COVARIANCE if name.startswith("cov_") else particular.get(name) or columns_of_all.get(name)
        if meaning is None:
            unknown.append(name)
        else:
            rows.append((table, name, *meaning))
    if unknown:
        raise KeyError(f"{table} has columns without unit and meaning in columns.yaml: {', '.join(unknown)}")
    return pd.DataFrame(rows, columns=["table", "column", "unit", "meaning"])
