"""Figures 3-1, 3-2 and 3-3: the body on the surface, the energy ellipse, and the region that each law reaches.

| on paper   | in code      | unit | shape  |                                                             |
|------------|--------------|------|--------|-------------------------------------------------------------|
| θ, v       | `Example`    | rad, m/s | (3,) | state of the impact shown in the schematic figures          |
| r          | `r`          | m    | (1, 2) | contact point, from the shape                               |
| c          | `c_t`, `c_n` | N s  |        | impulse; outlines of sets are closed curves in this plane   |

All geometry comes from the functions used for computing (thesis section 3.3.1).  The outline of a law's region is the
image of the edge of the box 0 ≤ μ < ∞, 0 ≤ ε ≤ 1.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Arc

from thesis_lib.bodies.body import Body
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.law import Law
from thesis_lib.contact.space import (
    ContactSpace,
    contact_space,
    energy_ellipse,
    line_of_maximum_compression,
    line_of_sticking,
)
from thesis_lib.figures.law_style import style_of
from thesis_lib.figures.style import GREY, INK, PANELS, Drawn, ImpulseAxis, house_style, new_figure
from thesis_lib.impact_study.predictive_range import admissible_outline, region
from thesis_lib.impact_study.tables import VARIANTS

SHADE = "#DCE6F0"
# the thesis's grouping of figure 3-3
GROUPS = {
    "a": ("drumwright_shell", "anitescu_potra_poisson"),
    "b": ("anitescu_potra_newton", "mirtich", "wang_mason"),
    "c": ("whittaker",),
}


@dataclass(frozen=True)
class Example:
    """The impact of figures 3-1 to 3-3: fast slip to the right, contact to the right of the centre of mass."""

    theta: float = -0.6  # rad
    v: tuple[float, float, float] = (1.2, -1.5, 10.0)  # m/s, m/s, rad/s

    def contact_point(self, body: Body) -> np.ndarray:
        """r, (1, 2) in m."""
        return body.shape.contact_point(np.array([self.theta]))

    def space(self, body: Body) -> ContactSpace:
        """Contact space of this one impact, arrays (1,)."""
        v = np.array([self.v])
        return contact_space(v, self.contact_point(body), mass=body.mass or 1.0, k_g=body.radius_of_gyration)


EXAMPLE = Example()


@house_style
def figure_3_1(body: Body, example: Example = EXAMPLE) -> Drawn:
    """Planar body that touches the surface: pose, velocity, contact point C and contact frame."""
    r = example.contact_point(body)[0]
    centre, contact = np.array([0.0, -r[1]]), np.array([r[0], 0.0])
    cos, sin = np.cos(example.theta), np.sin(example.theta)
    outline = centre + body.shape.outline() @ np.array([[cos, sin], [-sin, cos]])
    size = body.shape.extent
    speed = 0.55 * size / np.hypot(*example.v[:2])
    axis = centre + np.array([[-1.0], [1.35]]) * size * np.array([cos, sin])
    vectors = {
        "r": (centre, contact - centre),
        "t": (contact, np.array([0.75 * size, 0.0])),
        "n": (contact, np.array([0.0, 0.75 * size])),
        "v": (centre, speed * np.array(example.v[:2])),
    }

    figure = new_figure(4.0, 2.3)
    ax = figure.add_subplot()
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.fill(*outline.T, facecolor=SHADE, edgecolor=INK, linewidth=1.2)
    left, right = outline[:, 0].min() - 1.1 * size, outline[:, 0].max() + 0.9 * size
    ax.fill([left, right, right, left], [0, 0, -0.16 * size, -0.16 * size], fill=False, linewidth=0, hatch="////")
    ax.plot([left, right], [0, 0], color=INK, linewidth=1.2)
    ax.plot(*axis.T, color=GREY, linestyle=(0, (6, 3)), linewidth=0.8)
    ax.plot([centre[0], centre[0] + 1.35 * size], [centre[1]] * 2, color=GREY, linewidth=0.8)
    turn = sorted((0.0, np.degrees(example.theta)))
    ax.add_patch(Arc(centre, 2.0 * size, 2.0 * size, theta1=turn[0], theta2=turn[1], color=INK, linewidth=0.8))
    half = 0.5 * example.theta
    _label(ax, centre + 1.12 * size * np.array([np.cos(half), np.sin(half)]), r"$\theta$")
    colors = {"r": "#0072B2", "t": "#D55E00", "n": "#D55E00", "v": "#009E73"}
    sides = {"r": (-0.13, 0.1), "t": (0.05, 0.13), "n": (0.12, 0.0), "v": (0.14, 0.0)}
    for name, (start, vector) in vectors.items():
        arrow = {"arrowstyle": "-|>", "color": colors[name], "linewidth": 1.4, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", start + vector, start, arrowprops=arrow)
        share = 0.5 if name == "r" else 1.0
        _label(ax, start + share * vector + size * np.array(sides[name]), rf"$\mathbf{{{name}}}$", colors[name])
    ax.plot(*centre, "o", color=INK, markersize=4)
    ax.plot(*contact, "o", color=INK, markersize=4)
    _label(ax, contact + size * np.array([-0.32, 0.1]), "$C$")
    _label(ax, centre + size * np.array([-0.5, 0.16]), r"$m,\ I$")
    corner = np.array([left + 0.12 * size, 0.35 * size])
    for name, vector in (("x", (0.4 * size, 0.0)), ("y", (0.0, 0.4 * size))):
        tip = corner + np.array(vector)
        ax.annotate("", tip, corner, arrowprops={"arrowstyle": "->", "color": INK, "shrinkA": 0, "shrinkB": 0})
        _label(ax, tip + 0.25 * np.array(vector), f"${name}$")
    ax.set_xlim(left, right)

    rows = [("outline", *point) for point in outline]
    rows += [("centre of mass", *centre), ("C", *contact)]
    rows += [(name, *point) for name, (start, v) in vectors.items() for point in (start, start + v)]
    return figure, pd.DataFrame(rows, columns=["series", "x", "y"])


@house_style
def figure_3_2(body: Body, example: Example = EXAMPLE) -> Drawn:
    """Energy ellipse with the admissible set shaded, and the lines of sticking and of maximum compression."""
    space, unit = example.space(body), ImpulseAxis.of(body.mass is not None)
    figure = new_figure(4.6, 3.6, layout="compressed")
    ax = figure.add_subplot()
    rows = draw_ellipse(ax, space, unit, labels=True)
    _impulse_axes(ax, unit)
    figure.legend(loc="outside right upper")
    return figure, rows


@house_style
def figure_3_3(body: Body, coverage: pd.DataFrame | None = None, example: Example = EXAMPLE) -> Drawn:
    """Regions of the six laws in the energy ellipse, as published (upper row) and as defined (lower row).

    `coverage` (law, share) gives the mean share of the admissible set covered by a law, for the legend.
    """
    space, unit = example.space(body), ImpulseAxis.of(body.mass is not None)
    shares = {} if coverage is None else dict(zip(coverage["law"], coverage["share"]))
    figure = new_figure(5.0, 5.8, layout="compressed")
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    parts = []
    for row, (variant, names) in zip(axes, VARIANTS.items()):
        for ax, (letter, members) in zip(row, GROUPS.items()):
            ellipse = draw_ellipse(ax, space, unit)
            if not parts:  # the same in every panel
                parts.append(ellipse.assign(variant="", panel="all"))
            for name in members:
                law = LAWS[names[SIX_LAWS.index(name)]]
                outline = region_outline(law, space)
                label = style_of(name).label
                if law.name in shares:
                    label += f" ({100 * shares[law.name]:.0f} %)"
                draw_region(ax, law, outline, unit, label)
                series = pd.DataFrame(outline, columns=["c_t", "c_n"]).assign(series=law.name)
                parts.append(series.assign(variant=variant, panel=letter))
            ax.label_outer()
            ax.set_title(f"({letter}) {PANELS[variant]}")
            ax.legend(loc="upper left", bbox_to_anchor=(-0.1, -0.05 if variant == "as_published" else -0.19))
        row[0].set_ylabel(f"normal impulse $c_n$ ({unit.unit})")
    axes[-1, 1].set_xlabel(f"tangential impulse $c_t$ ({unit.unit})")
    table = pd.concat(parts, ignore_index=True)
    return figure, table[["variant", "panel", "series", "c_t", "c_n"]]


def region_outline(law: Law, space: ContactSpace, points: int = 25) -> np.ndarray:
    """Closed outline (4 (points − 1) + 1, 2) in N s of what a law can predict for the one impact in `space`.

    It is the image of the edge of the parameter box.  If a law maps parts of the box onto each other, its region may
    extend a little beyond it.
    """
    c = np.stack([part[:, :, 0] for part in region(law, space, points=points)], axis=-1)
    return np.concatenate([c[0, :-1], c[:-1, -1], c[-1, :0:-1], c[:0:-1, 0], c[:1, 0]])


def draw_region(ax: Axes, law: Law, outline: np.ndarray, unit: ImpulseAxis, label: str) -> None:
    """Outline of a law's region, filled with its hatch."""
    style = style_of(law.name)
    ax.fill(*(unit.factor * outline.T), fill=False, hatch=style.hatch, edgecolor=style.color, linewidth=0)
    ax.plot(*(unit.factor * outline.T), color=style.color, linestyle=style.dash, linewidth=1.5, label=label)
    # some regions gain energy and leave the ellipse
    ax.set_ylim(top=max(ax.get_ylim()[1], 1.03 * unit.factor * float(outline[:, 1].max())))


def draw_ellipse(ax: Axes, space: ContactSpace, unit: ImpulseAxis, *, labels: bool = False) -> pd.DataFrame:
    """Energy ellipse of the one impact in `space`, its lines and shaded admissible set; returns the plotted points."""
    ellipse = energy_ellipse(space)
    outline = ellipse.outline(points=121)[0]
    shade = np.stack([part[::6, 0] for part in admissible_outline(space)], axis=-1)
    low, high = outline.min(axis=0), outline.max(axis=0)
    margin = 0.08 * (high - low)
    low, high = np.minimum(low, 0.0) - margin, np.maximum(high, 0.0) + margin
    c_n = np.array([low[1], high[1]])
    c_t = np.array([low[0], high[0]])
    curves = {
        "energy ellipse": (outline, {"color": INK, "linewidth": 1.1}),
        "line of sticking": (
            np.stack([line_of_sticking(space, c_n), c_n], axis=-1),
            {"color": "0.35", "linestyle": (0, (5, 2)), "linewidth": 0.9},
        ),
        "line of maximum compression": (
            np.stack([c_t, line_of_maximum_compression(space, c_t)], axis=-1),
            {"color": "0.35", "linestyle": (0, (1, 1.2)), "linewidth": 1.1},
        ),
    }
    ax.fill(*(unit.factor * shade.T), color=SHADE, linewidth=0, label="admissible set" if labels else None)
    ax.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    ax.axvline(0.0, color="0.8", linewidth=0.6, zorder=0)
    for name, (points, look) in curves.items():
        ax.plot(*(unit.factor * points.T), label=name if labels else None, **look)
    ax.plot(*(unit.factor * ellipse.centre[0]), "+", color=INK, markersize=6, label="centre" if labels else None)
    ax.set(xlim=unit.factor * c_t, ylim=unit.factor * c_n, aspect="equal")
    parts = {"admissible set": shade, **{name: points for name, (points, _) in curves.items()}}
    parts["centre"] = ellipse.centre
    return pd.concat(
        [pd.DataFrame(points, columns=["c_t", "c_n"]).assign(series=name) for name, points in parts.items()],
        ignore_index=True,
    )[["series", "c_t", "c_n"]]


def _impulse_axes(ax: Axes, unit: ImpulseAxis) -> None:
    ax.set(xlabel=f"tangential impulse $c_t$ ({unit.unit})", ylabel=f"normal impulse $c_n$ ({unit.unit})")


def _label(ax: Axes, at: np.ndarray, text: str, color: str = INK) -> None:
    ax.text(*at, text, color=color, ha="center", va="center", fontsize=10)
