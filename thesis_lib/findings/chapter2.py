"""What the figures and tables of chapter 2 show: forces, m/I and hidden effects of simulated mechanisms."""

from typing import TYPE_CHECKING, Any

from thesis_lib.findings.finding import Finding
from thesis_lib.findings.rows import row_of
from thesis_lib.findings.wording import count, ends, estimate, interval, listing, number, percent, side, times

if TYPE_CHECKING:
    import pandas as pd

THESIS_FORCES = 0.2  # section 2.4: contact forces of arm and disk are estimated to within about 20 %
OUTSIDE = "cogging"  # the one hidden cause that no effect of the critique's library describes
ARCS = "arcs"  # maximum likelihood over arcs, without a contact law
FROM_ZERO = ("below zero", "not told apart from zero", "above zero")
HYPOTHESES = {  # as in the figure of the measured m/I
    "as_published": "the data as they are",
    "mirrored_rotation": "rotation mirrored",
    "angle_offset": "angle offset",
    "rounded_corners": "rounded corners",
    "earlier_vy_post": "earlier v_y⁺",
}


def figure_2_2(figure: "pd.DataFrame") -> str:
    """How each end of the rod meets the ground, and for how long."""
    said = []
    for end in ("left end", "right end"):
        steps = figure[(figure["panel"] == "modes") & (figure["series"] == end)].sort_values("t")
        mode, t = steps["mode"].to_numpy(), steps["t"].to_numpy()
        touching = (mode != "open").nonzero()[0]
        if not len(touching):
            said.append(f"The {end} does not land.")
            continue
        first = touching[0]
        changed = (mode[first:] != mode[first]).nonzero()[0]
        last = first + changed[0] if len(changed) else len(t) - 1
        lasted = number(t[last] - t[first], "s")
        said.append(f"The {end} lands at {number(t[first], 's')} and {mode[first]} for {lasted}.")
    return " ".join(said)


def figure_2_5(figure: "pd.DataFrame") -> str:
    """What a flat and a tilted landing determine."""
    said = []
    for panel, landing in (("c", "flat"), ("d", "tilted")):
        row = figure[(figure["panel"] == panel) & (figure["series"] == "square")].iloc[0]
        found = "a combination" if row["rank"] > 0 else "no combination"
        inertia = "I as well" if row["rank_mass_known"] > 0 else "not I either"
        largest = number(row["sigma_1"], digits=2)
        said.append(
            f"landing {landing} determines {found} of m and I (largest singular value of the regressor {largest}), "
            f"and with the mass known {inertia}"
        )
    return f"For the square without known force, {'; '.join(said)}."


def figure_2_9(figure: "pd.DataFrame") -> str:
    """How far the wheel comes with high and with low friction."""
    way, t = {}, 0.0
    for friction in ("high", "low"):
        own = figure[figure["panel"] == f"wheel, {friction} friction"]
        path = own[own["series"] == "path of the centre"].sort_values("t")
        moved = path[["x", "y"]].iloc[-1] - path[["x", "y"]].iloc[0]
        way[friction], t = float((moved**2).sum() ** 0.5), float(path["t"].iloc[-1])
    return (
        f"In {number(t, 's')} the wheel's centre comes {number(way['high'], 'm')} with high friction and "
        f"{number(way['low'], 'm')} with low friction, {times(way['low'] / way['high'])} as far."
    )


def figure_2_10(figure: "pd.DataFrame") -> str:
    """Angles that wheels of different masses have turned by."""
    last = figure.sort_values("t").groupby("mass")["theta"].last().abs()
    rises, falls = last.is_monotonic_increasing, last.is_monotonic_decreasing
    trend = "more with more mass" if rises else "less with more mass" if falls else "in no order of mass"
    spread = float(last.max() - last.min())
    return (
        f"After {number(float(figure['t'].max()), 's')} wheels of {listing([f'{mass:g}' for mass in last.index])} kg "
        f"have turned by {listing([number(angle) for angle in last])} rad, {trend}: up to {number(spread, 'rad')} "
        f"apart, {percent(spread / float(last.max()))} of the largest angle."
    )


def figure_2_11(figure: "pd.DataFrame", summary: "pd.DataFrame") -> str:
    """Whether the true normal forces lie within the stated errors of the estimate."""
    rolling = figure[figure["kind"] == "rolling"]
    force = rolling.pivot_table(index=["spoke", "t"], columns="series", values="force_or_impulse")
    force["std"] = rolling[rolling["series"] == "fit"].set_index(["spoke", "t"])["std"]
    force = force[force["truth"] > 0]
    within = float(((force["fit"] - force["truth"]).abs() <= 2.0 * force["std"]).mean())
    ours, plain = (_relative_rms(force[name], force["truth"]) for name in ("fit", "plain"))
    shares = [percent(share) for share in summary.loc[summary["method"] == "fit", "within_2_std"]]
    return (
        f"In the motion shown maximum likelihood errs by {percent(ours)} of the normal forces (rms), equation 2.12 on "
        f"the same noisy states by {percent(plain)}. The truth lies within two standard errors of our estimate in "
        f"{percent(within)} of the contact steps shown, and in {listing(shares)} for the spokes of all motions; "
        f"{percent(0.95)} would be right."
    )


def figure_2_12(figure: "pd.DataFrame") -> str:
    """Errors of the forces of arm and ground on the trajectory shown."""
    errors = {
        str(pair): [_relative_rms(own[name], own["true"]) for name in ("estimate", "plain")]
        for pair, own in figure.groupby("pair")
    }
    said = [
        f"{percent(ours)} at the {pair} (plain program: {percent(plain)})"
        for pair, (ours, plain) in errors.items()
    ]
    ours = [error for error, _ in errors.values()]
    worst: Any = figure.iloc[int((figure["estimate"] - figure["true"]).abs().argmax())]
    return (
        f"On the trajectory shown the forces err by {listing(said)}, rms over all steps, {_against_thesis(ours)}. "
        f"The largest error is that of a {worst['component']} force at the {worst['pair']}, "
        f"{number(worst['estimate'], 'N')} instead of {number(worst['true'], 'N')} at {number(worst['t'], 's')}."
    )


def figure_2_15(figure: "pd.DataFrame", summary: "pd.DataFrame") -> str:
    """The peak of the impact shown, and the spread of the impulses' errors."""
    peak = figure[figure["panel"] == "b"].groupby("series")["force"].max().astype(float)
    normal, tangential = (row_of(summary, method=ARCS, reference=name) for name in ("true_c_n", "true_c_t"))
    return (
        f"In the impact shown the half-sine peaks at {number(peak['estimate'], 'N')}, the compliant contact at "
        f"{number(peak['contact_force'], 'N')}, and the force plate's largest sample is {number(peak['sensor'], 'N')}. "
        f"Over {normal['n']:.0f} impacts the errors of normal and tangential impulse spread by "
        f"{number(normal['std'] / normal['std_stated'], digits=2)} and "
        f"{number(tangential['std'] / tangential['std_stated'], digits=2)} times their stated standard deviations."
    )


def figure_table_2_1(table: "pd.DataFrame") -> str:
    """Errors of m/I against the Cramér-Rao bound."""
    ours, plain = (table.loc[table["method"] == name, "error_over_bound"] for name in (ARCS, "plain"))
    share = (2.0 * table["n"]) ** -0.5  # standard error of the root mean square of n normal errors, relative
    low, high = ends(ours, ours * share[ours.index])
    above, below = int((low > 1.0).sum()), int((high < 1.0).sum())
    return (
        f"By maximum likelihood over arcs, without a contact law, m/I errs by {_span(ours)} times the Cramér-Rao "
        f"bound ({int(table['n'].max())} drops each): of {len(ours)} errors {above} lie above it, {below} below, and "
        f"{len(ours) - above - below} are not told apart from it. By the plain program it errs by {_span(plain)} times "
        "the bound."
    )


def table_2_1(table: "pd.DataFrame") -> str:
    """Bias of m/I."""
    best = table[table["snr"] == table["snr"].max()]
    said = []
    for shape, own in best.groupby("shape"):
        rows = own.set_index("method")
        (ours, ours_std), (plain, plain_std) = rows.loc[
            [ARCS, "plain"], ["mean_error", "mean_error_std"]
        ].to_numpy()
        word = side(*ends(ours, ours_std), 0.0, FROM_ZERO)
        said.append(
            f"m/I of the {shape} errs on average by {estimate(ours, ours_std, '%')} by maximum likelihood over arcs, "
            f"{word}, by {estimate(plain, plain_std, '%')} by the plain program and by "
            f"{number(rows.loc['plain', 'thesis'], '%', 2)} in the thesis"
        )
    low, high = ends(table["mean_error"], table["mean_error_std"])
    biased = ((low > 0.0) | (high < 0.0)).groupby(table["method"]).agg(["sum", "size"])
    ours, plain = (f"{biased.loc[name, 'sum']} of {biased.loc[name, 'size']}" for name in (ARCS, "plain"))
    return (
        f"At {number(float(best['snr'].iloc[0]), 'dB', 2)} {'; '.join(said)}. Over all shapes and noise levels a bias "
        f"is told apart from zero in {ours} cases by maximum likelihood, in {plain} by the plain program."
    )


def programs(table: "pd.DataFrame") -> str:
    """Starts from which each program finds the truth."""
    counts = table.groupby("name", sort=False)[["n_success", "n_starts"]].sum()
    said = [f"{name} {ok:,} of {n:,}" for name, (ok, n) in zip(counts.index, counts.to_numpy())]
    failed = (table["n_starts"] - table["n_success"]).groupby(table["mechanism"], sort=False).sum()
    where = str(failed.idxmax()).replace("arm_disk", "arm with disk")
    failures = f"{where} {int(failed.max())} of {int(failed.sum())}" if failed.any() else "none"
    wrong = count(table["n_false_claims"].sum(), table["n_claims"].sum())
    return (
        f"Starts that end at the truth: {'; '.join(said)}. Most failures: {failures}. "
        f"Wrong claims of success: {wrong}."
    )


def wheel_forces(table: "pd.DataFrame") -> str:
    """Errors of the spokes' forces, and refusals."""
    ours, plain = (table[table["method"] == method] for method in ("fit", "plain"))
    said = [
        f"{percent(ours[column].max())} of the {kind} force (plain program: {percent(plain[column].max())})"
        for kind, column in (("normal", "error_n_median"), ("tangential", "error_t_median"))
    ]
    n = int((ours["n"] + ours["n_failed"]).max())
    return (
        f"Maximum likelihood errs by {listing(said)}: medians over the motions, for the worst spoke. "
        f"Refused of {n} motions: {int(ours['n_failed'].max())} (plain program: {int(plain['n_failed'].max())})."
    )


def arm_summary(table: "pd.DataFrame") -> str:
    """Errors of forces and base parameters, and refusals."""
    rows = table.set_index(["quantity", "method"])
    median = {key: float(value) for key, value in rows["error_median"].items()}
    names = {
        "arm_force": "forces at the arm",
        "ground_force": "forces at the ground",
        "theta": "base parameters",
    }
    said = [
        f"{name} by {percent(median[key, 'ours'])} (plain program: {percent(median[key, 'plain'])})"
        for key, name in names.items()
    ]
    ours = table[table["method"] == "ours"]
    n = int(ours["n_trajectories"].max())
    good = float(ours.loc[ours["quantity"].isin(names), "share_5_percent"].min())
    return (
        f"In the median trajectory maximum likelihood errs in {listing(said)}; its errors of forces are "
        f"{_against_thesis([median['arm_force', 'ours'], median['ground_force', 'ours']])}. "
        f"Each of the three errs by at most {percent(0.05, 1)} in {count(good * n, n)} trajectories or more; "
        f"refused: {int(ours['n_failed'].max())}."
    )


def impact_force_summary(table: "pd.DataFrame") -> str:
    """Impulses and peaks against the simulation's."""
    impulse, peak, plate = (
        row_of(table, method=ARCS, reference=name) for name in ("true_c_n", "peak_true", "peak_sensor")
    )
    bias = side(*ends(impulse["mean_error"], impulse["mean_error_std"]), 0.0, FROM_ZERO)
    n, held = float(impulse["n"]), float(impulse["coverage_95"])
    low, high = ends(held, (0.95 * 0.05 / n) ** 0.5)
    honest = side(low, high, 0.95, ("fewer than stated", "as stated", "more than stated"))
    return (
        f"The normal impulse errs by {percent(impulse['std'] / impulse['mean'])} of its mean (standard deviation), its "
        f"mean error is {bias}, and {percent(held)} of the stated {percent(0.95)} intervals hold the truth, {honest}. "
        f"The peak force errs by {estimate(peak['mean_error'], peak['mean_error_std'], 'N')} on average against the "
        f"compliant contact, and by {estimate(plate['mean_error'], plate['mean_error_std'], 'N')} against the force "
        f"plate, with a standard deviation of {number(plate['std'], 'N')} (thesis: "
        f"{number(plate['thesis_mean_error'], 'N')}, {number(plate['thesis_std'], 'N')})."
    )


def measured_ratio(table: "pd.DataFrame") -> str:
    """m/I as measured, against the dataset's header."""
    table = table[table["status"] == "ok"]
    if table.empty:
        return "No measured dataset gives an estimate."
    return " ".join(_measured(str(name), rows) for name, rows in table.groupby("dataset", sort=False))


def _measured(dataset: str, rows: "pd.DataFrame") -> str:
    header = float(rows["published"].iloc[0])
    # the misfit of the residuals, whichever of the two the dataset allows
    rows = rows.assign(misfit=rows["scale"].fillna(rows["velocity_noise"])).sort_values("misfit")
    best = row_of(rows, dataset=dataset)
    said, held = [], []
    for row in rows.to_dict("records"):
        name = " and ".join(HYPOTHESES.get(part, part) for part in str(row["variant"]).split("+"))
        is_best = row["variant"] == best["variant"]
        word = side(row["low"], row["high"], header, ("below", "not told apart from", "above"))
        if is_best or row["variant"] == "as_published":
            found = interval(row["ratio"], row["low"], row["high"], "1/m²")
            said.append(
                f"{found} under {name}{', which leaves the least misfit' * is_best}, {word} the header"
            )
        if row["low"] <= header <= row["high"]:
            held.append(
                name if is_best else f"{name} (misfit {times(row['misfit'] / best['misfit'])} the least)"
            )
    return (
        f"{dataset} (header: {number(header, '1/m²', 4)}): m/I is {'; '.join(said)}. The header lies in the interval "
        f"of {listing(held) if held else 'no hypothesis'}."
    )


def figure_hidden(summary: "pd.DataFrame") -> str:
    """How often the hidden effect was found, and what that does to the forces."""
    datasets = summary["datasets"]
    right = (summary["right"] * datasets).round()
    said = []
    for truth, what in (
        ("nothing", "with nothing hidden"),
        (OUTSIDE, f"with {OUTSIDE}, which is in no library,"),
    ):
        own = summary["truth"] == truth
        if own.any():
            said.append(f"{what} on {int(right[own].sum())} of {int(datasets[own].sum())}")
    named = summary[~summary["truth"].isin(["nothing", OUTSIDE])]
    named = named[named["snr_db"] == named["snr_db"].min()]
    before, after = (float(named[f"force_error_{when}"].median()) for when in ("before", "after"))
    change = "fall" if after < before else "rise"
    return (
        f"The critique is right on {count(right.sum(), datasets.sum())} datasets"
        f"{''.join(f', {part}' for part in said)}. At {number(float(named['snr_db'].iloc[0]), 'dB', 2)} the errors of "
        f"contact forces {change} with the effect that was found from {percent(before)} to {percent(after)} (median of "
        "the hidden effects)."
    )


def _relative_rms(estimate: "pd.Series", truth: "pd.Series") -> float:
    return float((((estimate - truth) ** 2).sum() / (truth**2).sum()) ** 0.5)


def _span(values: "pd.Series") -> str:
    return f"{number(float(values.min()), digits=2)} to {number(float(values.max()), digits=2)}"


def _against_thesis(errors: list[float]) -> str:
    """Relative errors of contact forces against the thesis's."""
    word = (
        "within"
        if max(errors) <= THESIS_FORCES
        else "beyond"
        if min(errors) > THESIS_FORCES
        else "partly within"
    )
    return f"{word} the thesis's {percent(THESIS_FORCES)}"


FINDINGS = {
    "figure_2_2": Finding(("figure_2_2.csv",), figure_2_2),
    "figure_2_5": Finding(("figure_2_5.csv",), figure_2_5),
    "figure_2_9": Finding(("figure_2_9.csv",), figure_2_9),
    "figure_2_10": Finding(("figure_2_10.csv",), figure_2_10),
    "figure_2_11": Finding(("figure_2_11.csv", "wheel_forces.csv"), figure_2_11),
    "figure_2_12": Finding(("figure_2_12.csv",), figure_2_12),
    "figure_2_15": Finding(("figure_2_15.csv", "impact_force_summary.csv"), figure_2_15),
    "figure_table_2_1": Finding(("figure_table_2_1.csv",), figure_table_2_1),
    "table_2_1": Finding(("table_2_1.csv",), table_2_1),
    "programs": Finding(("programs.csv",), programs),
    "wheel_forces": Finding(("wheel_forces.csv",), wheel_forces),
    "arm_summary": Finding(("arm_summary.csv",), arm_summary),
    "impact_force_summary": Finding(("impact_force_summary.csv",), impact_force_summary),
    "measured_ratio": Finding(("measured_ratio.csv",), measured_ratio),
    "figure_hidden": Finding(("hidden_summary.csv",), figure_hidden),
}
