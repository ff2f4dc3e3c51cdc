"""Right verdicts in contacts as long as real ones, against what is asked.

A panel for each figure; points are shares of one source, shape and contact time with 95 % Wilson intervals, slightly
offset; the line is the share that is asked for.
"""

import pandas as pd

from thesis_lib.critique.proof.by_contact import ASKED, COVERAGE, COVERED, EVERY
from thesis_lib.critique.proof.cases import BODIES
from thesis_lib.critique.proof.headline import TIMES
from thesis_lib.figures.critique.errors import set_title
from thesis_lib.figures.marks import BLUE, GREEN, RED, YELLOW
from thesis_lib.figures.proof.curves import say_not_run
from thesis_lib.figures.style import GREY, Drawn, house_style, new_figure

TITLES = {
    "mujoco": "MuJoCo",
    "drake_point": "Drake, point contact",
    "drake_hydroelastic": "Drake, hydroelastic",
    "mechanism": "own simulator",
}
COLORS = dict(zip(TITLES, (BLUE, GREEN, YELLOW, RED)))
MARKERS = dict(zip(BODIES, "os"))
APART = 0.1  # between points, in distances between contact times


@house_style
def draw_real_contacts(table: pd.DataFrame) -> Drawn:
    """Shares by source, shape and contact time; `table` is that of `critique.proof.by_contact`."""
    figure = new_figure(height=4.6)
    set_title(figure, "Right verdicts in contacts as long as real ones")
    if table.empty:
        say_not_run(figure, "real contacts")
        return figure, table
    asked = {name: share for name, *_, share in ASKED} | {COVERED: COVERAGE[0]}
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    places = {time: i for i, time in enumerate(sorted(TIMES))}
    for (name, share), ax in zip(asked.items(), axes.flat):
        part = table[(table["figure"] == name) & table["contact_time"].isin(TIMES)]
        ax.axhline(100 * share, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)))
        for i, (source, shape) in enumerate((source, shape) for source in TITLES for shape in BODIES):
            points = part[(part["source"] == source) & (part["shape"] == shape)]
            x = points["contact_time"].map(places) + APART * (i - 0.5 * (len(TITLES) * len(BODIES) - 1))
            middle, low, high = (100 * points[column] for column in ("share", "low", "high"))
            look = {"color": COLORS[source], "marker": MARKERS[shape], "markersize": 3.2, "linestyle": ""}
            label = f"{TITLES[source]}, {shape}"
            ax.errorbar(x, middle, yerr=[middle - low, high - middle], elinewidth=0.6, label=label, **look)
        whole = table[(table["figure"] == name) & (table["source"] == EVERY)]
        count = f"\n{100 * whole['share'].iloc[0]:.0f} % of {whole['n'].iloc[0]}" if len(whole) else "\nnot run"
        ax.set_title(name[0].upper() + name[1:] + count, fontsize=6.5, loc="left", pad=3)
    axes[0, 0].set(xlim=(-0.5, len(places) - 0.5), ylim=(-4, 104), yticks=[0, 50, 100])
    for ax in axes[-1]:
        ax.set_xticks(list(places.values()), [f"{1e3 * time:g}" for time in places])
        ax.set_xlabel("contact time (ms)", fontsize=7)
    figure.supylabel("right verdicts (%)", fontsize=8)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=6.5)
    return figure, table
