"""How well the proof's effects are recovered: the misfit before and after, and parameters against their bound.

Dots are medians over datasets, bars their middle 80 % (for a coverage, the 95 % Wilson interval).
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator

from thesis_lib.critique.proof.summary import TARGETS, WIDEST
from thesis_lib.critique.results.titles import symbol
from thesis_lib.figures.critique.errors import AFTER, BEFORE, set_title
from thesis_lib.figures.proof.style import SOURCE_TITLE, in_order, say_not_run, sources_in, words
from thesis_lib.figures.style import GREY, INK, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import wilson

ROW = 0.165  # inches, height of a row
MIDDLE = (0.1, 0.9)
FLOOR_LINES = tuple(
    limits[1] for t in TARGETS if t.measure == "misfit" for limits in (t.aim, t.at_least)
)  # 1.05 and 1.2


@house_style
def draw_misfits(outcomes: pd.DataFrame) -> Drawn:
    """Misfit over its floor before and after adding the effects, a row for each truth and a panel for each source.

    `outcomes`: rows of one size, drops and noise; columns as in `critique.proof.results.outcomes`.
    """
    singles = outcomes[(outcomes["kind"] == "single") & outcomes["after_over_floor"].notna()]
    rows = []
    for key, group in singles.groupby(["source", "effect"]):
        for series in ("before", "after"):
            values = group[f"{series}_over_floor"].astype(float)
            rows.append((*key, series, len(values), values.median(), *values.quantile(MIDDLE)))
    table = pd.DataFrame(rows, columns=["source", "effect", "series", "n", "median", "low", "high"])
    effects = in_order(table["effect"])
    figure = new_figure(height=1.2 + ROW * max(len(effects), 3))
    set_title(figure, "How far the effects that were found bring the misfit down to its floor")
    if not effects:
        say_not_run(figure, "misfit before and after")
        return figure, table
    names = sources_in(table)
    axes = np.atleast_1d(figure.subplots(1, len(names), sharex=True, sharey=True))
    place = {name: i for i, name in enumerate(effects)}
    for name, ax in zip(names, axes):
        for x, style in zip(FLOOR_LINES, (":", (0, (4, 2)))):
            ax.axvline(x, color=GREY, linestyle=style, linewidth=0.9, label=f"{x:g}")
        for series, colour, marker, up in (("before", BEFORE, "o", 0.12), ("after", AFTER, "D", -0.12)):
            part = table[(table["source"] == name) & (table["series"] == series)]
            y = part["effect"].map(place) - up
            ax.hlines(y, part["low"], part["high"], color=colour, linewidth=0.8)
            ax.plot(
                part["median"],
                y,
                marker,
                color=colour,
                markersize=3.2,
                markerfacecolor="white" if series == "before" else colour,
                label=f"{series} the effects were added",
            )
        ax.set(title=SOURCE_TITLE[name], xlabel="misfit over its floor")
    _rows(axes[0], effects)
    _log(axes[0], table["low"].min(), table["high"].max(), (0.5, 1, 2, 3, 5, 10, 20, 50, 100))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure, table


@house_style
def draw_parameters(recovered: pd.DataFrame) -> Drawn:
    """Coverage of each parameter's 95 % interval, and its width over the Cramér-Rao bound.

    `recovered`: rows of one size, drops and noise; columns as in `critique.proof.results.recovered`.
    """
    rows = []
    for (effect, name), group in recovered.groupby(["effect", "parameter"]):
        k, n = int(group["inside"].sum()), len(group)
        widths = group["width"].astype(float)
        rows.append((effect, name, n, k / n, *wilson(k, n), widths.median(), *widths.quantile(MIDDLE)))
    columns = ["effect", "parameter", "n", "coverage", "coverage_low", "coverage_high"]
    table = pd.DataFrame(rows, columns=[*columns, "width", "width_low", "width_high"])
    effects = in_order(table["effect"])
    table = table.sort_values(
        ["effect", "parameter"],
        key=lambda column: column.map(effects.index) if column.name == "effect" else column,
        ignore_index=True,
    )
    figure = new_figure(height=1.0 + ROW * max(len(table), 3))
    set_title(figure, "Injected effects: share of truths within the interval, and its width")
    if table.empty:
        say_not_run(figure, "parameters of injected laws")
        return figure, table
    left, right = figure.subplots(1, 2, sharey=True)
    y = np.arange(len(table))
    left.axvline(95, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)))
    left.hlines(y, 100 * table["coverage_low"], 100 * table["coverage_high"], color=INK, linewidth=0.8)
    left.plot(100 * table["coverage"], y, "o", color=INK)
    left.set(xlabel="within their 95 % interval (%)", xlim=(min(95 * table["coverage_low"].min(), 60), 102))
    right.axvline(1.0, color=GREY, linewidth=0.9)
    right.axvline(WIDEST, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)))
    right.hlines(y, table["width_low"], table["width_high"], color=INK, linewidth=0.8)
    right.plot(table["width"], y, "o", color=INK)
    right.set_xlabel("width over the Cramér-Rao bound")
    lowest, highest = np.nanmin([*table["width_low"], 1.0]), np.nanmax([*table["width_high"], WIDEST])
    if highest > 4.0 or lowest < 0.25:
        _log(right, lowest, highest, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100))
    else:
        right.set_xlim(min(0.95 * lowest, 0.8), 1.05 * highest)
    _rows(left, [f"{words(e)}, {symbol(p)}" for e, p in zip(table["effect"], table["parameter"])])
    return figure, table


def _rows(ax: Axes, labels: list[str]) -> None:
    ax.set_yticks(range(len(labels)), [words(label) if " " not in label else label for label in labels])
    ax.tick_params(axis="y", labelsize=6.5, length=0)
    ax.set_ylim(len(labels) - 0.4, -0.6)


def _log(ax: Axes, low: float, high: float, ticks: tuple[float, ...]) -> None:
    ax.set(xscale="log", xlim=(low / 1.15, high * 1.15))
    ax.xaxis.set_major_locator(FixedLocator([x for x in ticks if low / 1.15 <= x <= high * 1.15]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
