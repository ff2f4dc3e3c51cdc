"""Figures 4-3, 4-4 and 4-10 and the calibration of beliefs: the belief over a throw, at each contact and at rest.

Samples are poses of particles (m, rad) at the start (contact 0) and after each contact; distances are horizontal, in
sides from the start's mean; PIT is the probability integral transform of measured outcomes.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.figures.chapter4.dice import MODEL_STYLE, draw_outline
from thesis_lib.figures.densities import reflected_density
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, VIOLET, Drawn, house_style, new_figure

CONTACT_COLORS = (RED, GREEN, BLUE, VIOLET)
CONTACT_NAMES = ("start", "after the first contact", "after the second contact")
DRAWN = 60  # particles of each contact that are drawn


def draw_density(ax: Axes, grid: np.ndarray, density: np.ndarray, color: str, label: str | None = None) -> None:
    """A density (n,) over `grid` (n,) with its area shaded."""
    ax.fill_between(grid, density, color=color, alpha=0.3, linewidth=0.0)
    ax.plot(grid, density, color=color, label=label)
    ax.set_ylim(bottom=0.0)


@house_style
def figure_4_3(poses: pd.DataFrame, samples: pd.DataFrame, shape: Polygon) -> Drawn:
    """Measured throw until its second contact, with outlines of samples from the belief over it.

    `poses`: trial, t (s), x, y (m), theta (rad), as measured; `samples`: the same of a single trial, and contact.
    """
    trial = int(samples["trial"].iloc[0])
    figure = new_figure(height=3.2)
    ax = figure.add_subplot()
    shown = samples[samples["contact"] <= 2]
    rows = []
    for contact, part in shown.groupby("contact"):
        particles = part.head(DRAWN)
        for pose in particles[["x", "y", "theta"]].to_numpy():
            draw_outline(ax, shape, pose, color=CONTACT_COLORS[contact], linewidth=0.4, alpha=0.35)
        ax.plot([], [], color=CONTACT_COLORS[contact], label=f"belief, {CONTACT_NAMES[contact]}")
        rows += [(trial, f"belief_{contact}", *row) for row in particles[["t", "x", "y", "theta"]].to_numpy()]
    measured = poses[poses["trial"] == trial]
    measured = measured[measured["t"] <= measured["t"].iloc[0] + float(shown["t"].max()) + 0.15]
    ax.plot(measured["x"], measured["y"], color=INK, linewidth=1.1, label="measured centre")
    for pose in measured[["x", "y", "theta"]].to_numpy()[::6]:
        draw_outline(ax, shape, pose, color=GREY, linewidth=0.6)
    rows += [(trial, "measured", *row) for row in measured[["t", "x", "y", "theta"]].to_numpy()]
    ax.axhline(0.0, color=INK, linewidth=1.0)
    ax.set(aspect="equal", xlabel="$x$ (m)", ylabel="$y$ (m)")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return figure, pd.DataFrame(rows, columns=["trial", "series", "t", "x", "y", "theta"])


@house_style
def figure_4_4(samples: pd.DataFrame, rest: np.ndarray, side: float) -> Drawn:
    """Distribution of the horizontal distance at the start, after each of two contacts and at rest.

    `samples`: contact, x of one throw's particles; `rest`: (M,) their positions at rest; `side` of the die; all in m.
    """
    figure = new_figure(height=3.6)
    zero = float(samples.loc[samples["contact"] == 0, "x"].mean())
    series = {CONTACT_NAMES[i]: samples.loc[samples["contact"] == i, "x"].to_numpy() for i in (0, 1, 2)}
    series["at rest"] = np.asarray(rest)
    series = {name: (x - zero) / side for name, x in series.items() if len(x) > 1}
    axes = np.atleast_1d(figure.subplots(len(series), 1))
    rows = []
    for ax, (name, x), color in zip(axes, series.items(), CONTACT_COLORS):
        mid, half = float(np.median(x)), max(4.0 * float(x.std()), 1e-3)
        grid = np.linspace(mid - half, mid + half, 161)
        density = reflected_density(x, grid)
        draw_density(ax, grid, density, color)
        ax.set_yticks([])
        text = f"{name}\nstd {x.std():.2g} sides"
        ax.annotate(text, (0.01, 0.9), xycoords="axes fraction", va="top", fontsize="x-small")
        rows += [(name, a, b, x.std()) for a, b in zip(grid, density)]
    axes[-1].set_xlabel("horizontal distance from the start (sides; each panel has its own range)")
    figure.supylabel("density", fontsize="small")
    return figure, pd.DataFrame(rows, columns=["state", "distance", "density", "std"])


@house_style
def figure_4_10(beliefs: pd.DataFrame, marks: pd.DataFrame) -> Drawn:
    """Belief over the resting position of an easy and a hard throw, with the law's end and the measured end.

    `beliefs`: case ("easy", "hard"), distance of each particle; `marks`: case, law, measured; all in sides.
    """
    figure = new_figure(height=2.8)
    axes = figure.subplots(1, 2, sharex=True)
    low, high = beliefs["distance"].quantile([0.001, 0.999])
    ends = marks[["law", "measured"]].to_numpy()
    # extends beyond the samples, so that each density ends near 0
    grid = np.linspace(min(low, ends.min()) - 2.0, max(high, ends.max()) + 2.0, 321)
    rows = []
    for ax, case in zip(axes, ("hard", "easy")):
        x = beliefs.loc[beliefs["case"] == case, "distance"].to_numpy()
        density = reflected_density(x, grid)
        draw_density(ax, grid, density, GREEN, label="belief")
        mark = marks[marks["case"] == case].iloc[0]
        ax.axvline(mark["law"], color=BLUE, linestyle=(0, (5, 1.5)), label="law alone")
        ax.axvline(mark["measured"], color=INK, label="measured")
        ax.set(title=f"{case} to predict: std {x.std():.2f} sides", xlabel="resting position from the start (sides)")
        rows += [(case, a, b, mark["law"], mark["measured"], x.std()) for a, b in zip(grid, density)]
    axes[0].set_ylabel("density")
    axes[1].legend(loc="best")
    return figure, pd.DataFrame(rows, columns=["case", "distance", "density", "law", "measured", "std"])


@house_style
def figure_calibration(histograms: pd.DataFrame, coverage: pd.DataFrame) -> Drawn:
    """PIT histogram and coverage of beliefs over resting positions.

    `histograms`: model, pit, share, low, high (band of a calibrated belief).  `coverage`: model, level, coverage, low,
    high.
    """
    figure = new_figure(height=3.2)
    left, right = figure.subplots(1, 2)
    band = histograms.groupby("pit", sort=True)[["low", "high"]].first()
    look = {"color": "0.9", "linewidth": 0.0, "label": "95 % of right ones"}
    left.fill_between([0.0, 1.0], band["low"].min(), band["high"].max(), **look)
    for model, part in histograms.groupby("model", sort=False):
        color, dash, label = MODEL_STYLE[model]
        left.plot(part["pit"], part["share"], color=color, linestyle=dash, marker=".", markersize=3)
        levels = coverage[coverage["model"] == model]
        error = np.abs(levels[["low", "high"]].to_numpy().T - levels["coverage"].to_numpy())
        right.errorbar(levels["level"], levels["coverage"], error, color=color, linestyle=dash, marker=".", label=label)
    left.set(xlabel="PIT of the measured resting position", ylabel="share of throws", ylim=(0.0, None))
    left.legend(loc="upper center")
    right.plot([0.4, 1.0], [0.4, 1.0], color=GREY, linewidth=0.8, zorder=0)
    right.set(xlabel="nominal level of the central region", ylabel="share of outcomes inside")
    right.legend(loc="lower right", fontsize="x-small")
    pit = histograms.rename(columns={"pit": "at", "share": "value"}).assign(panel="pit")
    covered = coverage.rename(columns={"level": "at", "coverage": "value"}).assign(panel="coverage")
    table = pd.concat([pit, covered], ignore_index=True)
    return figure, table[["panel", "model", "at", "value", "low", "high"]]
