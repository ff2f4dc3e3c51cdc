"""Figures of the learned model of the tower: figure 5-7 (thesis section 5.5.4), abstractions, and hidden effects.

    friction cone:  |f_t| ≤ μ f_n,   μ = 0.42 (plastic on wood; 0.35 to 0.5 in the thesis)

f_n and f_t, in N, are the force on the block along and across the push; μ is the friction coefficient of finger and
block.  `mixture.names_of` names abstractions; apart from figure 5-7, the thesis describes them in words only.
"""

import re
from collections import Counter

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from thesis_lib.figures.planar_drawing import note
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SKY, VIOLET, YELLOW, Drawn, house_style, new_figure
from thesis_lib.jenga.tower.tower_model import LAYERS, PER_LAYER

MU, MU_RANGE = 0.42, (0.35, 0.5)
COLORS = {"no block": "#999999", "easy move": GREEN, "hard move": YELLOW, "no move": RED, "drags tower": VIOLET}
SPARE = (BLUE, SKY, "#000000")
DASHES = ("-", (0, (5, 1.5)), (0, (1, 1.2)), (0, (3, 1, 1, 1)))
QUANTITIES = {
    "share": "share of\nsamples",
    "force": "force\n(N)",
    "rise": "rise of force\n(N/mm)",
    "move": "motion of\nblock (1)",
    "lag": "lag\n(1)",
    "drag": "motion of\ntower (1)",
    "stuck_share": "truth:\nstuck",
}
STAGES = {"before": (RED, "o", "before"), "relearned": (BLUE, "s", "relearned")}
GROUPS = {"all": "all pushes", "failing": "pushes that fail"}
GROUPS |= {"affected": "blocks with\nthe effect", "others": "other\nblocks"}
AS_PREDICTED = "#E0E0E0"


def abstraction_style(names: list[str]) -> dict[str, tuple[str, object]]:
    """Colour for each kind of abstraction (new ones too), and line style for its number within the kind."""
    styles, counts, colors = {}, Counter(), dict(COLORS)
    for name in names:
        kind = re.sub(r" \d+$", "", name.removeprefix("new: "))
        color = colors.setdefault(kind, SPARE[(len(colors) - len(COLORS)) % len(SPARE)])
        styles[name] = (color, DASHES[counts[kind] % len(DASHES)])
        counts[kind] += 1
    return styles


@house_style
def figure_5_7(cone: pd.DataFrame, height: pd.DataFrame) -> Drawn:
    """Figure 5-7: (A) predicted forces over the friction cone; (B) force against the height of the block.

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
    # for a name in both panels, use the entry of the left panel, with the share inside the cone
    entries = [entry for ax in (right, left) for entry in zip(*ax.get_legend_handles_labels())]
    shown = {label.split(" (")[0]: (handle, label) for handle, label in entries}
    figure.legend(*zip(*[shown[name] for name in names]), loc="outside lower center", ncols=3, markerscale=2.5)
    table = pd.concat([cone.assign(panel="A"), height.assign(panel="B")], ignore_index=True)
    return figure, table[["panel", "abstraction", "f_n", "f_t", "inside", "height_mm", "f_n_pred"]]


@house_style
def figure_abstractions(table: pd.DataFrame) -> Drawn:
    """Figure of the properties of abstractions: a row of bars for each, and a panel for each quantity.

    `table`: abstraction (its name), share (1), force (N), rise (N/mm), move, lag, drag (1), stuck_share (share of its
    pushes whose block is truly stuck), stuck (1: counts as stuck by a rule without the truth; marked).
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
    figure.supxlabel("* counts as stuck by a rule that does not use the truth", fontsize=7, x=0.01, ha="left")
    return figure, table.reset_index(drop=True)


@house_style
def figure_hidden(errors: pd.DataFrame, pushes: pd.DataFrame) -> Drawn:
    """Figure of hidden effects: one-step error before and after relearning, and blocks on which predictions fail.

    `errors`: effect, stage (before, relearned), group (see `GROUPS`), error (1), low, high, n (pushes).  `pushes`:
    effect, block, fails (1: the predictive check fails), abstraction (name of the nearest abstraction).
    """
    effects = list(errors["effect"].unique())
    figure = new_figure(height=0.75 + 2.0 * len(effects))
    panels = figure.subplots(len(effects), 2, squeeze=False, width_ratios=[1.6, 1])
    failing = sorted(pushes.loc[pushes["fails"] == 1, "abstraction"].unique())
    fills = {name: color for name, (color, _) in abstraction_style(failing).items()}
    tables = []
    for (left, right), effect in zip(panels, effects):
        rows = errors[errors["effect"] == effect]
        _errors(left, rows)
        left.set_title(effect.replace("_", " "), fontweight="bold")
        blocks = _map_of_tower(right, pushes[pushes["effect"] == effect], fills)
        tables += [rows.assign(panel="error"), blocks.assign(panel="blocks", effect=effect)]
    handles, top = {}, 1.08 * float(errors[["error", "high"]].max().max())
    for left in panels[:, 0]:
        left.set(ylim=(0.0, top), ylabel="one-step error (in standard\ndeviations of a change)")
        handles |= dict(zip(*reversed(left.get_legend_handles_labels())))
    shown = {f"fails: {name}": fill for name, fill in fills.items()}
    shown |= {"as predicted": AS_PREDICTED, "not pushed": "white"}
    handles |= {name: Patch(facecolor=fill, edgecolor=INK) for name, fill in shown.items()}
    figure.legend(handles.values(), handles.keys(), loc="outside upper left", ncols=4, columnspacing=1.2)
    columns = ["panel", "effect", "stage", "group", "error", "low", "high", "n", "block", "failed", "abstraction"]
    return figure, pd.concat(tables, ignore_index=True)[columns]


def _errors(ax: Axes, errors: pd.DataFrame) -> None:
    """Draw the errors of one effect with their intervals, groups side by side."""
    groups = [group for group in GROUPS if group in set(errors["group"])]
    for row in errors.itertuples():
        color, marker, label = STAGES[row.stage]
        side = -1.0 if row.stage == "before" else 1.0
        x = groups.index(row.group) + 0.1 * side
        ax.plot([x, x], [row.low, row.high], color=color, linewidth=1.2)
        ax.plot(x, row.error, marker, color=color, markersize=5, label=label)
        look = {"ha": "right" if side < 0 else "left", "va": "center", "fontsize": 7}
        note(ax, f"{row.error:.2f}", (x, row.error), (6 * side, 0), **look)
    pushes = errors.groupby("group")["n"].max()
    ax.set_xticks(range(len(groups)), [f"{GROUPS[group]}\n(n = {pushes[group]:.0f})" for group in groups])
    ax.set_xlim(-0.6, len(groups) - 0.4)


def _map_of_tower(ax: Axes, pushes: pd.DataFrame, fills: dict[str, str]) -> pd.DataFrame:
    """Draw the 45 blocks that may be pushed, coloured if a push of the block failed; return the plotted numbers."""
    rows = []
    for block, part in pushes.groupby("block"):
        failing = part.loc[part["fails"] == 1, "abstraction"]
        rows.append((int(block), len(part), len(failing), failing.mode().iloc[0] if len(failing) else ""))
    table = pd.DataFrame(rows, columns=["block", "n", "failed", "abstraction"])
    colors = {row.block: fills[row.abstraction] if row.failed else AS_PREDICTED for row in table.itertuples()}
    for block in range((LAYERS - 3) * PER_LAYER):
        layer, place = divmod(block, PER_LAYER)
        look = {"facecolor": colors.get(block, "white"), "edgecolor": INK, "linewidth": 0.5}
        ax.add_patch(Rectangle((place, layer), 1, 1, **look))
    ax.set(xlim=(0, PER_LAYER), ylim=(0, LAYERS - 3), box_aspect=1.6)
    ax.set_xticks([0.5, 1.5, 2.5], ["side", "middle", "side"])
    ax.set_yticks([0.5, 4.5, 9.5, 14.5], ["0", "4", "9", "14"])
    ax.tick_params(length=0)
    ax.spines[:].set_visible(False)
    ax.set_ylabel("layer")
    return table
