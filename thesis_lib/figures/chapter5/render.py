"""Pictures of the tower, drawn without OpenGL so that they look the same on every machine.

Parallel projection: with camera azimuth α and elevation ε, the picture's axes are r = (−sin α, cos α, 0) and
w = (−sin ε cos α, −sin ε sin α, cos ε), the direction to the camera d = (cos ε cos α, cos ε sin α, sin ε).  Boxes are
painted from bottom to top, and from far to near within a layer, which is right for a camera above the layers.
"""

import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from thesis_lib.figures.style import INK, WIDTH, Drawn, house_style, new_figure
from thesis_lib.jenga.tower.tower_model import BLOCKS, rotation

AZIMUTH, ELEVATION = np.radians(35.0), np.radians(22.0)
WOOD, PUSHED, PLACED = (0.87, 0.72, 0.53), (0.80, 0.36, 0.22), (0.45, 0.62, 0.80)
LIGHT = np.array([0.55, 0.25, 0.80])
HALF_LAYER = 7.5e-3  # m; half of the height that is painted as one layer
# corners of each face of the cube [-1, 1]^3, in order around it, and the axis it faces
FACES = [
    (axis, side, [np.insert(pair, axis, side) for pair in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    for axis in range(3)
    for side in (-1, 1)
]


def draw_tower(axes: Axes, poses: np.ndarray, sizes: np.ndarray, colours: np.ndarray | None = None) -> None:
    """Draw the blocks into `axes`, in mm.

    poses: (54, 7), m and quaternions; rows of NaN are left out.  sizes: (54, 3), m.  colours: (54, 3), default wood.
    """
    colours = np.tile(WOOD, (BLOCKS, 1)) if colours is None else np.asarray(colours)
    c, s, ce, se = np.cos(AZIMUTH), np.sin(AZIMUTH), np.cos(ELEVATION), np.sin(ELEVATION)
    picture = np.array([[-s, c, 0.0], [-se * c, -se * s, ce]])
    camera = np.array([ce * c, ce * s, se])
    light = LIGHT / np.linalg.norm(LIGHT)
    present = np.flatnonzero(np.isfinite(poses[:, 0]))
    level = np.round(poses[present, 2] / (2 * HALF_LAYER) - 0.5)
    order = present[np.lexsort((poses[present, :2] @ camera[:2], level))]
    polygons, shades = [], []
    for block in order:
        matrix = rotation(poses[block, 3:])
        for axis, side, corners in FACES:
            normal = side * matrix[:, axis]
            if normal @ camera <= 0:
                continue
            points = poses[block, :3] + (np.array(corners) * sizes[block] / 2.0) @ matrix.T
            polygons.append(1e3 * points @ picture.T)
            shades.append(colours[block] * (0.55 + 0.45 * max(normal @ light, 0.0)))
    axes.add_collection(PolyCollection(polygons, facecolors=shades, edgecolors=INK, linewidths=0.3))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set_axis_off()


def colours_of(highlighted: dict[int, tuple[float, float, float]]) -> np.ndarray:
    """Colours (54, 3): wood, except for the given blocks."""
    colours = np.tile(WOOD, (BLOCKS, 1))
    for block, colour in highlighted.items():
        colours[block] = colour
    return colours


def _table(poses: np.ndarray) -> pd.DataFrame:
    names = ["x", "y", "z", "qw", "qx", "qy", "qz"]
    return pd.DataFrame(poses, columns=names).assign(block=np.arange(BLOCKS))[["block", *names]]


@house_style
def tower_figure(poses: np.ndarray, sizes: np.ndarray, colours: np.ndarray | None = None) -> Drawn:
    """One picture of a tower (figure 5-5A); arguments as in `draw_tower`.  Table: block, x, y, z (m), qw to qz."""
    figure = new_figure(WIDTH / 2, 4.2)
    draw_tower(figure.add_subplot(), poses, sizes, colours)
    return figure, _table(poses)


@house_style
def strip_figure(
    frames: Sequence[np.ndarray], sizes: np.ndarray, titles: Sequence[str], colours: Sequence[np.ndarray] | None = None
) -> Drawn:
    """Frames of a game (poses (54, 7) each) side by side, on one scale.  Table as above, with the column frame."""
    figure = new_figure(WIDTH, 2.1)
    axes = figure.subplots(1, len(frames), sharex=True, sharey=True, squeeze=False)[0]
    for number, (ax, poses, title) in enumerate(zip(axes, frames, titles)):
        draw_tower(ax, poses, sizes, None if colours is None else colours[number])
        ax.set_title(textwrap.fill(title, 10), fontsize=7, y=1.0, va="bottom")
    tables = [_table(poses).assign(frame=number) for number, poses in enumerate(frames)]
    return figure, pd.concat(tables, ignore_index=True)
