"""Figures of the proof: how often hidden effects are named correctly, and how well they are recovered.

Detection: share of right verdicts against the size of the effect, the drops and the noise, with 95 % Wilson intervals;
points of different sources are slightly offset.  Truths of the sources "mechanism" and "drake" count under the effect
that describes them best; two causes of one effect therefore share a point.  Recovery: the misfit before and after, and
parameters against their bound; dots are medians over datasets, bars their middle 80 % (for a coverage, the 95 % Wilson
interval).

Real contacts: a panel for each figure; points are shares of one source, shape and contact time with 95 % Wilson
intervals, slightly offset; the line is the required share.  Next drops: numbers of random drops and of drops in the
proposed states that settle a question between two effects.
"""

from collections.abc import Iterable

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thesis_lib.critique.results.titles import symbol
from thesis_lib.effects import EFFECTS
from thesis_lib.figures.critique.errors import AFTER, BEFORE, log_axis, set_title
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, YELLOW, Drawn, house_style, new_figure
from thesis_lib.studies.proof.by_contact import ASKED, COVERAGE, COVERED, EVERY
from thesis_lib.studies.proof.cases import BODIES
from thesis_lib.studies.proof.headline import TIMES
from thesis_lib.studies.proof.next_drops import STEPS
from thesis_lib.studies.proof.results import TABLE
from thesis_lib.studies.proof.store import share
from thesis_lib.studies.proof.summary import TARGETS, WIDEST

SOURCE_TITLE = {"law": "laws injected", "mechanism": "mechanisms", "drake": "mechanisms in Drake"}
SOURCE_LOOK = {"law": (BLUE, "o"), "mechanism": (RED, "s"), "drake": (GREEN, "^")}
COLUMNS = 4
PANEL = 1.0  # inches, height
APART = 1.07  # factor between points of two sources on a logarithmic axis
DRAWN = ("effect", "source", "ratio", "drops", "noise", "n", "right", "right_low", "right_high")
ROW = 0.165  # inches, height of a row
MIDDLE = (0.1, 0.9)
FLOOR_LINES = tuple(limits[1] for t in TARGETS if t.measure == "misfit" for limits in (t.aim, t.at_least))


def in_order(effects: Iterable[str]) -> list[str]:
    """Distinct effects in the order of the library, by family; effects outside it come last."""
    library = list(EFFECTS)
    return sorted(set(effects), key=lambda name: (library.index(name) if name in EFFECTS else len(library), name))


def words(name: str) -> str:
    """Name of an effect or cause as written on axes."""
    return name.replace("_", " ")


def sources_in(table: pd.DataFrame) -> list[str]:
    """Sources of a table, in the order of `SOURCE_TITLE`."""
    return [name for name in SOURCE_TITLE if (table["source"] == name).any()]


def not_run(figure: Figure, what: str, table: pd.DataFrame) -> Drawn:
    """A placeholder picture for results that are not stored, and its empty `table`."""
    figure.text(0.5, 0.5, f"{what}: no stored results", ha="center", va="center", color=GREY)
    return figure, table


@house_style
def draw_detection(outcomes: pd.DataFrame) -> Drawn:
    """Share of right verdicts against the base law's nominal misfit over the noise floor, a panel for each effect."""
    singles = outcomes[(outcomes["kind"] == "single") & (outcomes["drops"] == TABLE["drops"])]
    table = _shares(singles[singles["noise"] == TABLE["noise"]])
    title = "How often the critique is right, against the size of the hidden effect"
    return _panels(table, "ratio", "misfit over its floor", title)


@house_style
def draw_sizes(outcomes: pd.DataFrame) -> Drawn:
    """Share of right verdicts against the number of drops, at each noise, for each effect with such results."""
    table = _shares(outcomes[(outcomes["kind"] == "single") & (outcomes["ratio"] == TABLE["ratio"])])
    other = (table["drops"] != TABLE["drops"]) | (table["noise"] != TABLE["noise"])
    table = table[table["effect"].isin(table.loc[other, "effect"])]
    title = "How often the critique is right, against the number of drops and the noise"
    return _panels(table, "drops", "drops", title)


def _shares(outcomes: pd.DataFrame) -> pd.DataFrame:
    """Share of right verdicts with its interval, for each effect, source and size: columns `DRAWN`."""
    found = ((key, share(group["right"])) for key, group in outcomes.groupby(list(DRAWN[:5])))
    rows = [(*key, of["n"], of["share"], of["low"], of["high"]) for key, of in found]
    return pd.DataFrame(rows, columns=list(DRAWN))


def _panels(table: pd.DataFrame, along: str, label: str, title: str) -> Drawn:
    effects = in_order(table["effect"])
    rows = -(-len(effects) // COLUMNS)
    figure = new_figure(height=1.1 + PANEL * max(rows, 1))
    set_title(figure, title)
    if not effects:
        return not_run(figure, f"right against {label}", table)
    axes = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    ticks = sorted(table[along].unique())
    for name, ax in zip(effects, axes.flat):
        _draw_panel(ax, table[table["effect"] == name], along)
        _title(ax, words(name))
    for ax in axes.flat[len(effects) :]:
        ax.set_axis_off()
    first = axes[0, 0]
    log_axis(first, ticks[0] / 1.25, ticks[-1] * 1.25, ticks)
    first.set(ylim=(-4, 104), yticks=[0, 50, 100])
    for ax in axes.flat[max(len(effects) - COLUMNS, 0) : len(effects)]:
        ax.tick_params(labelbottom=True)
        ax.set_xlabel(label, fontsize=7)
    figure.supylabel("right (%)", fontsize=8)
    figure.legend(*_legend(first, table), loc="outside lower center", ncols=4)
    return figure, table


def _draw_panel(ax: Axes, shares: pd.DataFrame, along: str) -> None:
    order = list(SOURCE_LOOK)
    for key, line in shares.groupby(["source", "noise"] if along == "drops" else ["source"], sort=False):
        color, marker = SOURCE_LOOK[key[0]]
        noisy = along == "drops" and key[1] != TABLE["noise"]
        line = line.sort_values(along)
        x = line[along] * APART ** (order.index(key[0]) - 1 + 0.33 * noisy)
        middle, low, high = (100 * line[name] for name in ("right", "right_low", "right_high"))
        look = {"color": color, "marker": marker, "markersize": 3.2, "linewidth": 0.9, "elinewidth": 0.6}
        look |= {"linestyle": ":", "markerfacecolor": "white"} if noisy else {"linestyle": "-"}
        ax.errorbar(x, middle, yerr=np.abs([middle - low, high - middle]), **look)


def _title(ax: Axes, text: str) -> None:
    """Set a title in up to two lines, to avoid overlap with its neighbours."""
    parts = text.split(" ")
    cut = min(range(1, len(parts) + 1), key=lambda i: abs(len(" ".join(parts[:i])) - 0.5 * len(text)))
    long = len(text) > 16 and cut < len(parts)
    text = " ".join(parts[:cut]) + "\n" + " ".join(parts[cut:]) if long else text
    ax.set_title(text, fontsize=6.5, loc="left", pad=3)


def _legend(ax: Axes, table: pd.DataFrame) -> tuple[list, list[str]]:
    handles, labels = [], []
    for name in sources_in(table):
        color, marker = SOURCE_LOOK[name]
        handles += ax.plot([], [], color=color, marker=marker, markersize=3.2, linewidth=0.9)
        labels.append(SOURCE_TITLE[name])
    for noise in sorted(set(table["noise"]) - {TABLE["noise"]}):
        handles += ax.plot([], [], color=GREY, marker="o", markersize=3.2, markerfacecolor="white", linestyle=":")
        labels.append(f"{noise:g} times the rig's noise")
    return handles, labels


@house_style
def draw_misfits(outcomes: pd.DataFrame) -> Drawn:
    """Misfit over its floor before and after adding the effects, a row for each truth and a panel for each source.

    `outcomes`: rows of one size, drops and noise; columns as in `studies.proof.results.outcomes`.
    """
    singles = outcomes[(outcomes["kind"] == "single") & outcomes["after_over_floor"].notna()]
    rows = []
    for key, group in singles.groupby(["source", "effect"]):
        for series in ("before", "after"):
            values = group[f"{series}_over_floor"].astype(float)
            rows.append((*key, series, len(values), values.median(), *values.quantile(MIDDLE)))
    table = pd.DataFrame(rows, columns=["source", "effect", "series", "n", "median", "low", "high"])
    effects = in_order(table["effect"])
    figure = new_figure(height=1.2 + ROW * max(len(effects), 3))
    set_title(figure, "How far the effects that were found bring the misfit down to its floor")
    if not effects:
        return not_run(figure, "misfit before and after", table)
    names = sources_in(table)
    axes = np.atleast_1d(figure.subplots(1, len(names), sharex=True, sharey=True))
    place = {name: i for i, name in enumerate(effects)}
    for name, ax in zip(names, axes):
        for x, style in zip(FLOOR_LINES, (":", (0, (4, 2)))):
            ax.axvline(x, color=GREY, linestyle=style, linewidth=0.9, label=f"{x:g}")
        for series, color, face, marker, up in (
            ("before", BEFORE, "white", "o", 0.12),
            ("after", AFTER, AFTER, "D", -0.12),
        ):
            part = table[(table["source"] == name) & (table["series"] == series)]
            y = part["effect"].map(place) - up
            ax.hlines(y, part["low"], part["high"], color=color, linewidth=0.8)
            look = {"markersize": 3.2, "markerfacecolor": face, "label": f"{series} the effects were added"}
            ax.plot(part["median"], y, marker, color=color, **look)
        ax.set(title=SOURCE_TITLE[name], xlabel="misfit over its floor")
    _rows(axes[0], effects)
    low, high = table["low"].min() / 1.15, table["high"].max() * 1.15
    log_axis(axes[0], low, high, (0.5, 1, 2, 3, 5, 10, 20, 50, 100))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure, table


@house_style
def draw_parameters(recovered: pd.DataFrame) -> Drawn:
    """Coverage of each parameter's 95 % interval, and the interval's width over the Cramér-Rao bound.

    `recovered`: rows of one size, drops and noise; columns as in `studies.proof.results.recovered`.
    """
    rows = []
    for (effect, name), group in recovered.groupby(["effect", "parameter"]):
        of, widths = share(group["inside"]), group["width"].astype(float)
        covered = (of["n"], of["share"], of["low"], of["high"])
        rows.append((effect, name, *covered, widths.median(), *widths.quantile(MIDDLE)))
    columns = ["effect", "parameter", "n", "coverage", "coverage_low", "coverage_high"]
    table = pd.DataFrame(rows, columns=[*columns, "width", "width_low", "width_high"])
    effects = in_order(table["effect"])
    table["place"] = table["effect"].map(effects.index)
    table = table.sort_values(["place", "parameter"], ignore_index=True).drop(columns="place")
    figure = new_figure(height=1.0 + ROW * max(len(table), 3))
    set_title(figure, "Injected effects: share of truths within the interval, and its width")
    if table.empty:
        return not_run(figure, "parameters of injected laws", table)
    left, right = figure.subplots(1, 2, sharey=True)
    y = np.arange(len(table))
    for ax, name, factor, line in ((left, "coverage", 100, 95), (right, "width", 1, WIDEST)):
        ax.axvline(line, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)))
        ax.hlines(y, factor * table[f"{name}_low"], factor * table[f"{name}_high"], color=INK, linewidth=0.8)
        ax.plot(factor * table[name], y, "o", color=INK)
    left.set(xlabel="within their 95 % interval (%)", xlim=(min(95 * table["coverage_low"].min(), 60), 102))
    right.axvline(1.0, color=GREY, linewidth=0.9)
    right.set_xlabel("width over the Cramér-Rao bound")
    lowest, highest = np.nanmin([*table["width_low"], 1.0]), np.nanmax([*table["width_high"], WIDEST])
    if highest > 4.0 or lowest < 0.25:
        log_axis(right, lowest / 1.15, highest * 1.15, (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100))
    else:
        right.set_xlim(min(0.95 * lowest, 0.8), 1.05 * highest)
    _rows(left, [f"{words(e)}, {symbol(p)}" for e, p in zip(table["effect"], table["parameter"])])
    return figure, table


def _rows(ax: Axes, labels: list[str]) -> None:
    ax.set_yticks(range(len(labels)), [words(label) if " " not in label else label for label in labels])
    ax.tick_params(axis="y", labelsize=6.5, length=0)
    ax.set_ylim(len(labels) - 0.4, -0.6)


TITLES = {
    "mujoco": "MuJoCo",
    "drake_point": "Drake, point contact",
    "drake_hydroelastic": "Drake, hydroelastic",
    "mechanism": "own simulator",
}
COLORS = dict(zip(TITLES, (BLUE, GREEN, YELLOW, RED)))
MARKERS = dict(zip(BODIES, "os"))
TIMES_APART = 0.1  # offset between points, in units of the distance between contact times


@house_style
def draw_real_contacts(table: pd.DataFrame) -> Drawn:
    """Shares by source, shape and contact time; `table` comes from `studies.proof.by_contact`."""
    figure = new_figure(height=4.6)
    set_title(figure, "Right verdicts in contacts as long as real ones")
    if table.empty:
        return not_run(figure, "real contacts", table)
    asked = {name: least for name, *_, least in ASKED} | {COVERED: COVERAGE[0]}
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    places = {time: i for i, time in enumerate(sorted(TIMES))}
    for (name, least), ax in zip(asked.items(), axes.flat):
        part = table[(table["figure"] == name) & table["contact_time"].isin(TIMES)]
        ax.axhline(100 * least, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)))
        for i, (source, shape) in enumerate((source, shape) for source in TITLES for shape in BODIES):
            points = part[(part["source"] == source) & (part["shape"] == shape)]
            x = points["contact_time"].map(places) + TIMES_APART * (i - 0.5 * (len(TITLES) * len(BODIES) - 1))
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


QUESTION = 0.17  # inches, height of a question


@house_style
def draw_next_drops(answers: pd.DataFrame) -> Drawn:
    """A row for each open question, sorted by the random drops it needs (most at the top), on a logarithmic axis."""
    opened = answers[answers["open"]].sort_values(["random", "chosen"], ascending=[True, False], kind="stable")
    table = opened[["cause", "effect", "rival", "random", "chosen"]].reset_index(drop=True)
    figure = new_figure(height=1.0 + QUESTION * max(len(table), 4))
    set_title(figure, "Drops that tell two effects apart, beyond the first 50")
    if table.empty:
        return not_run(figure, "questions", table)
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
