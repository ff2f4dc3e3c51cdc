"""Table 2.1, m/I and hidden effects: what follows from motion, and what is missing."""

from thesis_lib.records.record import MEASURED, Figure, Job, Table, Tolerance
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
MEANS = Tolerance("a minimum that ends elsewhere in one noisy drop moves a mean by this much", abs=0.01, rel=0.02)
WEIGHTED = Tolerance("iterated weights; bootstrap draws are seeded", abs=1e-06, rel=0.001)
GATHER = Job("ch2_gather", "chapter2", group="programs")
NOISE = Job("ch2_table_2_1", "chapter2", group="noise")
MEASURED_RATIOS = Job("ch2_measured_ratios", "chapter2", group="measured data")
MEASURED_RATIO_OF_ONE = Job("ch2_measured_ratio", "chapter2/{dataset}", datasets=MEASURED)
HIDDEN = Job("ch2_hidden", "chapter2", group="hidden effects")
ESTIMATES = {  # shared by the table and its figure
    "title": "Estimates of m/I from noisy drops of block and ellipse",
    "caption": """The thesis's mean errors, a plain program (eq. 2.23), least squares at the true impact steps, and
our maximum likelihood over arcs with free impulses, with gaps, and with the contact law, beside the Cramér-Rao bound.
The thesis's column for the ellipse contradicts its text: its percentages are those of m/I near 6, not of 0.8.

What to look for: bias, which does not fall with more drops, and how near our errors come to the bound.""",
}
RATIOS = {  # shared by the table and its figure
    "title": "m/I = 1/k² from the measured impacts, under each hypothesis about the measurement",
    "caption": """With bootstrap intervals over trials and the range that any ratio of noises allows, against the
value of the dataset's header. The thesis's own 280 drops are not public.

What to look for: the hypotheses whose interval holds the value of the header.""",
}


@Table.found_by(
    job=GATHER,
    title="Starts from which each program finds parameters and contact forces",
    caption="""Counted are random starts that end within 1e-6 of the truth, for each program of thesis section
2.3.2, mechanism and window length, on noise-free windows. A solver's own claim of success does not count; claims that
are wrong are counted beside it. The qp is our mode-wise quadratic program.

What to look for: window lengths at which a program stops finding the truth, and claims of success that are wrong.""",
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


@Figure.found_by(
    job=NOISE,
    **ESTIMATES,
    keys="shape method snr",
    tolerances={"n mean_error mean_error_std error_over_bound thesis": MEANS},
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


TABLE_2_1 = Table(name="table_2_1", job=NOISE, **ESTIMATES, finding=table_2_1, reads=("table_2_1.csv",))


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


MEASURED_RATIO = Table(
    name="measured_ratio", job=MEASURED_RATIOS, **RATIOS, finding=measured_ratio, reads=("measured_ratio.csv",)
)

FIGURE_MEASURED_RATIO = Figure(
    name="figure_measured_ratio",
    job=MEASURED_RATIO_OF_ONE,
    **RATIOS,
    finding=measured_ratio,
    reads=("measured_ratio.csv",),
    keys="variant misfit_unit",
    tolerances={"ratio std low high published lower upper misfit": WEIGHTED},
    columns={
        "misfit": ("", "scatter about the rigid impact, in units of misfit_unit"),
        "misfit_unit": ("", "sigma: median deviation over the noise; m/s: noise of one velocity, where none is known"),
    },
)


@Figure.found_by(
    job=HIDDEN,
    title="What was hidden in arm and wheel, and what the critique found",
    caption="""Rows: what was hidden in simulated trials. Columns: what the critique of their residual forces found
first, over datasets, mechanisms and noise levels. Also drawn: contact forces of one trial, computed without and with
the effect that was found.

What to look for: entries off the diagonal, which are wrong names; and computed forces that return to the truth with the
effect.""",
    reads=("hidden_summary.csv",),
    keys="panel truth column",
    tolerances={"t value": Tolerance("shares are counts; forces by one least squares", abs=0.001, rel=0.001)},
    columns={
        "panel": ("", "mechanism, or component of the force drawn"),
        "truth": ("", "what was hidden; empty for forces"),
        "column": ("", "what was found first or the verdict; of forces: true, without, with_effects"),
        "t": ("s", "time; empty for shares"),
        "value": ("1 or N", "share of datasets, or force"),
    },
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
