"""Figures 2-10 and 2-11: influence of the mass on the rimless wheel's motion, and forces of its spokes (thesis 2.4).

The thesis draws all forces on one axis, where impacts hide the rest.  In figure 2-11 the axes show the normal forces
c_n in N while the wheel rolls.  Touchdowns are shaded; beside them is the impulse h Σ c_n in N s over the steps of each
touchdown, margin included.  The standard errors of the maximum-likelihood estimate are thinner than a line: the last
axis shows them around the estimate's error.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.style import GREY, INK, Drawn, house_style, new_figure
from thesis_lib.identify.wheel.study import WheelForces, rolling_steps, touchdown, touched_pairs

BAND = 2.0  # standard errors on either side
STYLES = {
    "truth": (INK, "-", "truth"),
    "noise_free": ("#009E73", (0, (4, 3)), "eq. 2.12, noise-free"),
    "plain": ("#E69F00", "-", "eq. 2.12 on noisy states"),
    "fit": ("#0072B2", (0, (1, 1.3)), "maximum likelihood on noisy states"),
}
MASSES = ("#56B4E9", "#0072B2", "#D55E00", INK)
DASHES = ((0, (1, 1.2)), (0, (4, 1.5)), (0, (5, 1.5, 1, 1.5)), "-")


@house_style
def figure_2_10(motions: pd.DataFrame) -> Drawn:
    """Angle and angular velocity against time for each mass.

    `motions`: mass (kg), t (s), theta (rad), omega (rad/s), as from `wheel_study.motion_by_mass`.
    """
    figure = new_figure(height=3.6)
    above, below = figure.subplots(2, 1, sharex=True)
    parts = []
    for i, (mass, motion) in enumerate(motions.groupby("mass")):
        turned = motion["theta"] - motion["theta"].iloc[0]
        look = {"color": MASSES[i % len(MASSES)], "linestyle": DASHES[i % len(DASHES)], "linewidth": 1.2}
        above.plot(motion["t"], turned, label=f"{mass:g} kg", **look)
        below.plot(motion["t"], motion["omega"], **look)
        parts.append(motion.assign(theta=turned))
    above.set_ylabel(r"$\theta-\theta_0$ (rad)")
    below.set(ylabel=r"$\omega$ (rad/s)", xlabel="time (s)", xlim=(0.0, motions["t"].max()))
    above.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(parts), title="mass, at equal inertia")
    return figure, pd.concat(parts, ignore_index=True)[["mass", "t", "theta", "omega"]]


@house_style
def figure_2_11(forces: WheelForces) -> Drawn:
    """Normal forces of the first spokes while the wheel rolls, and the impulses of their touchdowns.

    `forces`: of one record by every method, see `wheel.study.identify`.
    """
    truth, fit = forces.truth, forces.fit
    # a force acts over its whole step: drawn at the middle
    t = truth.h * (np.arange(truth.steps) + 0.5)
    rolling = rolling_steps(truth.c_n)
    c_n = {"truth": truth.c_n, **forces.c_n}
    order = ("plain", "truth", "noise_free", "fit")
    impacts = [touchdown(truth.c_n, pair) for pair in touched_pairs(truth.c_n, truth.c_n.shape[1])]
    figure = new_figure(height=6.2)
    grid = figure.add_gridspec(len(forces.pairs) + 1, 2, width_ratios=(4.2, 1.0))
    rows, ax = [], None
    top = 1.35 * float(truth.c_n[rolling].max())
    for i, pair in enumerate(forces.pairs):
        ax = figure.add_subplot(grid[i, 0], sharex=ax)
        for name in order:
            color, dash, label = STYLES[name]
            width = {"truth": 2.4, "plain": 0.6}.get(name, 1.3)
            shade = "0.75" if name == "truth" else color
            value = np.where(rolling, c_n[name][:, pair], np.nan)
            ax.plot(t, value, color=shade, linestyle=dash, linewidth=width, label=label if i == 0 else None)
            std = fit.std_n[:, pair] if name == "fit" else np.full(truth.steps, np.nan)
            rows += [
                (i + 1, name, "rolling" if on else "touchdown", a, b, s)
                for a, b, s, on in zip(t, c_n[name][:, pair], std, rolling)
            ]
        _shade(ax, impacts, truth.h)
        ax.set(ylim=(0.0, top), xlim=(0.0, t[-1]), ylabel=f"spoke {i + 1}\n$c_n$ (N)")
        ax.tick_params(labelbottom=False)
        rows += _impulses(figure.add_subplot(grid[i, 1]), forces, i, pair)
    ax = figure.add_subplot(grid[-1, 0], sharex=ax)
    color = STYLES["fit"][0]
    for pair in forces.pairs:
        used = rolling & (truth.c_n[:, pair] > 0)
        miss = np.where(used, 1e3 * (fit.record.c_n - truth.c_n)[:, pair], np.nan)
        band = np.where(used, 1e3 * BAND * fit.std_n[:, pair], np.nan)
        ax.plot(t, miss, color=color, linewidth=1.2)
        ax.fill_between(t, -band, band, color=color, alpha=0.25, linewidth=0.0)
    ax.axhline(0.0, color=GREY, linewidth=0.6)
    _shade(ax, impacts, truth.h)
    ax.set(ylabel="maximum like-\nlihood − truth\n(mN)", xlabel="time (s)")
    beside = figure.add_subplot(grid[-1, 1])
    beside.set_axis_off()
    beside.text(0.0, 0.5, f"band: ±{BAND:g}\nstandard errors", va="center", transform=beside.transAxes)
    figure.legend(loc="outside upper left", ncols=2)
    table = pd.DataFrame(rows, columns=["spoke", "series", "kind", "t", "force_or_impulse", "std"])
    return figure, table


def _shade(ax: Axes, impacts: list[slice | None], h: float) -> None:
    for impact in impacts:
        if impact is not None:
            ax.axvspan(h * impact.start, h * impact.stop, color=GREY, alpha=0.3, linewidth=0.0)


def _impulses(side: Axes, forces: WheelForces, i: int, pair: int) -> list[tuple]:
    """Draw the impulses of one touchdown; returns the rows of the table."""
    impact, h = touchdown(forces.truth.c_n, pair), forces.truth.h
    side.tick_params(labelbottom=False, bottom=False)
    side.yaxis.tick_right()
    side.yaxis.set_label_position("right")
    if impact is None:
        side.set_yticks([])
        side.text(0.5, 0.5, "stands from\nthe start", ha="center", va="center", transform=side.transAxes)
        return []
    rows = []
    for x, name in enumerate(("truth", "noise_free", "plain", "fit")):
        c_n = forces.truth.c_n if name == "truth" else forces.c_n[name]
        impulse = h * float(c_n[impact, pair].sum())
        std = forces.fit.impulse_std(impact, pair)[0] if name == "fit" else np.nan
        side.bar(x, impulse, color="0.75" if name == "truth" else STYLES[name][0], width=0.7)
        if name == "fit":
            side.errorbar(x, impulse, BAND * std, color=INK, linewidth=1.0, capsize=2.0)
        rows.append((i + 1, name, "impulse", h * 0.5 * (impact.start + impact.stop), impulse, std))
    side.set(xlim=(-0.7, 3.7), ylabel="impulse (N s)")
    return rows
