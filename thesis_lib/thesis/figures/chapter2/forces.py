"""Figures 2-10 to 2-12: motion and spoke forces of the rimless wheel, and forces of arm, disk and ground (thesis 2.4).

Forces at impact are tens of times larger than lasting forces.  In figure 2-11, touchdowns are shaded, with the
impulse h Σ c_n in N s over their steps, margin included, at the right; standard errors of the maximum-likelihood fit
are thinner than a line, so the last axis shows them with the error of the fit.  In figure 2-12, the axes have the
scale of the lasting force; a number at the edge gives the estimated size of a cut-off force, in N.  A force is one
point per step there, because a chattering contact acts in every other step.  The thesis shows the force between
manipulator and disk; we add the ground's force and the plain program's result for the same noisy states (grey).
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.planar_drawing import note
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SKY, YELLOW, Drawn, house_style, new_figure
from thesis_lib.thesis.identify.arm.study import ArmForces
from thesis_lib.thesis.identify.wheel.study import WheelForces, rolling_steps, touchdown, touched_pairs

BAND = 2.0  # half width of bands, in standard errors
STYLES = {
    "truth": ("0.75", "-", "truth"),
    "noise_free": (GREEN, (0, (4, 3)), "eq. 2.12, noise-free"),
    "plain": (YELLOW, "-", "eq. 2.12 on noisy states"),
    "fit": (BLUE, (0, (1, 1.3)), "maximum likelihood on noisy states"),
}
MASSES = (SKY, BLUE, RED, INK)
DASHES = ((0, (1, 1.2)), (0, (4, 1.5)), (0, (5, 1.5, 1, 1.5)), "-")
PAIRS = (("arm", "arm on disk"), ("ground", "ground on disk"))
COMPONENTS = (("normal", "$c_n$ (N)"), ("tangential", "$c_t$ (N)"))
LASTING = 3.0  # factor on the median force in contact; larger forces are cut off and labelled
HEADROOM = 1.3  # limit of the axis over the largest lasting force


@house_style
def figure_2_10(motions: pd.DataFrame) -> Drawn:
    """Figure 2-10: angle and angular velocity of the wheel against time for each mass.

    `motions`: mass (kg), t (s), theta (rad), omega (rad/s), as from `wheel.study.motion_by_mass`.
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
    """Figure 2-11: normal forces of the first spokes while the wheel rolls, and impulses of their touchdowns."""
    truth, fit = forces.truth, forces.fit
    # a force acts over its whole step and is drawn at the middle
    t = truth.h * (np.arange(truth.steps) + 0.5)
    rolling = rolling_steps(truth.c_n)
    c_n = {"truth": truth.c_n, **forces.c_n}
    impacts = [touchdown(truth.c_n, pair) for pair in touched_pairs(truth.c_n, truth.c_n.shape[1])]
    figure = new_figure(height=6.2)
    grid = figure.add_gridspec(len(forces.pairs) + 1, 2, width_ratios=(4.2, 1.0))
    rows, ax = [], None
    top = 1.35 * float(truth.c_n[rolling].max())
    for i, pair in enumerate(forces.pairs):
        ax = figure.add_subplot(grid[i, 0], sharex=ax)
        for name in ("plain", "truth", "noise_free", "fit"):
            color, dash, label = STYLES[name]
            look = {"linewidth": {"truth": 2.4, "plain": 0.6}.get(name, 1.3), "label": label if i == 0 else None}
            ax.plot(t, np.where(rolling, c_n[name][:, pair], np.nan), color=color, linestyle=dash, **look)
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
    return figure, pd.DataFrame(rows, columns=["spoke", "series", "kind", "t", "force_or_impulse", "std"])


def _shade(ax: Axes, impacts: list[slice | None], h: float) -> None:
    for impact in impacts:
        if impact is not None:
            ax.axvspan(h * impact.start, h * impact.stop, color=GREY, alpha=0.3, linewidth=0.0)


def _impulses(side: Axes, forces: WheelForces, i: int, pair: int) -> list[tuple]:
    """Draw the impulses of one touchdown; return the rows of the table."""
    impact, h = touchdown(forces.truth.c_n, pair), forces.truth.h
    side.tick_params(labelbottom=False, bottom=False)
    side.yaxis.tick_right()
    side.yaxis.set_label_position("right")
    if impact is None:
        side.set_yticks([])
        side.text(0.5, 0.5, "in contact\nfrom the start", ha="center", va="center", transform=side.transAxes)
        return []
    rows = []
    for x, name in enumerate(STYLES):
        c_n = forces.truth.c_n if name == "truth" else forces.c_n[name]
        impulse = h * float(c_n[impact, pair].sum())
        std = forces.fit.impulse_std(impact, pair)[0] if name == "fit" else np.nan
        side.bar(x, impulse, color=STYLES[name][0], width=0.7)
        if name == "fit":
            side.errorbar(x, impulse, BAND * std, color=INK, linewidth=1.0, capsize=2.0)
        rows.append((i + 1, name, "impulse", h * 0.5 * (impact.start + impact.stop), impulse, std))
    side.set(xlim=(-0.7, 3.7), ylabel="impulse (N s)")
    return rows


@house_style
def figure_2_12(forces: ArmForces) -> Drawn:
    """Figure 2-12: forces of one trajectory; table columns: pair, component, t, true, estimate, std, plain."""
    record, fit = forces.record, forces.fit
    t = record.t[:-1]
    figure = new_figure(height=4.0)
    axes = figure.subplots(2, 2, sharex=True)
    tables = []
    for j, (pair, title) in enumerate(PAIRS):
        true_n, size = record.c_n[:, j], np.hypot(record.c_n[:, j], record.c_t[:, j])
        contact = true_n > 0.0
        lasting = size <= LASTING * (np.median(size[contact]) if contact.any() else np.inf)
        for i, (component, label) in enumerate(COMPONENTS):
            parts = {
                "true": (record.c_n, record.c_t)[i],
                "estimate": (fit.c_n, fit.c_t)[i],
                "std": (fit.c_n_std, fit.c_t_std)[i],
                "plain": forces.c["plain"][i],
            }
            table = pd.DataFrame({"t": t} | {name: values[:, j] for name, values in parts.items()})
            top = HEADROOM * np.abs(table["true"].to_numpy()[lasting]).max(initial=1e-3)
            _contact_force(axes[i, j], table, (-0.05 * top if i == 0 else -top, top))
            axes[i, j].set_ylabel(label)
            tables.append(table.assign(pair=pair, component=component))
        axes[0, j].set_title(title)
        axes[1, j].set_xlabel("time (s)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    axes[0, 0].set_xlim(t[0], t[-1])
    columns = ["pair", "component", "t", "true", "estimate", "std", "plain"]
    return figure, pd.concat(tables, ignore_index=True)[columns]


def _contact_force(ax: Axes, table: pd.DataFrame, limits: tuple[float, float]) -> None:
    """Draw a component of the force of one contact, with labels at the edge where the estimate lies outside."""
    t, plain, estimate = (table[name].to_numpy() for name in ("t", "plain", "estimate"))
    shown = (plain >= limits[0]) & (plain <= limits[1])
    ax.plot(t[shown], plain[shown], ".", color=GREY, markersize=1.8, label="plain program", zorder=1)
    ring = {"markersize": 3.4, "markeredgewidth": 0.5, "markeredgecolor": INK, "markerfacecolor": "none"}
    ax.plot(t, table["true"], "o", label="true", zorder=2, **ring)
    bar = {"fmt": ".", "markersize": 2.2, "color": BLUE, "elinewidth": 0.8, "zorder": 3}
    ax.errorbar(t, estimate, yerr=BAND * table["std"], label="estimated from noisy states, ±2 std. errors", **bar)
    ax.set_ylim(*limits)
    beyond = np.flatnonzero((estimate > limits[1]) | (estimate < limits[0]))
    # of adjacent points, only the largest is labelled
    for run in np.split(beyond, np.flatnonzero(np.diff(beyond) > 12) + 1) if len(beyond) else []:
        k = run[np.argmax(np.abs(estimate[run]))]
        up = estimate[k] > 0.0
        look = {"va": "top" if up else "bottom", "fontsize": 6, "color": INK}
        note(ax, f"{estimate[k]:.0f}", (t[k], limits[1] if up else limits[0]), (3, -2 if up else 2), **look)
