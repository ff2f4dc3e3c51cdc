"""Functions for the findings of chapter 2: motions of mechanisms, m/I, contact forces."""

from thesis_lib.statistics.wording import ends, interval, listed, number, percent, side, times
from thesis_lib.thesis.records.rows import DataFrame, Series, row_of

OUTSIDE = "cogging"  # the only hidden cause that no effect of the critique's library describes
HYPOTHESES = {  # as in the figure of the measured m/I
    "as_published": "the data as they are",
    "mirrored_rotation": "rotation mirrored",
    "angle_offset": "angle offset",
    "rounded_corners": "rounded corners",
    "earlier_vy_post": "earlier v_y⁺",
}
THESIS_FORCES = 0.2  # section 2.4: contact forces of arm and disk are estimated to within about 20 %


def landing(figure: DataFrame, end: str) -> str:
    """Sentence on the landing of an end of the rod: instant, first mode of contact, and its duration (figure 2-2)."""
    steps = figure[(figure["panel"] == "modes") & (figure["series"] == end)].sort_values("t")
    mode, t = steps["mode"].to_numpy(), steps["t"].to_numpy()
    touching = (mode != "open").nonzero()[0]
    if not len(touching):
        return f"The {end} does not land."
    first = touching[0]
    changed = (mode[first:] != mode[first]).nonzero()[0]
    last = first + changed[0] if len(changed) else len(t) - 1
    lasted = number(t[last] - t[first], unit="s")
    return f"The {end} lands at {number(t[first], unit='s')} and {mode[first]} for {lasted}."


def travelled(figure: DataFrame, friction: str) -> float:
    """Distance in m by which the centre of the wheel moves with high or low friction (figure 2-9)."""
    rows = figure[figure["panel"] == f"wheel, {friction} friction"]
    path = rows[rows["series"] == "path of the centre"].sort_values("t")
    moved = path[["x", "y"]].iloc[-1] - path[["x", "y"]].iloc[0]
    return float((moved**2).sum() ** 0.5)


def against_bound(table: DataFrame) -> tuple[Series, int, int]:
    """Errors of m/I by arcs over the Cramér-Rao bound, and the numbers of them significantly above and below 1."""
    arcs = table.loc[table["method"] == "arcs", "error_over_bound"]
    share = (2.0 * table["n"]) ** -0.5  # standard error of the root mean square of n normal errors, relative
    low, high = ends(arcs, arcs * share[arcs.index])
    return arcs, int((low > 1.0).sum()), int((high < 1.0).sum())


def span(values: Series) -> str:
    """Range of values, as text."""
    return f"{number(float(values.min()), digits=2)} to {number(float(values.max()), digits=2)}"


def biased(table: DataFrame, method: str) -> str:
    """Number of cases, of all, in which the bias of a method differs significantly from zero, as text."""
    low, high = ends(table["mean_error"], table["mean_error_std"])
    sure = ((low > 0.0) | (high < 0.0))[table["method"] == method]
    return f"{sure.sum()} of {len(sure)}"


def against_header(dataset: str, rows: DataFrame) -> str:
    """Sentence that compares m/I of a dataset, under the relevant hypotheses, with the value in its header."""
    header = float(rows["published"].iloc[0])
    # each dataset has one of these two measures of misfit
    rows = rows.assign(misfit=rows["scale"].fillna(rows["velocity_noise"])).sort_values("misfit")
    best = row_of(rows, dataset=dataset)
    parts, holding = [], []
    for row in rows.to_dict("records"):
        name = " and ".join(HYPOTHESES.get(part, part) for part in str(row["variant"]).split("+"))
        is_best = row["variant"] == best["variant"]
        word = side(row["low"], row["high"], header, ("below", "indistinguishable from", "above"))
        if is_best or row["variant"] == "as_published":
            ratio = interval(row["ratio"], row["low"], row["high"], "1/m²")
            parts.append(f"{ratio} under {name}{', which leaves the least misfit' * is_best}, {word} the header")
        if row["low"] <= header <= row["high"]:
            holding.append(name if is_best else f"{name} (misfit {times(row['misfit'] / best['misfit'])} the least)")
    return (
        f"{dataset} (header: {number(header, 4, '1/m²')}): m/I is {'; '.join(parts)}. The header lies in the interval "
        f"of {listed(holding) if holding else 'no hypothesis'}."
    )


def absent(table: DataFrame) -> list[str]:
    """Datasets without any estimate, because they are not available in this run."""
    there = table.loc[table["ratio"].notna(), "dataset"]
    return list(dict.fromkeys(table.loc[~table["dataset"].isin(there), "dataset"]))


def rolling_forces(figure: DataFrame) -> tuple[float, float, float]:
    """Relative errors of fit and plain program, and share of true forces within two standard errors of the fit."""
    rolling = figure[figure["kind"] == "rolling"]
    force = rolling.pivot_table(index=["spoke", "t"], columns="series", values="force_or_impulse")
    force["std"] = rolling[rolling["series"] == "fit"].set_index(["spoke", "t"])["std"]
    force = force[force["truth"] > 0]
    within = float(((force["fit"] - force["truth"]).abs() <= 2.0 * force["std"]).mean())
    return relative_rms(force["fit"], force["truth"]), relative_rms(force["plain"], force["truth"]), within


def relative_rms(estimate: Series, truth: Series) -> float:
    """Root mean square error of estimates over the root mean square of the truth."""
    return float((((estimate - truth) ** 2).sum() / (truth**2).sum()) ** 0.5)


def against_thesis(errors: list[float]) -> str:
    """Phrase that states whether relative errors of contact forces are within the thesis's error."""
    word = "within" if max(errors) <= THESIS_FORCES else "beyond" if min(errors) > THESIS_FORCES else "partly within"
    return f"{word} the thesis's {percent(THESIS_FORCES)}"
