"""Names of impact laws within sentences."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from thesis_lib.statistics.wording import listed, number

if TYPE_CHECKING:
    import pandas as pd

PUBLISHED = "_as_published"


def ends_of(values: "pd.Series", written: Callable[[float], str] = number) -> str:
    """Smallest and largest value with the names of their laws."""
    parts = []
    for value in dict.fromkeys([float(values.min()), float(values.max())]):
        laws = [title_of(str(law)) for law in values.index[values == value]]
        parts.append(f"{written(value)} ({listed(laws)})")
    return " to ".join(parts)


def title_of(law: str) -> str:
    """The title as in the figures, but "published Mirtich" instead of "Mirtich (as published)", to fit in brackets."""
    from thesis_lib.contact import LAWS  # late: loads every law

    base = law.removesuffix(PUBLISHED)
    title = LAWS[base].title if base in LAWS else base
    return title if base == law else f"published {title}"
