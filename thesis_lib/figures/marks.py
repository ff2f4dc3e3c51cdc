"""Notes and arrows of all figures; directions in the plane."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from thesis_lib.figures.style import INK


def note(ax: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], **look: Any) -> None:
    """Text beside a point of the panel, `offset` in points."""
    ax.annotate(text, at, xytext=offset, textcoords="offset points", **look)


def white_box(pad: float, alpha: float | None = None) -> dict:
    """Box behind a text, so that it can be read over what is drawn."""
    return {"facecolor": "white", "edgecolor": "none", "pad": pad, "alpha": alpha}


def turned(points: np.ndarray, theta: float) -> np.ndarray:
    """Points (n, 2) turned counter-clockwise by theta (rad) about the origin."""
    cos, sin = np.cos(theta), np.sin(theta)
    return np.asarray(points, dtype=float) @ np.array([[cos, sin], [-sin, cos]])


def unit(angle: float) -> np.ndarray:
    """Unit vector (2,) at an angle (rad) from the x axis."""
    return np.array([np.cos(angle), np.sin(angle)])


def arrow(ax: Axes, start: np.ndarray, end: np.ndarray, color: str = INK, style: str = "-|>", **look: float) -> None:
    """Arrow from `start` to `end`, both (2,)."""
    props = {"arrowstyle": style, "color": color, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=props | look)
