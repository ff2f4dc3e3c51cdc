"""Figures 5-5A, 5-8, 5-9 and frames of a game: tower, beliefs during pushes, steering of a block (thesis 5.5.4).

Figures 5-8 and 5-9 show pushes of a stuck and an easy block.  Angles are drawn in mm, as in the thesis: yaw · r_g, with
the radius of gyration r_g = 23 mm.

Pictures of the tower are drawn without OpenGL, to look the same everywhere.  Parallel projection: with camera
azimuth α and elevation ε, the picture's axes are r = (−sin α, cos α, 0) and
w = (−sin ε cos α, −sin ε sin α, cos ε), the direction to the camera d = (cos ε cos α, cos ε sin α, sin ε).  Boxes are
painted from bottom to top, and from far to near within a layer, which is correct for a camera above the layers.
"""

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from thesis_lib.figures.planar_drawing import arrow, turned, unit
from thesis_lib.figures.style import BLUE, GREY, INK, RED, WIDTH, Drawn, house_style, new_figure
from thesis_lib.jenga.robot.samples import RADIUS_OF_GYRATION
from thesis_lib.jenga.tower.tower_model import BLOCKS
from thesis_lib.mechanics.space import rotation_matrix
from thesis_lib.thesis.figures.chapter5.model import abstraction_style

CASES = {"stuck": "A  block that is stuck", "easy": "B  block that moves easily"}
LENGTH, WIDE = 75.0, 25.0  # mm, of a block
SHOWN = 6  # number of steps drawn from above in figure 5-9
ARROW = 24.0  # mm, length of the heading's arrow
AZIMUTH, ELEVATION = np.radians(35.0), np.radians(22.0)
Colour = tuple[float, float, float]
STACKED = 10e-3  # m; a block that has risen by more than this was placed on top
WOOD, PUSHED, PLACED = (0.87, 0.72, 0.53), (0.80, 0.36, 0.22), (0.45, 0.62, 0.80)
LIGHT = np.array([0.55, 0.25, 0.80])
HALF_LAYER = 7.5e-3  # m; half of the height that is painted as one layer
# faces of the cube [-1, 1]^3: axis and side that a face points to, and its corners in order
FACES = [
    (axis, side, [np.insert(pair, axis, side) for pair in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    for axis in range(3)
    for side in (-1, 1)
]


@house_style
def figure_5_8(showcase: pd.DataFrame) -> Drawn:
    """Figure 5-8: force, displacement and probability at each step: readings, predictions, belief of each abstraction.

    `showcase`: case (stuck, easy), step, abstraction (name), belief, belief_nuts (1; NaN if there is none), f_n (N) and
    x (mm) as measured, f_n_pred and x_pred as predicted by the abstraction.
    """
    styles = abstraction_style(list(showcase["abstraction"].unique()))
    cases = [case for case in CASES if case in set(showcase["case"])]
    figure = new_figure(height=4.6)
    axes = figure.subplots(3, len(cases), sharex="col", sharey="row", squeeze=False)
    for column, case in zip(axes.T, cases):
        rows = showcase[showcase["case"] == case]
        for name, part in rows.groupby("abstraction", sort=False):
            color, dash = styles[name]
            part = part.sort_values("step")
            look = {"color": color, "linestyle": dash, "linewidth": 1.1}
            column[0].plot(part["step"], part["f_n_pred"], **look)
            column[1].plot(part["step"], part["x_pred"], **look)
            column[2].plot(part["step"], part["belief"], label=name, **look)
            column[2].plot(part["step"], part["belief_nuts"], "o", color=color, markersize=3.5, markeredgecolor=INK)
        readings = rows.drop_duplicates("step").sort_values("step")
        for ax, name in zip(column, ("f_n", "x")):
            ax.plot(readings["step"], readings[name], ".", color=INK, markersize=3.5, zorder=3)
        column[0].set_title(CASES[case])
        column[2].set(ylim=(-0.04, 1.04), xlabel="step of 1 mm")
    for ax, text in zip(axes[:, 0], ("force $f_n$ (N)", "displacement $x$ (mm)", "probability")):
        ax.set_ylabel(text)
    figure.align_ylabels(axes[:, 0])
    axes[0, 0].plot([], [], ".", color=INK, label="read")
    axes[2, 0].plot([], [], "o", color="white", markeredgecolor=INK, markersize=3.5, label="NUTS (line: filter)")
    shown = {label: handle for ax in axes.ravel() for handle, label in zip(*ax.get_legend_handles_labels())}
    figure.legend(shown.values(), shown.keys(), loc="outside upper left", ncols=min(4, len(shown)))
    columns = ["case", "step", "abstraction", "belief", "belief_nuts", "f_n", "x", "f_n_pred", "x_pred"]
    return figure, showcase[columns].reset_index(drop=True)


@house_style
def figure_5_9(steering: pd.DataFrame, exaggeration: float = 3.0) -> Drawn:
    """Figure 5-9: block from above at several steps of a steered push, and its path with and without steering.

    `steering`, for one block: steered (0, 1), step, advance (mm), x, y, yaw (mm; yaw times r_g), offset (mm), heading
    (rad), controlled (0 or 1: after the disturbance).  `exaggeration` enlarges y, yaw and heading as seen from above.
    """
    steering = steering.sort_values(["steered", "step"], ignore_index=True)
    controlled = steering[steering["steered"] == 1]
    figure = new_figure(height=3.9)
    grid = figure.add_gridspec(2, 1, height_ratios=[1.7, 1])
    chosen = controlled.index[np.unique(np.linspace(0, len(controlled) - 1, SHOWN).round().astype(int))]
    panels = grid[0].subgridspec(1, len(chosen)).subplots(sharex=True, sharey=True, squeeze=False)[0]
    # room for the largest rotation, the same in all panels
    outlines = [_from_above(ax, row, exaggeration) for ax, row in zip(panels, controlled.loc[chosen].itertuples())]
    corners = np.concatenate(outlines)
    half = float(np.abs(corners[:, 1]).max()) + 4.0
    panels[0].set_xlim(half, -half)  # y to the left: x points up, seen from above
    panels[0].set_ylim(-0.5 * LENGTH - ARROW - 8.0, float(corners[:, 0].max()) + 4.0)
    text = f"steered push from above, upwards, y to the left; y, yaw and heading × {exaggeration:g}; "
    figure.suptitle(f"{text}dotted: block at the start, dashed: goal", fontsize=7.5, x=0.01, ha="left")
    ax = figure.add_subplot(grid[1])
    for name, symbol, colour in (("y", "$y$", BLUE), ("yaw", r"$\theta\, r_g$", RED)):
        for steered, line in ((1, "-"), (0, (0, (1.2, 1.2)))):
            part = steering[steering["steered"] == steered]
            label = f"{symbol} {'steered' if steered else 'straight on'}"
            ax.plot(part["advance"], part[name], color=colour, linestyle=line, label=label)
    ax.axhline(0.0, color=GREY, linestyle=(0, (4, 2)), linewidth=0.9)
    takes_over = controlled.loc[controlled["controlled"] == 1, "advance"].min()
    ax.axvspan(float(controlled["advance"].min()), float(takes_over), color=GREY, alpha=0.2, linewidth=0)
    bottom = ax.get_ylim()[0]
    places = controlled.loc[chosen, "advance"]
    ax.plot(places, np.full(len(chosen), bottom), "^", color=INK, clip_on=False)
    ax.set(ylim=(bottom, None), ylabel="across, turn (mm)")
    ax.set_xlabel("advance (mm); grey: pushed off centre on purpose; triangles: steps above")
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4)
    columns = ["steered", "step", "advance", "x", "y", "yaw", "offset", "heading", "controlled"]
    return figure, steering[columns].assign(shown=steering.index.isin(chosen).astype(int))


def outline_from_above(x: float, y: float, angle: float) -> np.ndarray:
    """Closed outline (5, 2) in mm, along and across the push, of a block at x, y (mm) turned by `angle` (rad)."""
    corners = 0.5 * np.array([[-LENGTH, -WIDE], [LENGTH, -WIDE], [LENGTH, WIDE], [-LENGTH, WIDE], [-LENGTH, -WIDE]])
    return turned(corners, angle) + [x, y]


def _from_above(ax: Axes, row: tuple, factor: float) -> np.ndarray:
    """Draw one step: block, goal line, contact and heading of the next 1 mm; return the block's outline."""
    angle = factor * row.yaw / RADIUS_OF_GYRATION
    outline = outline_from_above(row.x, factor * row.y, angle)
    place = outline_from_above(0.0, 0.0, 0.0)
    ax.plot(place[:, 1], place[:, 0], color=GREY, linewidth=0.7, linestyle=":")
    ax.fill(outline[:, 1], outline[:, 0], facecolor="#EAD7BD", edgecolor=INK, linewidth=0.9, alpha=0.9)
    ax.axvline(0.0, color=GREY, linewidth=0.8, linestyle=(0, (4, 2)))
    centre = np.array([row.x, factor * row.y])
    nose = centre + turned([0.5 * LENGTH, 0.0], angle)
    ax.plot([centre[1], nose[1]], [centre[0], nose[0]], color=INK, linewidth=0.6)
    contact = centre + turned([-0.5 * LENGTH, row.offset], angle)
    tail = contact - ARROW * unit(factor * row.heading)
    arrow(ax, tail[::-1], contact[::-1], RED, linewidth=1.4, mutation_scale=8)
    ax.plot(contact[1], contact[0], "o", color=RED, markersize=3)
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_title(f"{row.advance:.0f} mm", loc="center", fontsize=7.5)
    return outline


def draw_tower(ax: Axes, poses: np.ndarray, sizes: np.ndarray, painted: Mapping[int, Colour]) -> pd.DataFrame:
    """Draw the blocks in mm, in the colour of wood or as `painted`; return block, x, y, z (m), qw to qz.

    poses: (54, 7), m and unit quaternions; rows of NaN are left out.  sizes: (54, 3), m.
    """
    c, s, ce, se = np.cos(AZIMUTH), np.sin(AZIMUTH), np.cos(ELEVATION), np.sin(ELEVATION)
    picture = np.array([[-s, c, 0.0], [-se * c, -se * s, ce]])
    camera = np.array([ce * c, ce * s, se])
    light = LIGHT / np.linalg.norm(LIGHT)
    present = np.flatnonzero(np.isfinite(poses[:, 0]))
    level = np.round(poses[present, 2] / (2 * HALF_LAYER) - 0.5)
    order = present[np.lexsort((poses[present, :2] @ camera[:2], level))]
    polygons, shades = [], []
    for block in order:
        matrix = rotation_matrix(poses[block, 3:])
        for axis, side, corners in FACES:
            normal = side * matrix[:, axis]
            if normal @ camera <= 0:
                continue
            points = poses[block, :3] + (np.array(corners) * sizes[block] / 2.0) @ matrix.T
            polygons.append(1e3 * points @ picture.T)
            shades.append(np.array(painted.get(block, WOOD)) * (0.55 + 0.45 * max(normal @ light, 0.0)))
    ax.add_collection(PolyCollection(polygons, facecolors=shades, edgecolors=INK, linewidths=0.3))
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_axis_off()
    table = pd.DataFrame(poses, columns=["x", "y", "z", "qw", "qx", "qy", "qz"])
    table.insert(0, "block", np.arange(BLOCKS))
    return table


@house_style
def figure_5_5a(poses: np.ndarray, sizes: np.ndarray) -> Drawn:
    """Figure 5-5A: the simulated tower; poses: (54, 7), m and unit quaternions; sizes: (54, 3), m."""
    figure = new_figure(WIDTH / 2, 4.2)
    return figure, draw_tower(figure.add_subplot(), poses, sizes, {})


@house_style
def figure_game(frames: Sequence[np.ndarray], sizes: np.ndarray, titles: Sequence[str], blocks: Sequence[int]) -> Drawn:
    """Figure with a strip of pictures of one game: current block in red, blocks already placed on top in blue.

    `frames`: poses (54, 7) each, the untouched tower first; `sizes`: (54, 3), m; `blocks`: current block of each
    frame, -1 for none.
    """
    figure = new_figure(height=2.1)
    axes = figure.subplots(1, len(frames), sharex=True, sharey=True, squeeze=False)[0]
    tables = []
    for number, (ax, poses, title, block) in enumerate(zip(axes, frames, titles, blocks)):
        placed = np.flatnonzero(poses[:, 2] > frames[0][:, 2] + STACKED)
        painted = dict.fromkeys(placed, PLACED) | {block: PUSHED}
        tables.append(draw_tower(ax, poses, sizes, painted).assign(frame=number))
        ax.set_title(textwrap.fill(title, 10), fontsize=7, y=1.0, va="bottom")
    return figure, pd.concat(tables, ignore_index=True)
