"""Figures 4-1 and 4-2: the body in contact with its energy ellipse, and the energy ellipsoid of contact wrenches.

    ellipse    (c + M_C v_C)ᵀ M_C⁻¹ (c + M_C v_C) ≤ v_Cᵀ M_C v_C                          equation 4.5
    ellipsoid  |z + B w|² ≤ |z|²,   z = (v_x, v_y, k ω),  w = (c_t, c_n, τ),  z⁺ = z + B w

The ellipsoid is the image of the ball of all velocities with at most the initial kinetic energy.  Its section τ = 0 is
the ellipse; impulses in its part with v_n⁺ ≥ 0 neither penetrate nor gain energy.  Impulses (c_t, c_n) and τ/k, the
couple about the contact point over the radius of gyration, are in N s.  The impact is that of figures 3-1 to 3-3.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from thesis_lib.bodies.body import Body
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SHADE, Drawn, ImpulseAxis, house_style, new_figure
from thesis_lib.learners.features import impulse_of
from thesis_lib.thesis.figures.chapter3.contact_space import EXAMPLE, body_on_surface, draw_ellipse

MERIDIANS, POINTS = 12, 73


@house_style
def figure_4_1(body: Body) -> Drawn:
    """Figure 4-1: planar body that touches a level surface, and the energy ellipse of this impact."""
    axis = ImpulseAxis.of(body.mass is not None)
    figure = new_figure(height=3.2)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    outline = _draw_body(left, body)
    left.set_title("(a)")
    ellipse = draw_ellipse(right, EXAMPLE.space(body), axis, labels=True)
    axis.label(right)
    right.set_title("(b)")
    figure.legend(loc="outside lower center", ncols=3)
    table = pd.concat([outline.assign(panel="a"), ellipse.assign(panel="b")], ignore_index=True)
    return figure, table[["panel", "series", "x", "y", "c_t", "c_n"]]


def _draw_body(ax: Axes, body: Body) -> pd.DataFrame:
    sketch, outline, centre, contact = body_on_surface(ax, body)
    v, size = np.array(EXAMPLE.v), body.shape.extent
    v_c = v[:2] + v[2] * np.array([centre[1], contact[0]])
    scale = 0.6 * size / np.hypot(*v_c)
    arrows = {
        r"$\mathbf{v}$": (centre, scale * v[:2], GREEN),
        r"$\mathbf{v}_C$": (contact, scale * v_c, RED),
        r"$\mathbf{r}$": (centre, contact - centre, BLUE),
    }
    left, right = outline[:, 0].min() - 0.5 * size, outline[:, 0].max() + 0.5 * size
    for name, (start, vector, color) in arrows.items():
        sketch.arrow(name.strip("$"), start, vector, color)
        side = np.array([vector[1], -vector[0]]) / np.hypot(*vector)
        side *= (np.sign(side[0]) or 1.0) * (-1.0 if "r" in name else 1.0)  # r and v are nearly parallel
        sketch.label(start + 0.6 * vector + 0.16 * size * side, name, color)
    sketch.label(contact + size * np.array([-0.17, 0.12]), "$C$")
    table = sketch.table()
    sketch.ground(left, right, 0.15 * size)
    bottom = min(-0.2 * size, (contact + scale * v_c)[1] - 0.1 * size)
    ax.set(xlim=(left, right), ylim=(bottom, outline[:, 1].max() + 0.15 * size))
    return table.loc[~table["series"].isin(["centre of mass", "C"]), ["series", "x", "y"]]


@house_style
def figure_4_2(body: Body) -> Drawn:
    """Figure 4-2: energy ellipsoid of wrenches, plane of maximum compression, energy ellipse of point impulses."""
    unit = ImpulseAxis.of(body.mass is not None)
    curves = _ellipsoid(_impact(body))
    figure = new_figure(4.6, 4.4)
    ax = figure.add_subplot(projection="3d", computed_zorder=False)
    looks = {
        "feasible": {"color": BLUE, "linewidth": 0.7, "alpha": 0.75},
        "penetrates": {"color": GREY, "linewidth": 0.5, "alpha": 0.6},
        "maximum compression": {"color": INK, "linewidth": 1.2, "linestyle": (0, (1, 1.2))},
        "energy ellipse, τ = 0": {"color": RED, "linewidth": 2.0},
    }
    for (series, curve), points in curves.groupby(["series", "curve"], sort=False):
        xyz = unit.factor * points[["c_t", "tau_over_k", "c_n"]].to_numpy().T
        ax.plot(*xyz, label=series if curve == 0 else None, **looks[series])
    disc = unit.factor * curves.loc[curves["series"] == "maximum compression", ["c_t", "tau_over_k", "c_n"]]
    ax.add_collection3d(Poly3DCollection([disc.to_numpy()], facecolor=SHADE, alpha=0.5, linewidth=0))
    ax.plot([0.0], [0.0], [0.0], "o", color=INK, markersize=4, label="no impulse")
    ax.set(xlabel=f"$c_t$ ({unit.unit})", ylabel=rf"$\tau/k$ ({unit.unit})", zlabel=f"$c_n$ ({unit.unit})")
    xyz = unit.factor * curves[["c_t", "tau_over_k", "c_n"]].to_numpy()
    low, high = xyz.min(axis=0), xyz.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=0.9)
    ax.view_init(elev=18.0, azim=-50.0)
    ax.locator_params(nbins=4)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis._axinfo["grid"].update(color="0.9", linewidth=0.5)  # mplot3d has no public way to set it
    figure.legend(loc="outside lower center", ncols=3)
    return figure, curves


def _impact(body: Body) -> Impacts:
    q = np.array([[0.0, 0.0, EXAMPLE.theta]])
    v, zero = np.array([EXAMPLE.v]), np.zeros(1, int)
    mass = body.mass or 1.0
    return Impacts(zero, zero, q, v, v, EXAMPLE.contact_point(body), k_g=body.radius_of_gyration, mass=mass)


def _ellipsoid(impact: Impacts) -> pd.DataFrame:
    """Curves on the ellipsoid about the direction of the contact normal: series, curve, c_t, c_n, tau_over_k."""
    k_g, r = impact.k_g, impact.r[0]
    z = impact.v_pre[0] * [1.0, 1.0, k_g]
    radius = np.linalg.norm(z)
    n = np.array([0.0, 1.0, r[0] / k_g])
    n /= np.linalg.norm(n)
    t = np.array([1.0, 0.0, -r[1] / k_g])
    t -= (t @ n) * n
    t /= np.linalg.norm(t)
    b = np.cross(n, t)
    around, up = np.linspace(0.0, 2.0 * np.pi, POINTS), np.linspace(-0.5 * np.pi, 0.5 * np.pi, POINTS)
    parts = []

    def add(series: str, curve: int, directions: np.ndarray) -> None:
        v_post = radius * directions / [1.0, 1.0, k_g]
        w = impulse_of(v_post - impact.v_pre, impact, wrench=True)
        wrench = {"c_t": w[:, 0], "c_n": w[:, 1], "tau_over_k": w[:, 2] / k_g}
        parts.append(pd.DataFrame({"series": series, "curve": curve} | wrench))

    def on_sphere(height: np.ndarray, angle: np.ndarray) -> np.ndarray:
        cos = np.cos(height)[:, None]
        return np.sin(height)[:, None] * n + cos * (np.cos(angle)[:, None] * t + np.sin(angle)[:, None] * b)

    for side, series in ((-1.0, "penetrates"), (1.0, "feasible")):
        for i in range(MERIDIANS):
            rows = up[side * up >= 0.0]
            add(series, i, on_sphere(rows, np.full(len(rows), 2.0 * np.pi * i / MERIDIANS)))
        for j in (1, 2):
            add(series, MERIDIANS + j, on_sphere(np.full(POINTS, side * j * np.pi / 6.0), around))
    add("maximum compression", 0, on_sphere(np.zeros(POINTS), around))
    # a point impulse does not change z·b, which gives a circle of the sphere at that height
    fixed = z @ b / radius
    circle = np.cos(around)[:, None] * t + np.sin(around)[:, None] * n
    add("energy ellipse, τ = 0", 0, fixed * b + np.sqrt(1.0 - fixed**2) * circle)
    return pd.concat(parts, ignore_index=True)
