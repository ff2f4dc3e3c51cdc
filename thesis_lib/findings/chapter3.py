"""What the figures and tables of chapter 3 show of one dataset: parameters, errors and ranges of the impact laws."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from thesis_lib.findings.finding import Finding
from thesis_lib.findings.rows import row_of
from thesis_lib.findings.wording import count, ends, estimate, listing, number, percent, side, times

if TYPE_CHECKING:
    import pandas as pd

CONVERGED = 100  # section 3.4: impacts from which on the parameters have converged, "about"
ABOUT = 1.5  # times as many is not "about" as many
INCLINED_PLANE = 0.3  # μ of PLA on aluminium, section 3.4
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
MAPPED = "anitescu_potra_poisson"  # that of figure 3-9
MU_ZERO = 1e-3  # below it an individual μ counts as zero, as in statements.csv
FROM_ZERO = ("below zero", "not told apart from zero", "above zero")
THESIS_RANGE = (0.355, 0.458)  # Table 3.2, smallest and largest fraction
PUBLISHED = "_as_published"
VISCOUS = "mirtich"  # its μ as published is no coefficient of friction: s/m


def figure_3_3(coverage: "pd.DataFrame") -> str:
    """Shares of the admissible set that the laws cover."""
    share = coverage.set_index("law")["share"]
    own_code = share.index.str.endswith(PUBLISHED)
    as_defined, differing = share[~own_code], share[own_code].rename(lambda law: law.removesuffix(PUBLISHED))
    # a law whose published code is that law stands for both
    as_published = differing.combine_first(as_defined)
    return (
        f"Over the simulated drops the laws cover on average {_ends_of(as_published, percent)} of the admissible set "
        f"as published, and {_ends_of(as_defined, percent)} as defined: every law leaves out "
        f"{percent(1.0 - share.max(), 3)} of it or more."
    )


def figure_3_6(statements: "pd.DataFrame") -> str:
    """Energy over impacts and between them, of all trials."""
    loss, taken = (row_of(statements, statement=name) for name in ("energy_loss", "energy_taken"))
    text = (
        f"Over all trials {percent(loss['value'])} of the impacts lower the total energy, and an impact takes "
        f"{estimate(100 * taken['value'], 100 * taken['std'], '%')} of it on average."
    )
    if not (statements["statement"] == "energy_between").any():
        return text
    between = row_of(statements, statement="energy_between")
    word = side(*ends(between["value"], between["std"]), 0.0, FROM_ZERO)
    return (
        f"{text} Over a flight between two impacts it changes by "
        f"{estimate(100 * between['value'], 100 * between['std'], '%')}, {word}."
    )


def figure_3_7(convergence: "pd.DataFrame", statements: "pd.DataFrame") -> str:
    """The valley of the cost, and from how many impacts the parameters have converged."""
    minima = int(row_of(statements, statement="local_minima")["value"])
    bent = row_of(statements, statement="convexity_violations")["value"]
    valley = (
        f"(a) The grid has {minima} local minim{'um' if minima == 1 else 'a'}, and the cost is not convex at "
        f"{percent(bent)} of it."
    )
    own = statements[(statements["statement"] == "converged_at") & statements["law"].notna()]
    if own.empty:
        return valley
    k = own.set_index("law")["value"]
    most = float(convergence["k"].max())
    earlier, later = k.max() <= ABOUT * CONVERGED, k.min() > ABOUT * CONVERGED
    word = "no later than" if earlier else "later than" if later else "for some laws later than"
    judged = f", {word} the thesis's about {CONVERGED}" if most > ABOUT * CONVERGED else ""
    slowest = convergence[convergence["law"] == k.idxmax()]
    at = slowest[slowest["k"] == slowest.loc[slowest["k"] <= CONVERGED, "k"].max()]
    last = slowest.loc[slowest["k"] == slowest["k"].max(), "mu"].mean()
    spread = (
        f" At {at['k'].iloc[0]:.0f} impacts the subsets' μ of {_title(str(k.idxmax()))} are {number(at['mu'].min())} "
        f"to {number(at['mu'].max())}, in the end {number(last)}."
        if len(at) and at["k"].iloc[0] < most
        else ""
    )
    return (
        f"{valley} (b) In every subset μ and ε stay within {percent(0.1)} of their last values from "
        f"{_ends_of(k, '{:.0f}'.format)} impacts on, of {most:.0f} followed{judged}.{spread}"
    )


def figure_3_8(summary: "pd.DataFrame", statements: "pd.DataFrame") -> str:
    """Errors of laws and bounds, and what the sense of rotation does to the bound."""
    error = summary.set_index("model")["mean"]
    bounds = error.index.str.startswith("best_post_hoc") | (error.index == "irb_bound")
    laws, post_hoc = error[~bounds], error[error.index.str.startswith("best_post_hoc")].min()
    bound, mirrored = (row_of(statements, statement=name) for name in ("irb_bound", "irb_bound_mirrored"))
    least, most = str(laws.idxmin()), str(laws.idxmax())
    word = side(*_difference(mirrored, bound), 0.0, ("falls to", "is not told apart, with", "rises to"))
    return (
        f"The IRB Bound is {estimate(bound['value'], bound['std'], 'm/s')}, {times(bound['value'] / laws[least])} the "
        f"least mean error of a law ({number(laws[least], 'm/s')}, {_title(least)}); the largest is "
        f"{number(laws[most], 'm/s')} ({_title(most)}), and Best Post Hoc has {number(post_hoc, 'm/s')}. "
        f"With the rotation read clockwise the bound {word} {estimate(mirrored['value'], mirrored['std'], 'm/s')}."
    )


def figure_3_9(figure: "pd.DataFrame", statements: "pd.DataFrame") -> str:
    """Errors near zero tangential momentum, and on its two sides."""
    rows = statements[(statements["statement"] == "small_momentum") & (statements["law"] == MAPPED)]
    said = [
        f"Where the tangential momentum is least (a fourth of the impacts) the error is "
        f"{_ratio(value, std, 'of the others')}; the thesis finds it largest there."
        for value, std in rows[["value", "std"]].to_numpy()
    ]
    impacts = figure[figure["series"] == "impact"]
    sides = [impacts.loc[impacts["momentum_t"] * sign > 0, "error"] for sign in (-1, 1)]
    if min(map(len, sides)) > 1:
        (left, left_std), (right, right_std) = (
            (float(own.mean()), float(own.std() / len(own) ** 0.5)) for own in sides
        )
        std = ((left_std / right) ** 2 + (left * right_std / right**2) ** 2) ** 0.5
        said.append(f"Left of the dashed line it is {_ratio(left / right, std, 'on the right')}.")
    return " ".join(said) or "All impacts lie on one side of the dashed line."


def figure_3_10(figure: "pd.DataFrame", statements: "pd.DataFrame") -> str:
    """Impacts that are explained best without friction, and the spread of the individual parameters."""
    mean = row_of(statements, statement="individual_minus_ensemble_mu", law=STUDIED)
    peak, peaks = (
        row_of(statements, statement=name, law=STUDIED)["value"] for name in ("epsilon_mode", "epsilon_modes")
    )
    panel = figure[figure["panel"] == "a"]
    each = panel[(panel["series"] == "individual") & panel["misfit"].notna()]
    zero = each["mu"] < MU_ZERO
    here, elsewhere = each.loc[zero, "misfit"].mean(), each.loc[~zero, "misfit"].mean()
    misfit = (
        f", with {times(here / elsewhere)} the mean misfit of the others"
        if zero.any() and elsewhere > 0
        else ""
    )
    ensemble = float(panel.loc[panel["series"] == "ensemble", "mu"].iloc[0])
    word = side(*ends(mean["value"], mean["std"]), 0.0, ("below", "not told apart from", "above"))
    return (
        f"{count(zero.sum(), len(each))} impacts are explained best without friction{misfit}. The mean of the single "
        f"μ, {number(each['mu'].mean())}, is {word} the ensemble's {number(ensemble)}; their standard deviation is "
        f"{number(each['mu'].std())}. The density of ε has {int(peaks)} peak{'s' if peaks > 1 else ''}, the highest at "
        f"{number(peak)}."
    )


def figure_3_11(statements: "pd.DataFrame") -> str:
    """How often impulses lie beyond the line of sticking and slip reverses, measured and predicted."""
    beyond, back = row_of(statements, statement="beyond_sticking"), row_of(statements, statement="back_spin")
    own = row_of(statements, statement="predicted_back_spin", law=STUDIED)
    predicted = statements[statements["statement"] == "predicted_beyond_sticking"].set_index("law")["value"]
    most = str(predicted.idxmax())
    reach = (
        f"{int((predicted == 0).sum())} of {len(predicted)} laws never predict that, {_title(most)} does most often "
        f"({percent(predicted[most])})"
        if predicted[most] > 0
        else "no law predicts that"
    )
    word = side(*_difference(own, back), 0.0, ("fewer", "not told apart", "more"))
    return (
        f"Of all held-out impulses {estimate(100 * beyond['value'], 100 * beyond['std'], '%')} lie beyond the line of "
        f"sticking; {reach}. Slip reverses in {estimate(100 * back['value'], 100 * back['std'], '%')}; "
        f"{_title(STUDIED)} with the ensemble's parameters predicts {percent(own['value'])}, {word}."
    )


def table_3_1(table: "pd.DataFrame") -> str:
    """Friction against the inclined plane's, and which law is nearest and farthest."""
    authors, kinetic = _part(table, "as_published", "unweighted"), _part(table, "as_defined", "kinetic")
    friction = authors.drop(VISCOUS, errors="ignore")
    below = int((ends(friction["mu"], friction["mu_std"])[1] < INCLINED_PLANE).sum())
    best, worst = authors["best"].astype(float), authors["worst"].astype(float)
    nearest, farthest = str(best.idxmax()), str(worst.idxmax())
    return (
        f"As the authors compute it μ is {_ends_of(friction['mu'])}, leaving out {_title(VISCOUS)}, whose published μ "
        f"has another unit: {below} of {len(friction)} are told apart below the inclined plane's {INCLINED_PLANE}. For "
        f"the laws as defined in the kinetic weighting it is {_ends_of(kinetic['mu'])}. Among the authors' laws "
        f"{_title(nearest)} is nearest most often ({number(best.max(), '%', 2)}), {_title(farthest)} farthest most "
        f"often ({number(worst.max(), '%', 2)}); {_title(STUDIED)} is farthest in {number(worst[STUDIED], '%', 2)}."
    )


def table_3_2(table: "pd.DataFrame") -> str:
    """Shares of impulses within the laws' ranges in both weightings."""
    least = table["tolerance"].min()
    table = table[table["tolerance"] == least]
    unweighted, kinetic, defined = (
        _ends_of(_part(table, *which)["fraction"], percent)
        for which in (("as_published", "unweighted"), ("as_published", "kinetic"), ("as_defined", "kinetic"))
    )
    low, high = (percent(share) for share in THESIS_RANGE)
    return (
        f"As the authors compute it the laws reproduce {unweighted} of the impulses within "
        f"{number(1000 * least, 'mm/s')} (thesis, for its ellipse: {low} to {high}). In the kinetic weighting they "
        f"reproduce {kinetic} as published and {defined} as defined."
    )


def _part(table: "pd.DataFrame", variant: str, weighting: str) -> "pd.DataFrame":
    return table[(table["variant"] == variant) & (table["weighting"] == weighting)].set_index("law")


def _difference(a: "pd.Series", b: "pd.Series") -> tuple[float, float]:
    """95 % interval of a − b, taken to be independent."""
    return ends(a["value"] - b["value"], (a["std"] ** 2 + b["std"] ** 2) ** 0.5)


def _ratio(value: float, std: float, other: str) -> str:
    told = side(*ends(value, std), 1.0, ("", ", not told apart", ""))
    return f"{estimate(value, std)} times that {other}{told}"


def _ends_of(values: "pd.Series", written: Callable[[float], str] = number) -> str:
    """Smallest and largest value with the names of their laws."""
    said = []
    for value in dict.fromkeys([float(values.min()), float(values.max())]):
        laws = [_title(str(law)) for law in values.index[values == value]]
        said.append(f"{written(value)} ({listing(laws)})")
    return " to ".join(said)


def _title(law: str) -> str:
    """As in the figures; for use within brackets "published Mirtich" instead of "Mirtich (as published)"."""
    from thesis_lib.contact import LAWS

    base = law.removesuffix(PUBLISHED)
    title = LAWS[base].title if base in LAWS else base
    return title if base == law else f"published {title}"


COMMON = {  # of no dataset
    "figure_3_3": Finding(("../drops/coverage.csv",), figure_3_3),
}
TRACKED = {  # of datasets with trajectories
    "figure_3_6": Finding(("statements.csv",), figure_3_6),
}
EVERY = {  # of every dataset
    "figure_3_7": Finding(("convergence.csv", "statements.csv"), figure_3_7),
    "figure_3_8": Finding(("error_summary.csv", "statements.csv"), figure_3_8),
    "figure_3_9": Finding(("figure_3_9.csv", "statements.csv"), figure_3_9),
    "figure_3_10": Finding(("figure_3_10.csv", "statements.csv"), figure_3_10),
    "figure_3_11": Finding(("statements.csv",), figure_3_11),
    "table_3_1": Finding(("table_3_1.csv",), table_3_1),
    "table_3_2": Finding(("table_3_2.csv",), table_3_2),
}
FINDINGS = {**COMMON, **TRACKED, **EVERY}
