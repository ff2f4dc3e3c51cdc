"""Figures 3-7, 3-10 and 3-11 and Table 3.1: friction and restitution, from many impacts and from single ones."""

from thesis_lib.records.record import DROPPED, Figure, Job, Table, Tolerance
from thesis_lib.records.rows import ABOUT, DataFrame, difference, ends_of, row_of, studied, title_of
from thesis_lib.statistics.wording import count, ends, estimate, number, percent, side, times

CONVERGED = 100  # section 3.4: the parameters have converged from "about" this number of impacts
NEAR = 1.5  # more than this many times CONVERGED is no longer "about" it
INCLINED_PLANE = 0.3  # μ of PLA on aluminium, section 3.4
STUDIED = "anitescu_potra_newton"  # the law of figures 3-10 and 3-11
MU_ZERO = 1e-3  # below it an individual μ counts as zero, as in statements.csv
VISCOUS = "mirtich"  # its published μ, in s/m, is not a coefficient of friction
FIGURES = Job("ch3_figures", "chapter3/{dataset}", datasets=DROPPED)
EVALUATE = Job("ch3_evaluate", "chapter3/{dataset}", datasets=DROPPED)


@Figure.found_by(
    job=FIGURES,
    title="Cost over (μ, ε), and convergence of the parameters",
    caption="""(a) Mean cost of the Whittaker law as published; lighter is better, the star is the least cost on the
grid. One valley, as the thesis says, but not convex: the cost levels off towards large μ, where the contact sticks and
μ no longer matters; *convexity_violations* in statements.csv counts it.

(b) Parameters and cost against the number of impacts k, for nested random subsets (line styles) and some laws. The
vertical line is the thesis's "about 100". What to compare there is how far the subsets still lie apart; at the right
end they share most of their impacts, so that their agreement there is no evidence.
{% if dataset == "planar_dice" %}
Most contacts of the die stick, where μ is hardly observable.
{% elif dataset == "drops" %}
AP Newton made these data; a wrong law converges to a cost above zero.
{% endif %}
The thesis shows three subsets of one law and does not say which.""",
    reads=("convergence.csv", "statements.csv"),
    keys="panel law subset k",
    tolerances={
        "mu epsilon": Tolerance("ten times the width at which the search on the grid stops", abs=1e-05),
        "cost": Tolerance("a minimum is flat, its value is better known than its place", rel=1e-05),
    },
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


@Figure.found_by(
    job=FIGURES,
    title="The (μ, ε) that explain each impact best under AP Newton",
    caption="""(a) The pair of each impact, coloured by the misfit that remains; the star is the ensemble's pair.
(b) Densities of both, reflected at their bounds, with the ensemble's value and the mean of the individual ones.

{% if dataset != "drops" %}
To see, as in the thesis: a pile-up at μ = 0 with large misfits, and values of μ spread from zero to a multiple of the
ensemble's.
{% endif %}
{% if dataset == "drops" %}
In the simulated drops, where one μ made all impacts, the flat part below it is no variation of friction: those contacts
stick, every μ above the sticking bound gives the same impulse, and the lowest is reported. Part of the measured spread
must be of this kind.
{% else %}
The thesis has ε "centered around 1". At its bound of 1 are impacts whose contact point leaves faster along the normal
than it came.
{% endif %}""",
    reads=("figure_3_10.csv", "statements.csv"),
    keys="panel series trial impact parameter",
    tolerances={
        "mu epsilon": Tolerance("where two pairs fit equally well rounding decides; elsewhere 1e-8", abs=0.001),
        "misfit": Tolerance("the least misfit is known to the width of the final pattern", abs=1e-06, rel=0.0001),
        "density": Tolerance("its bandwidth follows the parameters; 1 % of it cannot be seen", abs=0.01, rel=0.01),
    },
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


@Figure.found_by(
    job=FIGURES,
    title="Two single impacts in their energy ellipses",
    caption="""Drawn are the region of AP Newton, the measured impulse, the law's best (μ, ε) for this impact, and
the ensemble's prediction.

(a) μ = 0: of the impacts with an individual μ below 0.001, the quarter whose contact lies nearest to below the centre
of mass, and of these the one with the largest misfit. The region is a narrow band on one side, the measured impulse
lies on the other. (b) Spin reversal: of the impacts whose measured impulse lies beyond the line of sticking as seen
from the frictionless impulse, the one at the median distance.

The thesis says that no law reaches beyond that line. AP Newton, shown here, and Whittaker never do; others do in some
impacts, most often Drumwright-Shell in both variants and AP Poisson and Mirtich as published.

{% if dataset == "drops" %}
In the simulated drops, where the law is right, that distance is measurement noise about a sticking contact: being
beyond the line is no evidence against a law by itself.
{% endif %}
The thesis does not say how it chose its examples.""",
    reads=("statements.csv",),
    keys="panel trial impact series",
    tolerances={
        "c_t c_n": Tolerance("closed form of one impact, which the arc fits give to 1e-6", abs=1e-06, rel=0.0001)
    },
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


@Table.found_by(
    job=EVALUATE,
    title="Ensemble parameters of the six laws, and how often each predicts best and worst",
    caption="""Standard errors are bootstraps over trials; *best* and *worst* are the share of held-out impacts, in
per cent, in which a law predicts the impulse best and worst.

Rows with variant *as published* and weighting *unweighted* are what the authors computed (ω in rad/s counts like a
velocity in m/s); weighting *kinetic* (k ω counts like a velocity) does not depend on units, and is used in all figures.
Friction far below the inclined plane's 0.3 is the thesis's main finding here. The thesis gives no standard errors and
does not say how many impacts it identified from. *at_bound* names a parameter that ended at the edge of its range:
there the data say next to nothing about it.""",
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
