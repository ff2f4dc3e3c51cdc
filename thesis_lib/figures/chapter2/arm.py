"""Figure 2-12: contact forces of disk, arm and ground against time, true and estimated from noisy states.

The thesis shows the force between manipulator and disk; here the ground's force is added, and grey dots show the plain
program's answer on the same noisy states.  A force is one point per step, without a line, because a contact that
chatters acts in every other step.  Bars are ±2 standard errors.

Impacts are tens of times larger than lasting forces.  The axes have the scale of the lasting force; what exceeds it is
cut, and a mark at the edge gives its estimated size in N.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.style import GREY, INK, Drawn, house_style, new_figure
from thesis_lib.identify.arm.study import ArmForces

PAIRS = (("arm", "arm on disk"), ("ground", "ground on disk"))
COMPONENTS = (("normal", "$c_n$ (N)"), ("tangential", "$c_t$ (N)"))
BLUE = "#0072B2"
BAND = 2.0  # standard errors on either side
LASTING = 3.0  # times the median force in contact; larger forces are cut and labelled
HEADROOM = 1.3  # end of the axis over the largest lasting force


@house_style
def figure_2_12(one: ArmForces) -> Drawn:
    """Forces of one trajectory; columns of the table: pair, component, t, true, estimate, std, plain."""
    t = one.record.t[:-1]
    figure = new_figure(height=4.0)
    axes = figure.subplots(2, 2, sharex=True)
    rows = []
    for j, (pair, title) in enumerate(PAIRS):
        true_n = one.record.c_n[:, j]
        contact = true_n > 0.0
        typical = np.median(np.hypot(true_n, one.record.c_t[:, j])[contact]) if contact.any() else np.inf
        for i, (component, label) in enumerate(COMPONENTS):
            true = (one.record.c_n, one.record.c_t)[i][:, j]
            estimate, std = (one.fit.c_n, one.fit.c_t)[i][:, j], (one.fit.c_n_std, one.fit.c_t_std)[i][:, j]
            plain = one.c["plain"][i][:, j]
            lasting = np.hypot(true_n, one.record.c_t[:, j]) <= LASTING * typical
            top = HEADROOM * np.abs(true[lasting]).max(initial=1e-3)
            _panel(axes[i, j], t, true, estimate, std, plain, (-0.05 * top if i == 0 else -top, top))
            axes[i, j].set_ylabel(label)
            table = {"t": t, "true": true, "estimate": estimate, "std": std, "plain": plain}
            rows.append(pd.DataFrame({"pair": pair, "component": component, **table}))
        axes[0, j].set_title(title)
        axes[1, j].set_xlabel("time (s)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=4)
    axes[0, 0].set_xlim(t[0], t[-1])
    return figure, pd.concat(rows, ignore_index=True)


def _panel(
    ax: Axes,
    t: np.ndarray,
    true: np.ndarray,
    found: np.ndarray,
    std: np.ndarray,
    plain: np.ndarray,
    limits: tuple[float, float],
) -> None:
    shown = (plain >= limits[0]) & (plain <= limits[1])
    ax.plot(t[shown], plain[shown], ".", color=GREY, markersize=1.8, label="plain program", zorder=1)
    ax.plot(
        t,
        true,
        "o",
        markersize=3.4,
        markeredgewidth=0.5,
        markeredgecolor=INK,
        markerfacecolor="none",
        label="true",
        zorder=2,
    )
    ax.errorbar(
        t,
        found,
        yerr=BAND * std,
        fmt=".",
        markersize=2.2,
        color=BLUE,
        elinewidth=0.8,
        label="estimated from noisy states, ±2 std. errors",
        zorder=3,
    )
    ax.set_ylim(*limits)
    beyond = np.flatnonzero((found > limits[1]) | (found < limits[0]))
    # only the largest of a run of neighbours is labelled
    for run in np.split(beyond, np.flatnonzero(np.diff(beyond) > 12) + 1) if len(beyond) else []:
        k = run[np.argmax(np.abs(found[run]))]
        up = found[k] > 0.0
        ax.annotate(
            f"{found[k]:.0f}",
            (t[k], limits[1] if up else limits[0]),
            xytext=(3, -2 if up else 2),
            textcoords="offset points",
            va="top" if up else "bottom",
            fontsize=6,
            color=INK,
        )
