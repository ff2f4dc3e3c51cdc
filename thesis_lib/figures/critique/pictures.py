"""All pictures of one critique, by name; with that of laws and engines side by side."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.engines.compare import WITH, WITHOUT, model_sentences, model_title
from thesis_lib.figures.critique.data import draw_data
from thesis_lib.figures.critique.errors import (
    AFTER,
    BEFORE,
    draw_budget,
    draw_ladder,
    draw_laws,
    draw_parameters,
    readable_log,
    set_title,
)
from thesis_lib.figures.critique.residuals import BINS, draw_flights, draw_residuals
from thesis_lib.figures.critique.where import draw_where
from thesis_lib.figures.style import GREY, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import Z95

LOOKS = {WITHOUT: (BEFORE, "white", 0.14), WITH: (AFTER, AFTER, -0.14)}  # edge, face, place in the row
LABELS = {WITHOUT: "without the named effects", WITH: "with them"}


@house_style
def draw_models(table: pd.DataFrame) -> Drawn:
    """Held-out error and μ of each model, engines as diamonds, bounds of μ as triangles; the best at the top."""
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
        width = Z95 * np.nan_to_num(row["mu_std"])  # 0 of a friction fitted alone
        fmt = {"lower": ">", "upper": "<"}.get(row["mu_bound"]) or ("o" if row["kind"] == "law" else "D")
        right.errorbar([row["mu"]], [y], xerr=[width], fmt=fmt, **look)
    floor = float(table["noise_floor"].iloc[0])
    if np.isfinite(floor):
        left.axvline(floor, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
    shown = [*table["error"], *([floor] if np.isfinite(floor) else [])]
    readable_log(left, shown, shown)
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
    set_title(figure, model_sentences(table)[0].rstrip("."))
    return figure, table


NAMES = ("data", "laws", "budget", "where", "residuals", "flights", "ladder", "parameters")


@house_style
def pictures(
    critique: DropsCritique, tables: Mapping[str, pd.DataFrame] | None, where: Mapping | None
) -> dict[str, Drawn]:
    """Figures with the tables of the numbers drawn in them, by the names in `NAMES`.

    `tables`: `ladder`, `comparison` (IRB bound), `budget` and `models`; `where`: content of where.json.  The pictures
    of the error budget and of flights are left out without table `budget` or enough flights, that of models without
    its table.
    """
    tables = tables or {}
    drawn: dict[str, Drawn | None] = {"data": draw_data(critique), "laws": draw_laws(critique)}
    if "budget" in tables:
        drawn["budget"] = draw_budget(tables)
    drawn |= {"where": draw_where(critique, where), "residuals": draw_residuals(critique)}
    if len(critique.observations.flights) > BINS:
        drawn["flights"] = draw_flights(critique)
    drawn |= {"ladder": draw_ladder(critique, tables), "parameters": draw_parameters(critique)}
    if "models" in tables:
        drawn["models"] = draw_models(tables["models"])
    return {name: one for name, one in drawn.items() if one is not None}
