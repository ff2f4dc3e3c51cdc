"""Figures 2-10 to 2-15: contact forces and impulses of wheel, arm and ellipse."""

from typing import Any

from thesis_lib.records.chapter2_mechanisms import SIMULATED
from thesis_lib.records.record import Figure, Job, Table, Tolerance
from thesis_lib.records.rows import FROM_ZERO, DataFrame, Series, row_of
from thesis_lib.statistics.wording import count, ends, estimate, listed, number, percent, side

THESIS_FORCES = 0.2  # section 2.4: contact forces of arm and disk are estimated to within about 20 %
ARCS = "arcs"  # maximum likelihood over arcs, without a contact law
ITERATED = "estimates by iterated least squares; a thousandth of a force cannot be seen"
INTEGRATED = Tolerance("Drake controls its own step; 1 % of a force cannot be seen", abs=0.0001, rel=0.01)
WHEEL = Job("ch2_wheel", "chapter2", group="forces")
ARM = Job("ch2_arm", "chapter2", group="forces")
IMPACT_FORCES = Job("ch2_impact_forces", "chapter2", group="forces")


@Figure.found_by(
    job=WHEEL,
    title="The motion of the rimless wheel for several masses at the same inertia about its hub",
    caption="""Only the ratio m/I matters: wheels with the same ratio move alike. Wheel and masses are ours; the
thesis gives none.""",
    keys="mass",
    tolerances={"t theta omega": SIMULATED},
    columns={
        "mass": ("kg", "mass of the wheel; its inertia is the same in all"),
        "t": ("s", "time since the start"),
        "theta": ("rad", "angle since the start"),
        "omega": ("rad/s", "angular velocity"),
    },
)
def figure_2_10(figure: DataFrame) -> str:
    """Angles through which wheels of different masses turn."""
    last = figure.sort_values("t").groupby("mass")["theta"].last().abs()
    rises, falls = last.is_monotonic_increasing, last.is_monotonic_decreasing
    trend = "more with more mass" if rises else "less with more mass" if falls else "in no order of mass"
    spread = float(last.max() - last.min())
    return (
        f"After {number(float(figure['t'].max()), unit='s')} wheels of "
        f"{listed([f'{mass:g}' for mass in last.index])} kg have turned by "
        f"{listed([number(angle) for angle in last])} rad, {trend}: up to {number(spread, unit='rad')} "
        f"apart, {percent(spread / float(last.max()))} of the largest angle."
    )


@Figure.found_by(
    job=WHEEL,
    title="Normal force of the first three spokes of the rolling rimless wheel",
    caption="""Truth, the estimate from noise-free states, and our estimate at 40 dB with its standard errors. Steps
with an impact are marked apart, because their force is an impulse over one time step and would hide the rest.

What to look for: whether the truth lies within the standard errors of our estimate.""",
    reads=("figure_2_11.csv", "wheel_forces.csv"),
    keys="spoke series kind",
    tolerances={"t force_or_impulse std": Tolerance(ITERATED, abs=0.0001, rel=0.001)},
    columns={
        "spoke": ("1", "place of the spoke in the order of touching, from 1"),
        "series": ("", "truth, noise_free, plain or fit, as in wheel_forces_rows"),
        "kind": ("", "rolling or touchdown: normal force in a step; impulse: sum over a touchdown"),
        "t": ("s", "middle of the step or of the touchdown"),
        "force_or_impulse": ("N or N s", "normal force, or impulse where kind says so"),
        "std": ("N or N s", "its standard error; only of fit"),
    },
)
def figure_2_11(figure: DataFrame, summary: DataFrame) -> str:
    """Whether the true normal forces lie within the stated errors of the estimates."""
    rolling = figure[figure["kind"] == "rolling"]
    force = rolling.pivot_table(index=["spoke", "t"], columns="series", values="force_or_impulse")
    force["std"] = rolling[rolling["series"] == "fit"].set_index(["spoke", "t"])["std"]
    force = force[force["truth"] > 0]
    within = float(((force["fit"] - force["truth"]).abs() <= 2.0 * force["std"]).mean())
    fit, plain = (_relative_rms(force[name], force["truth"]) for name in ("fit", "plain"))
    shares = [percent(share) for share in summary.loc[summary["method"] == "fit", "within_2_std"]]
    return (
        f"In the motion shown maximum likelihood errs by {percent(fit)} of the normal forces (rms), equation 2.12 on "
        f"the same noisy states by {percent(plain)}. The truth lies within two standard errors of our estimate in "
        f"{percent(within)} of the contact steps shown, and in {listed(shares)} for the spokes of all motions; "
        f"{percent(0.95)} would be right."
    )


@Table.found_by(
    job=WHEEL,
    title="Errors of the contact forces of the rimless wheel's first three spokes",
    caption="""Relative rms errors of the normal and tangential forces over contact steps, touchdowns apart: from
exact states (eq. 2.12), from noisy states by the plain program, and by our maximum likelihood, with the records that
its tests refuse.

What to look for: how far the errors of our maximum likelihood lie below those of the plain program on the same noisy
states, and how many records its tests refuse.""",
)
def wheel_forces(table: DataFrame) -> str:
    """Errors of the spokes' forces, and refused motions."""
    fit, plain = (table[table["method"] == method] for method in ("fit", "plain"))
    errors = [
        f"{percent(fit[column].max())} of the {kind} force (plain program: {percent(plain[column].max())})"
        for kind, column in (("normal", "error_n_median"), ("tangential", "error_t_median"))
    ]
    n = int((fit["n"] + fit["n_failed"]).max())
    return (
        f"Maximum likelihood errs by {listed(errors)}: medians over the motions, for the worst spoke. "
        f"Refused of {n} motions: {int(fit['n_failed'].max())} (plain program: {int(plain['n_failed'].max())})."
    )


@Figure.found_by(
    job=ARM,
    title="Estimated and true contact forces of the disk with arm and ground, at 40 dB",
    caption="""Forces and inertial parameters are identified together. Arm, torques and friction are ours: the
thesis gives no numbers. The thesis's estimates are within about 20 %.

What to look for: whether the estimates follow the truth through every change of contact, and where they leave it.""",
    keys="pair component",
    tolerances={"t true estimate std plain": Tolerance(ITERATED, abs=0.001, rel=0.001)},
    columns={
        "pair": ("", "as in arm_forces"),
        "component": ("", "normal or tangential force on the disk"),
        "t": ("s", "time since release, start of the step"),
        "true": ("N", "force in the simulation"),
        "estimate": ("N", "maximum likelihood from noisy states"),
        "std": ("N", "its standard error"),
        "plain": ("N", "answer of the plain program on the same noisy states"),
    },
)
def figure_2_12(figure: DataFrame) -> str:
    """Errors of the forces at arm and ground on the trajectory shown."""
    errors = {
        str(pair): [_relative_rms(forces[name], forces["true"]) for name in ("estimate", "plain")]
        for pair, forces in figure.groupby("pair")
    }
    parts = [
        f"{percent(fitted)} at the {pair} (plain program: {percent(plain)})" for pair, (fitted, plain) in errors.items()
    ]
    fitted = [error for error, _ in errors.values()]
    worst: Any = figure.iloc[int((figure["estimate"] - figure["true"]).abs().argmax())]
    return (
        f"On the trajectory shown the forces err by {listed(parts)}, rms over all steps, {_against_thesis(fitted)}. "
        f"The largest error is that of a {worst['component']} force at the {worst['pair']}, "
        f"{number(worst['estimate'], unit='N')} instead of {number(worst['true'], unit='N')} at "
        f"{number(worst['t'], unit='s')}."
    )


@Table.found_by(
    job=ARM,
    title="Errors of contact forces and base parameters of arm and disk",
    caption="""Forces and parameters of a trajectory are identified together: from exact states (eq. 2.12), from
noisy states by the plain program, and by our maximum likelihood from blind starts, whose refusals count as failures in
the shares.

What to look for: how far the errors of our maximum likelihood lie below those of the plain program on the same noisy
states, and how many trajectories it refuses.""",
)
def arm_summary(table: DataFrame) -> str:
    """Errors of forces and base parameters, and refused trajectories."""
    rows = table.set_index(["quantity", "method"])
    median = {key: float(value) for key, value in rows["error_median"].items()}
    names = {"arm_force": "forces at the arm", "ground_force": "forces at the ground", "theta": "base parameters"}
    parts = [
        f"{name} by {percent(median[key, 'ours'])} (plain program: {percent(median[key, 'plain'])})"
        for key, name in names.items()
    ]
    fits = table[table["method"] == "ours"]
    n = int(fits["n_trajectories"].max())
    good = float(fits.loc[fits["quantity"].isin(names), "share_5_percent"].min())
    return (
        f"In the median trajectory maximum likelihood errs in {listed(parts)}; its errors of forces are "
        f"{_against_thesis([median['arm_force', 'ours'], median['ground_force', 'ours']])}. "
        f"Each of the three errs by at most {percent(0.05, 1)} in {count(good * n, n)} trajectories or more; "
        f"refused: {int(fits['n_failed'].max())}."
    )


@Figure.found_by(
    job=IMPACT_FORCES,
    title="An ellipse comes down, and the force of that impact",
    caption="""Drake's compliant contact stands in for the force sensor, whose recordings are not public. What the
250 Hz poses determine is the impulse; a peak force follows only with the declared contact duration, a choice of ours,
and the half-sine drawn has that duration.""",
    reads=("figure_2_15.csv", "impact_force_summary.csv"),
    keys="panel series",
    tolerances={"t x y force z density": INTEGRATED},
    columns={
        "t": ("s", "time since touch"),
        "force": ("N", "normal force"),
        "z": ("1", "error of an impulse over its stated standard deviation: centre of the bin"),
        "density": ("1", "probability density of z"),
    },
)
def figure_2_15(figure: DataFrame, summary: DataFrame) -> str:
    """The peak of the impact shown, and the spread of the impulses' errors."""
    peak = figure[figure["panel"] == "b"].groupby("series")["force"].max().astype(float)
    normal, tangential = (row_of(summary, method=ARCS, reference=name) for name in ("true_c_n", "true_c_t"))
    return (
        f"In the impact shown the half-sine peaks at {number(peak['estimate'], unit='N')}, the compliant contact at "
        f"{number(peak['contact_force'], unit='N')}, and the force plate's largest sample is "
        f"{number(peak['sensor'], unit='N')}. "
        f"Over {normal['n']:.0f} impacts the errors of normal and tangential impulse spread by "
        f"{number(normal['std'] / normal['std_stated'], digits=2)} and "
        f"{number(tangential['std'] / tangential['std_stated'], digits=2)} times their stated standard deviations."
    )


@Table.found_by(
    job=IMPACT_FORCES,
    title="Impulse and peak force of an ellipse's impacts, against the simulated truth",
    caption="""Impulses estimated from noisy 250 Hz poses, against the integral of the force in Drake's compliant
contact and against a modelled force plate; and the peak of a half-sine of the declared contact duration against the
true peak. The thesis's mean and standard deviation of the error in peak force stand beside it.

What to look for: impulses against peaks. The impulse does not depend on the declared duration of the contact, the peak
does.""",
)
def impact_force_summary(table: DataFrame) -> str:
    """Impulses and peak forces against the simulation."""
    impulse, peak, plate = (
        row_of(table, method=ARCS, reference=name) for name in ("true_c_n", "peak_true", "peak_sensor")
    )
    bias = side(*ends(impulse["mean_error"], impulse["mean_error_std"]), 0.0, FROM_ZERO)
    n, share = float(impulse["n"]), float(impulse["coverage_95"])
    low, high = ends(share, (0.95 * 0.05 / n) ** 0.5)
    honest = side(low, high, 0.95, ("fewer than stated", "as stated", "more than stated"))
    return (
        f"The normal impulse errs by {percent(impulse['std'] / impulse['mean'])} of its mean (standard deviation), its "
        f"mean error is {bias}, and {percent(share)} of the stated {percent(0.95)} intervals hold the truth, {honest}. "
        f"The peak force errs by {estimate(peak['mean_error'], peak['mean_error_std'], 'N')} on average against the "
        f"compliant contact, and by {estimate(plate['mean_error'], plate['mean_error_std'], 'N')} against the force "
        f"plate, with a standard deviation of {number(plate['std'], unit='N')} (thesis: "
        f"{number(plate['thesis_mean_error'], unit='N')}, {number(plate['thesis_std'], unit='N')})."
    )


def _relative_rms(estimate: Series, truth: Series) -> float:
    return float((((estimate - truth) ** 2).sum() / (truth**2).sum()) ** 0.5)


def _against_thesis(errors: list[float]) -> str:
    """Whether relative errors of contact forces are within the thesis's error."""
    word = "within" if max(errors) <= THESIS_FORCES else "beyond" if min(errors) > THESIS_FORCES else "partly within"
    return f"{word} the thesis's {percent(THESIS_FORCES)}"
