"""Figures 4-3, 4-4 and 4-7 to 4-10: thrown dice, beliefs (predictive distributions), errors and their causes.

Poses x, y, θ are in m, rad; the error is (x measured − x expected)/side at rest, positive for an undershoot.

Samples of a belief are poses of particles (m, rad) at the start (contact 0) and after each contact; distances are
horizontal, in sides from the start's mean; PIT is the probability integral transform of measured outcomes.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.bodies.shapes import Polygon
from thesis_lib.figures.densities import reflected_density
from thesis_lib.figures.planar_drawing import turned
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SKY, VIOLET, YELLOW, Drawn, house_style, new_figure

MODEL_STYLE = {
    "law": (BLUE, (0, (5, 1.5)), "law alone"),
    "residual": (YELLOW, (0, (3, 1, 1, 1)), "law + rigid residual"),
    "residual_wrench": (RED, (0, (1, 1.2)), "law + wrench residual"),
    "critique": (VIOLET, (0, (4, 1.2, 1, 1.2)), "critique's law"),
    "compliant": (SKY, (0, (2, 1)), "compliant contact"),
    "compliant_residual": (GREEN, "-", "compliant contact + residual"),
}
OUTLINES = 26  # number of outlines of a whole throw in figure 4-7
AFTER = 0.06  # s after the first contact that are shown in figure 4-9
SHOWN = 4.0  # sides; the table gives the share of larger errors
CONTACT_COLORS = (RED, GREEN, BLUE, VIOLET)
CONTACT_NAMES = ("start", "after the first contact", "after the second contact")
DRAWN = 60  # number of particles drawn for each contact


def draw_outline(ax: Axes, shape: Polygon, pose: np.ndarray, **style) -> None:
    """Draw the outline of the body at a pose (3,)."""
    ax.plot(*(turned(shape.outline(), pose[2]) + pose[:2]).T, **style)


@house_style
def figure_4_7(poses: pd.DataFrame, shape: Polygon, trial: int) -> Drawn:
    """Figure 4-7: outlines of one measured throw; `poses`: trial, t, x, y, theta."""
    figure = new_figure(height=2.6)
    ax = figure.add_subplot()
    throw = poses[poses["trial"] == trial]
    rows = np.unique(np.linspace(0, len(throw) - 1, OUTLINES).astype(int))
    table = throw.iloc[rows][["trial", "t", "x", "y", "theta"]].reset_index(drop=True)
    outlined = table[["x", "y", "theta"]].to_numpy()
    for i, pose in enumerate(outlined):
        draw_outline(ax, shape, pose, color=str(0.75 - 0.6 * i / max(1, len(table) - 1)), linewidth=0.8)
    ax.plot(throw["x"], throw["y"], color=RED, linewidth=0.8, label="centre")
    draw_outline(ax, shape, outlined[-1], color=INK, linewidth=1.6, label="at rest")
    _ground(ax)
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return figure, table


@house_style
def figure_4_8(throws: pd.DataFrame) -> Drawn:
    """Figure 4-8: densities of the error of the resting position for each model, with mean and standard deviation.

    `throws`: model, error (1), a row for each held-out throw.
    """
    figure = new_figure(height=3.0)
    ax = figure.add_subplot()
    grid = np.linspace(-SHOWN, SHOWN, 321)
    rows = []
    for model, part in throws.groupby("model", sort=False):
        color, dash, label = MODEL_STYLE[model]
        error = part["error"].to_numpy()
        density = reflected_density(error, grid)
        mean, std, beyond = error.mean(), error.std(), float(np.mean(np.abs(error) > SHOWN))
        ax.plot(grid, density, color=color, linestyle=dash, label=f"{label} ({mean:+.2f} ± {std:.2f})")
        rows += [(model, x, d, mean, std, beyond) for x, d in zip(grid, density)]
    ax.axvline(0.0, color=GREY, linewidth=0.7, zorder=0)
    ax.set(xlim=(-SHOWN, SHOWN), ylim=(0.0, None))
    ax.set(xlabel="measured minus expected resting position (sides)", ylabel="density")
    ax.legend(loc="upper left", title="mean ± standard deviation", fontsize="x-small", title_fontsize="x-small")
    return figure, pd.DataFrame(rows, columns=["model", "error", "density", "mean", "std", "beyond"])


@house_style
def figure_4_9(poses: pd.DataFrame, hits: pd.DataFrame, shape: Polygon, easy: int, hard: int) -> Drawn:
    """Figure 4-9: a hard (left) and an easy throw; outlines at all samples until shortly after the first contact.

    `poses`: trial, t, x, y, theta; `hits`: trial, t of detected hits; `easy` and `hard` are numbers of trials.
    """
    figure = new_figure(width=4.725, height=3.0, layout="compressed")
    axes = figure.subplots(1, 2, sharey=True)
    tables = []
    for ax, trial, title in zip(axes, (hard, easy), ("hard to predict", "easy to predict")):
        first = float(hits.loc[hits["trial"] == trial, "t"].min())
        part = poses[(poses["trial"] == trial) & (poses["t"] <= first + AFTER)]
        for pose, t in zip(part[["x", "y", "theta"]].to_numpy(), part["t"]):
            draw_outline(ax, shape, pose, color=BLUE if t <= first else RED, linewidth=0.5, alpha=0.55)
        ax.plot([], [], color=BLUE, label="before the first contact")
        ax.plot([], [], color=RED, label="after")
        _ground(ax)
        ax.set_title(title)
        after_first = (part["t"] > first).astype(int)
        tables.append(part[["trial", "t", "x", "y", "theta"]].assign(after_first=after_first, case=title))
    # equal widths, so that panels of equal scale have equal heights
    ends = np.array([ax.get_xlim() for ax in axes])
    half = 0.5 * np.ptp(ends, axis=1).max()
    for ax, middle in zip(axes, ends.mean(axis=1)):
        ax.set_xlim(middle - half, middle + half)
    axes[1].set_ylabel("")
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.12), ncols=2)
    return figure, pd.concat(tables, ignore_index=True)


def _ground(ax: Axes) -> None:
    low, high = ax.get_xlim()
    ax.axhline(0.0, color=INK, linewidth=1.0)
    ax.set(xlim=(low, high), aspect="equal", xlabel="$x$ (m)", ylabel="$y$ (m)")


@house_style
def figure_restitution(table: pd.DataFrame) -> Drawn:
    """Figure of measured and modelled restitution against the place of the contact, for first and later contacts.

    `table`: first (1: a throw's first contact), x (m), measured, model (1); see `residual.restitution`.
    """
    figure = new_figure(height=2.6)
    axes = figure.subplots(1, 2, sharey=True)
    for ax, first, title in zip(axes, (1, 0), ("first contacts", "later contacts")):
        part = table[table["first"] == first]
        ax.plot(100.0 * part["x"], part["measured"], "o", color=BLUE, markersize=2.2, alpha=0.6, label="measured")
        ax.plot(100.0 * part["x"], part["model"], "x", color=RED, markersize=2.8, label="compliant contact")
        ax.set(title=title, xlabel="place of the contact $x$ (cm)")
        ax.locator_params(axis="x", nbins=5)
    axes[0].set(ylabel="restitution $e_n$", ylim=(0.1, 0.8))
    axes[0].legend(loc="lower left")
    return figure, table[["first", "trial", "x", "measured", "model"]]


@house_style
def figure_budget(table: pd.DataFrame) -> Drawn:
    """Figure of the share of correct faces, and scatter at rest, of throws continued from before each contact.

    `table`: model, contact, std (sides), std_error, face_right, face_error; "nearest" and "pairs" have contact 0.
    """
    figure = new_figure(height=2.8)
    axes = figure.subplots(1, 2)
    columns = (("face_right", "face_error", 100.0), ("std", "std_error", 1.0))
    for ax, (column, error, scale) in zip(axes, columns):
        for i, (model, (color, dash, label)) in enumerate(MODEL_STYLE.items()):
            part = table[table["model"] == model]
            at = part["contact"] + 0.05 * (i - 2.5)
            ax.errorbar(at, scale * part[column], scale * part[error], color=color, linestyle=dash, label=label)
        for model, marker, label in (("nearest", "s", "nearest throws"), ("pairs", "D", "most alike pairs")):
            part = table[table["model"] == model]
            ax.plot(part["contact"] - 0.3, scale * part[column], marker, color=INK, markersize=4, label=label)
        ax.set(xlabel="contact before which the throw is restarted", xticks=range(int(table["contact"].max()) + 1))
    axes[0].axhline(25.0, color=GREY, linewidth=0.7, zorder=0)
    axes[0].set(ylabel="correct faces (%)", ylim=(0.0, 100.0))
    axes[1].set(ylabel="scatter at rest (sides)", ylim=(0.0, None))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, fontsize="x-small")
    return figure, table


def draw_density(ax: Axes, grid: np.ndarray, density: np.ndarray, color: str, label: str | None = None) -> None:
    """Draw a density (n,) over `grid` (n,) with shaded area."""
    ax.fill_between(grid, density, color=color, alpha=0.3, linewidth=0.0)
    ax.plot(grid, density, color=color, label=label)
    ax.set_ylim(bottom=0.0)


@house_style
def figure_4_3(poses: pd.DataFrame, samples: pd.DataFrame, shape: Polygon) -> Drawn:
    """Figure 4-3: measured throw until its second contact, with outlines of samples from the belief.

    `poses`: trial, t (s), x, y (m), theta (rad), as measured; `samples`: the same for one trial, and contact.
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
    """Figure 4-4: distribution of the horizontal distance at the start, after each of two contacts, and at rest.

    `samples`: contact, x of the particles of one throw; `rest`: (M,) positions at rest; `side` of the die; all in m.
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
    """Figure 4-10: belief over the resting position of an easy and a hard throw, with predicted and measured end.

    `beliefs`: case ("easy", "hard"), distance of each particle; `marks`: case, law, measured; all in sides.
    """
    figure = new_figure(height=2.8)
    axes = figure.subplots(1, 2, sharex=True)
    low, high = beliefs["distance"].quantile([0.001, 0.999])
    ends = marks[["law", "measured"]].to_numpy()
    # extends beyond the samples, where each density is near 0
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
    """Figure of the PIT histogram and coverage of beliefs over resting positions.

    `histograms`: model, pit, share, low, high (band of a calibrated belief).  `coverage`: model, level, coverage, low,
    high.
    """
    figure = new_figure(height=3.2)
    left, right = figure.subplots(1, 2)
    band = histograms.groupby("pit", sort=True)[["low", "high"]].first()
    look = {"color": "0.9", "linewidth": 0.0, "label": "95 % if calibrated"}
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
