"""Rows of a run's tables: finding one, counting, and comparing two that have 95 % intervals."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from thesis_lib.statistics.wording import interval

if TYPE_CHECKING:
    import pandas as pd

Row = Mapping[Any, Any]  # or a row of a table
FROM_ZERO = ("below zero", "not told apart from zero", "above zero")
THAN = ("less than", "not told apart from", "more than")


def row_of(table: "pd.DataFrame", **where: object) -> Any:
    """The first row in which the named columns have these values.

    Raises:
        KeyError: there is no such column.
        IndexError: there is no such row.
    """
    for column, value in where.items():
        table = table[table[column] == value]
    if table.empty:
        raise IndexError(", ".join(f"a row with {column} {value}" for column, value in where.items()))
    return table.iloc[0]


def compared(row: Row, other: Row, words: tuple[str, str, str] = THAN) -> str:
    """The word for a row whose interval (low, high) lies below, across or above that of another row."""
    below, around, above = words
    return below if row["high"] < other["low"] else above if row["low"] > other["high"] else around


def share(row: Row, column: str = "value") -> str:
    """A share with its interval: 81.1 (77.4 to 84.5) %."""
    return interval(100.0 * row[column], 100.0 * row["low"], 100.0 * row["high"], "%")


def counted(n: float, noun: str, ending: str = "s") -> str:
    """1 tower, 3 towers, 1,000 impacts."""
    return f"{n:,.0f} {noun}{'' if n == 1 else ending}"
