"""Figures of residuals against the state, before and after adding effects: impacts in the contact frame, and flights.

Columns of panels are the features on which the components depend most (`critique.results.numbers.dependence`).  All
impacts and flights are shown, training and held out.  Residuals of flights are accelerations in units of noise
(`critique.drops.questions.flight_residuals`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import features
from thesis_lib.critique.drops.questions import flight_residuals as flying
from thesis_lib.critique.results.numbers import bin_of, contact_residuals, dependence
from thesis_lib.critique.results.titles import FEATURE_LABEL, plain
from thesis_lib.figures.critique.errors import AFTER, BEFORE, set_title
from thesis_lib.figures.critique.where import axis_label
from thesis_lib.figures.planar_drawing import white_box
from thesis_lib.figures.style import GREY, Drawn, house_style, new_figure
from thesis_lib.statistics.intervals import Z95
from thesis_lib.statistics.spread import MAD_TO_STD
from thesis_lib.statistics.wording import number

SHOWN_FEATURES = 3
BINS = 8
WILD = 5.0  # robust standard deviations beyond which values are clipped
LITTLE = 0.05  # share of variance below which a dependence is not mentioned
LOOKS = {
    "before": {"color": BEFORE, "fmt": "o-", "label": "base law"},
    "after": {"color": AFTER, "fmt": "s-", "label": "with the effects"},
}
FLIGHT_LABEL = FEATURE_LABEL | {
    "v_x": "velocity along the surface $v_x$",
    "v_y": "velocity upwards $v_y$",
    "r_x": "lowest point $r_x$",
    "y": "height $y$",
    "span": "duration of the flight",
}


@dataclass(frozen=True)
class Residuals:
    """Content of one picture."""

    components: Mapping[str, str]  # names of the rows of panels, with their axis labels
    labels: Mapping[str, str]  # axis label of each feature
    table: pd.DataFrame  # features, n rows
    values: Mapping[str, np.ndarray]  # residuals (n, components), by "before" and "after"

    @property
    def shares(self) -> pd.DataFrame:
        """Share of the variance of the base law's residual components (rows) that each feature explains (columns).

        Features are binned.
        """
        before = self.values["before"].T
        shares = {name: [dependence(part, x.to_numpy(float)) for part in before] for name, x in self.table.items()}
        return pd.DataFrame(shares, index=list(self.components))


@house_style
def draw_residuals(critique: DropsCritique) -> Drawn | None:
    """Draw residuals in the contact frame against the features on which they depend most, before and after effects.

    None if no feature explains `LITTLE` of a component.  In space, the components are along the slip before impact
    (tangential), across it (lateral) and along the normal.
    """
    o = critique.observations.single
    values = {kind: contact_residuals(fitted, o) for kind, fitted in _fits(critique).items()}
    symbols = {"tangential": r"$\delta v_t$", "normal": r"$\delta v_n$", "couple": r"$\delta\tau/k$"}
    if not o.space.is_plane:
        first = {"tangential": symbols["tangential"], "lateral": r"$\delta v_b$"}
        symbols = first | {"normal": r"$\delta v_n$", "couple": r"$|\delta\tau|/k$"}
    table = features(critique.ladder[0][1], o)
    components = {name: f"{name} {symbol}\n(m/s)" for name, symbol in symbols.items()}
    shown = Residuals(components, {name: axis_label(name) for name in table}, table, values)
    if not (sentence := _strongest(shown)):
        return None
    figure, rows = _panels(shown)
    set_title(figure, sentence)
    return figure, rows


@house_style
def draw_flights(critique: DropsCritique) -> Drawn | None:
    """Draw residual accelerations of flights over noise against the state at mid-flight; None as above, or in space."""
    o = critique.observations
    if not o.space.is_plane:
        return None
    values = {kind: flying.relative_residuals(fitted, o.flights, o.rig) for kind, fitted in _fits(critique).items()}
    table = flying.flight_features(critique.ladder[0][1], o.flights, o.rig)
    units = {name: "" if unit == "1" else f" ({unit})" for name, unit in flying.FLIGHT_UNITS.items()}
    components = {name: f"{name}\n(over noise)" for name in ("horizontal", "vertical", "angular")}
    shown = Residuals(components, {name: FLIGHT_LABEL[name] + units[name] for name in table}, table, values)
    if not _strongest(shown):
        return None
    figure, _ = _panels(shown)
    set_title(figure, flights_sentence(critique, shown))
    return figure, flying.flight_table(critique)


def _fits(critique: DropsCritique) -> dict:
    rungs = {"before": critique.ladder[0]} | ({"after": critique.ladder[-1]} if len(critique.ladder) > 1 else {})
    return {kind: fitted for kind, (_, fitted, _) in rungs.items()}


def _panels(shown: Residuals) -> tuple[Figure, pd.DataFrame]:
    """Draw one row of panels for each component that depends on a feature, and one column for each such feature.

    Also returns the plotted means, with one row for each bin.
    """
    shares, before = shown.shares, shown.values["before"]
    names = features_to_show(shares)
    kept = [(i, name) for i, name in enumerate(shown.components) if shares.loc[name].max() >= LITTLE]
    figure = new_figure(height=1.2 + 1.15 * len(kept))
    axes = figure.subplots(len(kept), len(names), sharex="col", sharey="row", squeeze=False)
    rows = []
    for row, (i, component) in enumerate(kept):
        spread = np.quantile(np.abs(before[:, i]), 0.97) or 1.0  # 0 for a component that is not measured
        for j, name in enumerate(names):
            ax = axes[row, j]
            ax.axhline(0.0, color=GREY, linewidth=0.7, zorder=0)
            x = shown.table[name].to_numpy(float)
            ax.plot(x, before[:, i], ".", color="0.75", markersize=1.6, zorder=1, rasterized=True)
            for kind, residual in shown.values.items():
                binned = _binned(x, residual[:, i])
                look = LOOKS[kind] | {"linewidth": 1.0, "markersize": 3, "capsize": 1.5, "zorder": 3}
                ax.errorbar(binned["x"], binned["mean"], yerr=Z95 * binned["std"], **look)
                rows.append(binned.assign(component=component, feature=name, series=kind))
            ax.set(ylim=(-1.25 * spread, 1.25 * spread), xlim=np.quantile(x, [0.005, 0.995]))
            if (share := shares.loc[component, name]) >= LITTLE:
                look = {"ha": "right", "va": "top", "fontsize": 6.5, "bbox": white_box(0.5, 0.8)}
                ax.annotate(f"explains {100 * share:.0f} %", (0.98, 0.97), xycoords="axes fraction", **look)
            ax.locator_params(nbins=5)
        axes[row, 0].set_ylabel(shown.components[component])
    for ax, name in zip(axes[-1], names):
        ax.set_xlabel(shown.labels[name])
    figure.align_ylabels(axes[:, 0])
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure, pd.concat(rows, ignore_index=True)[["component", "feature", "series", "x", "mean", "std", "n"]]


def features_to_show(shares: pd.DataFrame) -> list[str]:
    """Return the feature on which each component depends most, strongest first, then the next strongest features.

    Features that explain less than `LITTLE` of every component are left out.
    """
    best = shares.max(axis=1).sort_values(ascending=False, kind="stable")
    first = [shares.loc[component].idxmax() for component in best.index if best[component] >= LITTLE]
    rest = shares.max(axis=0).sort_values(ascending=False, kind="stable")
    return list(dict.fromkeys([*first, *rest.index[rest >= LITTLE]]))[:SHOWN_FEATURES]


def flights_sentence(critique: DropsCritique, shown: Residuals) -> str:
    """Return a sentence on the misfit of flights, and on the feature on which it depends most."""
    first, last = (float(np.sqrt(critique.ladder[i][2].sigmas["flight"])) for i in (0, -1))
    sentence = _strongest(shown)
    if not np.isfinite(first):  # no flight is held out
        return sentence
    text = f"Held-out flights miss the base law by {number(first, 2)} times the noise"
    if len(critique.ladder) > 1:
        text += f", by {number(last, 2)} with the effects"
    return f"{text}. {sentence}"


def _strongest(shown: Residuals) -> str:
    """Return a sentence on the strongest dependence, before and after the effects; '' if all are weak."""
    shares = shown.shares
    component, name = shares.stack().idxmax()
    share = float(shares.loc[component, name])
    if share < LITTLE:
        return ""
    words = plain(shown.labels[name].split(" (")[0])
    text = f"The {component} residual depends most on the {words}: {100 * share:.0f}\u00a0% of its variance"
    if "after" in shown.values:
        i = list(shown.components).index(component)
        remaining = dependence(shown.values["after"][:, i], shown.table[name].to_numpy(float))
        text += f" before the effects are added, {100 * remaining:.0f}\u00a0% after"
    return text


def _binned(x: np.ndarray, y: np.ndarray) -> pd.DataFrame:
    """Return the mean of y (n,) with its standard error in quantile bins of x (n,); outliers in a bin are clipped."""
    label = bin_of(x, BINS)
    table = pd.DataFrame({"x": x, "y": y})
    centre = table.groupby(label)["y"].transform("median")
    limit = WILD * MAD_TO_STD * (table["y"] - centre).abs().groupby(label).transform("median")
    table["y"] = table["y"].clip(centre - limit, centre + limit)
    bins = table.groupby(label).agg(x=("x", "mean"), mean=("y", "mean"), std=("y", "sem"), n=("y", "size"))
    return bins.reset_index(drop=True)
