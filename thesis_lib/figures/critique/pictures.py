"""All pictures of one critique, by name, including those of the data, and of laws compared with engines.

The data: some trials with arcs and detected impacts, the states before impact, and counts of impacts left out.  Arcs
are the flights that the critique fitted on either side of each impact, with the gravity of the dataset.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from thesis_lib.bodies.walls import as_filmed
from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import features
from thesis_lib.critique.drops.words import reason_text
from thesis_lib.critique.engines.compare import WITH, WITHOUT, model_sentences, model_title
from thesis_lib.critique.results.tables import left_out_impacts
from thesis_lib.figures.critique import errors
from thesis_lib.figures.critique.candidates import draw_candidates
from thesis_lib.figures.critique.residuals import BINS, draw_flights, draw_residuals
from thesis_lib.figures.critique.where import axis_label, draw_where
from thesis_lib.figures.planar_drawing import note, turned
from thesis_lib.figures.style import BLUE, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.mechanics.state import State
from thesis_lib.statistics.intervals import Z95

PANEL = 1.3  # width of a trial's panel over its height
TRIALS = 3  # trials drawn
USED, LEFT_OUT = BLUE, RED
STATES = ("v_t", "v_n", "omega", "theta", "omega_t", "omega_n")
LOOKS = {  # edge colour, face colour, vertical offset in the row
    WITHOUT: (errors.BEFORE, "white", 0.14),
    WITH: (errors.AFTER, errors.AFTER, -0.14),
}
LABELS = {WITHOUT: "without the named effects", WITH: "with them"}


@house_style
def draw_data(critique: DropsCritique) -> Drawn:
    """Draw trials (planar only), histograms of the states before impact, and reasons for leaving impacts out."""
    o = critique.observations
    shown = trials_to_show(critique) if o.space.is_plane else []
    left_out = left_out_impacts(o)["reason"].map(reason_text).value_counts().sort_index().sort_values(kind="stable")
    has_paths = len(shown) > 0
    heights = [2.0] * has_paths + [1.45] + [0.35 + 0.17 * (len(left_out) + 1)] * bool(len(left_out))
    figure = new_figure(height=sum(heights) + 0.9)
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    rows = []
    if has_paths:
        axes = np.atleast_1d(parts[0].subplots(1, len(shown)))
        for ax, trial in zip(axes, shown):
            rows += _path(ax, critique, int(trial))
        axes[0].set_ylabel("position $y$ (m)" if critique.source.header.surfaces else "height $y$ (m)")
        handles = [
            Line2D([], [], color="0.6", marker=".", linestyle="", markersize=3, label="samples"),
            Line2D([], [], color=INK, linewidth=1.1, label="fitted flight"),
            Line2D([], [], color=USED, marker="o", linewidth=0.8, label="impact used"),
            Line2D([], [], color=LEFT_OUT, marker="x", linestyle=(0, (2, 1.5)), linewidth=0.8, label="impact left out"),
        ]
        parts[0].legend(handles=handles, loc="outside upper left", ncols=4)
    table = features(critique.ladder[0][1], o)
    held_out = np.isin(o.trial, np.unique(critique.held_out.trial))
    below = parts[int(has_paths)]
    states = [name for name in STATES if name in table]
    for i, (ax, name) in enumerate(zip(below.subplots(1, len(states)), states)):
        rows += _histogram(ax, name, table[name].to_numpy(), held_out)
        if i == 0:
            ax.set_ylabel("impacts")
    kinds = [Patch(color="0.8", label="training"), Patch(color=USED, label="held out")]
    below.legend(handles=kinds, loc="outside upper left", ncols=2, handlelength=1.2)
    if len(left_out):
        rows += _left_out(parts[-1].add_subplot(), left_out, len(o))
    errors.set_title(figure, data_sentence(critique))
    return figure, pd.DataFrame(rows, columns=["panel", "series", "x", "y", "count", "trial"])


def _left_out(ax: Axes, left_out: pd.Series, used: int) -> list[tuple]:
    """Draw bars of the impacts left out, by reason, and of the impacts used."""
    names = [*left_out.index, "used"]
    counts = np.array([*left_out.to_numpy(), used])
    ax.barh(range(len(names)), counts, color=[LEFT_OUT] * len(left_out) + [USED], height=0.7)
    for i, count in enumerate(counts):
        note(ax, f"{count}", (count, i), (3, 0), va="center", fontsize=7)
    ax.set_yticks(range(len(names)), names)
    ax.set(xlabel="impacts detected", xlim=(0, 1.1 * counts.max()))
    return [("impacts", name, np.nan, np.nan, float(n), np.nan) for name, n in zip(names, counts)]


def data_sentence(critique: DropsCritique) -> str:
    """Return a sentence on the numbers of impacts and trials used, and of impacts left out."""
    o = critique.observations
    out = len(left_out_impacts(o))
    text = f"{len(o)} impacts of {len(np.unique(o.trial))} trials are used"
    return f"{text}; {out} ({100 * out / (out + len(o)):.0f} %) were left out" if out else f"{text}, none left out"


def trials_to_show(critique: DropsCritique) -> np.ndarray:
    """Return up to `TRIALS` trials with typical impact counts, from the start, middle and end of the dataset."""
    source = critique.source
    if source is None or source.trajectories is None or not critique.observations.arcs:
        return np.zeros(0, int)
    trials, counts = np.unique(critique.observations.trial, return_counts=True)
    typical = trials[np.abs(counts - np.median(counts)) <= 1]
    typical = typical if len(typical) >= TRIALS else trials
    return typical[np.unique(np.linspace(0, len(typical) - 1, TRIALS).astype(int))]


def _path(ax: Axes, critique: DropsCritique, trial: int) -> list[tuple]:
    """Draw one planar trial: samples, fitted arcs, outline of the body at each impact, surface."""
    source, o = critique.source, critique.observations
    searched = o.found.samples
    assert source is not None and searched is not None
    rows_of_trial = searched.trial == trial
    walls = source.header.surfaces or ()
    hits = o.found.arcs[o.found.arcs["trial"] == trial].sort_values("t")
    t, (x, y, theta) = searched.t[rows_of_trial], searched.q[rows_of_trial].T
    last = hits["t"].max() + 0.12 if len(hits) else t.max()
    shown = t <= last  # after the last hit the body mostly rests
    ax.plot(x[shown], y[shown], ".", color="0.6", markersize=1.6, zorder=1)
    rows = [("path", "sample", a, b, np.nan, trial) for a, b in zip(x[shown], y[shown])]
    outline = o.rig.shape.outline(60)
    played = {(i, k) for i, first, n in zip(o.trial, o.impact, o.hits) for k in range(first, first + n)}
    hits = hits.assign(used=[pair in played for pair in zip(hits["trial"], hits["impact"])])
    for hit in hits.itertuples():
        angle, at_x, at_y = (np.interp(hit.t, t, values) for values in (theta, x, y))
        color, dash = (USED, "-") if hit.used else (LEFT_OUT, (0, (2, 1.5)))
        edge = turned(outline, angle) + [at_x, at_y]
        ax.plot(*edge.T, color=color, linewidth=0.8, linestyle=dash, zorder=2)
        ax.plot(at_x, at_y, "o" if hit.used else "x", color=color, markersize=3.5, zorder=4)
        rows.append(("path", "impact" if hit.used else "impact left out", at_x, at_y, np.nan, trial))
    for i in np.flatnonzero(o.trial == trial):
        for side in (0, 1):
            # the nodes reach from one end of the samples used to the other
            reach = o.nodes[i, side]
            tau = np.linspace(0.0, reach.min() if side == 0 else reach.max(), 15)
            q = o.value[i, side] + tau[:, None] * o.slope[i, side]
            # the fit stores a straight line; the parabola due to gravity relative to it is added
            bow = 0.5 * tau**2 - o.bow[i, side, 0] - o.bow[i, side, 1] * tau
            wall = np.full(len(tau), o.surface[i])
            q += o.rig.fall(State.of(q, np.zeros_like(q), tau, tau, wall)).T * bow[:, None]
            q = as_filmed(walls, wall, q) if walls else q
            height = q[:, 1]
            ax.plot(q[:, 0], height, color=INK, linewidth=1.1, zorder=3)
            rows += [("path", "arc", a, b, np.nan, trial) for a, b in zip(q[:, 0], height)]
    margin = o.rig.shape.extent
    if walls:
        for wall in walls:
            other = np.add(wall.point, [wall.n[1], -wall.n[0]])
            ax.axline(wall.point, (float(other[0]), float(other[1])), color=GREY, linewidth=0.8)
        # a wall has no ends: the panel shows the path, and the point that defines each wall
        seen = np.concatenate([np.column_stack([x[shown], y[shown]]), [wall.point for wall in walls]])
        (left, low), (right, high) = seen.min(axis=0) - margin, seen.max(axis=0) + margin
        ax.set(xlim=(left, right), ylim=(low, high))
    else:
        low, high = o.rig.height - 0.4 * margin, y[shown].max() + margin
        left, right = x[shown].min() - margin, x[shown].max() + margin
        # both axes have the same scale in a panel of proportions `PANEL`
        wide = max(right - left, PANEL * (high - low))
        ax.axhspan(low, o.rig.height, color="0.9", zorder=0)
        ax.axhline(o.rig.height, color=GREY, linewidth=0.8, zorder=0)
        ax.set(xlim=(0.5 * (left + right - wide), 0.5 * (left + right + wide)), ylim=(low, low + wide / PANEL))
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel("position $x$ (m)")
    ax.set_title(f"trial {trial}", fontsize=7.5)
    ax.locator_params(nbins=4 if walls else 5)
    return rows


def _histogram(ax: Axes, name: str, values: np.ndarray, held: np.ndarray) -> list[tuple]:
    low, high = np.quantile(values, [0.002, 0.998])
    edges = np.linspace(low, high, 21) if high > low else np.linspace(low - 0.5, high + 0.5, 3)
    values = np.clip(values, edges[0], edges[-1])
    kinds = (("training", ~held, "0.8"), ("held out", held, USED))
    counts = [np.histogram(values[rows], edges)[0] for _, rows, _ in kinds]
    look = {"color": [color for *_, color in kinds], "edgecolor": "white", "linewidth": 0.3}
    ax.hist([edges[:-1]] * 2, edges, weights=counts, stacked=True, **look)
    ax.set_xlabel(axis_label(name).replace(" $", "\n$", 1))
    ax.locator_params(nbins=4)
    middle = 0.5 * (edges[1:] + edges[:-1])
    return [
        (f"state {name}", kind, float(x), np.nan, float(n), np.nan)
        for (kind, *_), numbers in zip(kinds, counts)
        for x, n in zip(middle, numbers)
    ]


@house_style
def draw_models(table: pd.DataFrame) -> Drawn:
    """Draw held-out error and μ of each model; engines as diamonds, bounds of μ as triangles, the best at the top."""
    names = list(dict.fromkeys(table["model"]))
    figure = new_figure(height=1.7 + 0.28 * len(names))
    left, right = figure.subplots(1, 2, sharey=True, gridspec_kw={"width_ratios": [1.5, 1.0]})
    for row in table.to_dict("records"):
        edge, face, shift = LOOKS[row["effects"]]
        y = names.index(row["model"]) + shift
        look = {"color": edge, "markerfacecolor": face, "markersize": 4.5, "elinewidth": 1.0, "capsize": 0}
        half = [[row["error"] - max(row["error_low"], 1e-12)], [row["error_high"] - row["error"]]]
        left.errorbar([row["error"]], [y], xerr=half, fmt="o" if row["kind"] == "law" else "D", **look)
        if row["kind"] == "default":
            continue  # its friction was not measured
        width = Z95 * np.nan_to_num(row["mu_std"])  # 0 if only friction was fitted
        fmt = {"lower": ">", "upper": "<"}.get(row["mu_bound"]) or ("o" if row["kind"] == "law" else "D")
        right.errorbar([row["mu"]], [y], xerr=[width], fmt=fmt, **look)
    floor = float(table["noise_floor"].iloc[0])
    if np.isfinite(floor):
        left.axvline(floor, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
    shown = [*table["error"], *([floor] if np.isfinite(floor) else [])]
    errors.readable_log(left, shown, shown)
    left.set_yticks(range(len(names)), [model_title(name) for name in names])
    left.set(ylim=(len(names) - 0.5, -0.5), xlabel="held-out error (m/s)")
    low, high = table[table["kind"] != "default"]["mu"].quantile([0.1, 0.9])
    right.set(xlabel="friction μ (95 % interval)", xlim=(max(0.0, low - 0.5 * high), 1.5 * high))
    right.tick_params(axis="y", left=False)
    handles = [
        Line2D([], [], marker=marker, linestyle="", color=edge, markerfacecolor=face, label=f"{kind}, {LABELS[label]}")
        for label, (edge, face, _) in LOOKS.items()
        for kind, marker in (("engine", "D"), ("law", "o"))
        if ((table["effects"] == label) & (table["kind"] == kind)).any()
    ]
    if np.isfinite(floor):
        handles.append(Line2D([], [], color=GREY, linestyle=(0, (4, 2)), label="noise floor"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    errors.set_title(figure, model_sentences(table)[0].rstrip("."))
    return figure, table


NAMES = ("data", "laws", "budget", "where", "residuals", "flights", "candidates", "ladder", "parameters")


@house_style
def pictures(critique: DropsCritique, tables: Mapping[str, pd.DataFrame], where: Mapping) -> dict[str, Drawn]:
    """Draw all figures; return them with the tables of the numbers drawn, by the names in `NAMES`.

    `tables`: `ladder`, `budget`, `candidates` and `models`; `where`: content of where.json.  The picture of flights is
    omitted if there are too few flights, those of candidates and models without their tables.
    """
    drawn: dict[str, Drawn | None] = {
        "data": draw_data(critique),
        "laws": errors.draw_laws(critique),
        "budget": errors.draw_budget(tables["budget"]),
        "where": draw_where(critique, where),
        "residuals": draw_residuals(critique),
        "flights": draw_flights(critique) if len(critique.observations.flights) > BINS else None,
        "candidates": draw_candidates(critique, tables.get("candidates")),
        "ladder": errors.draw_ladder(critique, tables["ladder"]),
        "parameters": errors.draw_parameters(critique),
    }
    if "models" in tables:
        drawn["models"] = draw_models(tables["models"])
    return {name: one for name, one in drawn.items() if one is not None}
