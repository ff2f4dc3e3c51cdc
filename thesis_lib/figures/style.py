"""Common style of all figures: one style sheet and one function to save them (laws: `law_style`).

A figure function is wrapped in `house_style`, takes arrays and tables, and returns the figure and the table of the
numbers drawn in it.  `save_figure` writes both; the bytes depend only on the content: no dates, no version numbers, no
settings from the user's matplotlibrc.

Figures are made without pyplot, so they share no state and need no window system.
"""

import functools
import io
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, TypeVar

import matplotlib
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from thesis_lib.foundation.columns import explain
from thesis_lib.foundation.files import atomic, write_table

SHEET = Path(__file__).with_name("thesis.mplstyle")
WIDTH = 6.3  # inches: the text width of an A4 or letter page
GREY, INK, SHADE = "0.55", "0.15", "#DCE6F0"
# Okabe and Ito's colours, for colour-blind readers
BLUE, RED, GREEN, VIOLET, YELLOW, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
SHADES = LinearSegmentedColormap.from_list("shades", ["#ffffff", "#9ecae1", "#0072B2"])
DARK = 0.55  # position on `SHADES` above which numbers are written in white
Drawn = tuple[Figure, pd.DataFrame]
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class ImpulseAxis:
    """Readable unit of impulses on axes; tables hold N s, or N s/kg if a dataset gives no mass."""

    factor: float
    unit: str

    @classmethod
    def of(cls, mass_known: bool) -> "ImpulseAxis":
        """Return mN s for hand-sized bodies of known mass, otherwise N s per kg."""
        return cls(1e3, "mN s") if mass_known else cls(1.0, "N s/kg")

    def label(self, ax: Axes, *, x: bool = True, y: bool = True) -> None:
        """Label the axes of tangential (x) and normal (y) impulse."""
        if x:
            ax.set_xlabel(f"tangential impulse $c_t$ ({self.unit})")
        if y:
            ax.set_ylabel(f"normal impulse $c_n$ ({self.unit})")


def _settings() -> dict:
    # matplotlib's own template, then our style sheet: a user's matplotlibrc must not change a figure
    rc = matplotlib.rc_params_from_file(SHEET, use_default_template=True)
    return {key: value for key, value in rc.items() if not key.startswith(("backend", "interactive", "toolbar"))}


def house_style(function: Callable[P, T]) -> Callable[P, T]:
    """Return a figure function that runs under the common style sheet."""

    @functools.wraps(function)
    def styled(*args: P.args, **kwargs: P.kwargs) -> T:
        with matplotlib.rc_context(_settings()):
            return function(*args, **kwargs)

    return styled


class NotebookFigure(Figure):
    """A figure that notebooks display exactly as it is saved, without pyplot."""

    def _repr_png_(self) -> bytes:
        return png_of(self)


def new_figure(width: float = WIDTH, height: float = 3.0, layout: str = "constrained") -> Figure:
    """Return an empty figure of the given size in inches, without pyplot; call under `house_style`.

    `layout` is "compressed" for a grid of panels of fixed aspect.
    """
    figure = NotebookFigure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


@house_style
def png_of(figure: Figure) -> bytes:
    """Return the figure as PNG; equal content gives equal bytes."""
    _settle(figure)
    file = io.BytesIO()
    figure.savefig(file, format="png", metadata={"Software": None})
    return file.getvalue()


@house_style
def save_figure(figure: Figure, table: pd.DataFrame, path: str | Path, png: bytes | None = None) -> None:
    """Write the picture `path` (.png, which may be omitted), the same as .pdf and the plotted numbers as .csv.

    `png` is the result of `png_of`; None: made here.  Equal content gives equal bytes.

    Raises:
        KeyError: foundation/columns.yaml does not explain a column.  Figures of the pipeline may have further columns,
            which their records explain; the rule `provenance` checks these.
    """
    path = Path(path).with_suffix("")
    if not path.name.startswith("figure_"):
        explain(path.name, table.columns)
    with atomic(path.with_name(f"{path.name}.png")) as tmp:
        tmp.write_bytes(png_of(figure) if png is None else png)
    with atomic(path.with_name(f"{path.name}.pdf")) as tmp, _fonts_without_layout():
        figure.savefig(tmp, metadata={"Creator": None, "Producer": None, "CreationDate": None})
    write_table(table, path.with_name(f"{path.name}.csv"))


def save_figures(drawn: Mapping[str, Drawn], beside: str | Path) -> None:
    """Write figures, by name, into the folder of the file `beside`."""
    for name, (figure, table) in drawn.items():
        save_figure(figure, table, Path(beside).with_name(name))


def _settle(figure: Figure) -> None:
    """Compute the layout of a figure once; without a layout engine, saving draws the figure once instead of twice.

    Constrained layout continues from its last state, and with panels of fixed aspect it does not converge: the page,
    .png and .pdf of one figure would differ.
    """
    if (engine := figure.get_layout_engine()) is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


@contextmanager
def _fonts_without_layout() -> Iterator[None]:
    """Embed fonts without their ligature and kerning tables, which are not needed if a PDF places each glyph.

    Reducing these tables to the glyphs in use takes as long as the rest of a figure; matplotlib has no option for it.
    """
    from fontTools.subset import Options

    kept = Options._drop_tables_default
    Options._drop_tables_default = [*kept, "GDEF", "GPOS", "GSUB"]
    try:
        yield
    finally:
        Options._drop_tables_default = kept
