"""Figures 3-7 and 3-10: parameters identified from all impacts together and from single impacts.

Ensemble parameters (μ, ε) minimise eq. 3.8 summed over k impacts; individual parameters (μ_i, ε_i) belong to impact i.
The tables are from thesis_lib.thesis.impact_study.study, which defines their columns.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable

from thesis_lib.contact import LAWS
from thesis_lib.figures.densities import reflected_density
from thesis_lib.figures.law_style import style_of
from thesis_lib.figures.style import GREEN, GREY, INK, RED, Drawn, ImpulseAxis, house_style, new_figure
from thesis_lib.foundation.errors import UserError

SETTLED = 100  # number of impacts after which the parameters have converged, according to the thesis
SUBSET_DASHES = ("-", (0, (5, 1.5)), (0, (1, 1.2)))
GRID = 200  # points of a density
# share of individual μ within the axis; the title counts the rest, often at the limit of the box
SHOWN_SHARE = 0.99


@house_style
def figure_3_7(topography: pd.DataFrame, convergence: pd.DataFrame, *, mass_known: bool) -> Drawn:
    """Figure 3-7: (a) cost over (μ, ε) with its minimum; (b) parameters and cost against the number of impacts k.

    `topography`: law, n, mu, epsilon, cost on a full grid; lighter is better, as in the thesis.  `convergence`: law,
    subset, k, mu, epsilon, cost.  Costs are in N s, or in N s/kg without a mass.
    """
    unit = ImpulseAxis.of(mass_known)
    figure = new_figure(height=3.7)
    left, right = figure.subfigures(1, 2, width_ratios=(1.05, 1.0))
    _topography(left.subplots(), topography, unit)
    axes = right.subplots(3, 1, sharex=True)
    rows = (("mu", r"$\mu$", 1.0), ("epsilon", r"$\epsilon$", 1.0), ("cost", f"cost ({unit.unit})", unit.factor))
    for ax, (column, label, factor) in zip(axes, rows):
        ax.axvline(SETTLED, color=GREY, linewidth=0.7)
        for (law, subset), curve in convergence.groupby(["law", "subset"], sort=False):
            look = {"linestyle": SUBSET_DASHES[subset % len(SUBSET_DASHES)], "color": style_of(law).color}
            look |= {"linewidth": 1.1, "marker": "o" if curve["k"].nunique() < 3 else None}
            ax.plot(curve["k"], factor * curve[column], label=LAWS[law].title if subset == 0 else None, **look)
        ax.set(xscale="log", ylabel=label)
    axes[0].set_title("(b)", pad=22)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), borderaxespad=0.0, ncols=1)
    axes[-1].set_xlabel("number of impacts used, $k$")
    axes[-1].xaxis.set_major_formatter("{x:g}")
    right.align_ylabels(axes)
    table = pd.concat([topography.assign(panel="a"), convergence.assign(panel="b")], ignore_index=True)
    table["subset"] = table["subset"].astype("Int64")
    table["k"] = table["k"].fillna(table["n"]).astype("Int64")
    return figure, table[["panel", "law", "subset", "k", "mu", "epsilon", "cost"]]


def _topography(ax: Axes, topography: pd.DataFrame, unit: ImpulseAxis) -> None:
    cost = unit.factor * topography.pivot(index="epsilon", columns="mu", values="cost")
    mu, epsilon = cost.columns.to_numpy(), cost.index.to_numpy()
    mesh = ax.pcolormesh(mu, epsilon, cost.to_numpy(), cmap="viridis_r", shading="gouraud", rasterized=True)
    # evenly spaced in the square root of the rise above the minimum, so that the valley has contours
    low, high = float(cost.min().min()), float(cost.max().max())
    levels = low + (high - low) * np.linspace(0.0, 1.0, 11)[1:-1] ** 2
    if high > low:
        ax.contour(mu, epsilon, cost.to_numpy(), levels=levels, colors="white", linewidths=0.6)
    best = topography.loc[topography["cost"].idxmin()]
    ax.plot(best["mu"], best["epsilon"], "*", color=RED, markersize=9, label="least cost", clip_on=False)
    ax.set(xlabel=r"coefficient of friction $\mu$", ylabel=r"coefficient of restitution $\epsilon$")
    ax.set_title(f"(a) {LAWS[best['law']].title}, {best['n']} impacts", pad=22)
    ax.legend(loc="lower left", bbox_to_anchor=(-0.05, 1.01), borderaxespad=0.0)
    _bar(ax, mesh, f"mean cost ({unit.unit})")


def _bar(ax: Axes, shades: ScalarMappable, label: str, **look: str) -> None:
    bar = ax.figure.colorbar(shades, ax=ax, location="bottom", aspect=30, pad=0.02, **look)
    bar.set_label(label)
    bar.outline.set_visible(False)


@house_style
def figure_3_10(individual: pd.DataFrame, ensemble: pd.DataFrame, law: str, *, mass_known: bool) -> Drawn:
    """Figure 3-10: (a) individual (μ, ε) of one law, coloured by misfit; (b) densities of μ and ε, with ensemble value.

    `individual`: trial, impact, law, mu, epsilon, misfit; `ensemble`: law, mu, epsilon of the same weighting.  Misfits
    are in N s, or in N s/kg without a mass.

    Raises:
        UserError: no impact has individual parameters under this law.
    """
    unit = ImpulseAxis.of(mass_known)
    impacts = individual[(individual["law"] == law) & individual["misfit"].notna()]
    if not len(impacts):
        raise UserError(f"No impact has individual parameters under {law}; see individual.csv.")
    fit = ensemble[ensemble["law"] == law].iloc[0]
    mu_max = 1.05 * max(float(impacts["mu"].quantile(SHOWN_SHARE)), 0.02, 1.3 * fit["mu"])
    figure = new_figure(height=3.3)
    axes = figure.subplot_mosaic([["a", "mu"], ["a", "epsilon"]], width_ratios=(1.25, 1.0))

    ax = axes["a"]
    shown = impacts.sort_values("misfit", kind="stable")  # largest misfit on top
    top = max(float(shown["misfit"].quantile(0.98)), np.finfo(float).tiny)
    look = {"vmin": 0.0, "vmax": unit.factor * top, "s": 5, "linewidths": 0, "clip_on": True}
    dots = ax.scatter(shown["mu"], shown["epsilon"], c=unit.factor * shown["misfit"], **look)
    ax.plot(fit["mu"], fit["epsilon"], "*", color=RED, markersize=10, markeredgecolor="white")
    ax.set(
        xlim=(-0.02 * mu_max, mu_max), ylim=(-0.02, 1.03), xlabel=r"individual $\mu$", ylabel=r"individual $\epsilon$"
    )
    beyond = int((impacts["mu"] > mu_max).sum())
    note = f", {beyond} beyond the axis" if beyond else ""
    ax.set_title(f"(a) {LAWS[law].title}, {len(impacts)} impacts{note}")
    _bar(ax, dots, f"remaining misfit ({unit.unit})", extend="max")

    columns = ["panel", "series", "trial", "impact", "mu", "epsilon", "misfit"]
    star = {"panel": "a", "series": "ensemble", "mu": fit["mu"], "epsilon": fit["epsilon"]}
    parts = [impacts.assign(panel="a", series="individual")[columns], pd.DataFrame([star])]
    for name, symbol, upper in (("mu", r"\mu", np.inf), ("epsilon", r"\epsilon", 1.0)):
        low, high = (0.0, mu_max) if name == "mu" else _shown_range(impacts[name].to_numpy())
        grid = np.linspace(low, high, GRID)
        density = reflected_density(impacts[name].to_numpy(), grid, 0.0, upper)
        ax = axes[name]
        ax.fill_between(grid, density, color=GREEN, alpha=0.25, linewidth=0)
        ax.plot(grid, density, color=GREEN)
        ax.axvline(fit[name], color=RED, linestyle=(0, (5, 1.5)), label="ensemble")
        ax.axvline(impacts[name].mean(), color=INK, linestyle=(0, (1, 1.2)), label="mean of individual")
        ax.set(xlabel=f"${symbol}$", ylabel="density", ylim=(0.0, None), xlim=(grid[0], grid[-1]))
        parts.append(pd.DataFrame({"panel": "b", "series": name, "parameter": grid, "density": density}))
    axes["mu"].set_title("(b)", pad=22)
    axes["mu"].legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), borderaxespad=0.0)
    table = pd.concat(parts, ignore_index=True)
    table[["trial", "impact"]] = table[["trial", "impact"]].astype("Int64")
    return figure, table


def _shown_range(epsilon: np.ndarray) -> tuple[float, float]:
    """Part of [0, 1] that contains nearly all values, with a margin on either side."""
    low, high = np.quantile(epsilon, [0.01, 0.99])
    room = max(0.3 * (high - low), 0.05)
    return max(0.0, float(low) - room), min(1.0, float(high) + room)
