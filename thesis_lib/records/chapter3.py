"""Findings of chapter 3: what laws can predict, their held-out errors, and friction and restitution."""

from thesis_lib.records.rows import (
    ABOUT,
    FROM_ZERO,
    PUBLISHED,
    DataFrame,
    difference,
    ends_of,
    row_of,
    studied,
    title_of,
)
from thesis_lib.statistics.wording import count, ends, estimate, number, percent, side, times

THESIS_RANGE = (0.355, 0.458)  # Table 3.2, smallest and largest fraction
CONVERGED = 100  # section 3.4: the parameters have converged from "about" this number of impacts
NEAR = 1.5  # more than this many times CONVERGED is no longer "about" it
INCLINED_PLANE = 0.3  # μ of PLA on aluminium, section 3.4
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
MU_ZERO = 1e-3  # below it an individual μ counts as zero, as in statements.csv
VISCOUS = "mirtich"  # its published μ, in s/m, is not a coefficient of friction
MAPPED = "anitescu_potra_poisson"  # the law of figure 3-9


def figure_3_3(coverage: DataFrame) -> str:
    """Shares of the admissible set covered by the laws."""
    share = coverage.set_index("law")["share"]
    is_published = share.index.str.endswith(PUBLISHED)
    as_defined, differing = (share[~is_published], share[is_published].rename(lambda law: law.removesuffix(PUBLISHED)))
    # a law whose published code matches its definition has one row, used for both
    as_published = differing.combine_first(as_defined)
    return (
        f"Over the simulated drops the laws cover on average {ends_of(as_published, percent)} of the admissible set "
        f"as published, and {ends_of(as_defined, percent)} as defined: every law leaves out "
        f"{percent(1.0 - share.max(), 3)} of it or more."
    )


def figure_3_6(statements: DataFrame) -> str:
    """Energy over the impacts of all trials and between them."""
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


def table_3_2(table: DataFrame) -> str:
    """Shares of impulses within the laws' ranges, in both weightings."""
    least = table["tolerance"].min()
    table = table[table["tolerance"] == least]
    unweighted, kinetic, defined = (
        ends_of(studied(table, *which)["fraction"], percent)
        for which in (("as_published", "unweighted"), ("as_published", "kinetic"), ("as_defined", "kinetic"))
    )
    low, high = (percent(share) for share in THESIS_RANGE)
    return (
        f"As the authors compute it the laws reproduce {unweighted} of the impulses within "
        f"{number(1000 * least, unit='mm/s')} (thesis, for its ellipse: {low} to {high}). In the kinetic weighting "
        f"they reproduce {kinetic} as published and {defined} as defined."
    )


def figure_3_7(convergence: DataFrame, statements: DataFrame) -> str:
    """The valley of the cost, and the number of impacts from which the parameters have converged."""
    minima = int(row_of(statements, statement="local_minima")["value"])
    bent = row_of(statements, statement="convexity_violations")["value"]
    valley = (
        f"(a) The grid has {minima} local minim{'um' if minima == 1 else 'a'}, and the cost is not convex at "
        f"{percent(bent)} of it."
    )
    rows = statements[(statements["statement"] == "converged_at") & statements["law"].notna()]
    if rows.empty:
        return valley
    k = rows.set_index("law")["value"]
    most = float(convergence["k"].max())
    earlier, later = k.max() <= NEAR * CONVERGED, k.min() > NEAR * CONVERGED
    word = "no later than" if earlier else "later than" if later else "for some laws later than"
    judged = f", {word} the thesis's about {CONVERGED}" if most > NEAR * CONVERGED else ""
    slowest = convergence[convergence["law"] == k.idxmax()]
    at = slowest[slowest["k"] == slowest.loc[slowest["k"] <= CONVERGED, "k"].max()]
    last = slowest.loc[slowest["k"] == slowest["k"].max(), "mu"].mean()
    spread = (
        f" At {at['k'].iloc[0]:.0f} impacts the subsets' μ of {title_of(str(k.idxmax()))} are {number(at['mu'].min())} "
        f"to {number(at['mu'].max())}, in the end {number(last)}."
        if len(at) and at["k"].iloc[0] < most
        else ""
    )
    return (
        f"{valley} (b) In every subset μ and ε stay within {percent(0.1)} of their last values from "
        f"{ends_of(k, '{:.0f}'.format)} impacts on, of {most:.0f} followed{judged}.{spread}"
    )


def figure_3_10(figure: DataFrame, statements: DataFrame) -> str:
    """Impacts that are explained best without friction, and the spread of individual parameters."""
    mean = row_of(statements, statement="individual_minus_ensemble_mu", law=STUDIED)
    peak, peaks = (
        row_of(statements, statement=name, law=STUDIED)["value"] for name in ("epsilon_mode", "epsilon_modes")
    )
    panel = figure[figure["panel"] == "a"]
    fits = panel[(panel["series"] == "individual") & panel["misfit"].notna()]
    zero = fits["mu"] < MU_ZERO
    here, elsewhere = fits.loc[zero, "misfit"].mean(), fits.loc[~zero, "misfit"].mean()
    misfit = f", with {times(here / elsewhere)} the mean misfit of the others" if zero.any() and elsewhere > 0 else ""
    ensemble = float(panel.loc[panel["series"] == "ensemble", "mu"].iloc[0])
    word = side(*ends(mean["value"], mean["std"]), 0.0, ABOUT)
    return (
        f"{count(zero.sum(), len(fits))} impacts are explained best without friction{misfit}. The mean of the single "
        f"μ, {number(fits['mu'].mean())}, is {word} the ensemble's {number(ensemble)}; their standard deviation is "
        f"{number(fits['mu'].std())}. The density of ε has {int(peaks)} peak{'s' if peaks > 1 else ''}, the highest at "
        f"{number(peak)}."
    )


def figure_3_11(statements: DataFrame) -> str:
    """How often impulses lie beyond the line of sticking and slip reverses, as measured and as predicted."""
    beyond, back = row_of(statements, statement="beyond_sticking"), row_of(statements, statement="back_spin")
    law_back = row_of(statements, statement="predicted_back_spin", law=STUDIED)
    predicted = statements[statements["statement"] == "predicted_beyond_sticking"].set_index("law")["value"]
    most = str(predicted.idxmax())
    reach = (
        f"{int((predicted == 0).sum())} of {len(predicted)} laws never predict that, {title_of(most)} does most often "
        f"({percent(predicted[most])})"
        if predicted[most] > 0
        else "no law predicts that"
    )
    word = difference(law_back, back, ("fewer", "not told apart", "more"))
    return (
        f"Of all held-out impulses {estimate(100 * beyond['value'], 100 * beyond['std'], '%')} lie beyond the line of "
        f"sticking; {reach}. Slip reverses in {estimate(100 * back['value'], 100 * back['std'], '%')}; "
        f"{title_of(STUDIED)} with the ensemble's parameters predicts {percent(law_back['value'])}, {word}."
    )


def table_3_1(table: DataFrame) -> str:
    """Friction compared with the inclined plane's, and which law is nearest and farthest."""
    authors, kinetic = studied(table, "as_published", "unweighted"), studied(table, "as_defined", "kinetic")
    friction = authors.drop(VISCOUS, errors="ignore")
    below = int((ends(friction["mu"], friction["mu_std"])[1] < INCLINED_PLANE).sum())
    best, worst = authors["best"].astype(float), authors["worst"].astype(float)
    nearest, farthest = str(best.idxmax()), str(worst.idxmax())
    return (
        f"As the authors compute it μ is {ends_of(friction['mu'])}, leaving out {title_of(VISCOUS)}, whose published μ "
        f"has another unit: {below} of {len(friction)} are told apart below the inclined plane's {INCLINED_PLANE}. For "
        f"the laws as defined in the kinetic weighting it is {ends_of(kinetic['mu'])}. Among the authors' laws "
        f"{title_of(nearest)} is nearest most often ({number(best.max(), 2, '%')}), {title_of(farthest)} farthest most "
        f"often ({number(worst.max(), 2, '%')}); {title_of(STUDIED)} is farthest in {number(worst[STUDIED], 2, '%')}."
    )


def figure_3_8(summary: DataFrame, statements: DataFrame) -> str:
    """Errors of laws and bounds, and how the sense of rotation changes the bound."""
    error = summary.set_index("model")["mean"]
    bounds = error.index.str.startswith("best_post_hoc") | (error.index == "irb_bound")
    laws, post_hoc = error[~bounds], error[error.index.str.startswith("best_post_hoc")].min()
    bound, mirrored = (row_of(statements, statement=name) for name in ("irb_bound", "irb_bound_mirrored"))
    least, most = str(laws.idxmin()), str(laws.idxmax())
    word = difference(mirrored, bound, ("falls to", "is not told apart, with", "rises to"))
    return (
        f"The IRB Bound is {estimate(bound['value'], bound['std'], 'm/s')}, {times(bound['value'] / laws[least])} the "
        f"least mean error of a law ({number(laws[least], unit='m/s')}, {title_of(least)}); the largest is "
        f"{number(laws[most], unit='m/s')} ({title_of(most)}), and Best Post Hoc has {number(post_hoc, unit='m/s')}. "
        f"With the rotation read clockwise the bound {word} {estimate(mirrored['value'], mirrored['std'], 'm/s')}."
    )


def figure_3_9(figure: DataFrame, statements: DataFrame) -> str:
    """Errors near zero tangential momentum, and on its two sides."""
    rows = statements[(statements["statement"] == "small_momentum") & (statements["law"] == MAPPED)]
    sentences = [
        f"Where the tangential momentum is least (a fourth of the impacts) the error is "
        f"{_ratio(value, std, 'of the others')}; the thesis finds it largest there."
        for value, std in rows[["value", "std"]].to_numpy()
    ]
    impacts = figure[figure["series"] == "impact"]
    sides = [impacts.loc[impacts["momentum_t"] * sign > 0, "error"] for sign in (-1, 1)]
    if min(map(len, sides)) > 1:
        (left, left_std), (right, right_std) = (
            (float(errors.mean()), float(errors.std() / len(errors) ** 0.5)) for errors in sides
        )
        std = ((left_std / right) ** 2 + (left * right_std / right**2) ** 2) ** 0.5
        sentences.append(f"Left of the dashed line it is {_ratio(left / right, std, 'on the right')}.")
    return " ".join(sentences) or "All impacts lie on one side of the dashed line."


def _ratio(value: float, std: float, other: str) -> str:
    doubt = side(*ends(value, std), 1.0, ("", ", not told apart", ""))
    return f"{estimate(value, std)} times that {other}{doubt}"
