"""Figure of the candidate effects: gain of each of the best candidates alone on held-out trials, and its status."""

import textwrap

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.results.candidates import ALIKE, FOUND, OTHER, REJECTED, gain_by_chance
from thesis_lib.critique.results.titles import effect_title
from thesis_lib.figures.critique.errors import error_dots, set_title
from thesis_lib.figures.style import BLUE, GREY, RED, YELLOW, Drawn, house_style, new_figure
from thesis_lib.statistics.wording import listed, number

COLORS = {FOUND: BLUE, ALIKE: YELLOW, REJECTED: RED, OTHER: GREY}
LABEL_WIDTH, WHY_WIDTH = 34, 44  # characters per line
LINEAR = 0.1  # nats per impact, up to which the axis is linear
FAR_BELOW = -1.0  # nats per impact, lower end of the axis
EXTREMES = (("gain_low", "min"), ("gain_high", "max"))
TICKS = (-1.0, -0.1, 0.0, 0.1, 1.0, 10.0, 100.0)


@house_style
def draw_candidates(critique: DropsCritique, table: pd.DataFrame | None) -> Drawn | None:
    """Draw the gain of each candidate with its 95 % interval, and the evidence for or against it.

    `table`: from `thesis_lib.critique.results.candidates`; None, or no row: no picture.
    """
    if table is None or table.empty:
        return None
    y = np.arange(len(table))
    figure = new_figure(height=1.5 + 0.27 * len(table))
    ax, text = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [1.25, 1.0]})
    ax.axvline(0.0, color=GREY, linewidth=0.8)
    ax.axvline(gain_by_chance(critique), color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
    for i, row in table.iterrows():
        one = table.loc[[i]]
        ends = (one[name].clip(lower=FAR_BELOW) for name in ("gain", "gain_low", "gain_high"))
        error_dots(ax, *ends, y[[i]], color=COLORS[row["standing"]])
        said = textwrap.fill(row["why"], WHY_WIDTH)
        text.text(0.0, i, said, va="center", fontsize=6.5, color="black" if row["standing"] == FOUND else "0.35")
    text.set_axis_off()
    ax.set_xscale("symlog", linthresh=LINEAR, linscale=0.7)
    low, high = (float(table[name].clip(lower=FAR_BELOW).agg(end)) for name, end in EXTREMES)
    ax.set(xlim=(min(1.3 * low, -0.5 * LINEAR), max(1.3 * high, LINEAR)), ylim=(len(table) - 0.5, -0.5))
    ticks = [t for t in TICKS if ax.get_xlim()[0] <= t <= ax.get_xlim()[1]]
    ax.set_xticks(ticks, [f"{t:g}".replace("-", "−") for t in ticks])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_yticks(y, [textwrap.fill(effect_title(name), LABEL_WIDTH) for name in table["effect"]])
    ax.set_xlabel("gain over the best law alone (nats per impact, held out)")
    shown = [name for name in COLORS if (table["standing"] == name).any()]
    handles = [Line2D([], [], marker="o", linestyle="", color=COLORS[name], label=name) for name in shown]
    handles.append(Line2D([], [], color=GREY, linestyle=(0, (4, 2)), label="gain of the best by chance"))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    set_title(figure, candidates_sentence(table))
    return figure, table


def candidates_sentence(table: pd.DataFrame) -> str:
    """Return a sentence on the lead of the effects found over the others; some may not be among the best candidates."""
    found, others = table[table["standing"] == FOUND], table[table["standing"] != FOUND]
    if found.empty:
        first = table.iloc[0]
        title, gain = effect_title(first["effect"]), number(first["gain"], 2)
        return f"Of all effects, “{title}” gains most, {gain} nats per impact, but {first['why']}"
    names = listed([f"“{effect_title(name)}”" for name in found["effect"]])
    gains = listed([number(gain, 2) for gain in found["gain"]])
    gain = "gain" if len(found) > 1 else "gains"
    sentence = f"Alone, {names} {gain} {gains} nats per impact on held-out trials"
    if others.empty:
        return sentence
    best = effect_title(others["effect"].iloc[0])
    return f"{sentence}; of the other effects, “{best}” gains most: {number(others['gain'].iloc[0], 2)}"
