"""Figures 4-5, 4-6 and of named physics with residuals: held-out errors of learned contact models.

The error of an impact is ‖v⁺ − v̂⁺‖_k = √(δv_x² + δv_y² + (k δω)²) in m/s; means are over held-out impacts and random
splits.  Tables are from thesis_lib.thesis.residual.learning_study; n is the number of training impacts.  Bands
and bars are 95 % intervals: over splits in figure 4-6, over held-out trials in the figure of named physics.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from thesis_lib.figures.law_style import BOUND_STYLE, LAW_STYLE, LineStyle
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SKY, VIOLET, YELLOW, Drawn, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.figures.chapter3.errors import draw_error_curves, label_error_curves

GRID = 120
LEARNER_STYLE = {
    "rigid_x1": LineStyle("rigid, X1", BLUE, "-"),
    "rigid_x2": LineStyle("rigid, X2", SKY, (0, (5, 1.5))),
    "rigid_x2_polar": LineStyle("rigid, X2 polar", SKY, (0, (1, 1.2))),
    "wrench_x1": LineStyle("wrench, X1", RED, "-"),
    "wrench_x1_omega": LineStyle("wrench, X1 and ω", RED, (0, (5, 1.5))),
    "residual_rigid": LineStyle("law + rigid residual", BLUE, "-"),
    "residual_wrench": LineStyle("law + wrench residual", RED, "-"),
    "law_parameters": LineStyle("law, learned μ and ε", YELLOW, "-"),
    "feasible_rigid": LineStyle("feasible rigid, X1", VIOLET, "-"),
    "feasible_wrench": LineStyle("feasible wrench, X1 and ω", VIOLET, (0, (5, 1.5))),
}
CLASSES = {
    "(a) data-driven": ("rigid_x1", "rigid_x2", "wrench_x1", "wrench_x1_omega", "feasible_rigid", "feasible_wrench"),
    "(b) with an impact law": ("residual_rigid", "residual_wrench", "law_parameters"),
}
NAMED_STYLE = {
    "law": LineStyle("law", GREY, (0, (5, 1.5))),
    "law_rigid": LineStyle("law + rigid residual", SKY, (0, (5, 1.5))),
    "law_wrench": LineStyle("law + wrench residual", YELLOW, (0, (5, 1.5))),
    "effects": LineStyle("law + effects", INK, "-"),
    "effects_rigid": LineStyle("law + effects + rigid residual", BLUE, "-"),
    "effects_wrench": LineStyle("law + effects + wrench residual", RED, "-"),
}


def _style(model: str) -> LineStyle:
    return {**LAW_STYLE, **BOUND_STYLE, **LEARNER_STYLE}[model]


@house_style
def figure_4_5(errors: pd.DataFrame, law: str) -> Drawn:
    """Figure 4-5: densities and shares of held-out errors of data-driven models (above) and models with a law (below).

    `errors`: model, n, error (m/s) of each held-out impact; a failed solve (NaN) counts as infinite in the share.
    `law`: the impact law of class 2, drawn in both rows.

    Raises:
        UserError: a model has no finite error.
    """
    values = {name: part["error"].to_numpy() for name, part in errors.groupby("model", sort=False)}
    for name, error in values.items():
        if not np.isfinite(error).any():
            raise UserError(f"{name} has no finite held-out error; see errors.csv.")
    everywhere = (law, "best_post_hoc", "irb_bound")
    drawn = [name for names in CLASSES.values() for name in names if name in values]
    top = 1.15 * float(np.nanmax([np.nanquantile(values[name], 0.97) for name in (*drawn, *everywhere)]))
    grid = np.linspace(0.0, top, GRID)
    figure = new_figure(height=5.4)
    axes = figure.subplots(2, 2, sharex="col", sharey="col")
    parts = []
    for row, (title, names) in zip(axes, CLASSES.items()):
        for name in (*everywhere, *(name for name in names if name in values)):
            line = _style(name).line | ({"linewidth": 1.0} if name in everywhere else {})
            parts.append(draw_error_curves(row, values[name], grid, line).assign(variant=title, model=name))
        row[0].set_title(title)
        row[1].legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    axes[0, 0].set(xlim=(0.0, top), ylim=(0.0, None))
    axes[0, 1].set_xscale("log")
    low = min(float(np.nanquantile(values[name], 0.03)) for name in (*drawn, *everywhere))
    axes[0, 1].set(xlim=(low, 1.5 * top), ylim=(0.0, 1.0))
    label_error_curves(axes)
    table = pd.concat(parts, ignore_index=True)
    table["n"] = int(errors["n"].iloc[0])
    return figure, table[["variant", "panel", "model", "n", "error", "density", "share_below"]]


@house_style
def figure_4_6(summary: pd.DataFrame, law: str) -> Drawn:
    """Figure 4-6: mean held-out error against the number of training impacts, with intervals over random splits.

    `summary`: model, n, mean, low, high (from `learning_study.curve_summary`); `law`: the impact law of class 2.
    """
    figure = new_figure(height=3.9)
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    parts = []
    for ax, (title, names) in zip(axes, CLASSES.items()):
        for name in (law, "best_post_hoc", "irb_bound", *names):
            curve = summary[summary["model"] == name].sort_values("n")
            _band(ax, curve, _style(name), thin=name not in LEARNER_STYLE)
            parts.append(curve[["model", "n", "mean", "low", "high"]].assign(panel=title))
        ax.set_title(title)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=2)
        ax.set_xlabel("training impacts")
    table = pd.concat(parts, ignore_index=True)
    _log_axes(axes[0], table)
    axes[0].set_ylabel("mean error of the velocity after impact (m/s)")
    return figure, table[["panel", "model", "n", "mean", "low", "high"]]


@house_style
def figure_named_physics(
    rungs: pd.DataFrame, summary: pd.DataFrame, effects: Sequence[str] = (), floor: float | None = None
) -> Drawn:
    """Figure of the errors of law, effects and residuals: the part left to learn once the missing effects are added.

    `rungs`, `summary`: model, n, mean, low, high, in m/s (of `learning_study.named_physics`); `rungs` with the rows
    irb_bound and irb_bound_effects.  `effects`: titles of effects chosen by the critique; `floor`: its noise floor in
    m/s, None if the noise is unknown.
    """
    at = rungs.set_index("model")
    figure = new_figure(height=4.0)
    left, right = figure.subplots(1, 2, width_ratios=(1.1, 1.0))
    places = {"law": 0, "law_rigid": 1, "law_wrench": 2, "effects": 3.6, "effects_rigid": 4.6, "effects_wrench": 5.6}
    for name, place in places.items():
        mean, low, high = at.loc[name, ["mean", "low", "high"]]
        color = NAMED_STYLE[name].color
        left.barh(place, mean, height=0.62, color=color, alpha=0.85)
        left.plot([low, high], [place, place], color="black", linewidth=1.0)
        left.text(high, place, f"  {mean:.3g}", va="center", fontsize=7)
    bounds = {"irb_bound": (-0.45, 2.45), "irb_bound_effects": (3.15, 6.05)}
    for i, (name, ends) in enumerate(bounds.items()):
        mean = at.loc[name, "mean"]
        left.plot([mean, mean], ends, color="black", linestyle=(0, (4, 1.5)), label=None if i else "IRB Bound")
    if floor is not None:
        left.axvline(floor, color=GREEN, linestyle=(0, (1, 1.2)), label="noise floor")
    named = ["law", "+ rigid residual", "+ wrench residual"]
    left.set_yticks(list(places.values()), [*named, "law + effects", *named[1:]])
    left.invert_yaxis()
    left.set(xlim=(0.0, 1.18 * float(at["high"].max())), xlabel="mean error of the velocity after impact (m/s)")
    left.set_title(f"(a) {int(at['n'].iloc[0])} training impacts")
    left.legend(loc="upper center", bbox_to_anchor=(0.3, -0.16), ncols=2)
    if effects:
        text = "effects:  " + ",\n".join(", ".join(effects[i : i + 2]) for i in range(0, len(effects), 2))
        # below this panel's legend, beside the taller one of the other panel
        left.text(0.0, -0.29, text, transform=left.transAxes, ha="left", va="top", fontsize=7, color=INK)
    for name, look in NAMED_STYLE.items():
        _band(right, summary[summary["model"] == name].sort_values("n"), look)
    _log_axes(right, summary[summary["model"].isin(NAMED_STYLE)])
    right.set(xlabel="training impacts", title="(b) what remains to be learned")
    right.legend(loc="upper center", bbox_to_anchor=(0.45, -0.16), ncols=1)
    columns = ["panel", "model", "n", "mean", "low", "high"]
    table = [rungs.assign(panel="a")[columns], summary.assign(panel="b")[columns]]
    if floor is not None:
        table.append(pd.DataFrame([{"panel": "a", "model": "noise_floor", "mean": floor}]))
    return figure, pd.concat(table, ignore_index=True)


def _band(ax: Axes, curve: pd.DataFrame, look: LineStyle, thin: bool = False) -> None:
    n = curve["n"].to_numpy()
    ax.plot(n, curve["mean"], **look.line | ({"linewidth": 1.0} if thin else {}))
    if not thin:
        ax.fill_between(n, curve["low"], curve["high"], color=look.color, alpha=0.15, linewidth=0)


def _log_axes(ax: Axes, drawn: pd.DataFrame) -> None:
    """Logarithmic axes with plain numbers; the error axis spans the mean errors drawn."""
    ax.set(xscale="log", yscale="log")
    low, high = drawn["mean"].min(), drawn["mean"].max()
    ax.set_ylim(0.85 * low, 1.15 * high)
    # fewer multiples of powers of ten are labelled on an axis with a wider range
    wide = (1.0, 2.0, 5.0) if high < 15.0 * low else (1.0, 3.0)
    ticks = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0) if high < 3.0 * low else wide
    for axis, subs in ((ax.xaxis, (1.0, 3.0)), (ax.yaxis, ticks)):
        axis.set_major_locator(LogLocator(subs=subs))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
