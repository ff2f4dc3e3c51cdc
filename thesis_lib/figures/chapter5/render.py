"""Figure 5-5A and frames of a game: pictures of the tower, without OpenGL, so that they look the same everywhere.

Parallel projection: with camera azimuth α and elevation ε, the picture's axes are r = (−sin α, cos α, 0) and
w = (−sin ε cos α, −sin ε sin α, cos ε), the direction to the camera d = (cos ε cos α, cos ε sin α, sin ε).  Boxes are
painted from bottom to top, and from far to near within a layer, which is right for a camera above the layers.
"""

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from thesis_lib.figures.style import INK, WIDTH, Drawn, house_style, new_figure
from thesis_lib.jenga.tower.tower_model import BLOCKS
from thesis_lib.mechanics.space import rotation_matrix

AZIMUTH, ELEVATION = np.radians(35.0), np.radians(22.0)
Colour = tuple[float, float, float]
STACKED = 10e-3  # m; a block this much higher than at first was placed on top
WOOD, PUSHED, PLACED = (0.87, 0.72, 0.53), (0.80, 0.36, 0.22), (0.45, 0.62, 0.80)
LIGHT = np.array([0.55, 0.25, 0.80])
HALF_LAYER = 7.5e-3  # m; half of the height that is painted as one layer
# corners of each face of the cube [-1, 1]^3, in order around it, and the axis it faces
FACES = [
    (axis, side, [np.insert(pair, axis, side) for pair in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    for axis in range(3)
    for side in (-1, 1)
]


def draw_tower(ax: Axes, poses: np.ndarray, sizes: np.ndarray, painted: Mapping[int, Colour]) -> pd.DataFrame:
    """Draw the blocks in mm, of wood apart from those `painted`; returns block, x, y, z (m), qw to qz.

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
    """The simulated tower; poses: (54, 7), m and unit quaternions; sizes: (54, 3), m."""
    figure = new_figure(WIDTH / 2, 4.2)
    return figure, draw_tower(figure.add_subplot(), poses, sizes, {})


@house_style
def figure_game(frames: Sequence[np.ndarray], sizes: np.ndarray, titles: Sequence[str], blocks: Sequence[int]) -> Drawn:
    """Strip of pictures of one game: the current block in red, those already placed on top in blue.

    `frames`: poses (54, 7) each, the untouched tower first; `sizes`: (54, 3), m; `blocks`: the current one of each
    frame, -1 for none.
    """
    figure = new_figure(WIDTH, 2.1)
    axes = figure.subplots(1, len(frames), sharex=True, sharey=True, squeeze=False)[0]
    tables = []
    for number, (ax, poses, title, block) in enumerate(zip(axes, frames, titles, blocks)):
        placed = np.flatnonzero(poses[:, 2] > frames[0][:, 2] + STACKED)
        painted = dict.fromkeys(placed, PLACED) | {block: PUSHED}
        tables.append(draw_tower(ax, poses, sizes, painted).assign(frame=number))
        ax.set_title(textwrap.fill(title, 10), fontsize=7, y=1.0, va="bottom")
    return figure, pd.concat(tables, ignore_index=True)
