"""The look that all figures share: one style sheet, one colour and line for each law, one way to save.

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

from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.files import atomic, write_table

SHEET = Path(__file__).with_name("thesis.mplstyle")
WIDTH = 6.3  # inches: the text width of an A4 or letter page
PANELS = {"as_published": "as published", "as_defined": "as defined"}
GREY = "0.55"
INK = "0.15"
Drawn = tuple[Figure, pd.DataFrame]
P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class LineStyle:
    """How one law or bound looks in every figure: told apart by colour, and without colour by dashes."""

    label: str
    color: str
    dash: str | tuple
    hatch: str = ""

    @property
    def line(self) -> dict:
        """Keywords for `Axes.plot`."""
        return {"color": self.color, "linestyle": self.dash, "label": self.label}


# Okabe and Ito's colours, which colour-blind readers tell apart; laws of one panel of figure 3-3 differ in lightness
_LOOKS = {
    "drumwright_shell": ("#0072B2", "-", "////"),
    "anitescu_potra_poisson": ("#E69F00", (0, (5, 1.5)), "\\\\\\\\"),
    "anitescu_potra_newton": ("#009E73", "-", "////"),
    "mirtich": ("#CC79A7", (0, (5, 1.5)), "\\\\\\\\"),
    "wang_mason": ("#D55E00", (0, (1, 1.2)), ""),
    "whittaker": ("#56B4E9", (0, (4, 1.2, 1, 1.2)), "////"),
}
LAW_STYLE = {name: LineStyle(LAWS[name].title, *_LOOKS[name]) for name in SIX_LAWS}
BOUND_STYLE = {
    "best_post_hoc": LineStyle("Best Post Hoc", "0.45", (0, (3, 1, 1, 1, 1, 1))),
    "irb_bound": LineStyle("IRB Bound", "black", "-"),
}


def style_of(model: str) -> LineStyle:
    """The look of a law (either variant) or bound.

    Raises:
        KeyError: there is no such model.
    """
    name = model.removesuffix("_as_published").removesuffix("_as_defined")
    return {**LAW_STYLE, **BOUND_STYLE}[name]


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
        KeyError: a column of the table is not explained in `COLUMNS`.
    """
    unknown = [name for name in table.columns if name not in COLUMNS]
    if unknown:
        raise KeyError(f"columns without unit and meaning in figures.style.COLUMNS: {', '.join(unknown)}")
    path = Path(path)
    with atomic(path.with_name(f"{path.name}.png")) as tmp:
        figure.savefig(tmp, metadata={"Software": None})
    with atomic(path.with_name(f"{path.name}.pdf")) as tmp:
        figure.savefig(tmp, metadata={"Creator": None, "Producer": None, "CreationDate": None})
    write_table(table, path.with_name(f"{path.name}.csv"))


# unit and meaning of every column in the CSV beside a figure
COLUMNS: dict[str, tuple[str, str]] = {
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
}
