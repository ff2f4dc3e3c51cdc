"""How far predicted tosses in space go off the measured ones: against time, and against the number of hits."""

import pandas as pd

from thesis_lib.figures.style import BLUE, GREY, Drawn, house_style, new_figure

AXES = {"t": "time since the first frame (s)", "hits": "hits until then, as predicted"}
PANELS = {"place": "error of the place (m)", "turn": "error of the attitude (rad)"}
LOOK = {"model": (BLUE, "model"), "floor": (GREY, "floor: the initial state alone")}


@house_style
def draw_rollout(table: pd.DataFrame) -> Drawn:
    """Mean errors with 95 % intervals, of `Rollout.curve`."""
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
