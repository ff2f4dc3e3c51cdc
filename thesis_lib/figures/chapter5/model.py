"""Figure 5-7 (thesis section 5.5.4), and the abstractions: the learned model of the tower.

    friction cone:  |f_t| ≤ μ f_n,   μ = 0.42 (plastic on wood; 0.35 to 0.5 in the thesis)

f_n and f_t, in N, are the force on the block along and across the push; μ is the friction coefficient of finger and
block.  `mixture.names_of` names abstractions.  Apart from figure 5-7, the thesis describes them only in words.
"""

import re
from collections import Counter

import numpy as np
import pandas as pd

from thesis_lib.figures.planar_drawing import note
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SKY, VIOLET, YELLOW, Drawn, house_style, new_figure

MU, MU_RANGE = 0.42, (0.35, 0.5)
COLORS = {"no block": "#999999", "easy move": GREEN, "hard move": YELLOW, "no move": RED, "drags tower": VIOLET}
SPARE = (BLUE, SKY, "#000000")
DASHES = ("-", (0, (5, 1.5)), (0, (1, 1.2)), (0, (3, 1, 1, 1)))
QUANTITIES = {
    "share": "share of\nsamples",
    "force": "force\n(N)",
    "rise": "force's rise\n(N/mm)",
    "move": "block's\nmove (1)",
    "lag": "lag\n(1)",
    "drag": "tower's\nmove (1)",
    "stuck_share": "truth:\nstuck",
}


def abstraction_style(names: list[str]) -> dict[str, tuple[str, object]]:
    """Colour by the kind of an abstraction, line style by its number among those of its kind."""
    styles, counts, colors = {}, Counter(), dict(COLORS)
    for name in names:
        kind = re.sub(r" \d+$", "", name)
        color = colors.setdefault(kind, SPARE[(len(colors) - len(COLORS)) % len(SPARE)])
        styles[name] = (color, DASHES[counts[kind] % len(DASHES)])
        counts[kind] += 1
    return styles


@house_style
def figure_5_7(cone: pd.DataFrame, height: pd.DataFrame) -> Drawn:
    """(A) Predicted forces over the friction cone; (B) force against the height of the block.

    `cone`: f_n, f_t (N, predicted next forces), abstraction, inside (1: within the cone).  `height`: height_mm (of the
    block above the base), f_n and f_n_pred (N, measured and predicted), abstraction; their means are drawn.
    """
    names = list(dict.fromkeys([*cone["abstraction"], *height["abstraction"]]))
    styles = abstraction_style(names)
    figure = new_figure(height=2.9)
    left, right = figure.subplots(1, 2)
    far = 1.05 * max(float(cone["f_n"].max()), 0.5)
    left.fill([0.0, far, far], [0.0, MU * far, -MU * far], color="0.93", zorder=0)
    for mu, dash in ((MU, "-"), *((mu, (0, (3, 2))) for mu in MU_RANGE)):
        for sign in (-1.0, 1.0):
            left.plot([0.0, far], [0.0, sign * mu * far], color=GREY, linewidth=0.8, linestyle=dash, zorder=1)
    for name, part in cone.groupby("abstraction", sort=False):
        share = f"{name} ({100 * part['inside'].mean():.0f} % inside)"
        left.plot(part["f_n"], part["f_t"], ".", color=styles[name][0], markersize=3, alpha=0.6, label=share)
    left.set_xlim(min(0.0, float(cone["f_n"].min())) - 0.02 * far, far)
    widest = 1.05 * max(MU_RANGE[1] * far, float(cone["f_t"].abs().max()))
    left.set(ylim=(-widest, widest), xlabel="normal force $f_n$ (N)", ylabel="tangential force $f_t$ (N)")
    left.set_title("A  predicted forces over the friction cone")
    for mu, side in ((MU, 1.0), *((mu, -1.0) for mu in MU_RANGE)):
        note(left, f"μ = {mu:g}", (far, side * mu * far), (2, 0), va="center", fontsize=7)
    for name, part in height.groupby("abstraction", sort=False):
        color, dash = styles[name]
        right.plot(part["height_mm"], part["f_n"], ".", color=color, markersize=3, alpha=0.35)
        mean = part.groupby("height_mm")[["f_n_pred", "f_n"]].mean()
        right.plot(mean.index, mean["f_n_pred"], color=color, linestyle=dash, label=name)
        right.plot(mean.index, mean["f_n"], "o", color=color, markersize=3.5, markerfacecolor="white")
    right.set(ylim=(min(0.0, float(height["f_n"].min())), None), ylabel="normal force $f_n$ (N)")
    right.set(xlabel="height of the block above the base (mm)", title="B  resistance (rings: measured)")
    # of a name in both panels the left one, with the share inside the cone
    entries = [entry for ax in (right, left) for entry in zip(*ax.get_legend_handles_labels())]
    shown = {label.split(" (")[0]: (handle, label) for handle, label in entries}
    figure.legend(*zip(*[shown[name] for name in names]), loc="outside lower center", ncols=3, markerscale=2.5)
    table = pd.concat([cone.assign(panel="A"), height.assign(panel="B")], ignore_index=True)
    return figure, table[["panel", "abstraction", "f_n", "f_t", "inside", "height_mm", "f_n_pred"]]


@house_style
def figure_abstractions(table: pd.DataFrame) -> Drawn:
    """Properties of each abstraction: a row of bars for each, a panel for each quantity.

    `table`: abstraction (its name), share (1), force (N), rise (N/mm), move, lag, drag (1), stuck_share (share of its
    pushes whose block is truly stuck), stuck (1: counts as stuck, found without truth; marked).
    """
    colors = [color for color, _ in abstraction_style(list(table["abstraction"])).values()]
    figure = new_figure(height=0.9 + 0.26 * len(table))
    axes = figure.subplots(1, len(QUANTITIES), sharey=True)
    places = np.arange(len(table))
    for ax, (name, title) in zip(axes, QUANTITIES.items()):
        values, known = np.nan_to_num(table[name].to_numpy(float)), table[name].notna()
        ax.barh(places, values, color=colors, height=0.65)
        ax.axvline(0.0, color=INK, linewidth=0.7)
        low, high = min(0.0, values.min()), max(1e-3, values.max())
        span = high - low
        ax.set_xlim(low - 0.05 * span, high + 0.55 * span)
        for place, value, is_known in zip(places, values, known):
            text = f"{value:.2f}" if is_known else "–"
            ax.text(max(value, 0.0) + 0.05 * span, place, text, va="center", fontsize=6.5)
        ax.set_title(title, fontsize=7.5)
        ax.set_xticks([])
        ax.spines[["bottom", "left"]].set_visible(False)
        ax.tick_params(axis="y", length=0)
    rows = zip(table["abstraction"], table["stuck"])
    axes[0].set_yticks(places, [f"{name} *" if mark == 1 else name for name, mark in rows])
    axes[0].set_ylim(len(table) - 0.4, -0.6)
    figure.supxlabel("* counts as stuck, by a rule without truth", fontsize=7, x=0.01, ha="left")
    return figure, table.reset_index(drop=True)
