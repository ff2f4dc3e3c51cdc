"""Hidden effects of the mechanisms of chapter 2: hidden against identified effects, and contact forces.

`figure_hidden` shows, for each mechanism, the share of datasets with a hidden effect (rows) in which an effect was
found first, or the verdict (columns); below, the contact force of one trial and the errors of its estimates
without and with the effect.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.critique.mechanisms import WITH, WITHOUT, words
from thesis_lib.figures.style import DARK, GREY, INK, SHADES, Drawn, house_style, new_figure


@house_style
def figure_hidden(effects: pd.DataFrame, forces: pd.DataFrame, pair: str = "arm") -> Drawn:
    """Hidden against identified effects, and forces of one contact pair estimated without and with the effect.

    `effects`, `forces` (in N): tables of the study, or rows of them; `forces` may be empty.
    """
    figure = new_figure(height=5.9 if len(forces) else 3.1)
    grid = figure.add_gridspec(3 if len(forces) else 1, 2, height_ratios=[2.3, 1, 1] if len(forces) else [1])
    tables = [
        _matrix(figure.add_subplot(grid[0, i]), str(mechanism), rows)
        for i, (mechanism, rows) in enumerate(effects.groupby("mechanism", sort=False))
    ]
    if len(forces):
        for i, component in enumerate(("normal", "tangential")):
            rows = forces[(forces["pair"] == pair) & (forces["component"] == component)]
            _forces(figure.add_subplot(grid[1, i]), figure.add_subplot(grid[2, i]), rows, f"{pair}, {component}")
            long = rows.melt(["t", "component"], ["true", "without", "with_effects"], "column", "value")
            tables.append(long.assign(panel=f"force, {component}", truth="").drop(columns="component"))
    table = pd.concat(tables, ignore_index=True)
    return figure, table[["panel", "truth", "column", "t", "value"]]


def _matrix(ax: Axes, mechanism: str, trials: pd.DataFrame) -> pd.DataFrame:
    """Draw the shares of one mechanism; return the plotted numbers."""
    trials = trials.assign(column=np.where(trials["first_effect"] != "", trials["first_effect"], trials["verdict"]))
    truths = list(dict.fromkeys(trials["truth"]))
    columns = ["adequate", *(t for t in truths if t not in ("nothing", "cogging")), "unexplained"]
    columns += sorted(set(trials["column"]) - set(columns))
    counts = trials.groupby(["truth", "column"]).size().unstack(fill_value=0)
    shares = counts.reindex(index=truths, columns=columns, fill_value=0)
    shares = shares.div(shares.sum(axis=1), axis=0)
    values = shares.to_numpy(float)
    ax.imshow(values, cmap=SHADES, vmin=0.0, vmax=1.0, aspect="auto", interpolation="none")
    for i, j in np.argwhere(values > 0.0):
        color = "white" if values[i, j] > DARK else INK
        ax.text(j, i, f"{100 * values[i, j]:.0f}", ha="center", va="center_baseline", fontsize=6, color=color)
    ax.set_xticks(range(len(columns)), [words(c) for c in columns], rotation=45, ha="right", fontsize=6)
    ax.set_yticks(range(len(truths)), [words(t) for t in truths], fontsize=6)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    noise = ", ".join("exact" if np.isinf(db) else f"{db:g} dB" for db in sorted(set(trials["snr_db"]), reverse=True))
    ax.set_title(f"{mechanism}: % of {len(trials) // len(truths)} datasets\n({noise})", fontsize=7.5)
    ax.set(xlabel="found first, or verdict", ylabel="hidden")
    flat = shares.stack().rename("value").rename_axis(["truth", "column"]).reset_index()
    return flat.assign(panel=mechanism, t=np.nan)


def _forces(top: Axes, bottom: Axes, force: pd.DataFrame, title: str) -> None:
    """Draw a force, and the errors of its two estimates."""
    top.plot(force["t"], force["true"], ".", color=INK, markersize=2)
    top.set_title(f"contact force, {title}", fontsize=7.5)
    top.set_ylabel("true (N)")
    top.tick_params(labelbottom=False)
    bottom.axhline(0.0, color=GREY, linewidth=0.6)
    for name, look, label in (("without", WITHOUT, "without the effect"), ("with_effects", WITH, "with it")):
        bottom.plot(force["t"], force[name] - force["true"], markersize=2.2, label=label, **look)
    bottom.set(ylabel="error (N)", xlabel="time (s)")
    bottom.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, markerscale=1.8)
    bottom.sharex(top)
