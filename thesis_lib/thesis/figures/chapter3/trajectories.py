"""Figures 3-5 and 3-6: configuration and energy of one trial against time, with its impacts.

Velocities come from the samples, because fitted arcs conserve energy by construction, which would make the figure
trivial.  Each is the slope of a straight line through x, θ and y + g t²/2 over a few neighbours between the same two
impacts.  The trial shown is the first in which all of the first (at most three) impacts are measured.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.thesis.impact_study.energy import rest_height

SERIES = {"x": (BLUE, "$x$"), "y": (RED, "$y$"), "k_theta": (GREEN, r"$k\,\theta$")}
ENERGIES = {
    "potential": (BLUE, (0, (5, 1.5)), "potential"),
    "kinetic": (RED, (0, (1, 1.2)), "kinetic"),
    "total": (INK, "-", "total"),
}
LEADING = 3  # number of first impacts that should be measured
HALF_WINDOW = 5  # samples on either side; at 250 Hz and 0.3 mm, the velocity's error is 7 mm/s


@house_style
def figure_3_5(dataset: Dataset, impacts: pd.DataFrame, arcs: pd.DataFrame) -> Drawn:
    """Figure 3-5: x, y, kθ of one trial; samples, fitted arcs on either side of each measured impact, and hits.

    `impacts`: measured impacts (trial, t, pose and velocities), as in impacts.csv; `arcs`: all detected impacts (trial,
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
    """Figure 3-6: potential, kinetic and total energy of the same trial until shortly after its first impacts.

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
    # a gap at each impact, where the energy is not measured
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


def pick_trial(arcs: pd.DataFrame) -> int:
    """Number of the trial to show; `arcs` has trial, impact, used (measurable); UserError if no impact is used."""
    if not arcs["used"].astype(bool).any():
        why = "left_out.csv gives the reasons."
        raise UserError(f"No impact of this dataset could be measured, so there is no trajectory to show; {why}")
    ordered = arcs.sort_values(["trial", "impact"], kind="stable")
    measured = ordered.assign(used=ordered["used"].astype(int)).groupby("trial")["used"]
    leading = measured.cumprod().groupby(ordered["trial"]).sum().clip(upper=LEADING)
    if leading.max() == 0:  # no trial has its first impact measured: use the trial with the most measured impacts
        leading = measured.sum()
    return int(leading.index[np.argmax(leading.to_numpy())])


def sample_velocities(t: np.ndarray, pose: np.ndarray, hits: np.ndarray, gravity: float) -> np.ndarray:
    """Velocities (n, 3) at a trial's samples; NaN for fewer than three neighbours between the same two impacts.

    `t` (n,) in s increases, `pose` (n, 3) is x, y, θ; `hits` are the instants of all impacts in s, measurable or not.
    """
    stretch = np.searchsorted(np.sort(hits), t)
    first, last = np.searchsorted(stretch, stretch), np.searchsorted(stretch, stretch, side="right")
    row = np.arange(len(t))
    low, high = np.maximum(first, row - HALF_WINDOW), np.minimum(last, row + HALF_WINDOW + 1)
    straight = pose.copy()
    straight[:, 1] += 0.5 * gravity * t**2  # free flight becomes a straight line
    start = straight.mean(axis=0), t.mean()
    q, s = straight - start[0], t - start[1]  # keeps the running sums small

    def windowed(values: np.ndarray) -> np.ndarray:
        total = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        return total[high] - total[low]

    n = (high - low)[:, None].astype(float)
    sum_s, sum_ss = windowed(s[:, None]), windowed(s[:, None] ** 2)
    slope = n * windowed(s[:, None] * q) - sum_s * windowed(q)
    spread = n * sum_ss - sum_s**2
    velocity = np.divide(slope, spread, out=np.full_like(slope, np.nan), where=n >= 4)
    velocity[:, 1] -= gravity * t
    return velocity


def energies(pose: np.ndarray, velocity: np.ndarray, dataset: Dataset) -> np.ndarray:
    """Energies m g (y − y_rest), m (v_x² + v_y² + k² ω²)/2 and sum, (n, 3) in J, or in J/kg without a mass."""
    rest = rest_height(dataset.shape, dataset.height)
    mass = 1.0 if dataset.mass is None else dataset.mass
    potential = mass * dataset.gravity * (pose[:, 1] - rest)
    kinetic = 0.5 * mass * np.sum((velocity * [1.0, 1.0, dataset.k_g]) ** 2, axis=1)
    return np.stack([potential, kinetic, potential + kinetic], axis=1)
