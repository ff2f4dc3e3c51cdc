"""Figure for the critique of a mechanism: residual generalised forces of held-out trials, and gains of candidates.

Residuals are whitened; gains are compared with the largest gain expected by chance.
"""

import numpy as np
import pandas as pd

from thesis_lib.figures.style import BLUE, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import Z95

WITHOUT = {"color": RED, "marker": "^", "linestyle": ""}
WITH = {"color": BLUE, "marker": ".", "linestyle": ""}
SMALLEST = 1e-2  # sigma; smaller residuals (of exact data) are drawn at this value


@house_style
def figure_residuals(residuals: pd.DataFrame, gains: pd.DataFrame, limit: float) -> Drawn:
    """Draw whitened residuals of held-out windows before and after adding effects, and gains of the candidates.

    `residuals`: window, coordinate, before, after (in standard deviations, signed); `gains`: candidate, gain (nats);
    `limit`: gain in nats that the best candidate exceeds by chance in 1 % of draws.
    """
    figure = new_figure(height=2.6)
    left, right = figure.subplots(1, 2, width_ratios=[1.5, 1])
    for name, look, label in (("before", WITHOUT, "believed model"), ("after", WITH, "with the effects")):
        left.semilogy(
            residuals["window"], np.maximum(residuals[name].abs(), SMALLEST), markersize=2.5, label=label, **look
        )
    left.axhline(Z95, color=GREY, linewidth=0.7, linestyle=(0, (4, 2)), label="95 % of noise below")
    left.set(xlabel="held-out window", ylabel="|residual force| (σ)")
    left.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, handlelength=1.6, columnspacing=1.0)
    ordered = gains.sort_values("gain", ignore_index=True)
    right.barh(range(len(ordered)), np.maximum(ordered["gain"], 0.1), color=GREY, height=0.6)
    right.set_yticks(range(len(ordered)), [words(name) for name in ordered["candidate"]], fontsize=6.5)
    right.axvline(limit, color=INK, linewidth=0.8, linestyle=(0, (2, 2)))
    right.set(xscale="log", xlabel="gain (nats)")
    right.set_title("dashed: 1 % by chance", fontsize=7, loc="right")
    long = residuals.melt(["window", "coordinate"], ["before", "after"], "series", "value")
    bars = ordered.rename(columns={"candidate": "series", "gain": "value"}).assign(window=-1, coordinate="")
    table = pd.concat([long.assign(panel="residuals"), bars.assign(panel="gains")], ignore_index=True)
    return figure, table[["panel", "series", "window", "coordinate", "value"]]


def words(name: str) -> str:
    """Return the name of a hidden effect of a mechanism in words, on at most two lines."""
    return name.replace("_", " ").replace("viscous joint", "viscous\njoint").replace("coulomb joint", "Coulomb\njoint")
