"""Figures of the games: 5-5B and 5-6, paired comparisons of policies, and the movable blocks.

`mean` is the number of successful consecutive extractions, averaged over towers; `size` is the number of samples, 0 for
policies that do not learn; `share` is successes over attempts.  `low` and `high` are 95 % intervals from the tables.
Source: thesis, sections 5.4.4 and 5.5.2.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.planar_drawing import note
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SKY, VIOLET, YELLOW, Drawn, house_style, new_figure

GOAL = 21  # extractions expected on an unperturbed tower (thesis): 47 % of 45
PUBLISHED_MOVABLE, TOLERANCE = 0.47, 0.04  # share in the thesis; deviation that counts as reproduced (own choice)
POLICY_STYLE = {
    "hma": (RED, "-", "o", "HMA"),
    "hma_without_cost": (YELLOW, (0, (4, 1.5)), "D", "HMA without “no move” cost"),
    "hma_one_shot": (SKY, (0, (4, 1, 1, 1)), "P", "HMA in one shot"),
    "mor": (BLUE, (0, (5, 1.5)), "s", "MOR"),
    "mor_with_cost": (BLUE, (0, (1, 1)), "X", "MOR with “no move” cost"),
    "network": (GREEN, (0, (3, 1, 1, 1)), "^", "network"),
    "network_with_cost": (GREEN, (0, (1, 1)), "d", "network with “no move” cost"),
    "ppo": (VIOLET, (0, (1, 1.2)), "v", "PPO"),
    "oracle": (INK, "-", "", "oracle"),
    "rule": ("0.35", (0, (6, 2)), "", "rule"),
    "exploration": ("0.5", (0, (3, 2)), "", "exploration"),
    "always_push": ("0.6", (0, (1.5, 1.5)), "", "always push"),
}
COLUMNS = (48, 100, 136)  # right ends of the columns of text beside the bars of figure 5-6, in points
PANELS_ACROSS = 4
# bars can be distinguished without colour
PHASES = {
    "exploration": {"color": "0.72", "hatch": "////", "edgecolor": "white", "linewidth": 0},
    "learned": {"color": SKY},
}


def policy_style(name: str) -> tuple[str, object, str, str]:
    """Colour, line style, marker and label of a policy; the label of an unknown policy is its name."""
    return POLICY_STYLE.get(name, ("#7F3C8D", "-", "x", name.replace("_", " ")))


@house_style
def figure_5_5b(curve: pd.DataFrame) -> Drawn:
    """Figure 5-5B: consecutive extractions against the number of samples; policies that do not learn are level lines.

    `curve`: policy, size, mean, low, high, n (towers); size is 0 for a policy that does not learn.  The returned table
    has the thesis's goal as policy `thesis`.
    """
    figure = new_figure(height=3.5)
    ax = figure.add_subplot()
    learners, levels = curve[curve["size"] > 0], curve[curve["size"] == 0]
    names = list(learners["policy"].unique())
    for i, name in enumerate(names):
        color, dash, marker, label = policy_style(name)
        part = learners[learners["policy"] == name].sort_values("size")
        # offset, so that points of equal size are side by side
        x = part["size"] * 1.04 ** (i - 0.5 * (len(names) - 1))
        ax.plot(x, part["mean"], color=color, linestyle=dash, marker=marker, markersize=4, label=label)
        ax.vlines(x, part["low"], part["high"], color=color, linewidth=1.0)
    ax.set_xscale("log")
    sizes = np.sort(learners["size"].unique()) if names else np.array([100])
    ax.set_xticks(sizes, [f"{size:g}" for size in sizes])
    ax.set_xticks([], minor=True)
    marks = [("goal of the thesis", float(GOAL), INK)]
    ax.axhline(GOAL, color=INK, linewidth=0.9, linestyle=":")
    for row in levels.itertuples():
        color, dash, _, label = policy_style(row.policy)
        ax.axhline(row.mean, color=color, linewidth=1.0, linestyle=dash, zorder=1)
        ax.axhspan(row.low, row.high, color=color, alpha=0.12, linewidth=0, zorder=0)
        marks.append((label, row.mean, color))
    ax.set_xlim(sizes[0] / 1.6, sizes[-1] * 1.6)
    ax.set_ylim(0.0, 1.08 * np.nanmax([GOAL, curve["mean"].max(), curve["high"].max()]))
    _beside(ax, marks)
    ax.set_xlabel("samples (pushes of 1 mm)")
    ax.set_ylabel(f"consecutive extractions\n(mean over {_counted(curve['n'])}, 95 %)")
    if names:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, columnspacing=1.2)
    columns = ["policy", "size", "mean", "low", "high", "n"]
    goal = pd.DataFrame([("thesis", 0, float(GOAL), np.nan, np.nan, 0)], columns=columns)
    return figure, pd.concat([curve[columns], goal], ignore_index=True)


@house_style
def figure_paired(pairs: pd.DataFrame) -> Drawn:
    """Figure of differences of extractions on the same towers, with a panel for each policy and number of samples.

    A dot is filled if its interval excludes zero.  `pairs`: policy, rival, size (samples of the policy), difference,
    low, high, n (towers), and rival_size.
    """
    table = pairs.assign(other=pairs["rival_size"])
    # a rival with other sizes has a row for each size
    sized = set(table.loc[(table["other"] != table["size"]) & (table["other"] != 0), "rival"])
    label = table["rival"].map(lambda rival: policy_style(rival)[3])
    table["row"] = label + [f" ({row.other:g})" if row.rival in sized else "" for row in table.itertuples()]
    order = list(POLICY_STYLE)
    table["place"] = [order.index(rival) if rival in order else len(order) for rival in table["rival"]]
    rows = list(table.sort_values(["place", "rival", "other"], kind="stable")["row"].unique())
    panels = list(table.groupby(["policy", "size"], sort=False))
    across = min(PANELS_ACROSS, len(panels))
    down = -(-len(panels) // across)
    figure = new_figure(height=down * (0.5 + 0.25 * len(rows)) + 0.4)
    axes = figure.subplots(down, across, sharex=True, sharey=True, squeeze=False)
    for ax in axes.ravel()[len(panels) :]:
        ax.set_visible(False)
    for ax, ((policy, size), part) in zip(axes.ravel(), panels):
        color, _, _, label = policy_style(policy)
        ax.axvline(0.0, color=GREY, linewidth=0.8, zorder=0)
        for row in part.itertuples():
            y = rows.index(row.row)
            clear = row.low > 0.0 or row.high < 0.0
            ax.plot([row.low, row.high], [y, y], color=color, linewidth=1.4, zorder=2)
            ax.plot(row.difference, y, "o", color=color, markerfacecolor=color if clear else "white", zorder=3)
            note(ax, f"{row.difference:+.1f}", (row.difference, y), (0, 3), ha="center", va="bottom", fontsize=7)
        ax.set_title(f"{label} ({size:g}) minus" if size else f"{label} minus", fontsize=8)
        ax.tick_params(axis="y", length=0)
        ax.spines["left"].set_visible(False)
    axes[0, 0].set_yticks(range(len(rows)), rows)
    axes[0, 0].set_ylim(len(rows) - 0.6, -0.8)
    figure.supxlabel(f"difference of extractions on the same tower (95 %), {_counted(pairs['n'])}", fontsize=8)
    return figure, pairs.reset_index(drop=True)


@house_style
def figure_5_6(success: pd.DataFrame) -> Drawn:
    """Figure 5-6: success of push, extraction and placement, for exploration and learned policy, beside the thesis.

    `success`: phase (exploration, learned), position (all, side, middle), action (push, extract, place), attempts,
    successes, share, low, high, published (shares 0 to 1, NaN if nothing was tried or published).
    """
    figure = new_figure(height=3.9)
    ax = figure.add_subplot()
    ticks, y = [], 0.0
    for position in success["position"].unique():
        top = y
        for action in success["action"].unique():
            ticks.append((y + 0.19, action))
            for offset, (phase, look) in zip((0.0, 0.38), PHASES.items()):
                selected = success[(success[["position", "action", "phase"]] == [position, action, phase]).all(axis=1)]
                for row in selected.itertuples():
                    _success_row(ax, row, y + offset, look)
            y += 1.0
        _aside(ax, 0.0, -46, 0.5 * (top + y) - 0.3, position, fontsize=8, fontweight="bold")
        ax.axhline(y - 0.16, color="0.85", linewidth=0.7)
        y += 0.3
    for name, place in zip(("successes", "95 %", "thesis"), COLUMNS):
        _aside(ax, 1.0, place, -0.6, name, color=GREY, fontsize=7)
    for phase, look in PHASES.items():
        ax.barh([np.nan], [np.nan], label=phase, **look)
    ax.plot([], [], "D", color=RED, markersize=3.5, label="thesis, real robot")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.01), ncols=3)
    ax.set_yticks([place for place, _ in ticks], [text for _, text in ticks])
    ax.tick_params(axis="y", length=0)
    ax.set(xlim=(0.0, 100.0), ylim=(y - 0.4, -0.4), xlabel="success (%)")
    return figure, success.reset_index(drop=True)


@house_style
def figure_movable(fractions: pd.DataFrame, summary: pd.DataFrame, threshold: float) -> Drawn:
    """Figure of the share of movable blocks against the threshold (mm), and by tower at the threshold that was chosen.

    `fractions`: tower, set (development, test), threshold_mm, share; `summary`: set, threshold_mm, mean, low, high.
    """
    figure = new_figure(height=2.5)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.6, 1])
    looks = {"development": (BLUE, "o", "-"), "test": (RED, "s", (0, (5, 1.5)))}
    for ax in (left, right):
        ax.axhspan(PUBLISHED_MOVABLE - TOLERANCE, PUBLISHED_MOVABLE + TOLERANCE, color="0.92", zorder=0)
        ax.axhline(PUBLISHED_MOVABLE, color=GREY, linewidth=0.8, zorder=0)
    grid = np.sort(fractions["threshold_mm"].unique())
    nearest = grid[np.abs(grid - threshold).argmin()]
    for i, (name, part) in enumerate(fractions.groupby("set", sort=True)):
        color, marker, dash = looks[name]
        for _, tower in part.groupby("tower"):
            left.plot(tower["threshold_mm"], tower["share"], color=color, linewidth=0.5, alpha=0.35)
        mean = part.groupby("threshold_mm")["share"].mean()
        n = part["tower"].nunique()
        left.plot(mean.index, mean, color=color, marker=marker, linestyle=dash, label=f"{name}: mean of {n} towers")
        shares = np.sort(part.loc[part["threshold_mm"] == nearest, "share"])
        across = np.linspace(-0.16, 0.16, len(shares)) if len(shares) > 1 else np.zeros(1)
        right.plot(i + across, shares, marker, color=color, markersize=3, alpha=0.5)
        at = summary[(summary["set"] == name) & (summary["threshold_mm"] == nearest)]
        ((mean, low),) = at[["mean", "low"]].to_numpy()
        right.errorbar(i + 0.32, mean, mean - low, fmt="D", color=color, markersize=4, capsize=2)
        right.text(i + 0.38, mean + 0.004, f" {100 * mean:.0f} %", fontsize=7, color=color)
    left.axvline(threshold, color=INK, linewidth=0.8, linestyle=(0, (2, 2)), label="chosen")
    left.set(xlabel="largest motion of other blocks (mm)", ylabel="share of 45 blocks movable")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper left", ncols=3, columnspacing=1.2)
    right.set_xticks(range(fractions["set"].nunique()), sorted(fractions["set"].unique()))
    right.set_xlim(-0.4, fractions["set"].nunique() - 0.3)
    right.set_title(f"at {nearest:g} mm; mean, 95 %", fontsize=7.5)
    return figure, fractions[["set", "tower", "threshold_mm", "share"]].reset_index(drop=True)


def _counted(n: pd.Series) -> str:
    """Number of towers over which values are computed, as text."""
    low, high = int(n.min()), int(n.max())
    return f"{low} to {high} towers" if low < high else "1 tower" if low == 1 else f"{low} towers"


def _beside(ax: Axes, marks: list[tuple[str, float, str]]) -> None:
    """Write the names of levels at the right edge, moved apart where they would overlap."""
    bottom, top = ax.get_ylim()
    least = 0.055 * (top - bottom)
    places: list[float] = []
    for text, level, color in sorted(marks, key=lambda mark: mark[1]):
        place = max(level, places[-1] + least) if places else level
        places.append(place)
        line = {"arrowstyle": "-", "color": color, "linewidth": 0.5, "shrinkA": 1, "shrinkB": 0}
        look = {"color": color, "fontsize": 7, "va": "center", "arrowprops": line}
        across = ax.get_yaxis_transform()
        ax.annotate(text, (1.0, level), (1.04, place), xycoords=across, textcoords=across, **look)


def _success_row(ax: Axes, row: tuple, y: float, look: dict) -> None:
    """Draw one bar with its interval, its counts at the right, and the thesis's number as a marker."""
    ax.barh(y, 100 * np.nan_to_num(row.share), height=0.34, **look)
    tried, published = row.attempts > 0, np.isfinite(row.published)
    if tried:
        ax.plot([100 * row.low, 100 * row.high], [y, y], color=INK, linewidth=0.8)
    if published:
        ax.plot(100 * row.published, y, "D", color=RED, markersize=3.5, markeredgecolor="white", zorder=3)
    texts = (
        f"{row.successes:.0f} / {row.attempts:.0f}",
        f"{100 * row.low:.0f} to {100 * row.high:.0f} %" if tried else "none tried",
        f"{100 * row.published:.1f} %" if published else "",
    )
    for place, text in zip(COLUMNS, texts):
        _aside(ax, 1.0, place, y, text, fontsize=6.5)


def _aside(ax: Axes, edge: float, points: float, y: float, text: str, **look: object) -> None:
    """Write text at height y that ends `points` away from an edge (0 left, 1 right) of the panel."""
    note(ax, text, (edge, y), (points, 0), xycoords=ax.get_yaxis_transform(), ha="right", va="center", **look)
