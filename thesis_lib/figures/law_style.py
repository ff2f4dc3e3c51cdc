"""Colour and line style of each law and bound, the same in every figure.

This module is separate from `style`, so that a figure without laws does not depend on the code of the laws.
"""

from dataclasses import dataclass

from thesis_lib.contact import LAWS, SIX_LAWS


@dataclass(frozen=True)
class LineStyle:
    """Style of one law or bound in every figure; colour and dashes are each sufficient to distinguish it."""

    label: str
    color: str
    dash: str | tuple
    hatch: str = ""

    @property
    def line(self) -> dict:
        """Keyword arguments for `Axes.plot`."""
        return {"color": self.color, "linestyle": self.dash, "label": self.label}


# Okabe and Ito's colours, for colour-blind readers; laws in one panel of figure 3-3 differ in lightness
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
    """Return the style of a law (either variant) or bound.

    Raises:
        KeyError: the model is unknown.
    """
    name = model.removesuffix("_as_published").removesuffix("_as_defined")
    return {**LAW_STYLE, **BOUND_STYLE}[name]
