"""Figures 4-1, 4-2, 4-5 and 4-6: learned contact models, and what they add to named physics."""

import math

from thesis_lib.records.record import DROPPED, GEOMETRY, Figure, Job, Tolerance
from thesis_lib.records.rows import DataFrame, Row, compared, counted, row_of, value
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
SCHEMATICS = Job("ch4_schematics", "chapter4/common", group="contact space")
FIGURES = Job("ch4_figures", "chapter4/{dataset}", datasets=DROPPED)
NAMED_FIGURE = Job("ch4_named_figure", "chapter4/{dataset}", datasets=DROPPED)
SEARCHED = "hyperparameters end a search where its gradient is small; errors follow them to a per cent"
LEARNED = Tolerance(SEARCHED, abs=0.0001, rel=0.05)

FIGURE_4_1 = Figure(
    name="figure_4_1",
    job=SCHEMATICS,
    title="A planar body that touches a level surface, and the energy ellipse of that impact",
    caption="Impulses inside it neither penetrate nor gain energy.",
    keys="panel series",
    tolerances={"x y c_t c_n": GEOMETRY},
)

FIGURE_4_2 = Figure(
    name="figure_4_2",
    job=SCHEMATICS,
    title="The energy ellipsoid of contact wrenches, with the ellipse of point impulses in it",
    caption="""A couple about the contact point adds a third axis.

What to look for: the third axis: outcomes above and below the flat ellipse need a couple, which no point impulse can
give.""",
    keys="series curve",
    tolerances={"c_t c_n tau_over_k": GEOMETRY},
    columns={
        "curve": ("1", "number of the curve within its series"),
        "tau_over_k": (
            "N s",
            ("couple about the contact point over the radius of gyration; N s/kg where the dataset gives no mass"),
        ),
    },
)


@Figure.found_by(
    job=FIGURES,
    title="Densities of held-out errors of the velocity after impact",
    caption="""With the thesis's 450 training impacts: data-driven models above, models with an impact law below,
beside Best Post Hoc and the IRB Bound.

What to look for: which densities reach to the left of the IRB Bound. A rigid impulse cannot; a learned wrench can.""",
    reads=("learning_ratios.csv", "learning_errors.csv"),
    keys="variant panel model n",
    tolerances={
        "error": Tolerance(SEARCHED, abs=1e-05, rel=0.01),
        "density": Tolerance(SEARCHED, abs=0.01, rel=0.05),
        "share_below": Tolerance("a few of the first split's impacts may change sides of an error", abs=0.02),
    },
    most_rows=60,
    columns={"variant": ("", "row of the figure"), "n": ("1", "training impacts")},
)
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


@Figure.found_by(
    job=FIGURES,
    title="Mean held-out error against the number of training impacts",
    caption="""Over random splits of the trials, with 95 % intervals of the mean.

What to look for: where each curve becomes level: more impacts teach that model nothing more.""",
    reads=("learning_summary.csv", "learning_convergence.csv"),
    keys="panel model n",
    tolerances={"mean low high": LEARNED},
    columns={
        "n": ("1", "training impacts"),
        "low": ("m/s", "lower end of the 95 % interval of the mean over splits"),
        "high": ("m/s", "upper end of it"),
    },
)
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


@Figure.found_by(
    job=NAMED_FIGURE,
    title="What is left to learn once the effects that the critique named are in",
    caption="""Held-out error of the best plain law, with a learned rigid residual and with a learned wrench, and
the same on top of the law with its effects, beside the IRB Bound and the noise floor; and against the number of
training impacts.

What to look for: how much a learned residual still takes away once the named effects are in.""",
    keys="panel model n",
    tolerances={"mean low high": LEARNED},
    most_rows=200,
    columns={
        "n": ("1", "training impacts"),
        "low": ("m/s", "lower end of the 95 % interval: panel a over held-out trials, panel b over draws"),
        "high": ("m/s", "upper end of it"),
    },
)
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
