"""Functions for findings, from a run's tables: rows with 95 % intervals, counts, and names of laws."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from thesis_lib.statistics.wording import ends, interval, listed, number, side

if TYPE_CHECKING:
    from pandas import DataFrame, Series
else:  # pandas is loaded with the first table
    DataFrame = Series = Any

Row = Mapping[Any, Any]  # or a row of a table
FROM_ZERO = ("below zero", "indistinguishable from zero", "above zero")
THAN = ("less than", "indistinguishable from", "more than")
ABOUT = ("below", "indistinguishable from", "above")
PUBLISHED = "_as_published"


def rows_of(table: DataFrame, **where: object) -> DataFrame:
    """Return the rows in which the named columns have these values; KeyError if there is no such column."""
    for column, value in where.items():
        table = table[table[column] == value]
    return table


def row_of(table: DataFrame, **where: object) -> Any:
    """Return the first row in which the named columns have these values.

    Raises:
        KeyError: there is no such column.
        IndexError: there is no such row.
    """
    rows = rows_of(table, **where)
    if rows.empty:
        raise IndexError(", ".join(f"a row with {column} {value}" for column, value in where.items()))
    return rows.iloc[0]


def told(value: float, std: float, of: float, words: tuple[str, str, str]) -> str:
    """Word for an estimate with normal error that is below, indistinguishable from, or above the value `of`."""
    return side(*ends(value, std), of, words)


def compared(row: Row, other: Row, words: tuple[str, str, str] = THAN) -> str:
    """Word for a row whose interval (low, high) lies below, overlaps, or lies above the interval of another row."""
    below, around, above = words
    return below if row["high"] < other["low"] else above if row["low"] > other["high"] else around


def lies(row: Row, of: float, words: tuple[str, str, str] = ABOUT) -> str:
    """Word for a row whose interval lies below, around or above the value `of`."""
    return side(row["low"], row["high"], of, words)


def difference(a: Row, b: Row, words: tuple[str, str, str], column: str = "value") -> str:
    """Word for a difference a − b below, indistinguishable from, or above zero; a and b are independent, with `std`."""
    return told(a[column] - b[column], (a["std"] ** 2 + b["std"] ** 2) ** 0.5, 0.0, words)


def value(row: Row, column: str = "value", unit: str = "") -> str:
    """Value with its interval, as in 81.1 (77.4 to 84.5) m/s."""
    return interval(row[column], row["low"], row["high"], unit)


def share(row: Row, column: str = "value") -> str:
    """Share with its interval, as in 81.1 (77.4 to 84.5) %."""
    return interval(100.0 * row[column], 100.0 * row["low"], 100.0 * row["high"], "%")


def counted(n: float, noun: str, ending: str = "s") -> str:
    """Number with its noun, as in 1 tower, 3 towers, 1,000 impacts."""
    return f"{n:,.0f} {noun}{'' if n == 1 else ending}"


def studied(table: DataFrame, variant: str, weighting: str) -> DataFrame:
    """Rows of one variant of the laws and one weighting, indexed by law."""
    return table[(table["variant"] == variant) & (table["weighting"] == weighting)].set_index("law")


def ends_of(values: Series, written: Callable[[float], str] = number) -> str:
    """Smallest and largest value with the names of their laws."""
    parts = []
    for value in dict.fromkeys([float(values.min()), float(values.max())]):
        laws = [title_of(str(law)) for law in values.index[values == value]]
        parts.append(f"{written(value)} ({listed(laws)})")
    return " to ".join(parts)


def title_of(law: str) -> str:
    """Title of a law as in figures, but "published Mirtich" instead of "Mirtich (as published)", to fit in brackets."""
    from thesis_lib.contact import LAWS  # late: loads every law

    base = law.removesuffix(PUBLISHED)
    title = LAWS[base].title if base in LAWS else base
    return title if base == law else f"published {title}"
