"""Figures 2-2, 2-4, 2-5, 2-9 and 2-14: motions with contact, to scale and at regular times (thesis 2.2 to 2.5).

The mode of a contact (open, sticks, slides) is from the simulator's record (simulate/mechanisms/scenes.py).
Poses q are arrays (n, 3) in m, rad, with x and y in the axes of the surface; the window of figure 2-4 has
m = `stop - start` steps.

Figure 2-5 shows noisy poses and the contact manifold, and flat and tilted landing as excitation (thesis 2.3.2, 2.3.3):
poses in contact form the manifold φ_n(q) = 0, which over a flat surface is the curve y = -r_y(θ).  Noise moves measured
poses off it, where eq. 2.12 allows no force.  `identify/base_parameters/projection.py` projects them to the nearest
pose in the kinetic metric δx² + δy² + k² δθ², with the radius of gyration k in m; panel (b), with axes k θ and y,
shows this distance.

The `identifiability` of a landing is shown with m and I unknown and no external force, and with known mass.  A
square that lands flat does not turn, so its I is in the null space even if the mass is known.  σ_i, (n_Θ,), are the
singular values of the regressor outside the span of possible contact forces.
"""

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from thesis_lib.datasets.format.dataset import Dataset
from thesis_lib.figures.planar_drawing import Sketch
from thesis_lib.figures.style import BLUE, GREY, INK, RED, Drawn, house_style, new_figure
from thesis_lib.foundation.errors import UserError
from thesis_lib.simulate.mechanisms.scenes import Mode, NoisyMotion, RodFall
from thesis_lib.simulate.stepping.multibody import PlanarFreeBody
from thesis_lib.simulate.stepping.rimless_wheel import RimlessWheel
from thesis_lib.simulate.stepping.stepping import SimulatedMotion
from thesis_lib.thesis.figures.chapter2.schematics import outline_at
from thesis_lib.thesis.identify.base_parameters.identifiability import identifiability
from thesis_lib.thesis.identify.base_parameters.projection import ProjectedRecord
from thesis_lib.thesis.identify.base_parameters.window import ContactWindow

MODE_LOOK = {Mode.OPEN: (GREY, "open"), Mode.STICKS: (BLUE, "sticks"), Mode.SLIDES: (RED, "slides")}
ROD_EVERY, DISK_EVERY = 0.04, 0.13  # s between drawn configurations
TRACE_SHOWN = {"block": 0.2, "ellipse": 0.25, "wheel": 0.25}  # s between outlines, which then remain distinct
OBSERVED_EVERY = 2  # samples between the dots of figure 2-4
FALL_EVERY = 0.04  # s; figure 2-14, "a very sparse sub-sample": ten samples at 250 Hz
SAMPLE_EVERY = 3  # poses between the dots of panel (b) of figure 2-5
LANDING_SHOWN = 5  # number of squares drawn for each landing of figure 2-5, at equal intervals
NOISY, MOVED = RED, BLUE
BOUNCES = 3  # impacts in figure 2-14; the thesis uses the same number of each drop


@house_style
def figure_2_2(fall: RodFall) -> Drawn:
    """Figure 2-2: falling rod; left end lands and sticks, right end lands and slides; modes of both ends in time."""
    record, (left, right) = fall.record, fall.lands
    figure = new_figure(height=3.0)
    space, time = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.1, 1.0)})
    sketch = Sketch(space, "configurations")
    settled = int(np.flatnonzero(fall.modes[:, 1] == Mode.SLIDES)[-1]) + 1
    stride = max(1, round(ROD_EVERY / record.h))
    shown = sorted({*range(left % stride, settled + 1, stride), left, right, settled})
    for step in shown:
        color = MODE_LOOK[_leading_mode(fall, step)][0]
        event = step in (left, right)
        ends = outline_at(fall.body, record.q[step])
        look = {"linewidth": 2.4, "zorder": 4} if event else {"linewidth": 1.0, "zorder": 2}
        sketch.line("rod", ends, t=record.t[step], color=color, solid_capstyle="round", **look)
        sketch.ax.plot(*ends[0], "o", color=color, markersize=2.5, zorder=4)
    poses = outline_at(fall.body, record.q[0]), outline_at(fall.body, record.q[settled])
    sketch.ground(poses[0][:, 0].min() - 0.35, poses[1][:, 0].max() + 0.35, 0.06)
    first, second = (outline_at(fall.body, record.q[step])[end] for end, step in enumerate((left, right)))
    for number, at in ((1, first), (2, second)):
        sketch.point(f"event {number}", at, markersize=5, zorder=6)
    sketch.label(first + [-0.08, 0.12], "1: left end lands\nand sticks", ha="right", fontsize=7.5)
    slides = f"2: right end lands\nand slides {100.0 * (poses[1][1, 0] - second[0]):.0f} cm"
    sketch.label(second + [-0.03, 0.3], slides, ha="left", fontsize=7.5)

    t = record.t
    for row in range(2):
        for mode, (color, _) in MODE_LOOK.items():
            bars = [(t[k], record.h) for k in np.flatnonzero(fall.modes[:, row] == mode)]
            time.broken_barh(bars, (0.8 - row, 0.4), color=color, linewidth=0)
    for number, step in ((1, left), (2, right)):
        time.axvline(t[step], ymax=0.93, color=INK, linewidth=0.8)
        time.text(t[step], 1.45, f"{number}", ha="center", va="bottom", fontsize=7)
    time.set_yticks([1.0, 0.0], ["left\nend", "right\nend"])
    time.tick_params(axis="y", length=0)
    time.spines["left"].set_visible(False)
    time.set(xlim=(0.0, t[settled]), ylim=(-0.5, 1.6), box_aspect=0.45, xlabel="time (s)")
    handles = [Line2D([], [], color=color, label=name, linewidth=3) for color, name in MODE_LOOK.values()]
    time.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.05), ncols=3)

    steps = np.arange(settled + 1)
    outline = np.stack([outline_at(fall.body, q) for q in record.q[steps]])
    rows = []
    for end, series in enumerate(("left end", "right end")):
        modes = [MODE_LOOK[Mode(mode)][1] for mode in fall.modes[np.minimum(steps, len(t) - 2), end]]
        path = pd.DataFrame(outline[:, end], columns=["x", "y"])
        rows.append(path.assign(panel="modes", series=series, t=t[steps], mode=modes))
    return figure, pd.concat([sketch.table(), *rows], ignore_index=True)


@house_style
def figure_2_4(motion: NoisyMotion) -> Drawn:
    """Figure 2-4: disk from flight to rolling; true path (line), noisy observations (dots), window of length m."""
    record, body = motion.record, motion.body
    figure = new_figure(height=3.0)
    sketch = Sketch(figure.add_subplot())
    radius = body.shape.extent
    for step in range(0, record.steps + 1, max(1, round(DISK_EVERY / record.h))):
        outline = outline_at(body, record.q[step])
        look = {"t": record.t[step], "color": "0.7", "linewidth": 0.8, "zorder": 1}
        sketch.line("disk", outline, **look)
        # the first point of the outline is a mark on the rim
        sketch.line("mark on the rim", np.stack([record.q[step, :2], outline[0]]), **look)
    sketch.ground(record.q[0, 0] - 1.2 * radius, record.q[-1, 0] + 1.2 * radius, 0.12 * radius)
    sketch.line("true path", record.q[:, :2], t=record.t, linewidth=1.4, zorder=3, label="true path of the centre")
    inside = np.zeros(record.steps + 1, dtype=bool)
    inside[motion.start : motion.stop] = True
    every = np.arange(record.steps + 1) % OBSERVED_EVERY == 0
    for series, mask, color in (
        ("observations in the window", every & inside, RED),
        ("observations outside", every & ~inside, GREY),
    ):
        look = {"color": color, "marker": ".", "linestyle": "", "markersize": 3.5, "zorder": 4}
        sketch.line(series, motion.observed.q[mask, :2], t=record.t[mask], label=series, **look)
    sketch.ax.legend(loc="lower left", bbox_to_anchor=(0.02, 0.12))
    first, last = record.q[motion.start, :2], record.q[motion.stop - 1, :2]
    top = record.q[0, 1] + 1.4 * radius
    for name, at in (("start", first), ("end", last)):
        look = {"color": RED, "linewidth": 0.8, "linestyle": (0, (4, 2))}
        sketch.line(f"{name} of the window", np.array([[at[0], 0.0], [at[0], top]]), **look)
    sketch.dimension("window", np.array([first[0], top - 0.06]), np.array([last[0], top - 0.06]), RED)
    m = motion.stop - motion.start
    sketch.label((0.5 * (first[0] + last[0]), top + 0.07), f"window of length $m$ = {m}", RED)
    sketch.label((0.5 * (record.q[0, 0] + first[0]), top - 0.06), "free flight", fontsize=8)
    sketch.label((0.5 * (record.q[-1, 0] + last[0]), top - 0.06), "rolling", fontsize=8)
    return figure, sketch.table().assign(m=m)


@house_style
def figure_2_5(
    motion: NoisyMotion, projected: ProjectedRecord, landings: dict[str, tuple[SimulatedMotion, ContactWindow]]
) -> Drawn:
    """Figure 2-5: projection of noisy poses onto the contact manifold (a, b); flat and tilted landing (c, d).

    `motion`, `projected`: noisy states of a body that stays in contact, and their projection onto the contact manifold;
    `landings`: "flat" and "tilted", motion of a square and its window in unknown (m, I), as from
    `excitation_table.excitation_cases`.

    Raises:
        UserError: no noisy pose is near the manifold.
    """
    if not projected.closed.any():
        raise UserError("No noisy pose is near enough to the surface to be projected; lower the noise.")
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
    """Draw the touching corner of the pose with one contact and the largest gap, measured and projected."""
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
    """Draw the manifold, measured poses and their projections in the plane of k θ and y."""
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
    """Draw squares during a landing, side by side in time, and state the parameters that the window identifies."""
    free_mass, fixed_mass = identifiability(window), identifiability(window.fix({"m": body.mass}))
    sketch = Sketch(ax, letter)
    ax.set_title(f"({letter}) square lands {name}")
    size = body.shape.extent
    shown = np.linspace(0, record.steps, LANDING_SHOWN).astype(int)
    for column, step in enumerate(shown):
        # shifted to the right with time, so that squares do not overlap
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


@house_style
def figure_2_9(shown: dict[str, tuple[PlanarFreeBody, SimulatedMotion]]) -> Drawn:
    """Figure 2-9: traces of block (a), ellipse (b) and rimless wheel (c) with high (top) and low friction (bottom).

    `shown`: bodies and records with the keys of `scenes.traces`.
    """
    figure = new_figure(height=6.4)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.0, 1.0, 1.0))
    panels = {
        "block": ("a) block", grid[0, 0]),
        "ellipse": ("b) ellipse", grid[0, 1]),
        "wheel, high friction": ("c) rimless wheel, high friction", grid[1, :]),
        "wheel, low friction": ("c) rimless wheel, low friction", grid[2, :]),
    }
    # the two wheels share their limits, so that their paths can be compared
    far = max(float(shown[name][1].q[:, 0].max()) for name in panels if name.startswith("wheel"))
    parts = []
    for name, (title, place) in panels.items():
        body, record = shown[name]
        ax = figure.add_subplot(place)
        ax.set_title(title)
        every = max(1, round(TRACE_SHOWN[name.split(",")[0]] / record.h))
        right = far if name.startswith("wheel") else None
        parts.append(_trace(ax, name, body, record.q, record.t, every, right))
    return figure, pd.concat(parts, ignore_index=True)


@house_style
def figure_2_14(dataset: Dataset) -> Drawn:
    """Figure 2-14: a falling body, by a sparse sub-sample of the first trial up to its third impact.

    Raises:
        UserError: the dataset has no trajectories.
    """
    if dataset.trajectories is None:
        raise UserError(f"Dataset {dataset.name!r} has no trajectories.csv, so there is no falling body to draw.")
    table = dataset.trajectories
    trial = int(table["trial"].min())
    samples = table[table["trial"] == trial]
    q, t = samples[["x", "y", "theta"]].to_numpy(float), samples["t"].to_numpy(float)
    end = _end_of_bounces(dataset, q)
    body = PlanarFreeBody(dataset.shape, 1.0, dataset.k_g**2)
    q = q - [0.0, dataset.height, 0.0]
    figure = new_figure(3.6, 3.6)
    every = max(1, round(FALL_EVERY / float(np.median(np.diff(t)))))
    return figure, _trace(figure.add_subplot(), f"trial {trial}", body, q[:end], t[:end], every)


def _trace(
    ax: Axes, panel: str, body: PlanarFreeBody, q: np.ndarray, t: np.ndarray, every: int, far: float | None = None
) -> pd.DataFrame:
    """Draw every `every`-th outline of a body, light to dark, and the path of its centre; q: (n, 3), t: (n,) s."""
    sketch = Sketch(ax, panel, tilt=-body.tilt)
    shown = np.arange(0, len(q), every)
    colors = colormaps["Blues"](np.linspace(0.3, 1.0, len(shown)))
    wheel = isinstance(body, RimlessWheel)
    for color, step in zip(colors, shown):
        look = {"color": color, "linewidth": 0.9 if wheel else 1.0, "zorder": 2}
        sketch.line("outline", outline_at(body, q[step]), t=t[step], **look)
    sketch.line("path of the centre", q[:, :2], t=t, color=RED, linewidth=0.9, zorder=3)
    size = body.length if wheel else body.shape.extent
    left = float(q[:, 0].min()) - 1.25 * size
    right = (float(q[:, 0].max()) if far is None else far) + 1.25 * size
    sketch.ground(left, right, 0.025 * (right - left))
    return sketch.table()


def _leading_mode(fall: RodFall, step: int) -> Mode:
    """Mode of the rod's contact that determines the color: the left end, or the right end once it has landed."""
    left, right = fall.modes[min(step, len(fall.modes) - 1)]
    return Mode(right if step >= fall.lands[1] else left)


def _end_of_bounces(dataset: Dataset, q: np.ndarray) -> int:
    """Number of samples of a trial up to the sample after its third impact; all if it has fewer impacts.

    An impact is a local minimum of the gap within a tenth of the body's size from the surface.
    """
    gap = dataset.shape.gap(q[:, 1], q[:, 2], dataset.height)
    low = (gap[1:-1] <= gap[:-2]) & (gap[1:-1] < gap[2:]) & (gap[1:-1] < 0.1 * dataset.shape.extent)
    hits = np.flatnonzero(low) + 1
    return int(hits[BOUNCES - 1]) + 2 if len(hits) >= BOUNCES else len(q)
