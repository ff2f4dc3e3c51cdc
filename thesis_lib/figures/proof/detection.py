"""Detection curves of the proof: share of right answers against the size of the effect, the drops and the noise.

Truths of the sources "mechanism" and "drake" count under the effect that describes them best, so that two causes of
one effect share a point.  Bars are 95 % Wilson intervals; points of different sources are slightly offset.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, NullLocator

from thesis_lib.critique.proof.table import TABLE
from thesis_lib.figures.critique.errors import set_title
from thesis_lib.figures.proof.style import SOURCE_LOOK, SOURCE_TITLE, in_order, say_not_run, sources_in, words
from thesis_lib.figures.style import GREY, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import wilson

COLUMNS = 4
PANEL = 1.0  # inches, height
APART = 1.07  # factor between points of two sources on a logarithmic axis
DRAWN = ("effect", "source", "ratio", "drops", "noise", "n", "right", "right_low", "right_high")


@house_style
def draw_detection(outcomes: pd.DataFrame) -> Drawn:
    """Share of right answers against the base law's nominal misfit over the noise floor, a panel for each effect."""
    singles = outcomes[(outcomes["kind"] == "single") & (outcomes["drops"] == TABLE["drops"])]
    table = _shares(singles[singles["noise"] == TABLE["noise"]])
    title = "How often the critique is right, against the size of the hidden effect"
    return _panels(table, "ratio", "misfit over its floor", title)


@house_style
def draw_sizes(outcomes: pd.DataFrame) -> Drawn:
    """Share of right answers against drops, at each noise, for each effect that was run at other sizes."""
    table = _shares(outcomes[(outcomes["kind"] == "single") & (outcomes["ratio"] == TABLE["ratio"])])
    other = (table["drops"] != TABLE["drops"]) | (table["noise"] != TABLE["noise"])
    table = table[table["effect"].isin(table.loc[other, "effect"])]
    title = "How often the critique is right, against the number of drops and the noise"
    return _panels(table, "drops", "drops", title)


def _shares(outcomes: pd.DataFrame) -> pd.DataFrame:
    """Share of right answers with its interval, for each effect, source and size: columns `DRAWN`."""
    rows = []
    for key, group in outcomes.groupby(list(DRAWN[:5])):
        k, n = int(group["right"].sum()), len(group)
        rows.append((*key, n, k / n, *wilson(k, n)))
    return pd.DataFrame(rows, columns=list(DRAWN))


def _panels(table: pd.DataFrame, along: str, label: str, title: str) -> Drawn:
    effects = in_order(table["effect"])
    rows = -(-len(effects) // COLUMNS)
    figure = new_figure(height=1.1 + PANEL * max(rows, 1))
    set_title(figure, title)
    if not effects:
        say_not_run(figure, f"right against {label}")
        return figure, table
    axes = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    ticks = sorted(table[along].unique())
    for name, ax in zip(effects, axes.flat):
        _draw_panel(ax, table[table["effect"] == name], along)
        _title(ax, words(name))
    for ax in axes.flat[len(effects) :]:
        ax.set_axis_off()
    first = axes[0, 0]
    first.set(xscale="log", xlim=(ticks[0] / 1.25, ticks[-1] * 1.25))
    first.xaxis.set_major_locator(FixedLocator(ticks))
    first.xaxis.set_minor_locator(NullLocator())
    first.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    first.set(ylim=(-4, 104), yticks=[0, 50, 100])
    for ax in axes.flat[max(len(effects) - COLUMNS, 0) : len(effects)]:
        ax.tick_params(labelbottom=True)
        ax.set_xlabel(label, fontsize=7)
    figure.supylabel("right (%)", fontsize=8)
    figure.legend(*_legend(first, table), loc="outside lower center", ncols=4)
    return figure, table


def _draw_panel(ax: Axes, shares: pd.DataFrame, along: str) -> None:
    lines = list(shares.groupby(["source", "noise"] if along == "drops" else ["source"], sort=False))
    order = list(SOURCE_LOOK)
    for key, line in lines:
        colour, marker = SOURCE_LOOK[key[0]]
        noisy = along == "drops" and key[1] != TABLE["noise"]
        line = line.sort_values(along)
        x = line[along] * APART ** (order.index(key[0]) - 1 + 0.33 * noisy)
        share, low, high = (100 * line[name] for name in ("right", "right_low", "right_high"))
        ax.errorbar(
            x,
            share,
            yerr=np.abs([share - low, high - share]),
            color=colour,
            marker=marker,
            markersize=3.2,
            markerfacecolor="white" if noisy else colour,
            linestyle=":" if noisy else "-",
            linewidth=0.9,
            elinewidth=0.6,
        )


def _title(ax: Axes, text: str) -> None:
    """Title in up to two lines, so that neighbours do not overlap."""
    parts = text.split(" ")
    cut = min(range(1, len(parts) + 1), key=lambda i: abs(len(" ".join(parts[:i])) - 0.5 * len(text)))
    long = len(text) > 16 and cut < len(parts)
    ax.set_title(
        " ".join(parts[:cut]) + "\n" + " ".join(parts[cut:]) if long else text, fontsize=6.5, loc="left", pad=3
    )


def _legend(ax: Axes, table: pd.DataFrame) -> tuple[list, list[str]]:
    handles, labels = [], []
    for name in sources_in(table):
        colour, marker = SOURCE_LOOK[name]
        handles += ax.plot([], [], color=colour, marker=marker, markersize=3.2, linewidth=0.9)
        labels.append(SOURCE_TITLE[name])
    for noise in sorted(set(table["noise"]) - {TABLE["noise"]}):
        handles += ax.plot([], [], color=GREY, marker="o", markersize=3.2, markerfacecolor="white", linestyle=":")
        labels.append(f"{noise:g} times the rig's noise")
    return handles, labels
