"""Figure of the errors of predicted tosses in space: against time, and against the number of hits."""

import pandas as pd

from thesis_lib.figures.style import BLUE, GREY, Drawn, house_style, new_figure

AXES = {"t": "time since the first frame (s)", "hits": "number of predicted hits so far"}
PANELS = {"place": "position error (m)", "turn": "attitude error (rad)"}
LOOK = {"model": (BLUE, "model"), "floor": (GREY, "floor: error of the initial state")}


@house_style
def draw_rollout(table: pd.DataFrame) -> Drawn:
    """Draw the mean errors of `Rollout.curve` with 95 % intervals."""
    by = "t" if "t" in table else "hits"
    figure = new_figure(height=2.6)
    for ax, (name, label) in zip(figure.subplots(1, 2), PANELS.items()):
        for what, of in table.groupby("what"):
            color, title = LOOK[str(what)]
            ax.plot(of[by], of[name], color=color, label=title, marker="" if by == "t" else "o")
            ax.fill_between(of[by], of[f"{name}_low"].clip(lower=0.0), of[f"{name}_high"], color=color, alpha=0.2, lw=0)
        ax.set_xlabel(AXES[by])
        ax.set_ylabel(label)
        ax.set_ylim(bottom=0.0)
        ax.legend()
    return figure, table
