"""Functions for the findings of chapter 4, and names of learners and of models of throws."""

import math

from thesis_lib.statistics.wording import number, side
from thesis_lib.thesis.records.rows import DataFrame, Row, lies, row_of, share

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
SURE = 2.0  # number of standard errors over splits above which a difference counts
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
BELIEVED = "compliant_residual"  # the model whose predictive distributions figures 4-4 and 4-10 show


def below_bound(errors: DataFrame) -> float:
    """Share of impacts whose error by wrench, X1 is below their IRB bound; unsolved impacts count as not below."""
    by_impact = errors.pivot(index=["trial", "impact"], columns="model", values="error")
    return float((by_impact["wrench_x1"] < by_impact["irb_bound"]).mean())


def with_error(row: Row) -> str:
    """Value ± standard error, as in 1.041 ± 0.001, to the error's first digit; value alone for a single split."""
    value, std = row["value"], row["std"]
    if not std > 0.0:
        return number(value)
    decimals = max(0, -math.floor(math.log10(float(f"{std:.0e}"))))
    return f"{value:.{decimals}f} ± {std:.{decimals}f}"


def against_one(row: Row, words: tuple[str, str, str]) -> str:
    """Word for a ratio that is below, about or above 1, given its standard error."""
    return side(row["value"] - SURE * row["std"], row["value"] + SURE * row["std"], 1.0, words)


def as_stated(coverage: DataFrame) -> dict[str, list[str]]:
    """Models with the share of final positions in their central region, grouped by agreement with the stated share."""
    right, narrow, wide = "as many as stated, at the other levels too", "too few", "too many"
    uneven = "as many as stated, but not at every other level"
    groups: dict[str, list[str]] = {right: [], uneven: [], narrow: [], wide: []}
    for model, rows in coverage[coverage["kind"] == "roll"].groupby("model", sort=False):
        row = row_of(rows, level=SHOWN_LEVEL)
        group = right if rows["passes"].all() else lies(row, SHOWN_LEVEL, (narrow, uneven, wide))
        groups[group].append(f"{THROWERS[str(model)]} {share(row, 'coverage')}")
    return {word: models for word, models in groups.items() if models}


def slope(contacts: DataFrame, column: str) -> dict[str, float]:
    """Least-squares slope of a column over x, per 10 cm, with its 95 % interval."""
    from scipy.stats import linregress, t

    line = linregress(contacts["x"], contacts[column])
    half = float(t.ppf(0.975, len(contacts) - 2)) * line.stderr
    return {"value": 0.1 * line.slope, "low": 0.1 * (line.slope - half), "high": 0.1 * (line.slope + half)}


def share_below(belief: DataFrame) -> float:
    """Share of the predictive distribution of the resting position that lies below the measured position."""
    below = belief["distance"] <= belief["measured"].iloc[0]
    return float(belief.loc[below, "density"].sum() / belief["density"].sum())
