"""The look that all figures share: one style sheet and one way to save (laws have theirs in `law_style`).

A figure function is wrapped in `house_style`, takes arrays and tables, and returns the figure and the table of the
numbers drawn in it.  `save_figure` writes both beside each other with bytes that depend on nothing but the content:
no dates, no version numbers, and no settings from the user's own matplotlibrc.

Figures are made without pyplot, so that no state is shared and no window system is looked for.
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, TypeVar

import matplotlib
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from thesis_lib.foundation.columns import explain
from thesis_lib.foundation.files import atomic, write_table

SHEET = Path(__file__).with_name("thesis.mplstyle")
WIDTH = 6.3  # inches: the text width of an A4 or letter page
PANELS = {"as_published": "as published", "as_defined": "as defined"}
GREY = "0.55"
INK = "0.15"
Drawn = tuple[Figure, pd.DataFrame]
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class ImpulseAxis:
    """Impulses are stored in N s (N s/kg where a dataset gives no mass); axes show a readable multiple."""

    factor: float
    unit: str

    @classmethod
    def of(cls, mass_known: bool) -> "ImpulseAxis":
        """mN s for hand-sized bodies of known mass, else N s per kg."""
        return cls(1e3, "mN s") if mass_known else cls(1.0, "N s/kg")


def _settings() -> dict:
    # the template of matplotlib itself, then our sheet: a user's own matplotlibrc must not change a figure
    rc = matplotlib.rc_params_from_file(SHEET, use_default_template=True)
    return {
        key: value for key, value in rc.items() if not key.startswith(("backend", "interactive", "toolbar"))
    }


def house_style(function: Callable[P, T]) -> Callable[P, T]:
    """Run a figure function under the shared style sheet."""

    @functools.wraps(function)
    def styled(*args: P.args, **kwargs: P.kwargs) -> T:
        with matplotlib.rc_context(_settings()):
            return function(*args, **kwargs)

    return styled


def new_figure(width: float = WIDTH, height: float = 3.0, layout: str = "constrained") -> Figure:
    """An empty figure of the given size in inches, without pyplot; call under `house_style`.

    `layout` is "compressed" where a grid of panels keeps its aspect.
    """
    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


@house_style
def save_figure(figure: Figure, table: pd.DataFrame, path: str | Path) -> None:
    """Write `path`.png, `path`.pdf and the plotted numbers as `path`.csv; equal content gives equal bytes.

    Raises:
        KeyError: a column of the table is not explained in foundation/columns.yaml.  A figure of the run may have
            columns of its own, which its record explains; the rule `provenance` looks there, too.
    """
    path = Path(path)
    if not path.name.startswith("figure_"):
        explain(path.name, table.columns)
    with atomic(path.with_name(f"{path.name}.png")) as tmp:
        figure.savefig(tmp, metadata={"Software": None})
    with atomic(path.with_name(f"{path.name}.pdf")) as tmp:
        figure.savefig(tmp, metadata={"Creator": None, "Producer": None, "CreationDate": None})
    write_table(table, path.with_name(f"{path.name}.csv"))
