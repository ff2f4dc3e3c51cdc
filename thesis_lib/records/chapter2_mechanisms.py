"""Figures 2-1 to 2-9 and 2-14: the mechanisms and their motions."""

from thesis_lib.records.record import GEOMETRY, Figure, Job, Tolerance
from thesis_lib.records.rows import DataFrame
from thesis_lib.statistics.wording import number, times

SCHEMATIC = {"job": Job("ch2_schematics", "chapter2", group="mechanisms"), "keys": "panel series"}
MOTIONS = Job("ch2_motions", "chapter2", group="motions")
MOTION = {"job": MOTIONS, "keys": "panel series"}
PROJECTED = Tolerance("projections iterate to 1e-9; the rest is simulated in closed form", abs=1e-06)
SIMULATED = Tolerance("simulated in closed form per step; only rounding, which impacts multiply", abs=1e-06)

FIGURE_2_1 = Figure(
    name="figure_2_1",
    **SCHEMATIC,
    title="A two-link arm that pushes a disk over the ground",
    caption="""Angles q₁ and q₂, torques τ₁ and τ₂, pose (x, y, θ) of the disk, and the frames (n, t) of both
contacts. Drawn from the simulated mechanism, in a configuration in which both contacts are closed. The thesis gives no
dimensions; lengths and radius are ours.""",
    tolerances={"x y": GEOMETRY},
)


@Figure.found_by(
    job=MOTIONS,
    title="A simulated falling rod at regular times",
    caption="""Its left end lands and sticks (1), its right end lands and slides (2). Colours are what the leading
contact does, read off the simulator's record; the bars show both ends.

The thesis gives no numbers. The start is the one of a grid in which the shorter of sticking and sliding lasts longest,
with μ = 0.3 and ε = 0 by default, all our choice. Before the right end lands, the left one loses its load and starts to
slip.""",
    keys="panel series mode",
    tolerances={"x y t": SIMULATED},
    columns={
        "t": ("s", "time since release"),
        "series": ("", "what is drawn; left and right end: their places and modes step by step"),
        "mode": ("", "what a contact does in the step: open, sticks or slides"),
    },
)
def figure_2_2(figure: DataFrame) -> str:
    """How each end of the rod meets the ground, and for how long."""
    sentences = []
    for end in ("left end", "right end"):
        steps = figure[(figure["panel"] == "modes") & (figure["series"] == end)].sort_values("t")
        mode, t = steps["mode"].to_numpy(), steps["t"].to_numpy()
        touching = (mode != "open").nonzero()[0]
        if not len(touching):
            sentences.append(f"The {end} does not land.")
            continue
        first = touching[0]
        changed = (mode[first:] != mode[first]).nonzero()[0]
        last = first + changed[0] if len(changed) else len(t) - 1
        lasted = number(t[last] - t[first], unit="s")
        sentences.append(f"The {end} lands at {number(t[first], unit='s')} and {mode[first]} for {lasted}.")
    return " ".join(sentences)


FIGURE_2_3 = Figure(
    name="figure_2_3",
    **SCHEMATIC,
    title="Distance to contact",
    caption="""The point P of a falling body that is closest to the ground, and its distances φ_n and φ_t from the
origin O of the fixed frame; β and l place P in the body. The thesis shows some planar object, here a pentagon of
ours.""",
    tolerances={"x y phi_n phi_t": GEOMETRY},
    columns={"phi_t": ("m", "x of the body's closest point from the origin")},
)

FIGURE_2_4 = Figure(
    name="figure_2_4",
    job=MOTIONS,
    title="A simulated disk goes from free flight to rolling",
    caption="""True path of its centre (line), every second observation (dots), and a window of m steps about the
touchdown. Size, throw, window and noise (20 dB by default, the third level of Table 2.1) are ours.""",
    keys="panel series m",
    tolerances={"x y t": SIMULATED},
    columns={"t": ("s", "time since release"), "m": ("1", "steps of the window")},
)


@Figure.found_by(
    **MOTION,
    title="Projection of a noisy pose to the contact manifold, and what a landing determines",
    caption="""(a) A noisy pose of a block that rocks over its corner, and its projection. (b) The same for many
poses, in the plane of kθ (k the radius of gyration) and y, in which the kinetic metric is distance; poses near the kink
have both corners projected. (c, d) A square that lands flat does not turn: without known force not even m/I follows,
and with the mass known still nothing, as for a point particle; landing tilted it gives m/I, and I with the mass known.
Squares are shifted to the right in time.

The tolerances of the projection come from the noise that was added: a picture of the projection, not an estimate.""",
    tolerances={"x y k_theta t rank sigma_1 sigma_2 rank_mass_known": PROJECTED},
    columns={
        "x": ("m", "horizontal position; panels c and d: shifted to the right in time"),
        "t": ("s", "time since release"),
        "rank": ("1", "combinations of (m, I) that the landing determines without known force"),
        "sigma_1": ("1", ("larger singular value of the regressor outside the span of contact forces, scaled columns")),
        "sigma_2": ("1", "smaller singular value of the same"),
        "k_theta": ("m", "angle times the radius of gyration"),
        "rank_mass_known": ("1", "rank if the mass is given"),
    },
)
def figure_2_5(figure: DataFrame) -> str:
    """What a flat and a tilted landing determine."""
    parts = []
    for panel, landing in (("c", "flat"), ("d", "tilted")):
        row = figure[(figure["panel"] == panel) & (figure["series"] == "square")].iloc[0]
        result = "a combination" if row["rank"] > 0 else "no combination"
        inertia = "I as well" if row["rank_mass_known"] > 0 else "not I either"
        largest = number(row["sigma_1"], digits=2)
        parts.append(
            f"landing {landing} determines {result} of m and I (largest singular value of the regressor {largest}), "
            f"and with the mass known {inertia}"
        )
    return f"For the square without known force, {'; '.join(parts)}."


FIGURE_2_6 = Figure(
    name="figure_2_6",
    **SCHEMATIC,
    title="Block of side a in free fall",
    caption="""Its lowest corner P lies at l = a/√2 and β = π/4 from its own downward axis, as equations 2.19 and
2.20 have it. The side a = 1 m follows from the thesis's m/I = 6 for a uniform square.""",
    tolerances={"x y phi_n": GEOMETRY},
)

FIGURE_2_7 = Figure(
    name="figure_2_7",
    **SCHEMATIC,
    title="Ellipse in free fall, its radii a and b, and its lowest point P at distance l(β)",
    caption="""β is drawn as the polar angle from the major axis, which l(β) of equation 2.22 needs; the β of
equation 2.21 is the parameter of (a cos β, b sin β) instead. Radii of 2 and 1 m follow from the thesis's m/I = 0.8 for
a uniform ellipse.""",
    tolerances={"x y phi_n beta": GEOMETRY},
    columns={"beta": ("rad", "polar angle of the touching point from the ellipse's major axis")},
)

FIGURE_2_8 = Figure(
    name="figure_2_8",
    **SCHEMATIC,
    title="Rimless wheel on a slope γ, with the contact forces of two spokes that touch at once",
    caption="Eight spokes as in the thesis's figure; length, inertia and slope are ours.",
    tolerances={"x y": GEOMETRY},
)


@Figure.found_by(
    **MOTION,
    title="Simulated motions at regular times, later ones darker, with the path of the centre",
    caption="""(a) Block, (b) ellipse, (c) rimless wheel with high (top) and low friction (bottom), over the same
time and on the same stretch of slope. With high friction its feet stick and it walks; with low friction it slides, here
also for a while upright on one spoke.

Block and ellipse have the thesis's m, μ, ε and m/I. Of the first random drops the one that travels farthest is shown,
so that the outlines lie apart. Wheel, slope and the low coefficient of friction are ours.""",
    tolerances={"x y t": SIMULATED},
    columns={"t": ("s", "time since release")},
)
def figure_2_9(figure: DataFrame) -> str:
    """How far the wheel travels with high and with low friction."""
    travel, t = {}, 0.0
    for friction in ("high", "low"):
        rows = figure[figure["panel"] == f"wheel, {friction} friction"]
        path = rows[rows["series"] == "path of the centre"].sort_values("t")
        moved = path[["x", "y"]].iloc[-1] - path[["x", "y"]].iloc[0]
        travel[friction], t = float((moved**2).sum() ** 0.5), float(path["t"].iloc[-1])
    return (
        f"In {number(t, unit='s')} the wheel's centre comes {number(travel['high'], unit='m')} with high friction and "
        f"{number(travel['low'], unit='m')} with low friction, {times(travel['low'] / travel['high'])} as far."
    )


FIGURE_2_14 = Figure(
    name="figure_2_14",
    **MOTION,
    title="A falling ellipse up to its third impact",
    caption="""A sparse sub-sample of its tracked poses at 250 Hz; later ones are darker. The thesis's recordings
are not public (its authors publish single impacts of the ellipse, without trajectories): this is the first trial of the
simulated dataset *drops*, with an ellipse of the same size and simulated tracking noise.""",
    tolerances={"x y t": SIMULATED},
)
