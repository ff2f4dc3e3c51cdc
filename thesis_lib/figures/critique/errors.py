"""Figures of the errors of a critique: ladder of added effects, laws with bounds, error budget, parameters.

Every error is the held-out mean of √(δv_x² + δv_y² + (k δω)²) in m/s unless an axis says otherwise.
"""

import textwrap
from collections.abc import Iterable

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.results.numbers import BASE_NAMES, compensated, law_errors
from thesis_lib.critique.results.titles import GREEK, effect_title, handy_unit, law_title, rung_title
from thesis_lib.figures.law_style import LAW_STYLE
from thesis_lib.figures.planar_drawing import note, white_box
from thesis_lib.figures.style import BLUE, GREY, INK, RED, SKY, YELLOW, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import Z95, clustered_mean
from thesis_lib.statistics.wording import listed, number

BEFORE, AFTER = RED, BLUE  # Okabe and Ito; the second is darker in grey
TITLE_WIDTH = 76  # characters per line of a figure's title
LABEL_WIDTH = 34  # characters per line of a rung's label
SAME_BOUND = 0.02  # relative difference up to which two bounds are drawn as one line
ALIKE = 0.1  # relative difference of errors up to which the choice of law does not matter
FAR = 8.0  # misfit in units of noise above which its axis is logarithmic
CHANNELS = {"flight": ("o", "flight"), "meet": ("^", "poses"), "touch": ("s", "gap")}
# by term: color and hatch, with grey values falling from left to right to be legible without colour; and words that
# complete "<share> of the base law's mean square error ..."
BUDGET_LOOK = {
    "noise": ("#dddddd", "", "is noise of the measurement"),
    "parameters": (SKY, "....", "comes from the uncertainty of the parameters"),
    "choice_of_law": (YELLOW, "////", "would vanish with the best law for each impact"),
    "rigid_point_contact": (BLUE, "\\\\\\\\", "is beyond any rigid impulse at the believed contact point"),
    "rest": ("#333333", "", "is neither noise nor the choice of law: an effect is missing, or there is scatter"),
}


def set_title(figure: Figure, text: str) -> None:
    """Write the sentence above all panels that states the result of the figure."""
    text = textwrap.fill(text, TITLE_WIDTH, break_on_hyphens=False)
    figure.suptitle(text, x=0.01, ha="left", fontsize=9, fontweight="bold")


def step_label(critique: DropsCritique, i: int) -> str:
    """Return the label of the i-th rung of the ladder."""
    return textwrap.fill(rung_title(critique, i), LABEL_WIDTH)


@house_style
def draw_ladder(critique: DropsCritique, table: pd.DataFrame) -> Drawn:
    """Draw the held-out error after each added effect with 95 % intervals, from noise floor to no-impact baseline."""
    labels = [step_label(critique, i) for i in range(len(table))]
    channels = [name for name in CHANNELS if name in table and np.isfinite(table[name]).any()]
    figure = new_figure(height=1.75 + 0.36 * len(table))
    ratios = {"width_ratios": [2.1, 1.0]} if channels else None
    axes = np.atleast_1d(figure.subplots(1, 2 if channels else 1, sharey=True, gridspec_kw=ratios))
    y = np.arange(len(table))
    ax = axes[0]
    floor = critique.ladder[-1][2].floor
    best = float(law_errors(critique)[1].mean())
    lines = bound_lines(ax, floor, critique.irb, best, critique.no_impact, critique.irb_augmented)
    ax.plot(table["error"], y, color=GREY, linewidth=0.8, zorder=1)
    error_dots(ax, table["error"], table["error_low"], table["error_high"], y, color=INK)
    for i, row in table.iterrows():
        look = {"ha": "center", "fontsize": 7, "bbox": white_box(0.4, 0.85)}
        note(ax, number(row["error"]), (row["error"], i), (0, 6), **look)
    ax.set_yticks(y, labels)
    ax.set_ylim(len(table) - 0.4, -0.75)
    readable_log(ax, [*table["error_low"], *table["error"], *lines.values()], [*table["error_high"], *lines.values()])
    ax.set_xlabel("held-out error of the velocity after impact (m/s)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    if channels:
        _draw_misfits(axes[1], table[channels])
    set_title(figure, ladder_sentence(critique))
    bounds = pd.DataFrame({"label": list(lines), "error": list(lines.values())})
    return figure, pd.concat([table, bounds], ignore_index=True)


def _draw_misfits(ax: Axes, misfits: pd.DataFrame) -> None:
    """Draw the misfit of each channel (columns) at each rung (rows)."""
    ax.axvline(1.0, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
    shift = np.linspace(-0.14, 0.14, misfits.shape[1]) if misfits.shape[1] > 1 else [0.0]
    for name, dy in zip(misfits, shift):
        marker, text = CHANNELS[name]
        look = {"color": INK, "markerfacecolor": "white", "markersize": 4, "label": text}
        ax.plot(misfits[name], np.arange(len(misfits)) + dy, marker, **look)
    largest = float(misfits.max(axis=None))
    if largest > FAR:
        readable_log(ax, [*misfits.min(), 0.8], [*misfits.max(), 1.3])
    else:
        ax.set_xlim(0.0, max(1.15 * largest, 1.6))
    ax.set_xlabel("misfit (noise = 1)")
    ax.tick_params(axis="y", left=False)
    ax.legend(loc="lower left", bbox_to_anchor=(-0.03, 1.0), ncols=3, handletextpad=0.1, columnspacing=0.8)


def ladder_sentence(critique: DropsCritique) -> str:
    """Return a sentence on the change of the held-out error along the ladder, with the noise floor."""
    first, last = critique.ladder[0][2], critique.ladder[-1][2]
    before, after, floor = float(first.error.mean()), float(last.error.mean()), last.floor
    to_floor = f"; the noise floor is {number(floor)} m/s" if np.isfinite(floor) else ""
    if len(critique.ladder) == 1:
        return f"No effect was added: the held-out error is {number(before)} m/s{to_floor}"
    names = listed([effect_title(label) for label, *_ in critique.ladder[1:]])
    change = critique.settings.change(before, after, floor)
    return f"The held-out error of impacts {change} m/s with {names}{to_floor}"


@house_style
def draw_laws(critique: DropsCritique) -> Drawn:
    """Draw held-out error and log score of each law without effects, with Best Post Hoc, IRB bound and noise floor."""
    table, best = law_errors(critique)
    figure = new_figure(height=3.0)
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [1.25, 1.0]})
    y = np.arange(len(table))
    colors = [LAW_STYLE[name].color if name in LAW_STYLE else INK for name in table["model"]]
    floor = critique.ladder[-1][2].floor  # the same floor as everywhere else
    lines = bound_lines(left, floor, critique.irb, float(best.mean()), None)
    for ax, names in ((left, ("error", "error_low", "error_high")), (right, ("gain", "gain_low", "gain_high"))):
        for i, color in enumerate(colors):
            error_dots(ax, *(table[name].iloc[[i]] for name in names), y[[i]], color=color)
    base = critique.discovery.base
    left.set_yticks(y, [law_title(name) + ("  (base)" if name == base else "") for name in table["model"]])
    left.set(ylim=(len(table) - 0.5, -0.5), xlim=(0.0, None), xlabel="held-out error (m/s)")
    right.axvline(0.0, color=GREY, linewidth=0.8)
    right.set_xlabel("log score above the base law\n(nats per impact)")
    right.tick_params(axis="y", left=False)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    set_title(figure, laws_sentence(table))
    bounds = pd.DataFrame({"model": list(lines), "error": list(lines.values())})
    low_high = clustered_mean(best, critique.ladder[0][2].trial)[1:]
    bounds.loc[bounds["model"] == "best_post_hoc", ["error_low", "error_high"]] = low_high
    return figure, pd.concat([table, bounds], ignore_index=True)


def laws_sentence(table: pd.DataFrame) -> str:
    """Return a sentence on how much the choice of law matters."""
    if len(table) == 1:
        return f"{law_title(table['model'][0])} errs by {number(table['error'][0])} m/s on held-out impacts"
    (best, *_, worst), (least, *_, most) = table["model"].map(law_title), table["error"]
    alike = table.loc[table["error"] <= (1.0 + ALIKE) * least, "error"]
    if len(alike) == len(table):
        ends = " to ".join(dict.fromkeys(map(number, (least, most))))
        return f"The choice of law hardly matters: all {len(table)} err by {ends} m/s on held-out impacts"
    if len(alike) >= len(table) / 2:
        return (
            f"{len(alike)} of {len(table)} laws have similar errors on held-out impacts, {number(least)} to "
            f"{number(alike.iloc[-1])} m/s; {worst} errs most, by {number(most)} m/s"
        )
    return (
        f"The choice of law matters: held-out errors range from {number(least)} m/s ({best}) to {number(most)} m/s "
        f"({worst})"
    )


@house_style
def draw_budget(table: pd.DataFrame) -> Drawn:
    """Draw the parts of the mean square of the base law's held-out error."""
    total = float(table["mean_square"].sum())
    figure = new_figure(height=1.9)
    ax = figure.add_subplot()
    left = 0.0
    for row in table.itertuples():
        label = row.part.replace("_", " ")
        color, hatch, _ = BUDGET_LOOK[row.part]
        share = 100.0 * row.mean_square / total
        ax.barh(0, share, left=left, color=color, hatch=hatch, edgecolor="white", linewidth=0.6)
        # this part is 0 if the noise is unknown, which does not mean data without noise
        text = f"{label} {number(share, 2)} %" if row.part != "noise" or share > 0 else f"{label} unknown"
        ax.barh(0, 0, color=color, hatch=hatch, edgecolor="white", label=text)
        if share > 7:
            shade = "white" if row.part in ("rest", "rigid_point_contact") else "black"
            look = {"ha": "center", "va": "center", "fontsize": 7, "color": shade}
            ax.text(left + share / 2, 0, f"{share:.0f} %", bbox=white_box(1.0) | {"facecolor": color}, **look)
        left += share
    ax.set(yticks=[], xlim=(0, 100))
    ax.spines["left"].set_visible(False)
    ax.set_xlabel(f"share of the mean square, {number(total)} (m/s)², of the base law's held-out error (%)")
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    largest = table.loc[table["mean_square"].idxmax()]
    share = f"{100 * largest['mean_square'] / total:.0f} %"
    set_title(figure, f"{share} of the base law's mean square error {BUDGET_LOOK[largest['part']][2]}")
    return figure, table


@house_style
def draw_parameters(critique: DropsCritique) -> Drawn:
    """Draw each parameter with its 95 % interval at each step, or its bound as an arrow.

    A parameter that changes had compensated for a missing effect.
    """
    # a law that was replaced on the way may have parameters that other laws lack
    declared = {name: p for _, fitted, _ in critique.ladder for name, p in fitted.model.parameters.items()}
    rows = [
        (label, name, p.unit, fitted.content(name)["value"], fitted.std[name])  # std is NaN for a bound
        for label, fitted, _ in critique.ladder
        for name, p in fitted.model.parameters.items()
        if p.discrete is None
    ]
    table = pd.DataFrame(rows, columns=["label", "parameter", "unit", "value", "std"])
    names = list(dict.fromkeys(table["parameter"]))
    rows = -(-len(names) // 4)
    columns = -(-len(names) // rows)
    n = len(critique.ladder)
    figure = new_figure(height=0.75 + rows * (0.75 + 0.24 * n))
    axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
    for ax in axes.ravel()[len(names) :]:
        ax.set_axis_off()
    labels = [step_label(critique, i) for i in range(n)]
    at = {label: i for i, (label, *_) in enumerate(critique.ladder)}
    for ax, name in zip(axes.ravel(), names):
        steps = table[table["parameter"] == name]
        y = steps["label"].map(at).to_numpy()
        factor, unit = handy_unit(float(steps["value"].abs().max()), steps["unit"].iloc[0])
        half, value = factor * Z95 * steps["std"].to_numpy(), factor * steps["value"].to_numpy()
        known = np.isfinite(half)
        error_dots(ax, value[known], (value - half)[known], (value + half)[known], y[known], color=INK)
        for i in np.flatnonzero(~known):
            bound = critique.ladder[y[i]][1].bounds[name]
            _draw_bound(
                ax, value[i], y[i], bound.kind, float(np.ptp(value)) or abs(value[i]) or factor * declared[name].scale
            )
        half = np.nan_to_num(half)
        ax.plot(value, y, color=GREY, linewidth=0.8, zorder=1)
        symbol = symbol_of(name.split(".")[-1])
        ax.set_xlabel(symbol if unit == "1" else f"{symbol} ({unit})")
        if name not in BASE_NAMES:
            ax.set_title(textwrap.fill(effect_title(name.split(".")[0]), 20), fontsize=7)
        ax.margins(x=0.2)
        ax.locator_params(axis="x", nbins=3 if np.ptp(value) + half.max() > 0.02 * np.abs(value).max() else 2)
        ax.ticklabel_format(axis="x", useOffset=False)
    for ax in axes[:, 0]:
        ax.set_yticks(range(n), labels)
        ax.set_ylim(n - 0.5, -0.5)
    set_title(figure, parameters_sentence(critique))
    return figure, table


def _draw_bound(ax: Axes, value: float, y: float, kind: str, size: float) -> None:
    """Draw a bound as an open mark, with an arrow to the side on which the value may lie."""
    to = value + 0.5 * size * (1.0 if kind == "lower" else -1.0)
    ax.plot([value], [y], "|", color=INK, markersize=9)
    ax.annotate("", (to, y), (value, y), arrowprops={"arrowstyle": "->", "color": INK, "linewidth": 1.2})
    ax.plot([to], [y], alpha=0.0)  # extends the axis to the arrow


def symbol_of(name: str) -> str:
    """Return the name of a parameter as mathematics: Greek letters and subscripts."""
    parts = [GREEK.get(part, part) for part in name.split("_")]
    first, *rest = [part if len(part) == 1 else rf"\mathrm{{{part}}}" for part in parts]
    return f"${first}_{{{','.join(rest)}}}$" if rest else f"${first}$"


def parameters_sentence(critique: DropsCritique) -> str:
    """Return a sentence on parameters that had compensated for missing effects."""
    names = {"mu": "friction μ", "epsilon": "restitution ε", "tau": "contact time τ"}
    if len(critique.ladder) == 1:
        return "Parameters of the base law with 95 % intervals"
    first, last = (critique.ladder[i][1].model.law.name for i in (0, -1))
    if first != last:
        better = f"{law_title(last)} fits better than {law_title(first)}"
        return f"With the effects {better}, whose μ and ε have different meanings"
    moved = compensated(critique)
    if moved.empty:
        return "No parameter of the base law had compensated for missing effects: none changes by much"
    rows = zip(moved["parameter"], moved["before"], moved["after"])
    parts = [f"{names.get(name, name)} moves from {number(before)} to {number(after)}" for name, before, after in rows]
    return "Parameters that had compensated for missing effects: " + " and ".join(parts)


def error_dots(ax: Axes, value, low, high, y, color: str) -> None:
    """Draw dots with horizontal intervals."""
    value, low, high = (np.asarray(a, float) for a in (value, low, high))
    ax.errorbar(value, y, xerr=np.abs([value - low, high - value]), fmt="o", color=color, capsize=2.5, linewidth=1.2)


def bound_lines(
    ax: Axes, floor: float, irb: float, best: float | None, nothing: float | None, irb_augmented: float | None = None
) -> dict[str, float]:
    """Draw the known bounds as vertical lines, in m/s; return them by name.

    The IRB bound with the effects is drawn if it differs: effects can correct quantities that the bound assumes.
    """
    if irb_augmented is not None and abs(irb_augmented - irb) < SAME_BOUND * irb:
        irb_augmented = None
    looks = {
        "noise_floor": (floor, GREY, (0, (4, 2)), "noise floor"),
        "irb_bound": (irb, "black", "-", "IRB bound"),
        "irb_bound_augmented": (irb_augmented, INK, (0, (6, 1.5)), "IRB bound with the effects"),
        "best_post_hoc": (best, "0.45", (0, (3, 1, 1, 1, 1, 1)), "Best Post Hoc"),
        "no_impact": (nothing, "black", (0, (1, 1.5)), "no impulse"),
    }
    drawn = {}
    for name, (value, color, dash, label) in looks.items():
        if value is not None and np.isfinite(value):
            ax.axvline(value, color=color, linestyle=dash, linewidth=1.0, label=label, zorder=0)
            drawn[name] = float(value)
    return drawn


def readable_log(ax: Axes, low, high) -> None:
    """Set a logarithmic axis over the values, with plain numbers at 1, 2 and 5 (only at 1 over many decades)."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    low, high = low[np.isfinite(low) & (low > 0)], high[np.isfinite(high) & (high > 0)]
    if not len(low) or not len(high):
        return
    first, last = low.min() / 1.25, high.max() * 1.25
    digits = (1.0, 2.0, 5.0) if last / first < 3000 else (1.0,)
    log_axis(ax, first, last, (d * 10.0**k for k in range(-9, 9) for d in digits))


def log_axis(ax: Axes, first: float, last: float, ticks: Iterable[float]) -> None:
    """Set a logarithmic axis from `first` to `last` with plain numbers at the `ticks` in this range."""
    ax.set(xscale="log", xlim=(first, last))
    ax.xaxis.set_major_locator(FixedLocator([tick for tick in ticks if first <= tick <= last]))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
