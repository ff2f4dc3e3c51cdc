"""Figures 3-1 to 3-3 and 3-11: the body on the surface, the energy ellipse, and the region that each law can predict.

All geometry is computed by the functions of the analysis (thesis section 3.3.1).  The outline of a law's region is the
image of the edge of the box 0 ≤ μ < ∞, 0 ≤ ε ≤ 1.

Figure 3-11 explains unusual parameters by two impacts:

(a) μ = 0.  Of impacts with individual μ below `MU_ZERO`, the quarter with the contact point nearest to vertically below
    the centre of mass; of these, the impact with the largest misfit.  Without such impacts: the one with the least μ.
(b) Spin reversal.  Of impacts with measured impulse beyond the line of sticking, the impact at the median distance
    beyond it.  Without such impacts: the impact nearest to it.
"Beyond" is relative to the impulse without friction, c_t = 0 at the same c_n: friction has then reversed the slip
v_t + K_tn c_n that it opposed.  A change of sign of v_t is not enough: in a skewed contact the normal impulse alone can
cause it, and every law predicts this.  In ties, the first impact is used, so that equal data give equal figures.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Arc

from thesis_lib.bodies.body import Body
from thesis_lib.coefficients.cost import MeasuredImpulses, target_of
from thesis_lib.contact import LAWS, SIX_LAWS
from thesis_lib.contact.law import Law
from thesis_lib.contact.space import (
    beyond_sticking,
    contact_space,
    energy_ellipse,
    line_of_maximum_compression,
    line_of_sticking,
)
from thesis_lib.datasets.format.impacts import Impacts
from thesis_lib.figures.law_style import style_of
from thesis_lib.figures.planar_drawing import Sketch, turned, unit
from thesis_lib.figures.style import BLUE, GREEN, GREY, INK, RED, SHADE, Drawn, ImpulseAxis, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.mechanics.contact import Contact
from thesis_lib.thesis.impact_study.predictive_range import admissible_outline, region
from thesis_lib.thesis.impact_study.tables import MU_ZERO, VARIANTS

# the thesis's grouping of figure 3-3
GROUPS = {
    "a": ("drumwright_shell", "anitescu_potra_poisson"),
    "b": ("anitescu_potra_newton", "mirtich", "wang_mason"),
    "c": ("whittaker",),
}

HOLLOW = {"markerfacecolor": "none", "markeredgewidth": 1.3}
MARKS = {
    "measured impulse": {"marker": "X", "markersize": 7, "color": INK, "markeredgewidth": 0.6},
    "best of this impact": {"marker": "o", "markersize": 6, "color": RED} | HOLLOW,
    "ensemble prediction": {"marker": "s", "markersize": 5, "color": BLUE} | HOLLOW,
}


@dataclass(frozen=True)
class ExampleImpact:
    """Impact of figures 3-1 to 3-3: fast slip to the right, contact to the right of the centre of mass."""

    theta: float = -0.6  # rad
    v: tuple[float, float, float] = (1.2, -1.5, 10.0)  # m/s, m/s, rad/s

    def contact_point(self, body: Body) -> np.ndarray:
        """Contact point r, (1, 2) in m."""
        return body.shape.contact_point(np.array([self.theta]))

    def space(self, body: Body) -> Contact:
        """Contact space of this impact, arrays (1,)."""
        v = np.array([self.v])
        return contact_space(v, self.contact_point(body), mass=body.mass or 1.0, k_g=body.radius_of_gyration)


EXAMPLE = ExampleImpact()


@house_style
def figure_3_1(body: Body) -> Drawn:
    """Figure 3-1: planar body that touches the surface; pose, velocity, contact point C and contact frame."""
    figure = new_figure(4.0, 2.3)
    sketch, outline, centre, contact = body_on_surface(figure.add_subplot(), body)
    size = body.shape.extent
    speed = 0.55 * size / np.hypot(*EXAMPLE.v[:2])
    axis = centre + np.array([[-1.0], [1.35]]) * size * unit(EXAMPLE.theta)
    vectors = {
        "r": (centre, contact - centre),
        "t": (contact, np.array([0.75 * size, 0.0])),
        "n": (contact, np.array([0.0, 0.75 * size])),
        "v": (centre, speed * np.array(EXAMPLE.v[:2])),
    }

    left, right = outline[:, 0].min() - 1.1 * size, outline[:, 0].max() + 0.9 * size
    ax = sketch.ax
    ax.plot(*axis.T, color=GREY, linestyle=(0, (6, 3)), linewidth=0.8)
    ax.plot([centre[0], centre[0] + 1.35 * size], [centre[1]] * 2, color=GREY, linewidth=0.8)
    turn = sorted((0.0, np.degrees(EXAMPLE.theta)))
    ax.add_patch(Arc(centre, 2.0 * size, 2.0 * size, theta1=turn[0], theta2=turn[1], color=INK, linewidth=0.8))
    sketch.label(centre + 1.12 * size * unit(0.5 * EXAMPLE.theta), r"$\theta$")
    looks = {"r": (BLUE, (-0.13, 0.1)), "t": (RED, (0.05, 0.13)), "n": (RED, (0.12, 0.0)), "v": (GREEN, (0.14, 0.0))}
    for name, (start, vector) in vectors.items():
        color, beside = looks[name]
        sketch.arrow(name, start, vector, color)
        share = 0.5 if name == "r" else 1.0
        sketch.label(start + share * vector + size * np.array(beside), rf"$\mathbf{{{name}}}$", color)
    sketch.label(contact + size * np.array([-0.32, 0.1]), "$C$")
    sketch.label(centre + size * np.array([-0.5, 0.16]), r"$m,\ I$")
    table = sketch.table()[["series", "x", "y"]]
    sketch.ground(left, right, 0.16 * size)
    sketch.axes_cross(np.array([left + 0.12 * size, 0.35 * size]), 0.4 * size)
    ax.set_xlim(left, right)
    return figure, table


@house_style
def figure_3_2(body: Body) -> Drawn:
    """Figure 3-2: energy ellipse with shaded admissible set, and lines of sticking and of maximum compression."""
    space, axis = EXAMPLE.space(body), ImpulseAxis.of(body.mass is not None)
    figure = new_figure(4.6, 3.6, layout="compressed")
    ax = figure.add_subplot()
    rows = draw_ellipse(ax, space, axis, labels=True)
    axis.label(ax)
    figure.legend(loc="outside right upper")
    return figure, rows


@house_style
def figure_3_3(body: Body, coverage: pd.DataFrame) -> Drawn:
    """Figure 3-3: regions of the six laws in the energy ellipse, as published (upper row) and as defined (lower row).

    `coverage` (law, share) gives the mean share of the admissible set covered by a law, for the legend.
    """
    space, axis = EXAMPLE.space(body), ImpulseAxis.of(body.mass is not None)
    shares = dict(zip(coverage["law"], coverage["share"]))
    figure = new_figure(5.0, 5.8, layout="compressed")
    axes = figure.subplots(2, 3, sharex=True, sharey=True)
    parts = []
    for row, (variant, names) in zip(axes, VARIANTS.items()):
        for ax, (letter, members) in zip(row, GROUPS.items()):
            ellipse = draw_ellipse(ax, space, axis)
            if not parts:  # the same in every panel
                parts.append(ellipse.assign(variant="", panel="all"))
            for name in members:
                law = LAWS[names[SIX_LAWS.index(name)]]
                covered = f" ({100 * shares[law.name]:.0f} %)" if law.name in shares else ""
                label = style_of(name).label + covered
                drawn = draw_region(ax, law, space, axis, label)
                parts.append(drawn.assign(series=law.name, variant=variant, panel=letter))
            ax.label_outer()
            ax.set_title(f"({letter}) {variant.replace('_', ' ')}")
            ax.legend(loc="upper left", bbox_to_anchor=(-0.1, -0.05 if variant == "as_published" else -0.19))
        axis.label(row[0], x=False)
    axis.label(axes[-1, 1], y=False)
    return figure, pd.concat(parts, ignore_index=True)[["variant", "panel", "series", "c_t", "c_n"]]


@house_style
def figure_3_11(
    impacts: Impacts, individual: pd.DataFrame, ensemble: pd.DataFrame, law: str, *, mass_known: bool
) -> Drawn:
    """Figure 3-11: two impacts with unusual parameters; ellipse, region of `law`, measured, best, predicted impulses.

    `impacts`: all impacts studied; `individual`: trial, impact, law, mu, epsilon, misfit (N s); `ensemble`: law, mu,
    epsilon, of the same weighting.  Impulses are in N s, or in N s/kg without a mass.

    Raises:
        UserError: no impact qualifies.
    """
    axis = ImpulseAxis.of(mass_known)
    target = target_of(impacts)
    keys = pd.MultiIndex.from_arrays([impacts.trial, impacts.impact])
    parameters = individual[individual["law"] == law].set_index(["trial", "impact"]).reindex(keys)
    mu, epsilon, misfit = (parameters[name].to_numpy(float) for name in ("mu", "epsilon", "misfit"))
    fit = ensemble[ensemble["law"] == law].iloc[0]
    cases = {
        "a": (zero_friction_case(impacts, mu, misfit), r"$\mu = 0$"),
        "b": (spin_reversal_case(target), "spin reversal"),
    }
    figure = new_figure(height=4.3, layout="compressed")
    axes = figure.subplots(1, 2)
    parts = []
    for ax, (letter, (row, title)) in zip(axes, cases.items()):
        space = target.space[np.array([row])]
        part = [draw_ellipse(ax, space, axis, labels=True)]
        part.append(draw_region(ax, LAWS[law], space, axis, f"region of {LAWS[law].title}").assign(series="region"))
        best = LAWS[law].impulse(space, mu[[row]], epsilon[[row]])
        predicted = LAWS[law].impulse(space, np.array([fit["mu"]]), np.array([fit["epsilon"]]))
        points = ((target.c_t[row], target.c_n[row]), best, predicted)
        for (name, look), point in zip(MARKS.items(), points):
            c_t, c_n = (float(np.squeeze(value)) for value in point)
            ax.plot(axis.factor * c_t, axis.factor * c_n, linestyle="", label=name, clip_on=False, **look)
            part.append(pd.DataFrame({"series": [name], "c_t": [c_t], "c_n": [c_n]}))
        ax.set_title(f"({letter}) {title}: trial {impacts.trial[row]}, impact {impacts.impact[row]}")
        axis.label(ax, y=False)
        parts.append(pd.concat(part).assign(panel=letter, trial=impacts.trial[row], impact=impacts.impact[row]))
    axis.label(axes[0], x=False)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure, pd.concat(parts, ignore_index=True)[["panel", "trial", "impact", "series", "c_t", "c_n"]]


def zero_friction_case(impacts: Impacts, mu: np.ndarray, misfit: np.ndarray) -> int:
    """Index of case (a) among impacts with individual `mu` (n,) and `misfit` (n,) in N s; UserError if all are NaN."""
    usable = np.flatnonzero(np.isfinite(mu) & np.isfinite(misfit))
    if not len(usable):
        raise UserError("No impact has individual parameters, so there is no case with μ = 0 to show.")
    zero = usable[mu[usable] < MU_ZERO]
    if not len(zero):
        return int(usable[np.argmin(mu[usable])])
    offset = np.abs(impacts.r[zero, 0])
    central = zero[offset <= np.quantile(offset, 0.25)]
    return int(central[np.argmax(misfit[central])])


def spin_reversal_case(target: MeasuredImpulses) -> int:
    """Index of case (b) among n measured impulses; UserError if none is finite."""
    beyond = beyond_sticking(target.space, target.c_t, target.c_n)
    usable = np.flatnonzero(np.isfinite(beyond))
    if not len(usable):
        raise UserError("No measured impulse is finite, so there is no case of spin reversal to show.")
    order = usable[np.argsort(beyond[usable], kind="stable")]
    reversed_ = order[beyond[order] > 0.0]
    return int(order[-1] if not len(reversed_) else reversed_[(len(reversed_) - 1) // 2])


def region_outline(law: Law, space: Contact, points: int = 25) -> np.ndarray:
    """Closed outline (4 (points − 1) + 1, 2) in N s of the impulses that a law can predict for the impact in `space`.

    It is the image of the parameter box's boundary.  If a law maps parts of the box onto each other, its region may
    extend a little beyond it.
    """
    c = np.stack([part[:, :, 0] for part in region(law, space, points=points)], axis=-1)
    return np.concatenate([c[0, :-1], c[:-1, -1], c[-1, :0:-1], c[:0:-1, 0], c[:1, 0]])


def draw_region(ax: Axes, law: Law, space: Contact, axis: ImpulseAxis, label: str) -> pd.DataFrame:
    """Draw the outline of a law's region for the impact in `space`, filled with its hatch; return its points."""
    style, outline = style_of(law.name), region_outline(law, space)
    ax.fill(*(axis.factor * outline.T), fill=False, hatch=style.hatch, edgecolor=style.color, linewidth=0)
    ax.plot(*(axis.factor * outline.T), color=style.color, linestyle=style.dash, linewidth=1.5, label=label)
    # some regions contain impulses that gain energy, outside the ellipse
    ax.set_ylim(top=max(ax.get_ylim()[1], 1.03 * axis.factor * float(outline[:, 1].max())))
    return pd.DataFrame(outline, columns=["c_t", "c_n"])


def draw_ellipse(ax: Axes, space: Contact, axis: ImpulseAxis, *, labels: bool = False) -> pd.DataFrame:
    """Draw the energy ellipse of the impact in `space`, its lines and admissible set; return the plotted points."""
    ellipse = energy_ellipse(space)
    outline = ellipse.outline(points=121)[0]
    shade = np.stack([part[::6, 0] for part in admissible_outline(space)], axis=-1)
    low, high = outline.min(axis=0), outline.max(axis=0)
    margin = 0.08 * (high - low)
    low, high = np.minimum(low, 0.0) - margin, np.maximum(high, 0.0) + margin
    c_t, c_n = np.stack([low, high], axis=1)
    sticking = np.stack([line_of_sticking(space, c_n), c_n], axis=-1)
    compression = np.stack([c_t, line_of_maximum_compression(space, c_t)], axis=-1)
    curves = {
        "energy ellipse": (outline, {"color": INK, "linewidth": 1.1}),
        "line of sticking": (sticking, {"color": "0.35", "linestyle": (0, (5, 2)), "linewidth": 0.9}),
        "line of maximum compression": (compression, {"color": "0.35", "linestyle": (0, (1, 1.2)), "linewidth": 1.1}),
    }
    ax.fill(*(axis.factor * shade.T), color=SHADE, linewidth=0, label="admissible set" if labels else None)
    ax.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
    ax.axvline(0.0, color="0.8", linewidth=0.6, zorder=0)
    for name, (points, look) in curves.items():
        ax.plot(*(axis.factor * points.T), label=name if labels else None, **look)
    ax.plot(*(axis.factor * ellipse.centre[0]), "+", color=INK, markersize=6, label="centre" if labels else None)
    ax.set(xlim=axis.factor * c_t, ylim=axis.factor * c_n, aspect="equal")
    named = {name: points for name, (points, _) in curves.items()}
    parts = {"admissible set": shade} | named | {"centre": ellipse.centre}
    tables = [pd.DataFrame(points, columns=["c_t", "c_n"]).assign(series=name) for name, points in parts.items()]
    return pd.concat(tables, ignore_index=True)[["series", "c_t", "c_n"]]


def body_on_surface(ax: Axes, body: Body) -> tuple[Sketch, np.ndarray, np.ndarray, np.ndarray]:
    """Draw a body at its impact; sketch, outline (n, 2), centre of mass (2,) and contact point C (2,) in m."""
    r = EXAMPLE.contact_point(body)[0]
    centre, contact = np.array([0.0, -r[1]]), np.array([r[0], 0.0])
    outline = centre + turned(body.shape.outline(), EXAMPLE.theta)
    sketch = Sketch(ax)
    sketch.fill("outline", outline)
    sketch.point("centre of mass", centre, zorder=4)
    sketch.point("C", contact, zorder=4)
    return sketch, outline, centre, contact
