"""Findings of chapter 4: learned contact models, and errors and beliefs over the resting positions of dice."""

import math

from thesis_lib.records.rows import DataFrame, Row, compared, counted, lies, row_of, share, value
from thesis_lib.statistics.wording import listed, number, percent, side, times

LEARNERS = {  # as in the legends of figures 4-5 and 4-6
    "rigid_x1": "rigid, X1",
    "wrench_x1": "wrench, X1",
    "residual_rigid": "law + rigid residual",
    "residual_wrench": "law + wrench residual",
}
OVER_BOUND = {  # of learning_ratios.csv
    "rigid_over_irb": "rigid_x1",
    "wrench_over_irb": "wrench_x1",
    "residual_rigid_over_irb": "residual_rigid",
    "residual_wrench_over_irb": "residual_wrench",
}
SURE = 2.0  # standard errors over splits that count as a difference
THROWERS = {  # as in the legend of figure 4-8
    "law": "law alone",
    "residual": "law + rigid residual",
    "residual_wrench": "law + wrench residual",
    "critique": "critique's law",
    "compliant": "compliant contact",
    "compliant_residual": "compliant contact + residual",
}
SHOWN_LEVEL = 0.8
FEWEST = 3  # points for a slope with an interval
# thesis, figure 4-8: mean and standard deviation of the error at rest; section 4.4: share of right sides
PUBLISHED = {"law": (-0.97, 4.44, 0.23), "residual_wrench": (0.83, 1.83, 0.43)}
BELIEVED = "compliant_residual"  # the model whose beliefs figures 4-4 and 4-10 draw


def figure_4_5(ratios: DataFrame, errors: DataFrame) -> str:
    """Which models err less than the IRB Bound, by how much, and on how many impacts."""
    over = {name: row_of(ratios, statement=statement) for statement, name in OVER_BOUND.items()}
    shown = [f"{LEARNERS[name]}: {_with_error(row)}" for name, row in over.items()]
    below = [LEARNERS[name] for name, row in over.items() if _ratio_side(row, ("below", "", "")) == "below"]
    passed = f"below the bound {'is' if len(below) == 1 else 'are'} {listed(below)}" if below else "none is below it"
    by_impact = errors.pivot(index=["trial", "impact"], columns="model", values="error")
    # an impact that the model could not solve counts as not below the bound
    often = float((by_impact["wrench_x1"] < by_impact["irb_bound"]).mean())
    hoc = row_of(ratios, statement="best_post_hoc_over_rigid")
    rival = _ratio_side(hoc, ("errs more than", "is not told apart from", "errs less than"))
    return (
        f"With {counted(over['rigid_x1']['n'], 'training impact')} the mean error over the IRB Bound (± standard error "
        f"over splits) is {'; '.join(shown)}: {passed}. On {percent(often) if often else 'none'} of the held-out "
        f"impacts wrench, X1 errs less than the bound of that impact. Rigid, X1 {rival} Best Post Hoc, which errs "
        f"{_with_error(hoc)} times as much."
    )


def _with_error(row: Row) -> str:
    """1.041 ± 0.001: to the first digit of the standard error; without it for a single split."""
    value, std = row["value"], row["std"]
    if not std > 0.0:
        return number(value)
    decimals = max(0, -math.floor(math.log10(float(f"{std:.0e}"))))
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def _ratio_side(row: Row, words: tuple[str, str, str]) -> str:
    """The word for a ratio with a standard error below, about or above 1."""
    return side(row["value"] - SURE * row["std"], row["value"] + SURE * row["std"], 1.0, words)


def figure_4_6(summary: DataFrame, convergence: DataFrame) -> str:
    """How far errors fall with training impacts, and the number of impacts from which they are level."""
    curves = [_curve(summary, convergence, name) for name in ("rigid_x1", "wrench_x1", "residual_wrench")]
    first, last = summary["n"].min(), summary["n"].max()
    return (
        f"From {first:,.0f} to {counted(last, 'training impact')} the mean error {'; '.join(curves)}. "
        "The thesis finds about 100 impacts for rigid models and 300 for wrenches, on its ellipse."
    )


def _curve(summary: DataFrame, convergence: DataFrame, model: str) -> str:
    rows = summary[summary["model"] == model].sort_values("n")
    level = row_of(convergence, model=model)
    first, last = rows.iloc[0], rows.iloc[-1]
    moves = compared(last, first, ("falls", "goes, within its intervals,", "rises"))
    reached, low, high = (level[f"n_converged{end}"] for end in ("", "_low", "_high"))
    span = f"{reached:,.0f}" + (f" ({low:,.0f} to {high:,.0f})" if low != high else "")
    still = f"is level from {span} impacts on" if reached < last["n"] else "is not level before"
    return f"of {LEARNERS[model]} {moves} from {number(first['mean'])} to {_speed(last)} and {still}"


def figure_named_physics(drawn: DataFrame) -> str:
    """How much a learned wrench lowers the error before and after the effects are named, and what remains."""
    rungs = drawn[drawn["panel"] == "a"]
    law, wrench, effects, both = (
        row_of(rungs, model=name) for name in ("law", "law_wrench", "effects", "effects_wrench")
    )
    bound = row_of(rungs, model="irb_bound")["mean"]
    floor = rungs.loc[rungs["model"] == "noise_floor", "mean"]
    beyond = f"{times(both['mean'] / bound)} the IRB Bound of the data as given"
    beyond += f" and {times(both['mean'] / floor.iloc[0])} the noise floor" if len(floor) else ""
    return (
        f"With {counted(law['n'], 'training impact')} the law errs by {_speed(law)}; with a learned wrench residual by "
        f"{_speed(wrench)}, {compared(wrench, law)} the law alone; with what the critique named and nothing learned by "
        f"{_speed(effects)}, {compared(effects, wrench)} that residual. Both together err by {_speed(both)}, "
        f"{compared(both, effects)} what was named alone: {beyond}."
    )


def _speed(row: Row) -> str:
    return value(row, "mean", "m/s")


def figure_4_8(dice: DataFrame) -> str:
    """Bias and scatter of each model's error at rest, against the thesis."""
    mean, std = (dice[dice["quantity"] == name].set_index("model") for name in ("mean", "std"))
    parts = [
        f"{_error(mean, std, model)} (thesis {m:g} ± {s})".replace("-", "−") for model, (m, s, _) in PUBLISHED.items()
    ]
    least = str(std["value"].idxmin())
    if least not in PUBLISHED:
        parts.append(f"{_error(mean, std, least)}, the least scatter")
    scatter = compared(std.loc["residual_wrench"], std.loc["law"])
    biased = [THROWERS[str(name)] for name, row in mean.iterrows() if lies(row, 0.0, ("biased", "", "biased"))]
    return (
        f"Mean error ± standard deviation, in sides: {'; '.join(parts)}. The scatter with the learned wrench residual "
        f"is {scatter} that of the law alone; the intervals of the mean leave out zero for "
        f"{listed(biased) if biased else 'no model'}."
    )


def _error(mean: DataFrame, std: DataFrame, model: str) -> str:
    return f"{THROWERS[model]} {value(mean.loc[model])} ± {number(std.loc[model, 'value'])}"


def figure_calibration(coverage: DataFrame) -> str:
    """Which models' beliefs over resting positions are as wide as their errors."""
    rolls = coverage[coverage["kind"] == "roll"]
    right, narrow, wide = "as many as stated, at the other levels too", "too few", "too many"
    uneven = "as many as stated, but not at every other level"
    groups: dict[str, list[str]] = {right: [], uneven: [], narrow: [], wide: []}
    for model, rows in rolls.groupby("model", sort=False):
        row = row_of(rows, level=SHOWN_LEVEL)
        group = lies(row, SHOWN_LEVEL, (narrow, uneven, wide))
        groups[right if rows["passes"].all() else group].append(f"{THROWERS[str(model)]} {share(row, 'coverage')}")
    parts = [f"{word} ({', '.join(models)})" for word, models in groups.items() if models]
    return f"Measured ends inside the central {percent(SHOWN_LEVEL)} of the belief: {'; '.join(parts)}."


def figure_restitution(contacts: DataFrame) -> str:
    """The slope of restitution along the surface, measured and modelled, over first contacts (one per throw)."""
    first = contacts[contacts["first"] == 1]
    if len(first) < FEWEST:
        return f"There is too little for a slope: {counted(len(first), 'first contact')}."
    measured, model = (_slope(first, name) for name in ("measured", "model"))
    verb = lies(measured, 0.0, ("falls", "neither rises nor falls for sure", "rises"))
    return (
        f"Over {counted(len(first), 'first contact')} measured restitution, about {first['measured'].median():.2f}, "
        f"{verb} along the surface: {value(measured)} per 10 cm. That of the compliant contact has a slope of "
        f"{value(model)} per 10 cm, {compared(model, measured)} the measured one."
    )


def _slope(contacts: DataFrame, column: str) -> dict[str, float]:
    """Least-squares slope of a column over x, per 10 cm, with its 95 % interval."""
    from scipy.stats import linregress, t

    line = linregress(contacts["x"], contacts[column])
    half = float(t.ppf(0.975, len(contacts) - 2)) * line.stderr
    return {"value": 0.1 * line.slope, "low": 0.1 * (line.slope - half), "high": 0.1 * (line.slope + half)}


def figure_budget(budget: DataFrame) -> str:
    """What the first contacts of a throw cost its best model, and how well one can do without a model."""
    start = budget[(budget["contact"] == 0) & budget["model"].isin(list(THROWERS))].set_index("model")
    best = str(start["std"].idxmin())
    rows = budget[(budget["model"] == best) & (budget["contact"] > 0)]
    parts = [
        f"{percent(row['face_right'])} and {number(row['std'], digits=2)} sides from contact {row['contact']:.0f} "
        f"({percent(row['face_start'])} and {number(row['std_start'], digits=2)} from their release)"
        for _, row in rows.iterrows()
    ]
    nearest, pairs = (row_of(budget, model=name) for name in ("nearest", "pairs"))
    return (
        f"The {THROWERS[best]} names {percent(start.loc[best, 'face_right'])} of the faces from the release, with a "
        f"scatter of {number(start.loc[best, 'std'], digits=2)} sides; of throws that have the contact, "
        f"{listed(parts)}. Without a model, the nearest throws name {percent(nearest['face_right'])} and scatter by "
        f"{number(nearest['std'], digits=2)} sides; of pairs that start alike {percent(pairs['face_right'])} make as "
        f"many quarter turns, and they differ by {number(pairs['std'], digits=2)} sides over √2."
    )


def dice(table: DataFrame) -> str:
    """How near the models come to the measured ends, and to the limit set by the noise of the start."""

    def right(model: str, quantity: str = "face_right") -> str:
        return share(row_of(table, model=model, quantity=quantity))

    def missed(model: str) -> str:
        miss = value(row_of(table, model=model, quantity="median_abs"), unit="sides")
        return f"misses the end by {miss} and names the right side in {right(model)}"

    misses = table[table["quantity"] == "median_abs"].set_index("model")
    best = str(misses["value"].idxmin())
    sure = compared(misses.loc[best], misses.loc["law"], ("", ", not told apart from the law alone", ""))
    nearest = f"Nearest comes the {THROWERS[best]}: it {missed(best)}{sure}."
    limit, kept = (row_of(table, model=best, quantity=name)["value"] for name in ("limit_std", "limit_face"))
    alone, learned = (percent(PUBLISHED[model][2]) for model in ("law", "residual_wrench"))
    return (
        f"In the median over throws, the law alone {missed('law')}; without uncertainty it is right in "
        f"{right('law', 'face_right_certain')} (thesis: {alone}), and with a learned wrench residual in "
        f"{right('residual_wrench')} (thesis: {learned}). {nearest if best != 'law' else 'No model misses by less.'} "
        f"The noise of the measured start alone moves its ends by {number(limit, digits=2)} sides and keeps "
        f"{percent(kept)} of them on their side."
    )


def figure_4_4(drawn: DataFrame) -> str:
    """How the belief over one throw widens."""
    spread = drawn.drop_duplicates("state").set_index("state")["std"].rename({"start": "at the start"})
    steps = [f"{number(std, digits=2)} {state}" for state, std in spread.items()]
    grown = float(f"{spread.iloc[-1] / spread.iloc[0]:.0e}")
    return (
        f"The standard deviation of the horizontal position is, in sides, {listed(steps)}: it grows about "
        f"{grown:,.0f} times."
    )


def figure_4_10(drawn: DataFrame, difficulty: DataFrame) -> str:
    """Where the measured ends lie in the two beliefs, and whether a belief's width ranks throws by difficulty."""
    ends = [_end(drawn[drawn["case"] == case], case) for case in ("hard", "easy")]
    rank = row_of(difficulty, model=BELIEVED, spread="spread_rest")
    words = (
        "wide beliefs go with small errors",
        "the width of a belief does not tell large errors from small ones",
        "wide beliefs go with large errors",
    )
    return (
        f"{ends[0]} {ends[1]} Over all held-out throws {lies(rank, 0.0, words)}: rank correlation "
        f"{value(rank, 'rank_correlation')}."
    )


def _end(case: DataFrame, name: str) -> str:
    first = case.iloc[0]
    below = float(case.loc[case["distance"] <= first["measured"], "density"].sum() / case["density"].sum())
    inside = "inside" if 0.025 <= below <= 0.975 else "outside"
    return (
        f"The {name} throw (belief's standard deviation {number(first['std'], digits=2)} sides) ends {inside} the "
        f"central 95 % of its belief, {number(abs(first['measured'] - first['law']), digits=2)} sides from where the "
        "law alone puts it."
    )
