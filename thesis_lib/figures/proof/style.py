"""Shared by the pictures of the proof: the look of each source of truth, the order of effects, an empty picture."""

from collections.abc import Iterable

import pandas as pd
from matplotlib.figure import Figure

from thesis_lib.effects import EFFECTS
from thesis_lib.figures.style import GREY

SOURCE_TITLE = {"law": "laws injected", "mechanism": "mechanisms", "drake": "mechanisms in Drake"}
SOURCE_LOOK = {"law": ("#0072B2", "o"), "mechanism": ("#D55E00", "s"), "drake": ("#009E73", "^")}


def in_order(effects: Iterable[str]) -> list[str]:
    """Distinct effects in the order of the library, by family; effects outside it come last."""
    library = list(EFFECTS)
    return sorted(set(effects), key=lambda name: (library.index(name) if name in EFFECTS else len(library), name))


def words(name: str) -> str:
    """Name of an effect or cause, as on axes."""
    return name.replace("_", " ")


def sources_in(table: pd.DataFrame) -> list[str]:
    """Sources of a table, in the order of `SOURCE_TITLE`."""
    return [name for name in SOURCE_TITLE if (table["source"] == name).any()]


def say_not_run(figure: Figure, what: str) -> None:
    """Mark a picture for which nothing is stored."""
    figure.text(0.5, 0.5, f"{what}: no stored results", ha="center", va="center", color=GREY)
