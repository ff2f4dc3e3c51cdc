"""Sketches of planar mechanisms to scale; notes and arrows for all figures; directions in the plane.

A `Sketch` draws on one panel and keeps the points drawn: the table of the figure contains the geometry of the picture.
"""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.style import GREY, INK, SHADE

FONT = 9


def note(ax: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], **look: Any) -> None:
    """Write text beside a point of the panel, `offset` in points."""
    ax.annotate(text, at, xytext=offset, textcoords="offset points", **look)


def white_box(pad: float, alpha: float | None = None) -> dict:
    """Return a white box behind a text, which keeps it legible over a drawing."""
    return {"facecolor": "white", "edgecolor": "none", "pad": pad, "alpha": alpha}


def turned(points: np.ndarray, theta: float) -> np.ndarray:
    """Return points (n, 2) rotated counter-clockwise by theta (rad) about the origin."""
    cos, sin = np.cos(theta), np.sin(theta)
    return np.asarray(points, dtype=float) @ np.array([[cos, sin], [-sin, cos]])


def unit(angle: float) -> np.ndarray:
    """Return the unit vector (2,) at an angle (rad) from the x axis."""
    return np.array([np.cos(angle), np.sin(angle)])


def arrow(ax: Axes, start: np.ndarray, end: np.ndarray, color: str = INK, style: str = "-|>", **look: float) -> None:
    """Draw an arrow from `start` to `end`, both (2,)."""
    props = {"arrowstyle": style, "color": color, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=props | look)


class Sketch:
    """One panel without axes, true to scale, that keeps the points it draws; `tilt` (rad) rotates everything."""

    def __init__(self, ax: Axes, panel: str = "", tilt: float = 0.0) -> None:
        ax.set_axis_off()
        ax.set_aspect("equal")
        self.ax, self.panel, self.tilt = ax, panel, tilt
        self._parts: list[pd.DataFrame] = []

    def keep(self, series: str, points: np.ndarray, **columns: object) -> np.ndarray:
        """Add points (n, 2) to the table, in the axes of the panel after the tilt; return them."""
        points = turned(np.atleast_2d(points), self.tilt)
        self._parts.append(pd.DataFrame(points, columns=["x", "y"]).assign(panel=self.panel, series=series, **columns))
        return points

    def table(self) -> pd.DataFrame:
        """Return everything drawn so far: panel, series, x, y in m and further columns kept."""
        table = pd.concat(self._parts, ignore_index=True)
        first = ["panel", "series", "x", "y"]
        return table[first + [name for name in table.columns if name not in first]]

    def line(self, series: str, points: np.ndarray, *, t: np.ndarray | float | None = None, **look: object) -> None:
        """Draw a polyline through points (n, 2); `t`, one time or n times in s, is added to the table."""
        points = self.keep(series, points, **({} if t is None else {"t": t}))
        self.ax.plot(*points.T, **({"color": INK, "linewidth": 1.1} | look))

    def fill(self, series: str, points: np.ndarray, **look: object) -> None:
        """Draw a filled, closed shape."""
        defaults = {"facecolor": SHADE, "edgecolor": INK, "linewidth": 1.1}
        self.ax.fill(*self.keep(series, points).T, **(defaults | look))

    def point(self, series: str, at: np.ndarray, **look: object) -> None:
        """Draw a dot at `at` (2,)."""
        self.ax.plot(*self.keep(series, at).T, **({"marker": "o", "color": INK, "markersize": 3.5} | look))

    def arrow(self, series: str, start: np.ndarray, vector: np.ndarray, color: str = INK) -> None:
        """Draw an arrow from `start` along `vector`, both (2,)."""
        tail, tip = self.keep(series, np.stack([start, np.add(start, vector)]))
        self._arrow(tail, tip, "-|>", color, 1.3)

    def dimension(self, series: str, a: np.ndarray, b: np.ndarray, color: str = INK) -> None:
        """Draw a line with arrow heads at both ends a and b, (2,)."""
        a, b = self.keep(series, np.stack([a, b]))
        self._arrow(a, b, "<|-|>", color, 0.8)

    def arc(self, series: str, centre: np.ndarray, radius: float, start: float, end: float, color: str = INK) -> None:
        """Draw an arc with an arrow head at its end, from angle `start` to `end` in rad."""
        angle = np.linspace(start, end, 40)
        points = self.keep(series, np.asarray(centre) + radius * unit(angle).T)
        self.ax.plot(*points[:-1].T, color=color, linewidth=0.9)
        self._arrow(points[-3], points[-1], "-|>", color, 0.9)

    def label(self, at: np.ndarray, text: str, color: str = INK, **look: object) -> None:
        """Write text centred at `at` (2,)."""
        place = turned(np.atleast_2d(at), self.tilt)[0]
        self.ax.text(*place, text, color=color, **({"ha": "center", "va": "center", "fontsize": FONT} | look))

    def ground(self, left: float, right: float, depth: float) -> None:
        """Draw the surface y = 0 from `left` to `right`, hatched down to `depth` below it."""
        corners = turned(np.array([[left, 0.0], [right, 0.0], [right, -depth], [left, -depth]]), self.tilt)
        self.ax.fill(*corners.T, fill=False, linewidth=0, hatch="/////", edgecolor=GREY)
        self.line("ground", np.array([[left, 0.0], [right, 0.0]]))

    def axes_cross(self, at: np.ndarray, length: float) -> None:
        """Draw the directions x and y of the fixed frame at its origin `at` (2,)."""
        for name, vector in (("x", (length, 0.0)), ("y", (0.0, length))):
            self.arrow(f"axis {name}", at, np.array(vector))
            # beside the arrow head, because the surface may lie ahead of it
            self.label(np.add(at, vector) + 0.3 * length * np.array(vector[::-1]) / length, f"${name}$")

    def _arrow(self, start: np.ndarray, end: np.ndarray, style: str, color: str, width: float) -> None:
        arrow(self.ax, start, end, color, style, linewidth=width, mutation_scale=8)
        # an annotation does not extend the limits of the panel
        self.ax.update_datalim(np.stack([start, end]))
