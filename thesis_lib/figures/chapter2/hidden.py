"""Chapter 2, hidden effects of mechanisms: hidden against found effects, and forces before and after.

`figure_hidden` shows, for each mechanism, the share of datasets in which an effect was hidden (rows) and an effect was
found first, or the verdict (columns).  Below are the contact force of one trial and the errors of its estimates
without and with the effect.  `figure_residuals` shows one critique: whitened residual generalised forces of held-out
trials, and the gain of each candidate against the largest gain expected by chance.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.style import BLUE, DARK, GREY, INK, RED, SHADES, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import Z95

WITHOUT = {"color": RED, "marker": "^", "linestyle": ""}
WITH = {"color": BLUE, "marker": ".", "linestyle": ""}
SMALLEST = 1e-2  # sigma; smaller residuals (of exact data) are drawn at this value


@house_style
def figure_hidden(effects: pd.DataFrame, forces: pd.DataFrame, pair: str = "arm") -> Drawn:
    """Truth against finding, and contact forces of one contact pair without and with the effect.

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
    """Shares of one mechanism; returns the plotted numbers."""
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
    ax.set_xticks(range(len(columns)), [_words(c) for c in columns], rotation=45, ha="right", fontsize=6)
    ax.set_yticks(range(len(truths)), [_words(t) for t in truths], fontsize=6)
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    noise = ", ".join("exact" if np.isinf(db) else f"{db:g} dB" for db in sorted(set(trials["snr_db"]), reverse=True))
    ax.set_title(f"{mechanism}: % of {len(trials) // len(truths)} datasets\n({noise})", fontsize=7.5)
    ax.set(xlabel="found first, or verdict", ylabel="hidden")
    flat = shares.stack().rename("value").rename_axis(["truth", "column"]).reset_index()
    return flat.assign(panel=mechanism, t=np.nan)


def _forces(top: Axes, bottom: Axes, force: pd.DataFrame, title: str) -> None:
    """A force, and the errors of its two estimates."""
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


@house_style
def figure_residuals(residuals: pd.DataFrame, gains: pd.DataFrame, limit: float) -> Drawn:
    """Whitened residuals of held-out windows before and after, and gains of the candidates.

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
    right.set_yticks(range(len(ordered)), [_words(name) for name in ordered["candidate"]], fontsize=6.5)
    right.axvline(limit, color=INK, linewidth=0.8, linestyle=(0, (2, 2)))
    right.set(xscale="log", xlabel="gain (nats)")
    right.set_title("dashed: 1 % by chance", fontsize=7, loc="right")
    long = residuals.melt(["window", "coordinate"], ["before", "after"], "series", "value")
    bars = ordered.rename(columns={"candidate": "series", "gain": "value"}).assign(window=-1, coordinate="")
    table = pd.concat([long.assign(panel="residuals"), bars.assign(panel="gains")], ignore_index=True)
    return figure, table[["panel", "series", "window", "coordinate", "value"]]


def _words(name: str) -> str:
    return name.replace("_", " ").replace("viscous joint", "viscous\njoint").replace("coulomb joint", "Coulomb\njoint")
