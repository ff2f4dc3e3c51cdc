"""Figures 3-5 and 3-6: configurations and energies of one trial against time, with its impacts.

The choice of the trial, its velocities and its energies: `thesis_lib.impact_study.shown`.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.impact_study.shown import LEADING, energies, pick_trial, sample_velocities

SERIES = {"x": (BLUE, "$x$"), "y": (RED, "$y$"), "k_theta": (GREEN, r"$k\,\theta$")}
ENERGIES = {
    "potential": (BLUE, (0, (5, 1.5)), "potential"),
    "kinetic": (RED, (0, (1, 1.2)), "kinetic"),
    "total": (INK, "-", "total"),
}


@house_style
def figure_3_5(dataset: Dataset, impacts: pd.DataFrame, arcs: pd.DataFrame) -> Drawn:
    """Configurations x, y, kθ of one trial: samples, fitted arcs on either side of each measured impact, and hits.

    `impacts`: measured ones (trial, t, pose and velocities), as in impacts.csv; `arcs`: all that were detected (trial,
    impact, t, used, n_pre, n_post), as in arcs.csv.

    Raises:
        UserError: no impact was measurable.
    """
    trial, t, pose = _trial(dataset, arcs)
    scale = np.array([1.0, 1.0, dataset.k_g])
    hits = arcs[arcs["trial"] == trial].sort_values("t")
    step = float(np.median(np.diff(t)))
    figure = new_figure(height=4.2)
    axes = figure.subplots(3, 1, sharex=True)
    rows = [("", "impact", instant, np.nan) for instant in hits["t"]]
    for i, (ax, (name, (color, label))) in enumerate(zip(axes, SERIES.items())):
        _mark(ax, hits)
        ax.plot(t, scale[i] * pose[:, i], ".", color=color, markersize=2.2, alpha=0.7, label="samples")
        rows += [(name, "sample", a, b) for a, b in zip(t, scale[i] * pose[:, i])]
        label_arc = "fitted flight"
        for hit in hits[hits["used"].astype(bool)].itertuples():
            fit = impacts[(impacts["trial"] == trial) & (impacts["impact"] == hit.impact)].iloc[0]
            for side, count in (("pre", -hit.n_pre), ("post", hit.n_post)):
                tau = np.linspace(0.0, count * step, 12)
                curve = scale[i] * _flight(fit, side, tau, dataset.gravity)[:, i]
                ax.plot(hit.t + tau, curve, color=INK, linewidth=1.0, label=label_arc)
                label_arc = None
                order = np.argsort(tau)
                rows += [(name, "arc", a, b) for a, b in zip(hit.t + tau[order], curve[order])]
        ax.set_ylabel(f"{label} (m)")
    axes[-1].set_xlabel("time (s)")
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)
    axes[0].set_xlim(t[0], t[-1])
    table = pd.DataFrame(rows, columns=["series", "kind", "t", "value"])
    return figure, table.assign(trial=trial)[["trial", "series", "kind", "t", "value"]]


@house_style
def figure_3_6(dataset: Dataset, arcs: pd.DataFrame) -> Drawn:
    """Potential, kinetic and total energy of the same trial until shortly after its leading impacts.

    In J, or in J/kg if the dataset gives no mass.

    Raises:
        UserError: no impact was measurable.
    """
    trial, t, pose = _trial(dataset, arcs)
    hits = arcs[arcs["trial"] == trial].sort_values("t")
    times = hits["t"].to_numpy()
    velocity = sample_velocities(t, pose, times, dataset.gravity)
    end = times[LEADING] if len(times) > LEADING else times[-1] + 0.1
    shown = t <= min(end, t[-1])
    energy = energies(pose, velocity, dataset)[shown]
    factor, unit = (1.0, "J/kg") if dataset.mass is None else (1e3, "mJ")
    figure = new_figure(height=2.6)
    ax = figure.add_subplot()
    _mark(ax, hits[hits["t"] <= t[shown][-1]])
    rows = [("", "impact", instant, np.nan) for instant in times if instant <= t[shown][-1]]
    # a gap at each impact: there the energy is not measured
    cut = np.flatnonzero(np.diff(np.searchsorted(times, t[shown])))
    for i, (name, (color, dash, label)) in enumerate(ENERGIES.items()):
        broken = np.insert(energy[:, i], cut + 1, np.nan)
        ax.plot(np.insert(t[shown], cut + 1, np.nan), factor * broken, color=color, linestyle=dash, label=label)
        rows += [(name, "sample", a, b) for a, b in zip(t[shown], energy[:, i])]
    ax.set(ylim=(min(0.0, factor * float(np.nanmin(energy))), None), xlim=(t[0], t[shown][-1]))
    ax.set(xlabel="time (s)", ylabel=f"energy ({unit})")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5)
    table = pd.DataFrame(rows, columns=["series", "kind", "t", "energy"])
    return figure, table.assign(trial=trial)[["trial", "series", "kind", "t", "energy"]]


def _trial(dataset: Dataset, arcs: pd.DataFrame) -> tuple[int, np.ndarray, np.ndarray]:
    trial = pick_trial(arcs)
    samples = dataset.trajectories[dataset.trajectories["trial"] == trial]
    return trial, samples["t"].to_numpy(float), samples[["x", "y", "theta"]].to_numpy(float)


def _flight(fit: pd.Series, side: str, tau: np.ndarray, gravity: float) -> np.ndarray:
    """Pose (n, 3) at times `tau` from the impact: q + v τ − (0, g, 0) τ²/2."""
    q = fit[["x", "y", "theta"]].to_numpy(float)
    v = fit[[f"vx_{side}", f"vy_{side}", f"omega_{side}"]].to_numpy(float)
    return q + tau[:, None] * v - 0.5 * gravity * tau[:, None] ** 2 * np.array([0.0, 1.0, 0.0])


def _mark(ax: Axes, hits: pd.DataFrame) -> None:
    used = hits["used"].astype(bool)
    for mask, dash, label in ((used, "-", "impact"), (~used, (0, (2, 2)), "impact, left out")):
        for instant in hits.loc[mask, "t"]:
            ax.axvline(instant, color=GREY, linewidth=0.7, linestyle=dash, label=label, zorder=0)
            label = None
