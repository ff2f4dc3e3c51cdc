"""Findings of chapter 2: motions of mechanisms, m/I and hidden effects, contact forces and impulses."""

from typing import Any

from thesis_lib.records.rows import FROM_ZERO, DataFrame, Series, row_of
from thesis_lib.statistics.wording import count, ends, estimate, interval, listed, number, percent, side, times

OUTSIDE = "cogging"  # the only hidden cause that no effect of the critique's library describes
ARCS = "arcs"  # maximum likelihood over arcs, without a contact law
HYPOTHESES = {  # as in the figure of the measured m/I
    "as_published": "the data as they are",
    "mirrored_rotation": "rotation mirrored",
    "angle_offset": "angle offset",
    "rounded_corners": "rounded corners",
    "earlier_vy_post": "earlier v_y⁺",
}
THESIS_FORCES = 0.2  # section 2.4: contact forces of arm and disk are estimated to within about 20 %


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


def programs(table: DataFrame) -> str:
    """Starts from which each program converges to the truth."""
    counts = table.groupby("name", sort=False)[["n_success", "n_starts"]].sum()
    parts = [f"{name} {ok:,} of {n:,}" for name, (ok, n) in zip(counts.index, counts.to_numpy())]
    failed = (table["n_starts"] - table["n_success"]).groupby(table["mechanism"], sort=False).sum()
    where = str(failed.idxmax()).replace("arm_disk", "arm with disk")
    failures = f"{where} {int(failed.max())} of {int(failed.sum())}" if failed.any() else "none"
    wrong = count(table["n_false_claims"].sum(), table["n_claims"].sum())
    return (
        f"Starts that end at the truth: {'; '.join(parts)}. Most failures: {failures}. "
        f"Wrong claims of success: {wrong}."
    )


def figure_table_2_1(table: DataFrame) -> str:
    """Errors of m/I against the Cramér-Rao bound."""
    arcs, plain = (table.loc[table["method"] == name, "error_over_bound"] for name in (ARCS, "plain"))
    share = (2.0 * table["n"]) ** -0.5  # standard error of the root mean square of n normal errors, relative
    low, high = ends(arcs, arcs * share[arcs.index])
    above, below = int((low > 1.0).sum()), int((high < 1.0).sum())
    return (
        f"By maximum likelihood over arcs, without a contact law, m/I errs by {_span(arcs)} times the Cramér-Rao "
        f"bound ({int(table['n'].max())} drops each): of {len(arcs)} errors {above} lie above it, {below} below, and "
        f"{len(arcs) - above - below} are not told apart from it. By the plain program it errs by {_span(plain)} times "
        "the bound."
    )


def _span(values: Series) -> str:
    return f"{number(float(values.min()), digits=2)} to {number(float(values.max()), digits=2)}"


def table_2_1(table: DataFrame) -> str:
    """Bias of m/I."""
    best = table[table["snr"] == table["snr"].max()]
    parts = []
    for shape, group in best.groupby("shape"):
        rows = group.set_index("method")
        (arcs, arcs_std), (plain, plain_std) = rows.loc[[ARCS, "plain"], ["mean_error", "mean_error_std"]].to_numpy()
        word = side(*ends(arcs, arcs_std), 0.0, FROM_ZERO)
        parts.append(
            f"m/I of the {shape} errs on average by {estimate(arcs, arcs_std, '%')} by maximum likelihood over arcs, "
            f"{word}, by {estimate(plain, plain_std, '%')} by the plain program and by "
            f"{number(rows.loc['plain', 'thesis'], 2, '%')} in the thesis"
        )
    low, high = ends(table["mean_error"], table["mean_error_std"])
    biased = ((low > 0.0) | (high < 0.0)).groupby(table["method"]).agg(["sum", "size"])
    arcs, plain = (f"{biased.loc[name, 'sum']} of {biased.loc[name, 'size']}" for name in (ARCS, "plain"))
    return (
        f"At {number(float(best['snr'].iloc[0]), 2, 'dB')} {'; '.join(parts)}. Over all shapes and noise levels a bias "
        f"is told apart from zero in {arcs} cases by maximum likelihood, in {plain} by the plain program."
    )


def measured_ratio(table: DataFrame) -> str:
    """m/I as measured, against the dataset's header."""
    parts = [_measured(str(name), rows) for name, rows in table[table["status"] == "ok"].groupby("dataset", sort=False)]
    absent = table.loc[~table["dataset"].isin(table.loc[table["ratio"].notna(), "dataset"]), "dataset"]
    parts += [f"{name}: data not present." for name in dict.fromkeys(absent)]
    return " ".join(parts) if parts else "No measured dataset gives an estimate."


def _measured(dataset: str, rows: DataFrame) -> str:
    header = float(rows["published"].iloc[0])
    # a dataset has one of these two misfits of the residuals
    rows = rows.assign(misfit=rows["scale"].fillna(rows["velocity_noise"])).sort_values("misfit")
    best = row_of(rows, dataset=dataset)
    parts, holding = [], []
    for row in rows.to_dict("records"):
        name = " and ".join(HYPOTHESES.get(part, part) for part in str(row["variant"]).split("+"))
        is_best = row["variant"] == best["variant"]
        word = side(row["low"], row["high"], header, ("below", "not told apart from", "above"))
        if is_best or row["variant"] == "as_published":
            ratio = interval(row["ratio"], row["low"], row["high"], "1/m²")
            parts.append(f"{ratio} under {name}{', which leaves the least misfit' * is_best}, {word} the header")
        if row["low"] <= header <= row["high"]:
            holding.append(name if is_best else f"{name} (misfit {times(row['misfit'] / best['misfit'])} the least)")
    return (
        f"{dataset} (header: {number(header, 4, '1/m²')}): m/I is {'; '.join(parts)}. The header lies in the interval "
        f"of {listed(holding) if holding else 'no hypothesis'}."
    )


def figure_hidden(summary: DataFrame) -> str:
    """How often the hidden effect was found, and what adding it does to the forces."""
    datasets = summary["datasets"]
    right = (summary["right"] * datasets).round()
    parts = []
    for truth, setting in (("nothing", "with nothing hidden"), (OUTSIDE, f"with {OUTSIDE}, which is in no library,")):
        selected = summary["truth"] == truth
        if selected.any():
            parts.append(f"{setting} on {int(right[selected].sum())} of {int(datasets[selected].sum())}")
    named = summary[~summary["truth"].isin(["nothing", OUTSIDE])]
    named = named[named["snr_db"] == named["snr_db"].min()]
    before, after = (float(named[f"force_error_{when}"].median()) for when in ("before", "after"))
    change = "fall" if after < before else "rise"
    return (
        f"The critique is right on {count(right.sum(), datasets.sum())} datasets"
        f"{''.join(f', {part}' for part in parts)}. At {number(float(named['snr_db'].iloc[0]), 2, 'dB')} the errors of "
        f"contact forces {change} with the effect that was found from {percent(before)} to {percent(after)} (median of "
        "the hidden effects)."
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
