"""Figure of where a model fails: maps of the error before and after adding effects.

Maps show all impacts, training and held out, over the two features of the worst region of where.json (by default the
contact point's velocity before impact) and over the energy disc (`critique.results.numbers`); in space, over the
direction of the contact point from the centre of mass.  Means in titles are of held-out impacts.
"""

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from thesis_lib.critique.drops.criticise import DropsCritique
from thesis_lib.critique.drops.features import FEATURES, features
from thesis_lib.critique.drops.questions.where import Condition
from thesis_lib.critique.drops.words import plain_rule
from thesis_lib.critique.likelihood.fit import Fit
from thesis_lib.critique.likelihood.observations import Observations
from thesis_lib.critique.results.numbers import energy_disc, impact_errors
from thesis_lib.critique.results.titles import FEATURE_LABEL
from thesis_lib.figures.critique.errors import set_title
from thesis_lib.figures.planar_drawing import note, white_box
from thesis_lib.figures.style import BLUE, INK, Drawn, house_style, new_figure
from thesis_lib.statistics.wording import number

Box = tuple[float, float, float, float]
# quantile of the errors at which the colour scale ends, so that a few large errors do not dominate it
DARK = 0.95
POINTS = (  # of the energy disc: height, name, alignment, offset of the name
    (-1, "no impulse", "center", "top", (0, -4)),
    (0, "dead stop", "left", "center", (5, 0)),
    (1, "reversal", "center", "bottom", (0, 4)),
)
REGION_COLORS = ("#CC0000", BLUE, "black")


def inside(region: Mapping, table: pd.DataFrame) -> np.ndarray | None:
    """Return the mask (n,) of the impacts in a region; None if it uses a feature that `table` (n rows) lacks."""
    conditions = [Condition(**one) for one in region["conditions"]]
    if any(one.feature not in table for one in conditions):
        return None
    return np.all([one.inside(table) for one in conditions], axis=0)


def map_axes(regions: Sequence[Mapping]) -> tuple[str, str]:
    """Return the two features over which errors are mapped: from the worst region, by default v_t and v_n."""
    named = [condition["feature"] for condition in regions[0]["conditions"]] if regions else []
    named = sorted(dict.fromkeys([*named, "v_t", "v_n"][: max(2, len(set(named)))]), key=list(FEATURE_LABEL).index)
    return named[0], (named[1] if len(named) > 1 else "v_n")


def boxes_of(region: Mapping, axes: tuple[str, str], box: Box) -> list[Box] | None:
    """Return rectangles (low, high of the first feature, low, high of the second) within `box` that a region covers.

    None if the region uses features other than the two in `axes`.
    """
    boxes = [box]
    for condition in region["conditions"]:
        if condition["feature"] not in axes:
            return None
        low, high = condition["low"], condition["high"]
        low, high = -np.inf if low is None else low, np.inf if high is None else high
        parts = [(low, high)]
        if condition["absolute"]:
            parts = [(low, high), (-high, -low)] if low > 0.0 else [(-high, high)]
        k = 2 * axes.index(condition["feature"])
        cut = [(*old[:k], max(old[k], a), min(old[k + 1], b), *old[k + 2 :]) for old in boxes for a, b in parts]
        boxes = [new for new in cut if new[k] < new[k + 1]]
    return boxes


@house_style
def draw_where(critique: DropsCritique, where: Mapping) -> Drawn:
    """Draw maps of the error over (v_t, v_n), and over the energy disc or the body, before and after the effects."""
    o = critique.observations.single
    base, final = critique.ladder[0][1], critique.ladder[-1][1]
    table = features(base, o)
    disc = energy_disc(base, o) if o.space.is_plane else around_body(base, o)
    errors = {"before": impact_errors(base, o)}
    if len(critique.ladder) > 1:
        errors["after"] = impact_errors(final, o)
    regions = where["regions"]
    top = top_of(errors["before"])
    over = map_axes(regions)
    x, y = (table[name].to_numpy(float) for name in over)
    lines = [textwrap.fill(f"{i + 1}: {region_text(region)}", 110) for i, region in enumerate(regions)]
    figure = new_figure(height=(5.3 if len(errors) == 2 else 2.9) + 0.15 * len(lines))
    axes = figure.subplots(len(errors), 2).reshape(2, len(errors))
    names = {"before": "base law", "after": "with the effects"}
    held_out = np.isin(o.trial, critique.held_out.trial)
    means = {kind: error[held_out].mean() for kind, error in errors.items()}
    for column, (kind, error) in enumerate(errors.items()):
        ax = axes[0, column]
        shown = _tiles(ax, x, y, error, top)
        _outline(ax, regions, over)
        ax.set(xlabel=axis_label(over[0]), title=f"{names[kind]}: {number(means[kind])} m/s, single hits held out")
        if "wall" in over:
            walls = [wall.name for wall in o.rig.walls]
            axis = ax.yaxis if over[1] == "wall" else ax.xaxis
            axis.set_ticks(range(len(walls)), walls)
        ax = axes[1, column]
        if o.space.is_plane:
            _on_disc(ax, disc, error, top)
        else:
            _on_body(ax, disc, error, top)
        if len(errors) == 1:
            ax.set_title("energy disc" if o.space.is_plane else "on the body")
    axes[0, 0].set_ylabel(axis_label(over[1]))
    axes[1, 0].set_ylabel("energy disc:  impulse  → more" if o.space.is_plane else "elevation of the contact point (°)")
    bar = figure.colorbar(shown, ax=axes, shrink=0.7, aspect=30, pad=0.02, extend="max")
    bar.set_label("mean error of an impact, training and held out (m/s)")
    bar.outline.set_linewidth(0.5)
    if lines:
        figure.supxlabel("\n".join(lines), x=0.01, ha="left", fontsize=7)
    set_title(figure, where_sentence(critique, regions))
    data = table.assign(held_out=held_out.astype(int))
    names = ("disc_across", "disc_along") if o.space.is_plane else ("azimuth", "elevation")
    data = data.assign(**dict(zip(names, disc.T)))
    data = data.assign(**{f"error_{kind}": error for kind, error in errors.items()})
    for i, region in enumerate(regions):
        if (mask := inside(region, table)) is not None:
            data[f"region_{i + 1}"] = mask.astype(int)
    return figure, data


def top_of(error: np.ndarray) -> float:
    """Return the upper end in m/s of the scale of the errors (n,)."""
    return max(float(np.quantile(error, DARK)), 1e-12)


def around_body(fitted: Fit, observations: Observations) -> np.ndarray:
    """Return the direction (n, 2) in degrees of the contact points from the centre of mass, in axes of the body."""
    before, _ = fitted.on(observations).at_impulse
    x, y, z = before.space.turned_back(before.attitude, observations.rig.lowest(before))
    return np.degrees(np.stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))], axis=1))


def region_text(region: Mapping) -> str:
    """Return the description of a region in words and numbers."""
    text = plain_rule(region)
    if region["ratio"] is not None and region["ratio"] > 1.0:
        on = "held-out" if region["on"] == "held_out" else "all"
        text += f": {number(region['ratio'], 2)} times the error elsewhere (of {on} impacts)"
    else:
        text += ": a larger error, relative to the noise there, than elsewhere"
    return f"{text}, {100 * region['support']:.0f} % of impacts (p = {number(region['p_value'], 2)})"


def where_sentence(critique: DropsCritique, regions: Sequence[Mapping]) -> str:
    """Return a sentence on where the base law fails, and how much of the error the effects remove."""
    if not regions:
        return "The error of the base law is spread over all states: no region was found in which it is larger"
    text = f"The base law fails most where {plain_rule(regions[0])}"
    ratio = regions[0]["ratio"]
    if ratio is not None and ratio > 1.0:
        text += f" ({number(ratio, 2)} times the error elsewhere)"
    if len(critique.ladder) > 1:
        before, after = (critique.ladder[i][2].error.mean() for i in (0, -1))
        fall = 1.0 - after / before
        text += f"; the effects remove {100 * fall:.0f} % of the held-out error" if fall > 0.02 else ""
    return text


def _tiles(ax: Axes, x: np.ndarray, y: np.ndarray, error: np.ndarray, top: float, extent=None):
    """Draw hexagons with the mean error of their impacts; fewer impacts give larger hexagons."""
    size = int(np.clip(0.85 * np.sqrt(len(x)), 7, 24))
    if extent is None:
        # a few remote impacts must not shrink the map of the others
        (x_low, x_high), (y_low, y_high) = np.quantile(x, [0.005, 0.995]), np.quantile(y, [0.005, 0.995])
        extent = (x_low, x_high, y_low, y_high)
    inner = (x >= extent[0]) & (x <= extent[1]) & (y >= extent[2]) & (y <= extent[3])
    look = {"cmap": "cividis_r", "vmin": 0.0, "vmax": top, "linewidths": 0.2, "edgecolors": "white"}
    tiles = {"gridsize": (size, max(int(0.6 * size), 4)), "extent": extent, "reduce_C_function": np.mean}
    return ax.hexbin(x[inner], y[inner], C=error[inner], **tiles, **look)


def _on_disc(ax: Axes, disc: np.ndarray, error: np.ndarray, top: float) -> None:
    """Draw tiles over the energy disc (n, 2), with its circle and the names of its points."""
    _tiles(ax, disc[:, 0], disc[:, 1], error, top, extent=(-1.25, 1.25, -1.25, 1.25))
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.plot(np.cos(turn), np.sin(turn), color=INK, linewidth=0.9)
    for height, text, ha, va, offset in POINTS:
        ax.plot(0, height, "+", color=INK, markersize=5, markeredgewidth=0.8)
        look = {"ha": ha, "va": va, "fontsize": 6.5, "zorder": 5, "bbox": white_box(0.4, 0.75)}
        note(ax, text, (0, height), offset, **look)
    ax.set(aspect="equal", xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), xticks=[-1, 0, 1], yticks=[-1, 0, 1])
    ax.set_xlabel("less ←  impulse against the slip  → more")


def _on_body(ax: Axes, direction: np.ndarray, error: np.ndarray, top: float) -> None:
    """Draw the mean error in each direction (n, 2) in degrees of a contact point; larger marks for more impacts."""
    place, of, count = np.unique(np.round(direction), axis=0, return_inverse=True, return_counts=True)
    mean = np.bincount(of.ravel(), error) / count
    look = {"cmap": "cividis_r", "vmin": 0.0, "vmax": top, "edgecolors": INK, "linewidths": 0.4}
    ax.scatter(*place.T, 12.0 * np.sqrt(count), mean, **look)
    ax.set(xlim=(-185, 185), ylim=(-95, 95), xticks=[-180, -90, 0, 90, 180], yticks=[-90, -45, 0, 45, 90])
    ax.set_xlabel("azimuth of the contact point (°)")


def _outline(ax: Axes, regions: Sequence[Mapping], over: tuple[str, str]) -> None:
    """Draw numbered rectangles around the regions that the two features of the map describe."""
    (x_low, x_high), (y_low, y_high) = ax.get_xlim(), ax.get_ylim()
    for i, region in enumerate(regions):
        color = REGION_COLORS[i % len(REGION_COLORS)]
        for a, b, c, d in boxes_of(region, over, (x_low, x_high, y_low, y_high)) or ():
            ax.add_patch(Rectangle((a, c), b - a, d - c, fill=False, edgecolor=color, linewidth=1.4, clip_on=False))
            look = {"ha": "left", "va": "top", "fontsize": 7, "fontweight": "bold", "bbox": white_box(0.6, 0.85)}
            note(ax, str(i + 1), (a, d), (3, -3), color=color, **look)
    ax.set(xlim=(x_low, x_high), ylim=(y_low, y_high))


def axis_label(feature: str) -> str:
    """Return name, symbol and unit of a feature."""
    unit, _ = FEATURES[feature]
    return FEATURE_LABEL[feature] if unit == "1" else f"{FEATURE_LABEL[feature]} ({unit})"
