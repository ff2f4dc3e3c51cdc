"""What the figures of chapter 4 show: learned contact models, and dice thrown to rest by each of them.

Errors of impacts are the mean held-out error of the velocity after impact, in m/s; those of throws are in sides of the
die, measured minus expected.
"""

# pandas' stubs do not know what a row holds
# pyright: reportArgumentType=false, reportAttributeAccessIssue=false

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from thesis_lib.findings.finding import Finding
from thesis_lib.findings.rows import Row, compared, counted, row_of, share
from thesis_lib.findings.wording import interval, listing, number, percent, side, times

if TYPE_CHECKING:
    import pandas as pd

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
THROWERS = {  # as in the legend of figure 4-8
    "law": "law alone",
    "residual": "law + rigid residual",
    "residual_wrench": "law + wrench residual",
    "critique": "critique's law",
    "compliant": "compliant contact",
    "compliant_residual": "compliant contact + residual",
}
BELIEVED = "compliant_residual"  # whose beliefs figures 4-4 and 4-10 draw
SURE = 2.0  # standard errors over splits that count as a difference
SHOWN_LEVEL = 0.8
FEWEST = 3  # points for a slope with an interval
# thesis, figure 4-8: mean and standard deviation of the error at rest; section 4.4: share of right sides
PUBLISHED = {"law": (-0.97, 4.44, 0.23), "residual_wrench": (0.83, 1.83, 0.43)}


def figure_4_5(ratios: "pd.DataFrame", errors: "pd.DataFrame") -> str:
    """Which models pass the IRB Bound, by how much, and on how many impacts."""
    over = {name: row_of(ratios, statement=statement) for statement, name in OVER_BOUND.items()}
    shown = [f"{LEARNERS[name]}: {_with_error(row)}" for name, row in over.items()]
    below = [LEARNERS[name] for name, row in over.items() if _ratio_side(row, ("below", "", "")) == "below"]
    passed = (
        f"below the bound {'is' if len(below) == 1 else 'are'} {listing(below)}"
        if below
        else "none is below it"
    )
    by_impact = errors.pivot(index=["trial", "impact"], columns="model", values="error")
    # an impact that the model could not solve is none on which it is below the bound
    often = float((by_impact["wrench_x1"] < by_impact["irb_bound"]).mean())
    hoc = row_of(ratios, statement="best_post_hoc_over_rigid")
    rival = _ratio_side(hoc, ("errs more than", "is not told apart from", "errs less than"))
    return (
        f"With {counted(over['rigid_x1']['n'], 'training impact')} the mean error over the IRB Bound (± standard error "
        f"over splits) is {'; '.join(shown)}: {passed}. On {percent(often) if often else 'none'} of the held-out "
        f"impacts wrench, X1 errs less than the bound of that impact. Rigid, X1 {rival} Best Post Hoc, which errs "
        f"{_with_error(hoc)} times as much."
    )


def figure_4_6(summary: "pd.DataFrame", convergence: "pd.DataFrame") -> str:
    """How far errors fall with training impacts, and from where on they are level."""
    told = [_curve(summary, convergence, name) for name in ("rigid_x1", "wrench_x1", "residual_wrench")]
    first, last = summary["n"].min(), summary["n"].max()
    return (
        f"From {first:,.0f} to {counted(last, 'training impact')} the mean error {'; '.join(told)}. "
        "The thesis finds about 100 impacts for rigid models and 300 for wrenches, on its ellipse."
    )


def _curve(summary: "pd.DataFrame", convergence: "pd.DataFrame", model: str) -> str:
    own = summary[summary["model"] == model].sort_values("n")
    level = row_of(convergence, model=model)
    first, last = own.iloc[0], own.iloc[-1]
    moves = compared(last, first, ("falls", "goes, within its intervals,", "rises"))
    reached, low, high = (level[f"n_converged{end}"] for end in ("", "_low", "_high"))
    span = f"{reached:,.0f}" + (f" ({low:,.0f} to {high:,.0f})" if low != high else "")
    still = f"is level from {span} impacts on" if reached < last["n"] else "is not level before"
    return f"of {LEARNERS[model]} {moves} from {number(first['mean'])} to {_speed(last)} and {still}"


def figure_named_physics(drawn: "pd.DataFrame") -> str:
    """What a learned wrench takes away before and after the effects are named, and what is then left."""
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


def figure_4_4(drawn: "pd.DataFrame") -> str:
    """How the belief over one throw widens."""
    spread = drawn.drop_duplicates("state").set_index("state")["std"].rename({"start": "at the start"})
    steps = [f"{number(std, digits=2)} {state}" for state, std in spread.items()]
    grown = float(f"{spread.iloc[-1] / spread.iloc[0]:.0e}")
    return (
        f"The standard deviation of the horizontal position is, in sides, {listing(steps)}: it grows about "
        f"{grown:,.0f} times."
    )


def figure_4_8(dice: "pd.DataFrame") -> str:
    """Bias and scatter of each model's error at rest, against the thesis."""
    mean, std = (dice[dice["quantity"] == name].set_index("model") for name in ("mean", "std"))
    told = [
        f"{_error(mean, std, model)} (thesis {m:g} ± {s})".replace("-", "−")
        for model, (m, s, _) in PUBLISHED.items()
    ]
    least = str(std["value"].idxmin())
    if least not in PUBLISHED:
        told.append(f"{_error(mean, std, least)}, the least scatter")
    scatter = compared(std.loc["residual_wrench"], std.loc["law"])
    words = ("biased", "", "biased")
    biased = [
        THROWERS[str(name)] for name, row in mean.iterrows() if side(row["low"], row["high"], 0.0, words)
    ]
    return (
        f"Mean error ± standard deviation, in sides: {'; '.join(told)}. The scatter with the learned wrench residual "
        f"is {scatter} that of the law alone; the intervals of the mean leave out zero for "
        f"{listing(biased) if biased else 'no model'}."
    )


def _error(mean: "pd.DataFrame", std: "pd.DataFrame", model: str) -> str:
    row = mean.loc[model]
    return f"{THROWERS[model]} {interval(row['value'], row['low'], row['high'])} ± {number(std.loc[model, 'value'])}"


def figure_4_10(drawn: "pd.DataFrame", difficulty: "pd.DataFrame") -> str:
    """Where the measured ends lie in the two beliefs, and whether width grades difficulty over all throws."""
    told = [_end(drawn[drawn["case"] == case], case) for case in ("hard", "easy")]
    rank = row_of(difficulty, model=BELIEVED, spread="spread_rest")
    words = (
        "wide beliefs go with small errors",
        "the width of a belief does not tell large errors from small ones",
        "wide beliefs go with large errors",
    )
    return (
        f"{told[0]} {told[1]} Over all held-out throws {side(rank['low'], rank['high'], 0.0, words)}: rank correlation "
        f"{interval(rank['rank_correlation'], rank['low'], rank['high'])}."
    )


def _end(case: "pd.DataFrame", name: str) -> str:
    first = case.iloc[0]
    below = float(case.loc[case["distance"] <= first["measured"], "density"].sum() / case["density"].sum())
    inside = "inside" if 0.025 <= below <= 0.975 else "outside"
    return (
        f"The {name} throw (belief's standard deviation {number(first['std'], digits=2)} sides) ends {inside} the "
        f"central 95 % of its belief, {number(abs(first['measured'] - first['law']), digits=2)} sides from where the "
        "law alone puts it."
    )


def dice(table: "pd.DataFrame") -> str:
    """How near the models come to the measured ends, and to what the noise of the start would allow."""

    def right(model: str, quantity: str = "face_right") -> str:
        return share(row_of(table, model=model, quantity=quantity))

    def missed(model: str) -> str:
        miss = row_of(table, model=model, quantity="median_abs")
        ends = interval(miss["value"], miss["low"], miss["high"], "sides")
        return f"misses the end by {ends} and names the right side in {right(model)}"

    misses = table[table["quantity"] == "median_abs"].set_index("model")
    best = str(misses["value"].idxmin())
    sure = compared(misses.loc[best], misses.loc["law"], ("", ", not told apart from the law alone", ""))
    nearest = f"Nearest comes the {THROWERS[best]}: it {missed(best)}{sure}."
    limit, kept = (row_of(table, model=best, quantity=name)["value"] for name in ("limit_std", "limit_face"))
    told, learned = (percent(PUBLISHED[model][2]) for model in ("law", "residual_wrench"))
    return (
        f"In the median over throws, the law alone {missed('law')}; without uncertainty it is right in "
        f"{right('law', 'face_right_certain')} (thesis: {told}), and with a learned wrench residual in "
        f"{right('residual_wrench')} (thesis: {learned}). {nearest if best != 'law' else 'No model misses by less.'} "
        f"The noise of the measured start alone moves its ends by {number(limit, digits=2)} sides and keeps "
        f"{percent(kept)} of them on their side."
    )


def figure_calibration(coverage: "pd.DataFrame") -> str:
    """Whose beliefs over resting positions are as wide as their errors, and whose are not."""
    rolls = coverage[coverage["kind"] == "roll"]
    right, narrow, wide = "as many as stated, at the other levels too", "too few", "too many"
    uneven = "as many as stated, but not at every other level"
    groups: dict[str, list[str]] = {right: [], uneven: [], narrow: [], wide: []}
    for model, own in rolls.groupby("model", sort=False):
        row = row_of(own, level=SHOWN_LEVEL)
        group = side(row["low"], row["high"], SHOWN_LEVEL, (narrow, uneven, wide))
        groups[right if own["passes"].all() else group].append(
            f"{THROWERS[str(model)]} {share(row, 'coverage')}"
        )
    told = [f"{word} ({', '.join(models)})" for word, models in groups.items() if models]
    return f"Measured ends inside the central {percent(SHOWN_LEVEL)} of the belief: {'; '.join(told)}."


def figure_restitution(contacts: "pd.DataFrame") -> str:
    """The slope of restitution along the surface, measured and modelled, of the first contacts (one a throw)."""
    first = contacts[contacts["first"] == 1]
    if len(first) < FEWEST:
        return f"There is too little for a slope: {counted(len(first), 'first contact')}."
    measured, model = (_slope(first, name) for name in ("measured", "model"))
    verb = side(
        measured["low"], measured["high"], 0.0, ("falls", "neither rises nor falls for sure", "rises")
    )
    return (
        f"Over {counted(len(first), 'first contact')} measured restitution, about {first['measured'].median():.2f}, "
        f"{verb} along the surface: {_per_10_cm(measured)}. That of the compliant contact has a slope of "
        f"{_per_10_cm(model)}, {compared(model, measured)} the measured one."
    )


def _slope(contacts: "pd.DataFrame", column: str) -> dict[str, float]:
    """Least squares of a column on x, per 10 cm, with its 95 % interval."""
    from scipy.stats import linregress, t

    line = linregress(contacts["x"], contacts[column])
    half = float(t.ppf(0.975, len(contacts) - 2)) * line.stderr
    return {"value": 0.1 * line.slope, "low": 0.1 * (line.slope - half), "high": 0.1 * (line.slope + half)}


def _per_10_cm(slope: Mapping[str, float]) -> str:
    return f"{interval(slope['value'], slope['low'], slope['high'])} per 10 cm"


def _ratio_side(row: Row, words: tuple[str, str, str]) -> str:
    """Where a ratio with a standard error lies from 1."""
    return side(row["value"] - SURE * row["std"], row["value"] + SURE * row["std"], 1.0, words)


def _with_error(row: Row) -> str:
    """1.041 ± 0.001: to the first digit of the standard error; without it where a single split was drawn."""
    value, std = row["value"], row["std"]
    if not std > 0.0:
        return number(value)
    decimals = max(0, -math.floor(math.log10(float(f"{std:.0e}"))))
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def _speed(row: Row) -> str:
    return interval(row["mean"], row["low"], row["high"], "m/s")


LEARNED = {  # of every dataset
    "figure_4_5": Finding(("learning_ratios.csv", "learning_errors.csv"), figure_4_5),
    "figure_4_6": Finding(("learning_summary.csv", "learning_convergence.csv"), figure_4_6),
}
NAMED = {  # of datasets that were criticised
    "figure_named_physics": Finding(("figure_named_physics.csv",), figure_named_physics),
}
THROWN = {  # of dice
    "figure_4_4": Finding(("figure_4_4.csv",), figure_4_4),
    "figure_4_8": Finding(("dice.csv",), figure_4_8),
    "figure_4_10": Finding(("figure_4_10.csv", "dice_difficulty.csv"), figure_4_10),
    "figure_calibration": Finding(("dice_calibration.csv",), figure_calibration),
    "figure_restitution": Finding(("figure_restitution.csv",), figure_restitution),
    "dice": Finding(("dice.csv",), dice),
}
FINDINGS = {**LEARNED, **NAMED, **THROWN}
