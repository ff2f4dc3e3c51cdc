"""Figure 2-5: noisy poses and the contact manifold; flat and tilted landing as excitation (thesis 2.3.2 and 2.3.3).

Poses in contact form the manifold φ_n(q) = 0; over a flat surface it is the curve y = -r_y(θ).  Noise moves measured
poses off it, where eq. 2.12 allows no force.  `identify/base_parameters/projection.py` moves them back to the nearest
pose in the kinetic metric δx² + δy² + k² δθ², with the radius of gyration k in m; panel (b), with axes k θ and y,
shows this distance.

The `identifiability` of a landing is shown with m and I unknown and no external force, and with the mass given.  A
square that lands flat does not turn: its I is in the null space even if the mass is known.  σ_i, (n_Θ,), are the
singular values of the regressor outside the span of possible contact forces.
"""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from thesis_lib.figures.marks import BLUE, RED
from thesis_lib.figures.planar_drawing import Sketch, outline_at
from thesis_lib.figures.style import GREY, INK, Drawn, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.identify.base_parameters.identifiability import identifiability
from thesis_lib.identify.base_parameters.projection import ProjectedRecord
from thesis_lib.identify.base_parameters.window import ContactWindow
from thesis_lib.simulate.chapter2.scenes import NoisyMotion
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.simulate.stepping.stepping import SimulatedMotion

SAMPLE_EVERY = 3  # poses between the dots of panel (a)
LANDING_SHOWN = 5  # squares drawn of each landing, at equal intervals
NOISY, MOVED = RED, BLUE


@house_style
def figure_2_5(
    motion: NoisyMotion, projected: ProjectedRecord, landings: dict[str, tuple[SimulatedMotion, ContactWindow]]
) -> Drawn:
    """Projection of noisy poses to the contact manifold (a, b), and flat against tilted landing as excitation (c, d).

    `motion`, `projected`: noisy states of a body that stays in contact, and their projection to the contact manifold;
    `landings`: "flat" and "tilted", motion of a square and its window in unknown (m, I), as from
    `excitation_table.excitation_cases`.

    Raises:
        UserError: a landing is missing, or no noisy pose is near the manifold.
    """
    if set(landings) != {"flat", "tilted"}:
        raise UserError(f"Figure 2-5 compares a flat and a tilted landing; got {sorted(landings)}.")
    if not projected.closed.any():
        raise UserError("No noisy pose lies near enough to the surface to be projected; lower the noise.")
    figure = new_figure(height=4.4)
    grid = figure.add_gridspec(2, 2, height_ratios=(1.6, 1.0))
    parts = [
        _one_pose(figure.add_subplot(grid[0, 0]), motion, projected),
        _manifold(figure.add_subplot(grid[0, 1]), motion, projected),
    ]
    for i, (letter, name) in enumerate((("c", "flat"), ("d", "tilted"))):
        parts.append(_landing(figure.add_subplot(grid[1, i]), letter, name, motion.body, *landings[name]))
    return figure, pd.concat(parts, ignore_index=True)


def _one_pose(ax: Axes, motion: NoisyMotion, projected: ProjectedRecord) -> pd.DataFrame:
    """The touching corner of the pose with one contact and the largest gap, and of its projection."""
    body, steps = motion.body, len(projected.closed)
    gaps = np.where(projected.closed, body.contacts_of(motion.observed.q[:steps]).phi, 0.0).sum(axis=1)
    step = int(np.argmax(np.where(projected.closed.sum(axis=1) == 1, np.abs(gaps), -1.0)))
    pair = int(np.argmax(projected.closed[step]))
    sketch = Sketch(ax, "a")
    ax.set_title("(a) pose off the contact manifold")
    near = 0.3 * body.shape.extent
    looks = ((motion.observed.q[step], "measured", NOISY, (0, (4, 2))), (projected.q[step], "projected", MOVED, "-"))
    for q, name, color, dash in looks:
        corner = q[:2] + body.contact_points(q[2:])[0, pair]
        sketch.line(name, outline_at(body, q), color=color, linestyle=dash, label=name)
        sketch.point(f"corner, {name}", corner, color=color, zorder=4)
    sketch.ground(corner[0] - 1.5 * near, corner[0] + 1.2 * near, 0.12 * near)
    text = rf"measured $\phi_n$ = {1e3 * gaps[step]:.0f} mm"
    sketch.label(corner + near * np.array([-0.12, 0.12]), text, NOISY, ha="right", fontsize=8)
    ax.legend(loc="upper left")
    ax.set(xlim=(corner[0] - 1.3 * near, corner[0] + 0.9 * near), ylim=(-0.12 * near, 1.4 * near))
    return sketch.table()


def _manifold(ax: Axes, motion: NoisyMotion, projected: ProjectedRecord) -> pd.DataFrame:
    """Poses in the plane of k θ and y: the manifold, measured poses and their projections."""
    body, m = motion.body, projected.closed.shape[0]
    k_g = float(np.sqrt(body.inertia / body.mass))
    ax.set_title("(b) measured and projected poses")
    steps = np.flatnonzero(projected.closed.any(axis=1))[::SAMPLE_EVERY]
    measured, moved = motion.observed.q[:m][steps], projected.q[:m][steps]
    theta = np.linspace(*np.array([-0.05, 0.05]) + [moved[:, 2].min(), moved[:, 2].max()], 121)
    # φ_n = 0: y = -min r_y(θ)
    height = -body.contact_points(theta)[..., 1].min(axis=1)
    ax.plot(k_g * theta, height, color=INK, linewidth=1.0, label=r"manifold $\phi_n = 0$")
    for a, b in zip(measured, moved):
        ax.plot([k_g * a[2], k_g * b[2]], [a[1], b[1]], color=GREY, linewidth=0.6, zorder=1)
    ax.plot(k_g * measured[:, 2], measured[:, 1], ".", color=NOISY, label="measured")
    ax.plot(k_g * moved[:, 2], moved[:, 1], ".", color=MOVED, label="projected")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel=r"$k\,\theta$ (m)", ylabel="$y$ (m)")
    ax.legend(loc="upper left")
    curves = {"manifold": (theta, height), "measured": measured.T[[2, 1]], "projected": moved.T[[2, 1]]}
    parts = [pd.DataFrame({"series": name, "k_theta": k_g * angle, "y": y}) for name, (angle, y) in curves.items()]
    return pd.concat(parts, ignore_index=True).assign(panel="b")


def _landing(
    ax: Axes, letter: str, name: str, body: PlanarFreeBody, record: SimulatedMotion, window: ContactWindow
) -> pd.DataFrame:
    """Squares during a landing, side by side in time, and what the window identifies."""
    free_mass, fixed_mass = identifiability(window), identifiability(window.fix({"m": body.mass}))
    sketch = Sketch(ax, letter)
    ax.set_title(f"({letter}) square lands {name}")
    size = body.shape.extent
    shown = np.linspace(0, record.steps, LANDING_SHOWN).astype(int)
    for column, step in enumerate(shown):
        # shifted to the right in time, so that the squares do not overlap
        shift = np.array([1.65 * size * column, 0.0])
        points = outline_at(body, record.q[step]) - [record.q[0, 0], 0.0] + shift
        sketch.line("square", points, t=record.t[step], linewidth=0.9)
        sketch.point("centre", record.q[step, :2] - [record.q[0, 0], 0.0] + shift, markersize=2)
    sketch.ground(-1.1 * size, 1.65 * size * (len(shown) - 1) + 1.1 * size, 0.12 * size)
    verdict = {0: "nothing, not even $m/I$", 1: "$m/I$ only", 2: "$m$ and $I$"}[free_mass.rank]
    verdict_known_mass = "$I$" if fixed_mass.rank else "still nothing"
    text = f"identifiable without known force: {verdict}\nif the mass is known: {verdict_known_mass}"
    ax.text(0.0, -0.05, text, transform=ax.transAxes, va="top", fontsize=7.5)
    sigma_1, sigma_2 = free_mass.singular_values[:2]
    ranks = {"rank": free_mass.rank, "sigma_1": sigma_1, "sigma_2": sigma_2, "rank_mass_known": fixed_mass.rank}
    return sketch.table().assign(**ranks)
