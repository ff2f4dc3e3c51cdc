"""Figures 3-8 and 3-9: distribution of held-out errors, and their dependence on the momentum before impact.

The error of an impact is ‖v⁺ − v̂⁺‖_k = √(δv_x² + δv_y² + (k δω)²) in m/s, from
thesis_lib.thesis.impact_study.study.held_out_errors.  The momentum at the contact point before impact is
(p_t, p_n) = M_C v_C in N s.  Densities are reflected at zero (`densities`).  The thesis does not state how figure 3-9
is smoothed; here each node of a grid has the mean error of its nearest impacts, and nodes without impacts nearby are
left empty.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.coefficients.cost import contact_momentum
from thesis_lib.contact.bounds import best_post_hoc
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.figures.densities import error_curves, local_mean
from thesis_lib.figures.law_style import style_of
from thesis_lib.figures.style import Drawn, ImpulseAxis, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.impact_study.tables import VARIANTS

GRID = 100  # points of a curve
SIDE = 40  # nodes of the map along each axis
NEIGHBOURS = 12  # impacts averaged at a node, whose mean has a third of the spread of a single error
REACH = 0.25  # standard deviations of momentum; nodes without an impact this near are left empty
TALL = 10.0  # ratio of the highest to the lowest peak above which the density axis is logarithmic


@house_style
def figure_3_8(errors: pd.DataFrame) -> Drawn:
    """Figure 3-8: densities and cumulative shares of held-out errors: six laws, Best Post Hoc, IRB Bound, two variants.

    `errors`: trial, impact, model, velocity_error (m/s); a failed solve (NaN) counts as infinite in the share.

    Raises:
        UserError: a model has no finite error.
    """
    wide = errors.pivot(index=["trial", "impact"], columns="model", values="velocity_error")
    figure = new_figure(height=5.0)
    figure.get_layout_engine().set(wspace=0.08)
    axes = figure.subplots(2, 2, sharex="col", sharey="col")
    # densities end beyond the tail of the median model; the cumulative panel shows the rest
    grid = np.linspace(0.0, 1.25 * float(np.nanmedian(wide.quantile(0.95))) or 1.0, GRID)
    parts = []
    for row, (variant, laws) in zip(axes, VARIANTS.items()):
        values = {name: wide[name].to_numpy() for name in laws}
        values["best_post_hoc"] = best_post_hoc(np.stack(list(values.values()), axis=1))[1]
        values["irb_bound"] = wide["irb_bound"].to_numpy()
        for name, error in values.items():
            if not np.isfinite(error).any():
                raise UserError(f"{name} has no finite held-out error; see the status in errors.csv.")
            parts.append(draw_error_curves(row, error, grid, style_of(name).line).assign(variant=variant, model=name))
        row[0].set_title(f"({'ab'[list(VARIANTS).index(variant)]}) {variant.replace('_', ' ')}")
    table = pd.concat(parts, ignore_index=True)
    label_error_curves(axes)
    _limits(axes, table)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure, table[["variant", "panel", "model", "error", "density", "share_below"]]


def draw_error_curves(row: Sequence[Axes], error: np.ndarray, grid: np.ndarray, line: dict) -> pd.DataFrame:
    """Draw density (left) and cumulative share (right) of errors (n,) in m/s; return the numbers drawn."""
    density, quantile, shares = error_curves(error, grid)
    row[0].plot(grid, density, **line)
    row[1].plot(quantile, shares, **line)
    left = pd.DataFrame({"panel": "density", "error": grid, "density": density})
    right = pd.DataFrame({"panel": "cumulative", "error": quantile, "share_below": shares})
    return pd.concat([left, right], ignore_index=True)


def label_error_curves(axes: np.ndarray) -> None:
    """Label the axes of two columns of panels: densities, and shares of impacts."""
    for ax in axes[:, 0]:
        ax.set_ylabel("density (s/m)")
    for ax in axes[:, 1]:
        ax.set_ylabel("share of impacts below")
    for ax in axes[-1]:
        ax.set_xlabel("error of the velocity after impact (m/s)")


def _limits(axes: np.ndarray, table: pd.DataFrame) -> None:
    peaks = table[table["panel"] == "density"].groupby(["variant", "model"])["density"].max()
    if peaks.max() > TALL * peaks.min():
        axes[0, 0].set_yscale("log")
        axes[0, 0].set_ylim(0.4 * peaks.min(), 1.5 * peaks.max())  # lower values are single impacts
    else:
        axes[0, 0].set_ylim(0.0, 1.05 * peaks.max())
    axes[0, 0].set_xlim(0.0, float(table.loc[table["panel"] == "density", "error"].max()))
    low = table.loc[table["share_below"].between(0.03, 0.06), "error"].min()
    high = table.loc[table["panel"] == "cumulative", "error"].max()
    axes[0, 1].set(xscale="log", xlim=(max(float(low), 1e-4 * high), high), ylim=(0.0, 1.0))


@house_style
def figure_3_9(held_out: Impacts, errors: pd.DataFrame, law: str, *, mass_known: bool) -> Drawn:
    """Figure 3-9: mean held-out error of one law over the momentum at the contact point before impact.

    `errors`: trial, impact, model, velocity_error (m/s), with rows of `law` for the held-out impacts.  Momenta are in
    N s, or in N s/kg without a mass.

    Raises:
        UserError: no held-out impact has a finite error.
    """
    unit = ImpulseAxis.of(mass_known)
    keys = pd.MultiIndex.from_arrays([held_out.trial, held_out.impact])
    error = errors[errors["model"] == law].set_index(["trial", "impact"])["velocity_error"].reindex(keys)
    solved = np.isfinite(error.to_numpy())
    if not solved.any():
        raise UserError(f"{law} has no finite held-out error; see errors.csv.")
    error = error.to_numpy()[solved]
    momentum = contact_momentum(held_out)[solved]
    low, high = np.quantile(momentum, [0.002, 0.998], axis=0)
    pad = 0.03 * (high - low)
    axis_t, axis_n = (np.linspace(a, b, SIDE) for a, b in zip(low - pad, high + pad))
    nodes = np.stack(np.meshgrid(axis_t, axis_n), axis=-1).reshape(-1, 2)
    mean, distance = local_mean(momentum, error, nodes, NEIGHBOURS)
    mean = np.where(distance <= REACH, mean, np.nan)
    # quantile over impacts, not over area, so that a few remote outliers do not flatten the rest of the map
    top = float(np.quantile(local_mean(momentum, error, momentum, NEIGHBOURS)[0], 0.95)) or 1.0

    figure = new_figure(4.6, 3.4)
    ax = figure.add_subplot()
    look = {"shading": "nearest", "rasterized": True, "vmin": 0.0, "vmax": top}
    mesh = ax.pcolormesh(unit.factor * axis_t, unit.factor * axis_n, mean.reshape(SIDE, SIDE), **look)
    ax.plot(*(unit.factor * momentum.T), ".", color="black", markersize=1.2, alpha=0.5, linestyle="none")
    ax.axvline(0.0, color="white", linewidth=0.8, linestyle=(0, (4, 2)))
    ax.set(xlim=unit.factor * axis_t[[0, -1]], ylim=unit.factor * axis_n[[0, -1]])
    ax.set_xlabel(f"tangential contact momentum before impact ({unit.unit})")
    ax.set_ylabel(f"normal contact momentum before impact ({unit.unit})")
    bar = figure.colorbar(mesh, ax=ax, aspect=30, extend="max" if np.nanmax(mean) > top else "neither")
    neighbours = min(NEIGHBOURS, len(error))
    bar.set_label(f"mean error of the {neighbours} nearest impacts (m/s)")
    bar.outline.set_visible(False)
    parts = [
        pd.DataFrame({"series": series, "momentum_t": at[:, 0], "momentum_n": at[:, 1], "error": values, "n": n})
        for series, at, values, n in (("map", nodes, mean, neighbours), ("impact", momentum, error, 1))
    ]
    return figure, pd.concat(parts, ignore_index=True)
