"""Drops that settle a question between two effects: random ones against those in the states that are proposed."""

import pandas as pd

from thesis_lib.critique.proof.next_drops import STEPS
from thesis_lib.figures.critique.errors import set_title
from thesis_lib.figures.marks import BLUE, RED
from thesis_lib.figures.proof.curves import say_not_run, words
from thesis_lib.figures.style import GREY, Drawn, house_style, new_figure

ROW = 0.17  # inches, height of a question


@house_style
def draw_next_drops(answers: pd.DataFrame) -> Drawn:
    """A row for each open question, those that take random drops longest above; the axis is logarithmic."""
    opened = answers[answers["open"]].sort_values(["random", "chosen"], ascending=[True, False], kind="stable")
    table = opened[["cause", "effect", "rival", "random", "chosen"]].reset_index(drop=True)
    figure = new_figure(height=1.0 + ROW * max(len(table), 4))
    set_title(figure, "Drops that tell two effects apart, beyond the first 50")
    if table.empty:
        say_not_run(figure, "questions")
        return figure, table
    ax = figure.add_subplot()
    rows = range(len(table))
    ax.hlines(rows, table["chosen"], table["random"], color=GREY, linewidth=0.8)
    ax.plot(table["random"] / 2.0, rows, "|", color=GREY, markersize=5, label="half as many")
    ax.plot(table["random"], rows, "o", color=RED, markersize=4, label="random")
    ax.plot(table["chosen"], rows, "s", color=BLUE, markersize=3.5, label="in the states proposed")
    ax.set_xscale("log")
    ax.set_xticks([1, 3, 10, 30, 100, STEPS[-1]], ["1", "3", "10", "30", "100", f"{STEPS[-1]} or more"])
    ax.minorticks_off()
    ax.set_yticks(list(rows), [f"{words(a.effect)} or {words(a.rival)}" for a in table.itertuples()], fontsize=6)
    ax.set_xlabel("further drops until the scores are 3 nats apart")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=6.5)
    return figure, table
