"""Figure of one long recording and the drops that were cut out of it, for visual inspection."""

import numpy as np
import pandas as pd

from thesis_lib.datasets.space.drops import Cuts
from thesis_lib.figures.style import GREY, INK, Drawn, house_style, new_figure

ROWS = 6  # largest number of strips into which a long recording is divided
STRIP = 40.0  # s in a strip, unless there would be more than `ROWS`
POINTS = 2000  # drawn per strip
COLOURS = ("#0072B2", "#56B4E9")  # alternating, for successive drops
LEFT_OUT = "#D55E00"


@house_style
def draw_cuts(cuts: Cuts) -> Drawn:
    """Draw the height of the body's lowest point over time: drops in blue, numbered; excluded drops in orange."""
    duration = float(cuts.t[-1])
    rows = int(np.clip(np.ceil(duration / STRIP), 1, ROWS))
    figure = new_figure(height=0.5 + 1.2 * rows)
    axes = np.atleast_1d(np.asarray(figure.subplots(rows, 1, sharey=True)))
    every = max(1, len(cuts.t) // (POINTS * rows))
    for row, ax in enumerate(axes):
        start, end = row * duration / rows, (row + 1) * duration / rows
        inside = (cuts.t >= start) & (cuts.t <= end)
        ax.plot(cuts.t[inside][::every], cuts.height[inside][::every], ".", ms=1, color=GREY)
        for drop in cuts.drops:
            t = cuts.t[drop.start : drop.stop]
            if len(t) == 0 or t[-1] < start or t[0] > end:
                continue
            colour = LEFT_OUT if drop.left_out else COLOURS[drop.trial % 2]
            ax.plot(t, cuts.height[drop.start : drop.stop], "-", lw=1, color=colour)
            if start <= t[0] <= end:
                high = float(cuts.height[drop.start])
                ax.annotate(str(drop.trial), (float(t[0]), high), fontsize=6, color=INK, ha="right", va="bottom")
        ax.axhline(0.0, color=INK, lw=0.5)
        ax.set(xlim=(start, end), ylabel="height (m)")
    axes[-1].set_xlabel("time (s)")
    table = pd.DataFrame(
        [
            [drop.trial, cuts.t[drop.start], cuts.t[max(drop.start, drop.stop - 1)], len(drop.flights), drop.left_out]
            for drop in cuts.drops
        ],
        columns=["trial", "start", "end", "flights", "left_out"],
    )
    return figure, table
